"""What a bank and a schedule judge: noise models with what counts as visible, those of the scene's file among them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from pss import DetectionModel, Legible, NoiseModel
from pss.noise import CALIBRATED, CALIBRATION_LIMITS, SCALED_MODELS, Calibration, NoiseFactor, Weighted
from pss.visibility.points import VISIBILITY_TESTS, VisibilityTest
from pss.visibility.targets import TARGET_VISIBILITY, within_limits
from scenes import Scene
from validate.prediction.weights import scaled

__all__ = [
    "BASES",
    "CALIBRATED_LIMITS",
    "CALIBRATED_R",
    "FREE_MODELS",
    "FULL_MODEL",
    "PHYSICAL",
    "PHYSICAL_WHOLE",
    "SCALED",
    "Contender",
    "detection_model_of",
    "judged",
    "listed_contenders",
    "noise_models",
    "own_models",
    "scene_contenders",
    "shown_model",
    "visibilities",
]


PHYSICAL = "physical"
# Models that need no measurement.
FREE_MODELS = ("as-printed", "corrected", PHYSICAL, "identity")
# R and limits of detection, both fitted on the training views; all metrics are judged under it.
CALIBRATED_LIMITS = "calibrated, limits"
# The fitted R with all that was fitted of detection.
FULL_MODEL = CALIBRATED
# The fitted R alone, and the one that fits nothing with whole markers in place of their centres.
CALIBRATED_R, PHYSICAL_WHOLE = "calibrated R", "physical, whole markers"
# The models whose unit is open, times one scalar fitted on the training views.
SCALED = {name: f"{name}, scaled" for name in SCALED_MODELS}
# What every contender is compared with, pairwise: no R at all, the same in the unit that fits, the one that fits
# nothing, and the one that all metrics are judged under.
BASES = ("identity", SCALED["identity"], "physical", CALIBRATED_LIMITS)


@dataclass(frozen=True, eq=False)
class Contender:
    """What is judged: a noise model, what counts as visible, and the probability that it is found (None: it is)."""

    name: str
    noise: NoiseModel
    visibility: tuple[VisibilityTest, ...] = VISIBILITY_TESTS
    detection: DetectionModel | None = None


def own_models(scene: Scene) -> list[NoiseModel]:
    """The models of the scene's file beside those that are judged in any case, under the names that the file has.

    "calibrated" is judged in any case, by the calibration at hand and not by the shipped one.
    """
    listed = zip(scene.resolved()["noise"]["models"], scene.noise_models, strict=True)
    return [replace(model, name=name) for name, model in listed if name not in (*FREE_MODELS, FULL_MODEL)]


def detection_model_of(scene: Scene, calibration: Calibration) -> DetectionModel | None:
    """The calibration's probability of detection by the scene's sensor; None if it has none."""
    return DetectionModel(calibration.detection, scene.sensor) if calibration.detection else None


def noise_models(scene: Scene, calibration: Calibration) -> list[NoiseModel]:
    """The R_k that are judged in a scene, with its own sensor, switched-off factors and scale of Eq. 11.

    Those that are scaled as a whole are among them if the calibration has their scales; the calibrated R is behind
    them, and the scene's own are the last.
    """
    # Under the names that the tables have, which a model without some of its factors would extend.
    free = {name: replace(scene.noise_model(name), name=name) for name in FREE_MODELS}
    in_unit = [scaled(free[name], scale, SCALED[name]) for name, scale in calibration.scales.items()]
    return [
        *free.values(),
        *in_unit,
        # Whatever its file calls it: there it may have the name of another model.
        replace(calibration.model(scene.sensor, scene.sensor.ccd_noise), name=FULL_MODEL),
        *own_models(scene),
    ]


def visibilities(scene: Scene, calibration: Calibration) -> dict[str, tuple[VisibilityTest, ...]]:
    """What may count as visible: the paper's points, whole markers, those within the fitted limits, and the scene's."""
    fitted = within_limits(calibration.limits, scene.sensor)
    found = {"points": VISIBILITY_TESTS, "whole markers": TARGET_VISIBILITY, "fitted limits": fitted}
    if scene.visibility not in (VISIBILITY_TESTS, TARGET_VISIBILITY):
        found[f"limits of {scene.resolved()['metric']['visibility']}"] = scene.visibility
    return found


def scene_contenders(scene: Scene, calibration: Calibration) -> list[Contender]:
    """What is judged in a scene: each R with the scene's [metric], and those that know of whole markers in any case."""
    models = {model.name: model for model in noise_models(scene, calibration)}
    visible = visibilities(scene, calibration)
    return [
        *(Contender(name, models[name], scene.visibility) for name in FREE_MODELS),
        *(Contender(SCALED[name], models[SCALED[name]], scene.visibility) for name in calibration.scales),
        Contender(PHYSICAL_WHOLE, models[PHYSICAL], visible["whole markers"]),
        Contender(CALIBRATED_R, models[FULL_MODEL], scene.visibility),
        Contender(CALIBRATED_LIMITS, models[FULL_MODEL], visible["fitted limits"]),
        _full_model(models[FULL_MODEL], visible, detection_model_of(scene, calibration)),
        *(Contender(model.name, model, scene.visibility) for model in own_models(scene)),
    ]


def _full_model(
    noise: NoiseModel, visible: Mapping[str, tuple[VisibilityTest, ...]], detection: DetectionModel | None
) -> Contender:
    """The fitted R with the probability of detection; with the limits, if the calibration has no such probability."""
    if detection is None:
        return Contender(FULL_MODEL, noise, visible["fitted limits"])
    return Contender(FULL_MODEL, noise, visible["whole markers"], detection)


def shown_model(names: Sequence[str]) -> str:
    """Which of these noise models figures and headlines show: "physical", which fits nothing, or else the last."""
    return PHYSICAL if PHYSICAL in names else names[-1]


def listed_contenders(scene: Scene) -> list[Contender]:
    """The noise models of the scene's file, each with its [metric]: what a sweep predicts with."""
    return [Contender(model.name, model, scene.visibility) for model in scene.noise_models]


def judged(contenders: Iterable[Contender]) -> dict[str, dict[str, object]]:
    """What was predicted with, for run.json: by the contender's name, the factors of its R and its visibility tests.

    With the weights of factors and the limits of detection, where it has some.
    """
    found: dict[str, dict[str, object]] = {}
    for contender in contenders:
        tests = [test.name for test in contender.visibility]
        found[contender.name] = {
            "noise": [factor.name for factor in contender.noise.factors],
            "visibility": tests + ["probability of detection"] * (contender.detection is not None),
        }
        weights = {factor.name: _weight(factor) for factor in contender.noise.factors if isinstance(factor, Weighted)}
        if weights:
            found[contender.name]["weights"] = weights
        for test in contender.visibility:
            if isinstance(test, Legible):
                found[contender.name]["limits"] = {name: getattr(test, name) for name in CALIBRATION_LIMITS}
    return found


def _weight(factor: NoiseFactor) -> float:
    """Its weight in the sum: a factor of a calibration that the scene weights has both."""
    return factor.weight * _weight(factor.factor) if isinstance(factor, Weighted) else 1.0
