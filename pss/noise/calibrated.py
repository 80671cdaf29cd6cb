"""A calibration: weights of noise factors and limits of detection, fitted on training views, in a file that says how.

name = "calibrated"

[weights]                      # of covariances; px² where the factor itself is a ratio
brightness-contrast = 1.1
floor = 3e-5

[limits]                       # of what is detected (`pss.visibility_tests`); may be left out
smallest_module_px = 2.3
largest_blur_modules = 1.0

[provenance]                   # for people: read, and not used
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

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
from pss.noise.photometric import BrightnessContrast
from pss.noise.relative import ModuleSize, RelativeDefocus
from pss.photometry import ImageSensor

__all__ = ["CALIBRATION_FACTORS", "CALIBRATION_LIMITS", "Calibration", "calibration_factor"]

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

# A longer value would push what is allowed out of sight.
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
    """Fitted weights of noise factors and limits of detection, by name, and where they come from.

    Attributes:
        weights: by factor, of covariances (px² where the factor itself is a ratio).
        limits: all of `CALIBRATION_LIMITS` (`pss.legibility.Legible`), or none.
    """

    name: str
    weights: Mapping[str, float]
    provenance: Mapping[str, str | int | float]
    limits: Mapping[str, float] = field(default_factory=dict)

    def factors(
        self,
        sensor: ImageSensor | Mapping[str, ImageSensor] | None = None,
        ccd_noise: float | Mapping[str, float] = DEFAULT_CCD_NOISE,
    ) -> tuple[NoiseFactor, ...]:
        """The factors that have a weight above 0."""
        return tuple(
            Weighted(calibration_factor(factor, sensor, ccd_noise), weight)
            for factor, weight in self.weights.items()
            if weight > 0
        )

    def to_toml(self) -> str:
        """The file's text."""
        lines = [f"name = {_quoted(self.name)}", "", "[weights]"]
        lines += [f"{factor} = {float(weight)!r}" for factor, weight in self.weights.items()]
        if self.limits:
            lines += ["", "[limits]", *(f"{limit} = {float(value)!r}" for limit, value in self.limits.items())]
        lines += ["", "[provenance]"]
        lines += [f"{_key(key)} = {_value(value)}" for key, value in self.provenance.items()]
        return "\n".join(lines) + "\n"

    @classmethod
    def from_file(cls, path: str | Path) -> Calibration:
        """Read a calibration.

        Raises:
            RangeError: the file is missing or no TOML, or says something else than weights, limits, name, provenance.
        """
        if not Path(path).is_file():
            raise RangeError(f"{path}: there is no such file; allowed: the path of a calibration (.toml)")
        content = read_toml(path)
        if unknown := set(content) - {"name", "weights", "limits", "provenance"}:
            raise RangeError(
                f"{path}: {sorted(unknown)[0]!r:.{LONGEST_VALUE}}; allowed: name, weights, limits, provenance"
            )
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
        limits = content.get("limits", {})
        if not isinstance(limits, dict) or (limits and set(limits) != set(CALIBRATION_LIMITS)):
            raise RangeError(f"{path}: limits = {_shown(limits)}; allowed: none, or {' and '.join(CALIBRATION_LIMITS)}")
        for limit, value in limits.items():
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < math.inf:
                raise RangeError(f"{path}: limits.{limit} = {_shown(value)}; allowed: above 0, finite")
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
            {key: float(limits[key]) for key in CALIBRATION_LIMITS if limits},
        )


def _shown(value: object) -> str:
    """A value out of a file as a part of a line, shortened."""
    text = value if isinstance(value, str) and value.isprintable() else repr(value)
    return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 1] + "…"


def _quoted(text: str) -> str:
    # JSON's escapes are TOML's too, but for the one control character that JSON leaves as it is.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _key(key: str) -> str:
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else _quoted(key)


def _value(value: str | int | float) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return _quoted(value) if isinstance(value, str) else repr(value)
