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

import math
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from pss.errors import RangeError
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
        lines += [
            f"{key} = {_quoted(value) if isinstance(value, str) else repr(value)}"
            for key, value in self.provenance.items()
        ]
        return "\n".join(lines) + "\n"

    @classmethod
    def from_file(cls, path: str | Path) -> Calibration:
        """Read a calibration.

        Raises:
            RangeError: the file is missing or no TOML, or says something else than weights, limits, name, provenance.
        """
        try:
            content: dict[str, Any] = tomllib.loads(Path(path).read_text(encoding="utf-8"))
        except OSError as error:
            raise RangeError(f"{path}: {error.strerror}; allowed: the path of a calibration (.toml)") from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise RangeError(f"{path}: no TOML ({error})") from None
        if unknown := set(content) - {"name", "weights", "limits", "provenance"}:
            raise RangeError(f"{path}: {sorted(unknown)[0]!r}; allowed: name, weights, limits, provenance")
        weights = content.get("weights")
        if not isinstance(weights, dict) or not weights:
            raise RangeError(f"{path}: weights = {weights!r}; allowed: a table of {', '.join(CALIBRATION_FACTORS)}")
        for factor, weight in weights.items():
            if factor not in CALIBRATION_FACTORS:
                raise RangeError(f"{path}: weights.{factor}; allowed: {', '.join(CALIBRATION_FACTORS)}")
            if isinstance(weight, bool) or not isinstance(weight, int | float) or not 0 <= weight < math.inf:
                raise RangeError(f"{path}: weights.{factor} = {weight!r}; allowed: 0 or more, finite")
        if not any(weights.values()):
            raise RangeError(f"{path}: all weights are 0; allowed: at least one above")
        limits = content.get("limits", {})
        if not isinstance(limits, dict) or (limits and set(limits) != set(CALIBRATION_LIMITS)):
            raise RangeError(f"{path}: limits = {limits!r}; allowed: none, or {' and '.join(CALIBRATION_LIMITS)}")
        for limit, value in limits.items():
            if isinstance(value, bool) or not isinstance(value, int | float) or not 0 < value < math.inf:
                raise RangeError(f"{path}: limits.{limit} = {value!r}; allowed: above 0, finite")
        return cls(
            str(content.get("name", Path(path).stem)),
            {key: float(value) for key, value in weights.items()},
            content.get("provenance", {}),
            {key: float(limits[key]) for key in CALIBRATION_LIMITS if limits},
        )


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n") + '"'
