"""The noise models by name: the paper's, those without fit, the shipped calibration, and those of other packages.

To add a model, register an entry point of the group "pss.noise_models". The entry point's name is the model's; it loads
a `NoiseModel`, or a function that takes `NoiseSettings` and returns one.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

from pss.cameras.sensor import ImageSensor
from pss.entry_points import EntryPointTable
from pss.errors import RangeError
from pss.inputs import number
from pss.noise.calibrated import Calibration
from pss.noise.factors import DEFAULT_CCD_NOISE, Defocus, DistanceIncidence, IdentityNoise, Resolution
from pss.noise.model import NoiseModel
from pss.noise.photometric import BrightnessContrast

__all__ = [
    "BUILT_IN_MODELS",
    "CALIBRATED",
    "ENTRY_POINTS",
    "NOISE_MODELS",
    "SHIPPED_CALIBRATION",
    "NoiseSettings",
    "NoiseTable",
    "calibration_called",
    "noise_model",
    "shipped_calibration",
]

ENTRY_POINTS = "pss.noise_models"

CALIBRATED = "calibrated"
"""The name of the shipped calibration, in place of a calibration's path."""

SHIPPED_CALIBRATION = Path(__file__).with_name("calibrated.toml")
"""Fitted by `run_sweep.py bank` to training views of scenes/room.toml (results/reference/bank/calibrated.toml)."""

# In tables, in files and after "@" on the command line; the path of a calibration is not a name.
NAME = re.compile(r"(?!.*\.toml$)[A-Za-z0-9][\w.-]*")


@dataclass(frozen=True)
class NoiseSettings:
    """Constants that a model may depend on besides the views.

    Attributes:
        sensor: one for all cameras, or one for each by the camera's name.
        ccd_noise: dark noise over full well, for Eqs. 12 and 13; a number, or one for each camera by name.
        px2_per_m2: px²/m², the scale of Eq. 11.

    Raises:
        RangeError: a constant out of range.
    """

    sensor: ImageSensor | Mapping[str, ImageSensor] = field(default_factory=ImageSensor)
    ccd_noise: float | Mapping[str, float] = DEFAULT_CCD_NOISE
    px2_per_m2: float = 1.0

    def __post_init__(self) -> None:
        dark = self.ccd_noise.values() if isinstance(self.ccd_noise, Mapping) else [self.ccd_noise]
        scales = [*(number(value, "ccd_noise") for value in dark), number(self.px2_per_m2, "px2_per_m2")]
        if not all(scale > 0 for scale in scales):
            raise RangeError(f"ccd_noise = {self.ccd_noise!r}, px2_per_m2 = {self.px2_per_m2!r}; allowed: above 0")


Build = Callable[[NoiseSettings], NoiseModel]


class NoiseTable(EntryPointTable[Build]):
    """Functions from `NoiseSettings` to a model, by its name; the project's, then those of entry points."""

    def __init__(self, models: Mapping[str, Build]) -> None:
        super().__init__(ENTRY_POINTS, "noise model", models.items())

    def _items_of(self, name: str, loaded: object) -> Iterable[tuple[str, Build]]:
        if not NAME.fullmatch(name):
            raise RangeError(f"the name {name!r}; allowed: letters, digits, -, _ and ., not ending in .toml")
        if not isinstance(loaded, NoiseModel) and not callable(loaded):
            raise RangeError(f"{loaded!r}; allowed: a pss.NoiseModel, or a function of pss.NoiseSettings to one")
        yield name, _named(name, loaded)


def _named(name: str, loaded: object) -> Build:
    """The model of an entry point, under the entry point's name."""

    def build(settings: NoiseSettings) -> NoiseModel:
        try:
            model = loaded(settings) if callable(loaded) else loaded
        except Exception as error:  # third-party code: the message needs the model's name
            raise RangeError(f"noise model {name!r} raised {type(error).__name__}: {error}") from error
        if not isinstance(model, NoiseModel):
            raise RangeError(f"noise model {name!r} is built as {model!r}; allowed: a pss.NoiseModel")
        return dataclasses.replace(model, name=name)

    return build


def _of_the_paper(name: str, corrected: bool) -> Build:
    """Eqs. 11 to 15."""

    def build(settings: NoiseSettings) -> NoiseModel:
        first = DistanceIncidence(corrected=corrected, px2_per_m2=settings.px2_per_m2)
        return NoiseModel(name, (first, Resolution(settings.ccd_noise), Defocus()))

    return build


@cache
def shipped_calibration() -> Calibration:
    """The calibration that comes with the package, "calibrated"."""
    return Calibration.from_file(SHIPPED_CALIBRATION)


def calibration_called(name: str | Path) -> Calibration | None:
    """The calibration of that name or path: the shipped one, or a file (.toml); None if it is neither.

    Raises:
        RangeError: the path is not that of a calibration.
    """
    if str(name) == CALIBRATED:
        return shipped_calibration()
    return Calibration.from_file(name) if str(name).endswith(".toml") else None


NOISE_MODELS = NoiseTable(
    {
        "as-printed": _of_the_paper("as-printed", corrected=False),
        "corrected": _of_the_paper("corrected", corrected=True),
        "physical": lambda settings: NoiseModel("physical", (BrightnessContrast(settings.sensor),)),
        "identity": lambda settings: NoiseModel("identity", (IdentityNoise(),)),
        CALIBRATED: lambda settings: shipped_calibration().model(settings.sensor, settings.ccd_noise),
    }
)

BUILT_IN_MODELS = tuple(NOISE_MODELS.own)
"""Names of the models that need no other package."""


def noise_model(
    name: str | Path,
    *,
    switched_off: Iterable[str] = (),
    weights: Mapping[str, float] | None = None,
    ccd_noise: float | Mapping[str, float] = DEFAULT_CCD_NOISE,
    px2_per_m2: float = 1.0,
    sensor: ImageSensor | Mapping[str, ImageSensor] | None = None,
) -> NoiseModel:
    """The noise model called `name`, of `pss.NOISE_MODELS`, or that of the calibration at that path (.toml).

    "as-printed" is Eqs. 11–15, "corrected" has D²/cos α in Eq. 11, "physical" is the bound from the tag's edges and the
    sensor's noise, "identity" is R = I, "calibrated" has the weights fitted to the shipped room. "physical" and
    calibrations need `appearance` in `pss.evaluate`.

    Args:
        switched_off: names of factors, or of parts of one ("distance", "incidence"), to switch off.
        weights: factors for the covariances, 0 or more, by name of the noise factor.
        ccd_noise, px2_per_m2: as in `NoiseSettings`.
        sensor: one for all cameras, or one for each by name; None for `ImageSensor()`.

    Raises:
        RangeError: an unknown name of a model or a factor, or a constant out of range.
    """
    if isinstance(switched_off, str):
        raise RangeError(f"switched_off = {switched_off!r}; allowed: a list of names")
    settings = NoiseSettings(ImageSensor() if sensor is None else sensor, ccd_noise, px2_per_m2)
    calibration = calibration_called(name)
    if calibration is not None:
        model = calibration.model(settings.sensor, settings.ccd_noise)
    elif isinstance(name, str) and name in NOISE_MODELS:
        model = NOISE_MODELS[name](settings)
    else:
        allowed = f"{', '.join(NOISE_MODELS)}, or a calibration's path (.toml)"
        raise RangeError(f"noise model {str(name)!r}; allowed: {allowed}")
    model = model.without(*switched_off)
    return model.weighted(weights) if weights else model
