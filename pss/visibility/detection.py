"""The probability that a detector finds a target: a smooth function of size, blur, signal and incidence.

For a target that is in view as a whole without occlusion (`pss.visibility.targets.WholeTarget`),

    p = (1 − lapse) / (1 + exp(−z)),
    z = constant − size · ln(1 + (3 px/s)⁴) − blur · ln(1 + b²) − signal · ln(1 + (5/q)²) + incidence · ln cos α

with the module's narrow side s in px, the blur b in modules (motion included), the contrast over noise q of one capture
and the angle of incidence α. All coefficients except the constant are non-negative, so that larger, sharper, clearer
and less oblique targets are never found less often. Each term except the last saturates: a marker that is large enough
gains nothing from being larger. The coefficients are fitted to a detector (`validate.prediction.detection`); the form
was selected by leaving out one training camera at a time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.special import expit

from pss.cameras.sensor import ImageSensor
from pss.cameras.views import Views
from pss.errors import RangeError
from pss.hints import Floats
from pss.noise.calibrated import DETECTION_COEFFICIENTS, Calibration
from pss.visibility.targets import blur_modules, contrast_over_noise, narrow_side_px

__all__ = ["DETECTION_PARTS", "DetectionModel", "detection_features", "detection_model"]


# Coefficients besides the constant and the lapse, in the order of `detection_features`.
DETECTION_PARTS = ("size", "blur", "signal", "incidence")
# Where size and signal begin to saturate.
SIZE_PX, SIGNAL = 3.0, 5.0
# Smaller probabilities count as 0: the effect on a metric is negligible, and fewer cases have to be summed.
SMALLEST_PROBABILITY = 1e-4


@dataclass(frozen=True)
class DetectionModel:
    """The probability that a whole target is found in one capture, by this module's formula.

    Attributes:
        coefficients: by name, all of `DETECTION_COEFFICIENTS`: "constant", the `DETECTION_PARTS`, and "lapse", the
            share that is missed under any conditions.
        sensor: the cameras' image sensor, or one for each by the camera's name: its exposure determines motion blur,
            and its noise is compared with the signal.
    """

    coefficients: Mapping[str, float]
    sensor: ImageSensor | Mapping[str, ImageSensor] = field(default_factory=ImageSensor)

    def __post_init__(self) -> None:
        if set(self.coefficients) != set(DETECTION_COEFFICIENTS):
            raise RangeError(
                f"DetectionModel.coefficients has {', '.join(sorted(map(str, self.coefficients))) or 'none'}; "
                f"allowed: all of {', '.join(DETECTION_COEFFICIENTS)}"
            )
        for name, (low, high) in DETECTION_COEFFICIENTS.items():
            value = self.coefficients[name]
            if not (low <= value < high and math.isfinite(value)):
                raise RangeError(
                    f"DetectionModel.coefficients[{name!r}] = {value!r}; allowed: {low:g} or more, below {high:g}"
                )

    def probability(self, views: Views) -> Floats:
        """Probability, (C, N), that each camera finds each target, assuming that it is in view as a whole.

        Raises:
            RangeError: `views` has no appearance.
        """
        parts = detection_features(views, self.sensor)
        score = self.coefficients["constant"] + sum(
            self.coefficients[name] * part for name, part in zip(DETECTION_PARTS, parts, strict=True)
        )
        found = (1 - self.coefficients["lapse"]) * expit(np.where(np.isnan(score), -np.inf, score))
        return np.asarray(np.where(found < SMALLEST_PROBABILITY, 0.0, found))


def detection_features(views: Views, sensor: ImageSensor | Mapping[str, ImageSensor]) -> Floats:
    """The features multiplied by the coefficients of `DETECTION_PARTS`, (4, C, N): 0 or less, and 0 is best.

    Raises:
        RangeError: `views` has no appearance.
    """
    # Points that are not visible may have any value, except an infinity times a coefficient of zero.
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        side, blur, signal = narrow_side_px(views), blur_modules(views, sensor), contrast_over_noise(views, sensor)
        parts = (
            -np.log1p((SIZE_PX / side) ** 4),
            -np.log1p(blur**2),
            -np.log1p((SIGNAL / signal) ** 2),
            np.log(np.minimum(np.where(views.cos_incidence > 0, views.cos_incidence, np.nan), 1.0)),
        )
    lowest = -1e6
    return np.array([np.where(np.isnan(part), lowest, np.maximum(part, lowest)) for part in parts])


def detection_model(path: str | Path, sensor: ImageSensor | Mapping[str, ImageSensor] | None = None) -> DetectionModel:
    """The detection probability of a calibration, for `pss.evaluate(…, detection=…)`.

    Args:
        path: of a calibration (.toml) with a table [detection].
        sensor: as in `DetectionModel`; `ImageSensor()` if None.

    Raises:
        RangeError: the file is not a calibration, or lacks the table.
    """
    coefficients = Calibration.from_file(path).detection
    if not coefficients:
        raise RangeError(f"{path}: no table [detection]; allowed: a calibration that was fitted with one")
    return DetectionModel(coefficients, ImageSensor() if sensor is None else sensor)
