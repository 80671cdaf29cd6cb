"""[noise] and [metric] of a scene file: from names and paths to noise models and visibility tests."""

from __future__ import annotations

import dataclasses
from pathlib import Path

from pss import ImageSensor, NoiseModel, RangeError, noise_model, visibility_tests
from pss.noise import NOISE_MODELS, Calibration
from pss.visibility.points import VisibilityTest
from pss.visibility.targets import VISIBILITIES
from scenes.errors import Location, Problems, allowed_in, nearest
from scenes.reading.inside import may_open
from scenes.schema.prediction_tables import NoiseSpec
from scenes.schema.scene_tables import SceneSpec

__all__ = ["CALIBRATION_FILE", "check_predictions", "named_model", "named_visibility"]

CALIBRATION_FILE = ".toml"


def named_model(
    name: str, noise: NoiseSpec, folder: Path, sensor: ImageSensor, ccd_noise: float | None = None
) -> NoiseModel:
    """The noise model called `name`, with those of the file's switches and weights that it has factors for.

    Its name in tables is that of the file, so that two calibrations never share one.

    Args:
        name: of `pss.NOISE_MODELS`, or the path of a calibration from `folder`.
        ccd_noise: dark noise over full well in place of the sensor's.

    Raises:
        RangeError: there is none, its package cannot build it, or no factor of it remains.
    """
    model = _unswitched(name, noise, folder, sensor, ccd_noise)
    for factor in noise.switched_off:
        if factor in model.switches:
            model = model.without(factor)
    of_model = {factor.name for factor in model.factors}
    weights = {factor: weight for factor, weight in (noise.weights or {}).items() if factor in of_model}
    return model.weighted(weights) if weights else model


def named_visibility(name: str, folder: Path, sensor: ImageSensor) -> tuple[VisibilityTest, ...]:
    """The visibility tests called `name`: "point", "target", or the limits of a calibration, by name or path.

    Raises:
        RangeError: there are none.
    """
    return visibility_tests(_placed(name, folder), sensor)


def check_predictions(draft: SceneSpec, folder: Path, problems: Problems, *, allow_outside: bool) -> None:
    """Every name in [noise] and [metric] must exist, and every key must have an effect."""
    if draft.noise is not None:
        _check_noise(draft.noise, folder, problems, allow_outside)
    if draft.metric is not None and draft.metric.visibility is not None:
        _check_visibility(draft.metric.visibility, folder, problems, allow_outside)


def _placed(name: str, folder: Path) -> str | Path:
    return folder / name if name.endswith(CALIBRATION_FILE) else name


def _unswitched(
    name: str, noise: NoiseSpec, folder: Path, sensor: ImageSensor, ccd_noise: float | None = None
) -> NoiseModel:
    dark = sensor.ccd_noise if ccd_noise is None else ccd_noise
    whole = noise_model(_placed(name, folder), ccd_noise=dark, px2_per_m2=noise.px2_per_m2, sensor=sensor)
    return dataclasses.replace(whole, name=name)


def _check_noise(noise: NoiseSpec, folder: Path, problems: Problems, allow_outside: bool) -> None:
    for key in ("models", "switched_off"):
        names = getattr(noise, key) or ()
        if len(set(names)) < len(names):
            problems.add(("noise", key), "each name once")
    if noise.models is None or noise.switched_off is None or noise.px2_per_m2 is None:
        return  # reported already, and the following checks would not apply
    before = len(problems.lines)
    whole = []
    for index, name in enumerate(noise.models):
        place = ("noise", "models", index)
        if not _may_open(name, place, folder, problems, allow_outside):
            continue
        if not name.endswith(CALIBRATION_FILE) and name not in NOISE_MODELS:
            hint, _ = nearest(name, NOISE_MODELS)
            problems.add(place, f"{', '.join(NOISE_MODELS)}, or the path of a calibration (.toml){hint}")
            continue
        try:
            whole.append(_unswitched(name, noise, folder, ImageSensor()))
        except RangeError as error:
            problems.add(place, f"a model that can be built ({error})")
    if len(problems.lines) > before:
        return  # its factors are unknown
    _check_factors(noise, whole, problems)
    if noise.px2_per_m2 != 1:
        others = noise.model_copy(update={"px2_per_m2": 2 * noise.px2_per_m2})
        if _same(whole, [_unswitched(name, others, folder, ImageSensor()) for name in noise.models]):
            problems.add(
                ("noise", "px2_per_m2"), "1.0, the scale of Eq. 11, as no model in noise.models has this equation"
            )


def _same(models: list[NoiseModel], others: list[NoiseModel]) -> bool:
    """Whether these are known to be the same; factors of other packages may not be comparable."""
    try:
        return models == others
    except ValueError:  # of arrays
        return False


def _check_factors(noise: NoiseSpec, models: list[NoiseModel], problems: Problems) -> None:
    """Each factor that is switched off or weighted must be in one of the models, and each model must keep one."""
    switches = list(dict.fromkeys(name for model in models for name in model.switches))
    for name in noise.switched_off:
        if name not in switches:
            hint, _ = nearest(name, switches)
            problems.add(
                ("noise", "switched_off"), f"factors that a model in noise.models has: {', '.join(switches)}{hint}"
            )
            return
    left = []
    for model in models:
        try:
            for name in noise.switched_off:
                model = model.without(name) if name in model.switches else model
        except RangeError:
            problems.add(
                ("noise", "switched_off"),
                f"not all factors of a model: {', '.join(f.name for f in model.factors)} is all that is left of "
                f'"{model.name}"; at least one factor must stay',
            )
            return
        left += [factor.name for factor in model.factors]
    for name in noise.weights or {}:
        if name not in left:
            hint, _ = nearest(name, left)
            problems.add(
                ("noise", "weights", name),
                f"factors that a model in noise.models has, and that are not switched off: "
                f"{', '.join(dict.fromkeys(left))}{hint}",
            )


def _check_visibility(name: str, folder: Path, problems: Problems, allow_outside: bool) -> None:
    place = ("metric", "visibility")
    if not _may_open(name, place, folder, problems, allow_outside):
        return
    if name.endswith(CALIBRATION_FILE):
        try:
            calibration = Calibration.from_file(folder / name)
        except RangeError as error:
            problems.add(place, f"a calibration that can be read ({error})")
            return
        if not calibration.limits:
            problems.add(place, f"a calibration with [limits], as bank fits them; this one has none: {folder / name}")
    elif name not in VISIBILITIES:
        try:
            visibility_tests(name)
        except RangeError as error:
            hint, _ = nearest(name, VISIBILITIES)
            problems.add(place, f"{allowed_in(error)}{hint}")


def _may_open(name: str, place: Location, folder: Path, problems: Problems, allow_outside: bool) -> bool:
    return not name.endswith(CALIBRATION_FILE) or may_open(name, place, folder, allow_outside, problems)
