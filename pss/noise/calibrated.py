"""A calibration: weights of noise factors and limits of detection, fitted on training views, as a file.

It can also have scales: for each model whose unit is not defined, the number with which it fits the same views best.

name = "calibrated"

[weights]                      # of covariances; px² where the factor itself is a ratio
brightness-contrast = 1.1
floor = 3e-5

[limits]                       # of detection (`pss.visibility_tests`); optional
smallest_module_px = 2.3
largest_blur_modules = 1.0

[detection]                    # probability of detection (`pss.detection_model`); optional
constant = 8.3
size = 2.0
blur = 3.3
signal = 6.7
incidence = 0.0
lapse = 0.005

[scales]                       # of whole models R, which are not changed; optional
as-printed = 1e-5

[provenance]                   # for information, not used
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pss.cameras.sensor import ImageSensor
from pss.errors import RangeError
from pss.files import read_toml
from pss.noise.factors import (
    DEFAULT_CCD_NOISE,
    Defocus,
    DistanceIncidence,
    IdentityNoise,
    NoiseFactor,
    Resolution,
    Weighted,
)
from pss.noise.model import NoiseModel
from pss.noise.photometric import BrightnessContrast
from pss.noise.relative import ModuleSize, RelativeDefocus
from pss.toml_text import toml_text

__all__ = [
    "CALIBRATION_FACTORS",
    "CALIBRATION_LIMITS",
    "DETECTION_COEFFICIENTS",
    "SCALED_MODELS",
    "Calibration",
    "calibration_factor",
]

CALIBRATION_FACTORS = (
    "brightness-contrast",
    "floor",
    "defocus",
    "relative-defocus",
    "module-size",
    "distance-incidence",
    "resolution",
)
CALIBRATION_LIMITS = ("smallest_module_px", "largest_blur_modules")
# Of the probability of detection (`pss.visibility.detection`): lower bound, and upper bound (exclusive), of each.
DETECTION_COEFFICIENTS: Mapping[str, tuple[float, float]] = {
    "constant": (-math.inf, math.inf),
    "size": (0.0, math.inf),
    "blur": (0.0, math.inf),
    "signal": (0.0, math.inf),
    "incidence": (0.0, math.inf),
    "lapse": (0.0, 1.0),
}
# The paper's models, which add m² to px², and R = I: their unit is not defined.
SCALED_MODELS = ("as-printed", "corrected", "identity")

TABLES = ("name", "weights", "limits", "detection", "scales", "provenance")
# A longer value would hide the rest of the message.
LONGEST_VALUE = 70


def calibration_factor(
    name: str,
    sensor: ImageSensor | Mapping[str, ImageSensor] | None = None,
    ccd_noise: float | Mapping[str, float] = DEFAULT_CCD_NOISE,
) -> NoiseFactor:
    """The factor called `name`, with the weight 1; `sensor` and `ccd_noise` as in `pss.noise_model`.

    Raises:
        RangeError: there is none.
    """
    match name:
        case "brightness-contrast":
            return BrightnessContrast(ImageSensor() if sensor is None else sensor)
        case "floor":
            return IdentityNoise(name="floor")
        case "defocus":
            return Defocus()
        case "relative-defocus":
            return RelativeDefocus()
        case "module-size":
            return ModuleSize()
        case "distance-incidence":
            return DistanceIncidence(corrected=True)
        case "resolution":
            return Resolution(ccd_noise)
    raise RangeError(f"noise factor {name!r}; allowed in a calibration: {', '.join(CALIBRATION_FACTORS)}")


@dataclass(frozen=True)
class Calibration:
    """Fitted weights of noise factors and limits of detection, by name, and their provenance.

    Attributes:
        weights: by factor, of covariances (px² where the factor itself is a ratio).
        limits: all of `CALIBRATION_LIMITS` (`pss.visibility.targets.Legible`), or none.
        detection: all of `DETECTION_COEFFICIENTS` (`pss.DetectionModel`), or none.
        scales: factors by which the covariances of `SCALED_MODELS` fit best, for all of them or none.
    """

    name: str
    weights: Mapping[str, float]
    provenance: Mapping[str, str | int | float]
    limits: Mapping[str, float] = field(default_factory=dict)
    scales: Mapping[str, float] = field(default_factory=dict)
    detection: Mapping[str, float] = field(default_factory=dict)

    def factors(
        self,
        sensor: ImageSensor | Mapping[str, ImageSensor] | None = None,
        ccd_noise: float | Mapping[str, float] = DEFAULT_CCD_NOISE,
    ) -> tuple[NoiseFactor, ...]:
        """The factors with a weight above 0."""
        return tuple(
            Weighted(calibration_factor(factor, sensor, ccd_noise), weight)
            for factor, weight in self.weights.items()
            if weight > 0
        )

    def model(
        self,
        sensor: ImageSensor | Mapping[str, ImageSensor] | None = None,
        ccd_noise: float | Mapping[str, float] = DEFAULT_CCD_NOISE,
    ) -> NoiseModel:
        """The noise model of its factors, under its own name; `sensor` and `ccd_noise` as in `pss.noise_model`."""
        return NoiseModel(self.name, self.factors(sensor, ccd_noise))

    def to_toml(self) -> str:
        """The file's text."""
        numbers = {"limits": self.limits, "detection": self.detection, "scales": self.scales}
        tables = {"weights": self.weights} | {name: table for name, table in numbers.items() if table}
        as_floats = {name: {key: float(value) for key, value in table.items()} for name, table in tables.items()}
        return toml_text({"name": self.name} | as_floats | {"provenance": dict(self.provenance)})

    @classmethod
    def from_file(cls, path: str | Path) -> Calibration:
        """Read a calibration.

        Raises:
            RangeError: the file is missing, is not valid TOML, or has anything but weights, limits, detection, scales,
                name and provenance.
        """
        if not os.path.isfile(path):  # False for a name that is too long, too
            raise RangeError(f"{path}: there is no such file; allowed: the path of a calibration (.toml)")
        content = read_toml(path)
        if unknown := set(content) - set(TABLES):
            raise RangeError(f"{path}: {sorted(unknown)[0]!r:.{LONGEST_VALUE}}; allowed: {', '.join(TABLES)}")
        weights = content.get("weights")
        if not isinstance(weights, dict) or not weights:
            raise RangeError(
                f"{path}: weights = {_shown(weights)}; allowed: a table of {', '.join(CALIBRATION_FACTORS)}"
            )
        for factor, weight in weights.items():
            if factor not in CALIBRATION_FACTORS:
                raise RangeError(f"{path}: weights.{_shown(factor)}; allowed: {', '.join(CALIBRATION_FACTORS)}")
            if isinstance(weight, bool) or not isinstance(weight, int | float) or not 0 <= weight < math.inf:
                raise RangeError(f"{path}: weights.{factor} = {_shown(weight)}; allowed: 0 or more, finite")
        if not any(weights.values()):
            raise RangeError(f"{path}: all weights are 0; allowed: at least one above")
        limits = _numbers(path, content, "limits", dict.fromkeys(CALIBRATION_LIMITS))
        scales = _numbers(path, content, "scales", dict.fromkeys(SCALED_MODELS))
        detection = _numbers(path, content, "detection", DETECTION_COEFFICIENTS)
        name = content.get("name", Path(path).stem)
        if not isinstance(name, str):
            raise RangeError(f"{path}: name = {_shown(name)}; allowed: text")
        provenance = content.get("provenance", {})
        if not isinstance(provenance, dict):
            raise RangeError(f"{path}: provenance = {_shown(provenance)}; allowed: a table of text and numbers")
        for key, value in provenance.items():
            if not isinstance(value, str | int | float):
                raise RangeError(f"{path}: provenance.{_shown(key)} = {_shown(value)}; allowed: text or a number")
        return cls(
            name,
            {key: float(value) for key, value in weights.items()},
            provenance,
            limits,
            scales,
            detection,
        )


