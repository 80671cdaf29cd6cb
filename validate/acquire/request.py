"""Requests for views, and their results."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

from pss import Appearance, PSSError, PTZCamera
from render.certificate import Certificate
from render.keys import state_key
from render.lens.sampling import Sampling
from render.renderer import ViewRequest
from render.store.folder import Store
from scenes import Scene
from validate.markers.detector_table import DEFAULT_DETECTOR
from validate.markers.view_measurement import MeasureTask, ViewMeasurement

__all__ = ["Acquired", "Acquisition", "LightError", "by_state", "error_line", "views_of"]


class LightError(PSSError, RuntimeError):
    """The light of a scene state cannot be solved; all its views fail for the same reason."""


@dataclass(frozen=True)
class Acquisition:
    """A requested view, with the trials to be measured on it, and the name of the detector that measures."""

    request: ViewRequest
    seed: int
    trials: int
    detector: str = DEFAULT_DETECTOR

    def task(self, store: Store) -> MeasureTask:
        """The measuring task of this view."""
        state = self.request.state
        ids = tuple(marker.id for marker in state.markers)
        return MeasureTask(
            store.folder, self.request.key, state.print.dictionary, ids, self.seed, self.trials, self.detector
        )


def views_of(
    scene: Scene,
    cameras: Iterable[PTZCamera],
    sampling: Sampling,
    renderer: str,
    seed: int,
    trials: int,
    detector: str = DEFAULT_DETECTOR,
) -> tuple[Acquisition, ...]:
    """A view of a scene for each of `cameras`, as `Acquisition` has them."""
    return tuple(
        Acquisition(ViewRequest(scene.state, camera, scene.sensor, sampling, renderer), seed, trials, detector)
        for camera in cameras
    )


@dataclass
class Acquired:
    """The results of the requested views; keys are the views' hashes (`measured`: with seed and trials).

    `appearances` are the markers' radiances of each scene state, by the state's hash, from its solved light;
    `failed` gives the reason why a view is missing. `rendered`, `render_seconds` and `measured_items` are of this run
    itself, `stored_seconds` (s) what rendering took another run, where the store has that.
    """

    measured: dict[Acquisition, ViewMeasurement] = field(default_factory=dict)
    certificates: dict[str, Certificate] = field(default_factory=dict)
    appearances: dict[str, Appearance] = field(default_factory=dict)
    failed: dict[str, str] = field(default_factory=dict)
    render_seconds: dict[str, float] = field(default_factory=dict)
    stored_seconds: dict[str, float] = field(default_factory=dict)
    rendered: int = 0
    measured_items: set[Acquisition] = field(default_factory=set)

    @property
    def counts(self) -> dict[str, object]:
        """For run.json: how many views this run rendered and measured itself, and the causes of those that failed."""
        return {"rendered": self.rendered, "measured": len(self.measured_items), "failed": self.failed}


def error_line(error: BaseException | None) -> str:
    """Why a view failed, in words for people."""
    return str(error) if isinstance(error, LightError) else f"{type(error).__name__}: {error}"


def by_state(todo: Sequence[Acquisition]) -> list[Acquisition]:
    """The same, those of one scene state together, in the order in which the states come first."""
    first: dict[str, int] = {}
    for item in todo:
        first.setdefault(state_key(item.request.state), len(first))
    return sorted(todo, key=lambda item: first[state_key(item.request.state)])
