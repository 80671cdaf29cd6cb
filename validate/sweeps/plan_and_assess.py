"""The one way from loaded files to assessed configurations: plan, acquire, assess."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from render.lens.sampling import Sampling
from scenes import Scene, SweepFile
from validate.acquire.auto_exposure import with_exposures
from validate.acquire.forecast import exposures_assumed
from validate.acquire.request import Acquired, Acquisition
from validate.acquire.source import ViewSource
from validate.markers.detector_table import DEFAULT_DETECTOR
from validate.sweeps.sweep import Plan, SweepResult, assess_sweep, plan

__all__ = ["assessed", "planned", "requested_views"]


def planned(
    loaded: Sequence[tuple[SweepFile, Scene]],
    source: ViewSource,
    *,
    forecast: bool = False,
    detector: str = DEFAULT_DETECTOR,
) -> list[Plan]:
    """Choose exposures of "auto", name the views of each sweep, and warn of what the scenes warn of.

    Args:
        loaded: sweeps with their scenes.
        source: of the views; it may solve light, by which exposures are chosen.
        detector: name of the one that measures the views.
        forecast: solve no light: the longest exposure stands in for one that would need it.
    """
    messages = source.messages
    of_files = dict.fromkeys(warning for _, scene in loaded for warning in scene.warnings)
    for warning in of_files:
        messages.warn(warning)
    if forecast:
        exposed = exposures_assumed(loaded, source)
    else:
        exposed = with_exposures(
            loaded,
            source.store,
            lambda line: messages.console.print(line, markup=False, soft_wrap=True),
            messages.note,
            source.backend,
            messages.light_solved,
        )
    plans = [
        plan(sweep, scene, source.renderer, Sampling(noise_ratio=sweep.render_noise_ratio), detector)
        for sweep, scene in exposed
    ]
    of_steps = dict.fromkeys(
        warning for each in plans for step in each.configurations for warning in step.scene.warnings
    )
    for warning in of_steps:
        if warning not in of_files:
            messages.warn(warning)
    return plans


def requested_views(plans: Iterable[Plan]) -> list[Acquisition]:
    """The views of all steps of all sweeps, in order; one that several steps share is there for each."""
    return [item for each in plans for views in each.views for item in views]


def assessed(plans: Sequence[Plan], acquired: Acquired) -> list[SweepResult]:
    """Predict and measure each sweep's configurations whose views exist."""
    return [assess_sweep(each, acquired) for each in plans]