def _numbers(
    path: str | Path, content: Mapping[str, object], table: str, ranges: Mapping[str, tuple[float, float] | None]
) -> dict[str, float]:
    """A table with a finite number for each name, or none at all.

    Args:
        ranges: lower bound and upper bound (exclusive) by name; None for above 0.

    Raises:
        RangeError: with path, key, value and what is allowed.
    """
    values = content.get(table, {})
    if not isinstance(values, dict) or (values and set(values) != set(ranges)):
        raise RangeError(f"{path}: {table} = {_shown(values)}; allowed: none, or {' and '.join(ranges)}")
    for name, value in values.items():
        low, high = ranges[name] or (0.0, math.inf)
        number = not isinstance(value, bool) and isinstance(value, int | float) and math.isfinite(value)
        if not number or not low <= value < high or (ranges[name] is None and value == 0):
            allowed = "above 0" if ranges[name] is None else "" if math.isinf(low) else f"{low:g} or more"
            allowed += f", below {high:g}" if math.isfinite(high) else ", finite" if allowed else "a finite number"
            raise RangeError(f"{path}: {table}.{name} = {_shown(value)}; allowed: {allowed}")
    return {name: float(values[name]) for name in ranges if values}


def _shown(value: object) -> str:
    """A value from a file as a part of a line, shortened."""
    text = value if isinstance(value, str) and value.isprintable() else repr(value)
    return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 1] + "…"
