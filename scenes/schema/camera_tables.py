"""The keys of [sensor], [lens] and [[cameras]], and of a named sensor's file."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from pss.cameras.camera import MAX_ABS_TILT_DEG, MOST_BLADES
from pss.cameras.sensor import LARGEST_PRNU_SHARE
from render.light.exposure import AutoExposure
from scenes.reading.limits import LONGEST_EXPOSURE_MS, SHORTEST_EXPOSURE_MS, SMALLEST_PITCH_UM
from scenes.reading.quantities import Degrees, Metres, Point
from scenes.reading.sensor_file import known_sensors
from scenes.reading.spec import Name, Number, Positive, Spec

__all__ = ["CameraSpec", "LensSpec", "SensorFileSpec", "SensorSpec"]


# The aperture beyond which the rays to the middle of the image would come from behind it (sine condition, in air).
FASTEST_F_NUMBER = 0.5
PixelCount = Annotated[int, Field(strict=True, ge=16, le=20000)]
EXPOSURE = f"a number from {SHORTEST_EXPOSURE_MS:g} to {LONGEST_EXPOSURE_MS:g}, in milliseconds"
Exposure = Annotated[Number, Field(ge=SHORTEST_EXPOSURE_MS, le=LONGEST_EXPOSURE_MS)]
TILT = f"a number from -{MAX_ABS_TILT_DEG:g} to {MAX_ABS_TILT_DEG:g}, in degrees"


class SensorFileSpec(Spec):
    """A named sensor's file: all keys of [sensor] that describe the sensor itself."""

    resolution_px: Annotated[
        tuple[PixelCount, PixelCount], Field(description="[width, height], whole numbers from 16 to 20000, in pixels")
    ]
    pixel_pitch_um: Annotated[
        Positive,
        Field(
            ge=SMALLEST_PITCH_UM,
            lt=1000,
            description=f"a number from {SMALLEST_PITCH_UM} to below 1000, in micrometres",
        ),
    ]
    wavelength_nm: Annotated[Positive, Field(description="a number above 0, in nanometres")]
    quantum_efficiency: Annotated[Positive, Field(le=1, description="a number above 0, at most 1")]
    full_well_e: Annotated[Positive, Field(description="a number above 0, in electrons")]
    # Eqs. 12 and 13 consist of the dark noise alone: without any they are not a noise model.
    read_noise_e: Annotated[Positive, Field(description="a number above 0, in electrons")]
    bits: Annotated[int, Field(strict=True, ge=8, le=16, description="a whole number from 8 to 16")]
    black_level_dn: Annotated[int, Field(strict=True, ge=0, description="a whole number, 0 or more")]
    dark_current_e_per_s: Number = Field(0.0, ge=0, description="a number, 0 or more, in electrons per second")
    prnu_share: Number = Field(
        0.0, ge=0, le=LARGEST_PRNU_SHARE, description=f"a number from 0 to {LARGEST_PRNU_SHARE} (0.01 is 1 %)"
    )
    dsnu_e: Number = Field(0.0, ge=0, description="a number, 0 or more, in electrons")
    # Without it the full well fills the converter's range above the black level.
    system_gain_dn_per_e: Positive | None = Field(
        None,
        description="a number above 0, in digital numbers per electron (without it, the full well fills the range)",
    )


class SensorSpec(SensorFileSpec):
    """[sensor]: one for all cameras. With `name` it starts from that sensor, and its own keys take precedence."""

    name: Annotated[str, Field(strict=True)] | None = Field(None, description=", ".join(known_sensors()))
    exposure_ms: Annotated[Exposure | Literal["auto"], Field(description=f'{EXPOSURE}, or "auto"')]
    # No numbers as defaults: with a numeric exposure, these keys have no effect.
    auto_exposure_share: Annotated[Number, Field(gt=0, le=1)] | None = Field(
        None, description=f"a number above 0, at most 1, of the saturation (without it, {AutoExposure.share:g})"
    )
    longest_exposure_ms: Exposure | None = Field(
        None, description=f"{EXPOSURE} (without it, {AutoExposure.longest_ms:g})"
    )

    # Another name means another sensor, not the old one's numbers under a new name.
    replaces: ClassVar = {"name": tuple(SensorFileSpec.model_fields)}


class LensSpec(Spec):
    """[lens]: one for all cameras, which only differ in their settings."""

    f_number: Positive
    widest_f_number: Annotated[
        Number,
        Field(ge=FASTEST_F_NUMBER, description=f"a number, {FASTEST_F_NUMBER} or more (no lens in air is faster)"),
    ] = FASTEST_F_NUMBER
    widest_fov_deg: Annotated[Positive, Field(lt=180, description="a number above 0 and below 180, in degrees")]
    max_zoom: Annotated[Number, Field(ge=1, description="a number, 1 or more")]
    radial_distortion: Annotated[
        tuple[Number, Number], Field(description="[k1, k2] of OpenCV's radial distortion, two numbers")
    ] = (0.0, 0.0)
    psf_sigma_um: Annotated[Number, Field(ge=0, description="a number, 0 or more, in micrometres on the sensor")] = 0.0
    aperture_blades: Annotated[
        int,
        Field(strict=True, ge=0, le=MOST_BLADES, description=f"0 (round), or a whole number from 3 to {MOST_BLADES}"),
    ] = 0


class CameraSpec(Spec):
    """[[cameras]]: aimed at `aim_m`, or along `pan_deg` and `tilt_deg`."""

    name: Name
    position_m: Point
    aim_m: Point | None = Field(None, description="[x, y, z], in metres")
    pan_deg: Degrees | None = Field(None, description="a number, in degrees")
    tilt_deg: Annotated[Number, Field(ge=-MAX_ABS_TILT_DEG, le=MAX_ABS_TILT_DEG)] | None = Field(None, description=TILT)
    zoom: Annotated[Number, Field(description="a number from 1 to the lens's max_zoom")]
    focus_distance_m: Metres
    f_number: Positive | None = Field(None, description="a number above 0 (without it, the lens's)")

    replaces: ClassVar = {"aim_m": ("pan_deg", "tilt_deg"), "pan_deg": ("aim_m",), "tilt_deg": ("aim_m",)}
