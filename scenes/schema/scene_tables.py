"""The keys of a scene file. Rules that involve several keys are in `scenes.rules`.

Units end the names: _m metres, _mm millimetres, _um micrometres, _nm nanometres, _ms milliseconds, _deg degrees,
_e electrons, _dn digital numbers, _per_ the divisor. A description is the text after "allowed:" in messages.
"""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field

from pss.cameras.camera import MAX_ABS_TILT_DEG, MOST_BLADES
from pss.cameras.sensor import LARGEST_PRNU_SHARE
from pss.noise.table import BUILT_IN_MODELS
from pss.visibility.targets import VISIBILITIES
from render.light.exposure import AutoExposure
from scenes.reading.limits import (
    BRIGHTEST_RING_W_PER_SR,
    BRIGHTEST_W_PER_M2_SR,
    LONGEST_EXPOSURE_MS,
    LONGEST_ROOM_M,
    MOST_CAMERAS,
    MOST_FACTORS,
    MOST_MODELS,
    MOST_OBJECTS,
    MOST_PANELS,
    MOST_PLACED,
    SHORTEST_EXPOSURE_MS,
    SMALLEST_PITCH_UM,
)
from scenes.reading.quantities import Albedo, Degrees, Direction, MarkerId, Metres, Millimetres, Point
from scenes.reading.sensor_file import known_sensors
from scenes.reading.spec import Count, Item, Name, Number, Positive, Spec, one_of
from scenes.schema.avatar import AvatarSpec
from scenes.schema.dictionaries import DICTIONARIES
from scenes.schema.meshes import BackdropSpec, MeshSpec
from scenes.schema.motion import MovingSpec

__all__ = [
    "BoxSpec",
    "CameraSpec",
    "GridSpec",
    "MarkersSpec",
    "PlacedSpec",
    "RectangleSpec",
    "SceneSpec",
    "SphereSpec",
    "SpiralSpec",
]

# The aperture beyond which the rays to the middle of the image would come from behind it (sine condition, in air).
FASTEST_F_NUMBER = 0.5

Size = Annotated[Number, Field(gt=0)]
Text = Annotated[str, Field(strict=True, min_length=1)]
PixelCount = Annotated[int, Field(strict=True, ge=16, le=20000)]
EXPOSURE = f"a number from {SHORTEST_EXPOSURE_MS:g} to {LONGEST_EXPOSURE_MS:g}, in milliseconds"
Exposure = Annotated[Number, Field(ge=SHORTEST_EXPOSURE_MS, le=LONGEST_EXPOSURE_MS)]
TILT = f"a number from -{MAX_ABS_TILT_DEG:g} to {MAX_ABS_TILT_DEG:g}, in degrees"


RoomSide = Annotated[
    Positive, Field(le=LONGEST_ROOM_M, description=f"a number above 0, in metres, at most {LONGEST_ROOM_M:g}")
]


class RoomSpec(Spec):
    """[room]: centred on x = y = 0, its floor at z = 0."""

    width_m: RoomSide
    length_m: RoomSide
    height_m: RoomSide
    wall_albedo: Albedo
    floor_albedo: Albedo
    ceiling_albedo: Albedo


class PanelSpec(Spec):
    """A lamp in the ceiling."""

    centre_m: Annotated[tuple[Number, Number], Field(description="[x, y], in metres")]
    size_m: Annotated[tuple[Size, Size], Field(description="[along x, along y], each above 0, in metres")]


class LightSpec(Spec):
    """[light]: "ambient", panels in the ceiling; or "ring", a strobe at each camera, visible to that camera only."""

    kind: Annotated[Literal["ambient", "ring"], Field(description='"ambient" or "ring"')] = "ambient"
    radiance_w_per_m2_sr: Annotated[Positive, Field(le=BRIGHTEST_W_PER_M2_SR)] | None = Field(
        None,
        description=f"a number above 0, at most {BRIGHTEST_W_PER_M2_SR:.0e} (the sun), in W/(m² sr), of the panels",
    )
    panels: Annotated[tuple[Annotated[PanelSpec, Item], ...], Field(min_length=1, max_length=MOST_PANELS)] | None = (
        Field(None, description=f"at least one {{ centre_m, size_m }}, at most {MOST_PANELS}")
    )
    ring_w_per_sr: Annotated[Positive, Field(le=BRIGHTEST_RING_W_PER_SR)] | None = Field(
        None,
        description=f"a number above 0, at most {BRIGHTEST_RING_W_PER_SR:.0e}, in W/sr, of each camera's ring light",
    )


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


class PlacedSpec(Spec):
    """[[markers.placed]]: a single marker, with `centre_m` on the surface of the object."""

    id: MarkerId
    object: Name
    centre_m: Point
    normal: Direction
    up: Direction | None = Field(None, description="[x, y, z], a direction of any length above 0 (without it, upwards)")
    module_mm: Millimetres


class MarkersSpec(Spec):
    """[markers]: the print of all markers."""

    dictionary: Annotated[Literal[tuple(DICTIONARIES)], Field(description=", ".join(DICTIONARIES))]
    quiet_zone_modules: Annotated[Number, Field(ge=0, description="a number, 0 or more, in modules")]
    white_albedo: Albedo
    black_albedo: Albedo
    placed: Annotated[tuple[Annotated[PlacedSpec, Item], ...], Field(max_length=MOST_PLACED)] = ()


class GridSpec(Spec):
    """Markers in the equal cells of a grid on a rectangle's front, row by row from top left."""

    columns: Count
    rows: Count
    module_mm: Millimetres
    first_id: MarkerId


class SpiralSpec(Spec):
    """Markers spread evenly over a sphere."""

    count: Count
    module_mm: Millimetres
    first_id: MarkerId


class RectangleSpec(MovingSpec):
    """A thin board."""

    name: Name
    kind: Literal["rectangle"]
    centre_m: Point
    width_m: Metres
    height_m: Metres
    facing_deg: Degrees = 0.0
    elevation_deg: Annotated[Number, Field(ge=-90, le=90, description="a number from -90 to 90, in degrees")] = 0.0
    albedo: Albedo
    markers: GridSpec | None = None


class SphereSpec(MovingSpec):
    """A ball."""

    name: Name
    kind: Literal["sphere"]
    centre_m: Point
    radius_m: Metres
    albedo: Albedo
    markers: SpiralSpec | None = None


class BoxSpec(MovingSpec):
    """An axis-parallel box between two corners."""

    name: Name
    kind: Literal["box"]
    lowest_m: Point
    highest_m: Point
    albedo: Albedo


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


ObjectSpec = one_of("kind", RectangleSpec, SphereSpec, BoxSpec, MeshSpec, AvatarSpec)
ProcessSpec = one_of("model", RandomWalkSpec, ConstantVelocitySpec, ConstantAccelerationSpec)


class SceneSpec(Spec):
    """A whole scene file."""

    room: RoomSpec
    light: LightSpec
    sensor: SensorSpec
    lens: LensSpec
    cameras: Annotated[tuple[Annotated[CameraSpec, Item], ...], Field(min_length=1, max_length=MOST_CAMERAS)]
    markers: MarkersSpec
    objects: Annotated[tuple[Annotated[ObjectSpec, Item], ...], Field(min_length=1, max_length=MOST_OBJECTS)]
    backdrop: BackdropSpec | None = None
    process: ProcessSpec
    noise: NoiseSpec
    metric: MetricSpec = MetricSpec()
