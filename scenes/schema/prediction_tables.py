"""The keys of [process], [noise] and [metric]: what is predicted, and with what."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from pss.noise.table import BUILT_IN_MODELS
from pss.visibility.targets import VISIBILITIES
from scenes.reading.limits import MOST_FACTORS, MOST_MODELS
from scenes.reading.spec import Number, Positive, Spec, one_of

__all__ = ["MetricSpec", "NoiseSpec", "ProcessSpec"]


Text = Annotated[str, Field(strict=True, min_length=1)]


class RandomWalkSpec(Spec):
    """`pss.RandomWalk`."""

    model: Literal["random-walk"]
    step_std_mm: Annotated[Positive, Field(description="a number above 0, in millimetres per frame")]


class ConstantVelocitySpec(Spec):
    """`pss.ConstantVelocity`."""

    model: Literal["constant-velocity"]
    acceleration_density_m2_s3: Annotated[Positive, Field(description="a number above 0, in m²/s³")]
    time_step_s: Annotated[Positive, Field(description="a number above 0, in seconds")]


class ConstantAccelerationSpec(Spec):
    """`pss.ConstantAcceleration`."""

    model: Literal["constant-acceleration"]
    jerk_density_m2_s5: Annotated[Positive, Field(description="a number above 0, in m²/s⁵")]
    time_step_s: Annotated[Positive, Field(description="a number above 0, in seconds")]


class NoiseSpec(Spec):
    """[noise]: the predictions of a run; factors are switched off, or weighted, in each model that has them."""

    models: Annotated[
        tuple[Text, ...],
        Field(
            min_length=1,
            max_length=MOST_MODELS,
            description=f"a list of one or more, at most {MOST_MODELS}, of {', '.join(BUILT_IN_MODELS)}, paths of "
            "calibrations (.toml) and names of installed packages",
        ),
    ]
    switched_off: Annotated[
        tuple[Text, ...], Field(max_length=MOST_FACTORS, description="a list of names of factors")
    ] = ()
    weights: Annotated[
        dict[Text, Annotated[Number, Field(gt=0)]] | None,
        Field(max_length=MOST_FACTORS, description="a table of numbers above 0 by the name of a factor"),
    ] = None
    px2_per_m2: Annotated[Positive, Field(description="a number above 0, in px²/m²")] = 1.0


class MetricSpec(Spec):
    """[metric]: the markers that count as visible in predictions; optional."""

    visibility: Annotated[
        Text, Field(description=f"{', '.join(VISIBILITIES)}, or the path of a calibration (.toml)")
    ] = "point"


ProcessSpec = one_of("model", RandomWalkSpec, ConstantVelocitySpec, ConstantAccelerationSpec)
