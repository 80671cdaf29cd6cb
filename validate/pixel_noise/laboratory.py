"""The laboratory: one marker on a grey board before one camera, with blur, size, incidence and signal set one by one.

The camera's ring light is the only light, so that the radiance of the marker is known without looking at any image; the
exposure is set so that white, at the marker's centre, yields the requested electrons.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.optimize import brentq
from scipy.stats import qmc

from pss import Appearance, ImageSensor, PTZCamera, Rectangle, noise_model
from pss.cameras.sensor import electrons_per_radiance
from pss.hints import Floats
from render.light import lit_scene
from render.light.radiosity import solve_light
from render.world.marker_print import predefined_dictionary
from render.world.state import Light, Marker, MarkerPrint, Room, SceneObject, SceneState
from validate.markers.cramer_rao import centre_bound, draw_finely

__all__ = ["DICTIONARY", "Factors", "Pose", "Setup", "draw_poses"]


DICTIONARY = "DICT_4X4_100"
MODULES = predefined_dictionary(DICTIONARY).markerSize + 2
PRINT = MarkerPrint(DICTIONARY, quiet_zone_modules=1.0, white_albedo=0.85, black_albedo=0.04)
RING_W_PER_SR = 40.0
# Black but for the board: the ring light lights each surface once, and nothing else sends light.
ROOM = Room(6.0, 6.0, 3.0, 0.0, 0.0, 0.0)
BOARD_ALBEDO, BOARD_SIDE_M = 0.5, 1.6
BOARD_BEHIND_M = 1e-3
# At 4 m a module of the centre point is 10 mm: the marker takes 1.5 % of its distance, and perspective is weak.
CAMERA_M, MARKER_M = (0.0, -2.5, 1.5), np.array([0.0, 1.5, 1.5])
FOCAL_PX, DISTANCE_M, F_NUMBER = 4000.0, 4.0, 1.8
SENSOR = ImageSensor()
# The image reaches beyond the plate, of eight modules a side with its quiet zone, however it is turned.
WINDOW_MODULES, WINDOW_PX, WINDOW_STEP_PX, SMALLEST_WINDOW_PX = 12.0, 16, 16, 128

# Samples a pixel's side from which the bound is drawn; good to 3 % (twice as many change it by less).
SMALL_MODULE_PX, SAMPLES_OF_SMALL, SAMPLES_OF_LARGE = 13.0, 8, 6


@dataclass(frozen=True)
class Factors:
    """What localisation depends on, at the marker's centre.

    Attributes:
        module_px: px, side of a module that faces the camera.
        cc_px: px, diameter of the circle of confusion (Eq. 14).
        incidence_deg: degrees between the marker's normal and the ray to the camera.
        white_e: electrons, mean signal of white.
    """

    module_px: float = 10.0
    cc_px: float = 0.0
    incidence_deg: float = 20.0
    white_e: float = 300.0

    @property
    def blur_px(self) -> float:
        """px (σ), of all that smears an edge: the pixel's own width and the circle of confusion; the lens adds none."""
        return math.sqrt(1 / 12 + (self.cc_px / 4) ** 2)

    @property
    def cos_incidence(self) -> float:
        """Cosine of the incidence angle."""
        return math.cos(math.radians(self.incidence_deg))

    @property
    def black_e(self) -> float:
        """Electrons, mean signal of black."""
        return self.white_e * PRINT.black_albedo / PRINT.white_albedo

    @property
    def white_snr(self) -> float:
        """Mean over σ of a white pixel: signal-to-noise ratio, no unit."""
        return self.white_e / float(SENSOR.noise_electrons(np.array(self.white_e)))

    @property
    def edge_cnr(self) -> float:
        """White minus black over the σ of the grey between them: contrast-to-noise ratio of an edge, no unit."""
        grey = (self.white_e + self.black_e) / 2
        return (self.white_e - self.black_e) / float(SENSOR.noise_electrons(np.array(grey)))


@dataclass(frozen=True)
class Pose:
    """What differs between renders of the same factors.

    Attributes:
        marker_id: number in the dictionary.
        roll_deg: degrees by which the print is turned in its plane.
        azimuth_deg: degrees, the direction in the image to which the marker leans away.
        phase_px: px, (2,), where the centre falls between pixel centres.
    """

    marker_id: int
    roll_deg: float
    azimuth_deg: float
    phase_px: tuple[float, float]


