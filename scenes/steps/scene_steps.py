"""[vary] with steps that change the scene itself: sensor, lens, light, objects, or several keys at once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field

from scenes.errors import Problems, SceneError
from scenes.reading.limits import MOST_CAMERAS, MOST_STEPS
from scenes.reading.spec import Name, Number, Spec

if TYPE_CHECKING:
    from scenes.scene import Scene

__all__ = ["SceneStepsSpec", "check_steps", "scenes_of_steps"]

Names = Annotated[tuple[Name, ...], Field(min_length=1, max_length=MOST_CAMERAS)]


class SceneStepsSpec(Spec):
    """[vary] with keys of the scene file, all of which change from one value of the `axis` to the next."""

    parameter: Literal["scene"]
    axis: Annotated[Name, Field(description="text of letters, digits, spaces, - and _: what the values are of")]
    values: Annotated[
        tuple[Number, ...],
        Field(min_length=1, max_length=MOST_STEPS, description=f"a list of one or more numbers, at most {MOST_STEPS}"),
    ]
    set: Annotated[
        dict[str, Any],
        Field(
            description="a table of the scene's dotted keys, each with a list as long as values, or with one for all"
        ),
    ]
    active: tuple[Names, ...] | None = Field(None, description="lists of names of cameras, one for each value")


def check_steps(draft: SceneStepsSpec, problems: Problems) -> None:
    """Report lists of another length than the values."""
    if draft.values is None:
        return
    count = len(draft.values)
    for key, given in (draft.set or {}).items():
        if isinstance(given, list) and len(given) != count:
            problems.add(("vary", "set", key), f"as many as the values, {count} (or one for all, no list)")
    if draft.active is not None and len(draft.active) != count:
        problems.add(("vary", "active"), f"as many as the values, {count}")
    if draft.active is not None and problems.given(("active",)):
        problems.add(("active",), "no active beside vary.active, which names the cameras")


def scenes_of_steps(vary: SceneStepsSpec, scene: Scene, problems: Problems) -> Iterator[tuple[float, Scene]]:
    """Each value with the scene of its step; an invalid scene, or one with other markers, is a problem."""
    if scene.auto_exposure is not None:
        problems.report(
            'vary.parameter = "scene", and the scene has sensor.exposure_ms = "auto"; allowed: a number of ms, '
            "since the exposure would differ between steps of different light or sensors"
        )
        return
    for number, value in enumerate(vary.values):
        where = f"vary.set at {vary.axis} = {value:g}"
        settings = {key: given[number] if isinstance(given, list) else given for key, given in vary.set.items()}
        try:
            changed = scene.with_settings(settings)
        except SceneError as error:
            for line in error.problems:
                problems.report(f"{where}: {line}")
            continue
        # Points are compared between steps, and so are noise models.
        for what, kept in (
            ("markers of the same ids on the same objects", _markers(changed) == _markers(scene)),
            ("the same noise models", _models(changed) == _models(scene)),
            ("an exposure that is a number of ms", changed.auto_exposure is None),
        ):
            if not kept:
                problems.report(f"{where}; allowed: {what} at every step")
        yield float(value), changed


def _markers(scene: Scene) -> list[tuple[int, str]]:
    return [(marker.id, marker.object_name) for marker in scene.state.markers]


def _models(scene: Scene) -> list[str]:
    return [model.name for model in scene.noise_models]