def draw_poses(count: int, rng: np.random.Generator) -> list[Pose]:
    """Poses spread evenly over roll, azimuth and phase (a Latin hypercube), each with a number of its own."""
    spread = qmc.LatinHypercube(4, rng=rng).random(count)
    numbers = len(predefined_dictionary(DICTIONARY).bytesList)
    ids = np.concatenate([rng.permutation(numbers) for _ in range(-(-count // numbers))])[:count]
    return [
        Pose(int(number), 360 * roll, 360 * azimuth, (x - 0.5, y - 0.5))
        for number, (roll, azimuth, x, y) in zip(ids.tolist(), spread.tolist(), strict=True)
    ]


@dataclass(frozen=True)
class Setup:
    """One marker before the camera: all that a view and its prediction need. Pixel centres are at whole numbers."""

    factors: Factors
    pose: Pose

    @property
    def camera(self) -> PTZCamera:
        """Focused for the requested circle of confusion, turned so that the centre has its phase."""
        needed_px = WINDOW_MODULES * self.factors.module_px + 2 * self.factors.cc_px + WINDOW_PX
        size = max(SMALLEST_WINDOW_PX, WINDOW_STEP_PX * math.ceil(needed_px / WINDOW_STEP_PX))
        right, down = (math.degrees(math.atan2(part, FOCAL_PX)) for part in self.pose.phase_px)
        return _camera(size, -right, down, _focus_distance(self.factors.cc_px))

    @property
    def marker(self) -> Marker:
        """At its place, leaning and turned."""
        towards, right, up = np.array([0.0, -1.0, 0.0]), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
        azimuth, roll = math.radians(self.pose.azimuth_deg), math.radians(self.pose.roll_deg)
        lean = math.cos(azimuth) * right + math.sin(azimuth) * up
        cos, sin = self.factors.cos_incidence, math.sin(math.radians(self.factors.incidence_deg))
        normal = cos * towards + sin * lean
        first = cos * lean - sin * towards
        second = np.cross(normal, first)
        turned = math.cos(roll) * first + math.sin(roll) * second
        module_m = self.factors.module_px * DISTANCE_M / FOCAL_PX
        return Marker(self.pose.marker_id, "board", _triple(MARKER_M), _triple(normal), _triple(turned), module_m)

    @property
    def state(self) -> SceneState:
        """The marker on its board in a black room."""
        marker = self.marker
        x, y, z = marker.normal
        behind = _triple(MARKER_M - BOARD_BEHIND_M * np.array(marker.normal))
        facing, elevation = math.degrees(math.atan2(x, y)), math.degrees(math.asin(min(1.0, max(-1.0, z))))
        board = Rectangle("board", behind, BOARD_SIDE_M, BOARD_SIDE_M, facing, elevation)
        light = Light(0.0, (), RING_W_PER_SR)
        return SceneState(ROOM, light, (SceneObject(board, BOARD_ALBEDO),), (marker,), PRINT)

    @property
    def sensor(self) -> ImageSensor:
        """The sensor, exposed until white makes the factors' electrons."""
        return self.exposed_for(self.factors.white_e)

    def exposed_for(self, white_e: float) -> ImageSensor:
        """The sensor, exposed until white, at the marker's centre, makes `white_e`."""
        camera, per_square_metre = self.camera, RING_W_PER_SR * PRINT.white_albedo / math.pi / DISTANCE_M**2
        radiance = per_square_metre * self.factors.cos_incidence
        collected = radiance * electrons_per_radiance(camera, SENSOR) * float(camera.cos_off_axis(MARKER_M)) ** 4
        return dataclasses.replace(SENSOR, exposure_ms=SENSOR.exposure_ms * white_e / collected)

    @property
    def truth_px(self) -> Floats:
        """px, (2,), the projection of the marker's centre."""
        return np.asarray(self.camera.project(MARKER_M)[0])

    @property
    def homography(self) -> Floats:
        """(3, 3), from modules about the marker's centre (right, down in its print) to pixels; scaled to 1 there."""
        camera, marker = self.camera, self.marker
        axes = np.column_stack([marker.right, -np.array(marker.up)]) * marker.module_m
        from_lens = np.column_stack([axes, MARKER_M - np.array(camera.position_m)])
        homography = camera.intrinsic_matrix @ camera.rotation @ from_lens
        return np.asarray(homography / homography[2, 2])

    def bound_px2(self) -> Floats:
        """px², (2, 2), the Cramér–Rao bound of this very marker in evenly spread light."""
        fine_enough = SAMPLES_OF_SMALL if self.factors.module_px <= SMALL_MODULE_PX else SAMPLES_OF_LARGE
        homography, shape = self.homography, self.camera.resolution[::-1]
        levels = self.factors.black_e, self.factors.white_e
        fine = draw_finely(DICTIONARY, self.pose.marker_id, homography, shape, levels, self.factors.cc_px, fine_enough)
        return centre_bound(fine, fine_enough, homography, MODULES, self.sensor)

    def baked(self) -> lit_scene.GlowMeshes:
        """The lit scene."""
        return lit_scene.bake(self.state, solve_light(self.state))

    def physical_px2(self) -> Floats:
        """px², (2, 2), the covariance that the `physical` noise model predicts for an average tag."""
        marker, white = self.marker, RING_W_PER_SR * PRINT.white_albedo / math.pi
        appearance = Appearance(
            marker.module_m,
            white,
            white * PRINT.black_albedo / PRINT.white_albedo,
            along=marker.right[None],
            modules=MODULES,
            ring_light=True,
        )
        model = noise_model("physical", sensor=self.sensor)
        return model.covariance(self.camera, MARKER_M[None], np.array([marker.normal]), appearance)[0]


@cache
def _focus_distance(cc_px: float) -> float:
    """m, nearer than the marker, at which its circle of confusion has this diameter."""
    if cc_px == 0:
        return DISTANCE_M

    def excess(focus_m: float) -> float:
        return float(_camera(SMALLEST_WINDOW_PX, 0.0, 0.0, focus_m).circle_of_confusion_px(MARKER_M)) - cc_px

    return float(brentq(excess, 0.1, DISTANCE_M, xtol=1e-9))


def _camera(size_px: int, pan_deg: float, tilt_deg: float, focus_m: float) -> PTZCamera:
    fov_deg = math.degrees(2 * math.atan(size_px / 2 / FOCAL_PX))
    return PTZCamera(CAMERA_M, pan_deg, tilt_deg, 1.0, focus_m, F_NUMBER, (size_px, size_px), widest_fov_deg=fov_deg)


def _triple(vector: Floats) -> tuple[float, float, float]:
    x, y, z = (float(value) for value in vector)
    return x, y, z
