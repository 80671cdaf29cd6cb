"""Which views a bank has: cameras at random zoom, focus, pan and tilt, in sets that share no setting.

The training set is for calibration: its cameras stand elsewhere along the walls. The held-out set has the scene's own
cameras, and configurations are drawn from it. A third set, of the training cameras at any zoom and focus, shows where
markers cease to be found. Nothing here looks at an image.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pss import PTZCamera, RangeError
from pss.cameras.camera import MAX_ABS_TILT_DEG
from pss.hints import Floats
from render.lens.sampling import Sampling
from render.random_streams import random_stream
from scenes import Scene
from validate.acquire.acquire import Acquired, Acquisition, views_of
from validate.bank.subpixel_shifts import joined, turned
from validate.markers.view_measurement import ViewMeasurement
from validate.stats.measured_errors import check_trials

__all__ = [
    "BankDesign",
    "BankView",
    "ViewBank",
    "detection_views",
    "draw_configurations",
    "held_out_views",
    "training_views",
]


# A training camera stands this far from the walls, at a height between these shares of the room's.
FROM_WALL_M = 0.2
HEIGHTS = (0.6, 0.95)
# Attempts to draw another configuration before all that there are count as found.
MOST_ATTEMPTS = 100
# Of the image distance: a lens has no image of what is nearer.
NEAREST_FOCUS = 2.0
# Degrees of tilt that stay free for the turned renders.
TILT_LEFT_DEG = 1.0


@dataclass(frozen=True)
class BankDesign:
    """How many views, and how far their settings spread.

    Attributes:
        settings: views of each camera.
        training_cameras: places of cameras for calibration.
        turns: renders of each view at slightly turned settings.
        trials: noisy captures of each render.
        zoom: smallest and largest; log-uniform.
        focus_spread: σ of the logarithm of focus distance over the distance to the middle of the points.
        aim_share: largest pan and tilt off the middle of the points, in shares of the field of view.
        detection_settings: further views of each training camera, of one render each, for the probability of detection.
        detection_zoom: their smallest and largest zoom.
        detection_focus: their nearest and farthest focus, in distances to the middle of the points.
        noise_ratio: bound on the sampling noise (`render.lens.sampling.Sampling`).
        seed: of settings, captures and draws.
    """

    settings: int = 10
    training_cameras: int = 6
    turns: int = 2
    trials: int = 10
    zoom: tuple[float, float] = (1.5, 6.0)
    focus_spread: float = 0.35
    aim_share: float = 0.2
    detection_settings: int = 6
    detection_zoom: tuple[float, float] = (1.0, 8.0)
    detection_focus: tuple[float, float] = (0.25, 4.0)
    noise_ratio: float = 0.6
    seed: int = 1

    def __post_init__(self) -> None:
        check_trials(self.trials, f"--trials {self.trials}")
        for name in ("settings", "turns", "detection_settings"):
            if getattr(self, name) < 1:
                raise RangeError(f"--{name.replace('_', '-')} {getattr(self, name)}; allowed: 1 or more")


@dataclass(frozen=True, eq=False)
class BankView:
    """A view: the setting that predictions are made for, and its turned renders."""

    camera: PTZCamera
    renders: tuple[Acquisition, ...]

    def measured(self, acquired: Acquired) -> ViewMeasurement:
        """The detections of all renders, in pixels of `camera`."""
        parts = [acquired.measured[item] for item in self.renders]
        return joined(self.camera, [item.request.camera for item in self.renders], parts)


@dataclass(frozen=True, eq=False)
class ViewBank:
    """A scene and the views that configurations are drawn from; `role` is what they are for."""

    scene: Scene
    views: tuple[BankView, ...]
    role: str = "held out"

    @property
    def cameras(self) -> tuple[PTZCamera, ...]:
        """The setting of each view."""
        return tuple(view.camera for view in self.views)

    @property
    def requested(self) -> list[Acquisition]:
        """All renders."""
        return [item for view in self.views for item in view.renders]

    def without(self, failed: Collection[str]) -> ViewBank:
        """The bank without the views of which a render is among these, by its hash."""
        kept = (view for view in self.views if not any(item.request.key in failed for item in view.renders))
        return dataclasses.replace(self, views=tuple(kept))

    def measured(self, acquired: Acquired) -> tuple[Floats, Floats]:
        """Pixels (V, T, N, 2) and their covariances in px² (V, T, N, 2, 2); nan where not detected."""
        parts = [view.measured(acquired) for view in self.views]
        return np.array([part.pixels for part in parts]), np.array([part.covariance for part in parts])


def held_out_views(scene: Scene, design: BankDesign, renderer: str) -> ViewBank:
    """The scene's own cameras, each at `design.settings` settings."""
    return _bank(scene, scene.cameras, design, renderer, "held out")


def training_views(scene: Scene, design: BankDesign, renderer: str) -> ViewBank:
    """Cameras at other places along the walls, each at `design.settings` settings."""
    return _bank(scene, _training_cameras(scene, design), design, renderer, "training")


def detection_views(scene: Scene, design: BankDesign, renderer: str) -> ViewBank:
    """The training cameras at any zoom and focus, for the probability of detection alone; one render a view.

    Zoom and focus are spread evenly: each equal part of either's logarithmic range has one of a camera's views.
    """
    sampling, count = Sampling(noise_ratio=design.noise_ratio), design.detection_settings
    middle, views = scene.state.points_m.mean(axis=0), []
    for camera in _training_cameras(scene, design):
        rng = random_stream(design.seed, f"{scene.path.name}/{camera.name}", "detection")
        zooms, focuses = (_spread(ends, count, rng) for ends in (design.detection_zoom, design.detection_focus))
        for zoom, focus in zip(zooms, focuses, strict=True):
            setting = _aimed(camera, middle, min(zoom, camera.max_zoom), focus, design, rng)
            views.append(BankView(setting, views_of(scene, [setting], sampling, renderer, design.seed, design.trials)))
    return ViewBank(scene, tuple(views), "detection")


def _spread(ends: tuple[float, float], count: int, rng: np.random.Generator) -> list[float]:
    """`count` numbers between two, one in each equal part of the logarithmic range, in random order."""
    low, high = np.log(ends)
    shares = (rng.permutation(count) + rng.uniform(size=count)) / count
    return [float(value) for value in np.exp(low + (high - low) * shares)]


def _training_cameras(scene: Scene, design: BankDesign) -> list[PTZCamera]:
    room, rng = scene.state.room, random_stream(design.seed, scene.path.name, "training places")
    model, cameras = scene.cameras[0], []
    for number in range(design.training_cameras):
        # Evenly along the walls but for a random part, so that no two stand together.
        along = (number + rng.uniform(0.2, 0.8)) / design.training_cameras
        x, y = _on_walls(along, room.width_m - 2 * FROM_WALL_M, room.length_m - 2 * FROM_WALL_M)
        height = room.height_m * rng.uniform(*HEIGHTS)
        cameras.append(dataclasses.replace(model, position_m=(x, y, height), name=f"training {number + 1}"))
    return cameras


def _on_walls(along: float, width: float, length: float) -> tuple[float, float]:
    """x and y of a place on a rectangle about the origin, `along` its outline from 0 to 1."""
    way = along * 2 * (width + length)
    for x, y, dx, dy, side in (
        (-1, -1, 1, 0, width),
        (1, -1, 0, 1, length),
        (1, 1, -1, 0, width),
        (-1, 1, 0, -1, length),
    ):
        if way <= side:
            return x * width / 2 + dx * way, y * length / 2 + dy * way
        way -= side
    return -width / 2, -length / 2


def _bank(scene: Scene, cameras: Sequence[PTZCamera], design: BankDesign, renderer: str, role: str) -> ViewBank:
    middle = scene.state.points_m.mean(axis=0)
    sampling = Sampling(noise_ratio=design.noise_ratio)
    views = []
    for camera in cameras:
        rng = random_stream(design.seed, f"{scene.path.name}/{camera.name}", role)
        for _ in range(design.settings):
            setting = _setting(camera, middle, design, rng)
            parts = turned(setting, design.turns, rng)
            renders = views_of(scene, parts, sampling, renderer, design.seed, design.trials)
            views.append(BankView(setting, renders))
    return ViewBank(scene, tuple(views), role)


def _setting(camera: PTZCamera, middle_m: Floats, design: BankDesign, rng: np.random.Generator) -> PTZCamera:
    # A camera that zooms less than the design requires is used up to its limit; one without zoom stays unchanged.
    low, high = (min(zoom, camera.max_zoom) for zoom in design.zoom)
    # Of a logarithm and back, an end of the range may come out beyond it.
    zoom = min(max(math.exp(rng.uniform(math.log(low), math.log(high))), low), high)
    return _aimed(camera, middle_m, zoom, math.exp(design.focus_spread * rng.standard_normal()), design, rng)


def _aimed(
    camera: PTZCamera, middle_m: Floats, zoom: float, focus_share: float, design: BankDesign, rng: np.random.Generator
) -> PTZCamera:
    """The camera at a zoom, focused at `focus_share` of the distance to the middle, which it looks past at random."""
    distance = float(np.linalg.norm(middle_m - camera.position_m))
    nearest = NEAREST_FOCUS * dataclasses.replace(camera, zoom=zoom).image_distance_m
    focus = max(distance * focus_share, nearest)
    zoomed = dataclasses.replace(camera, zoom=zoom, focus_distance_m=focus)
    middle_pan_deg, middle_tilt_deg = zoomed.direction_to(middle_m)
    pan, tilt = design.aim_share * zoomed.horizontal_fov_deg * rng.uniform(-1, 1, size=2)
    # Settings are turned a little later on, and a camera does not look over its head.
    most = MAX_ABS_TILT_DEG - TILT_LEFT_DEG
    tilt_deg = min(max(middle_tilt_deg + float(tilt), -most), most)
    return dataclasses.replace(zoomed, pan_deg=middle_pan_deg + float(pan), tilt_deg=tilt_deg)


def draw_configurations(
    camera_names: Sequence[str], size: int, count: int, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Draw `count` different configurations of `size` views, each of another camera, as indices of views.

    A configuration takes views of different cameras, since one camera has one setting at a time.

    Returns:
        (K, size), sorted; K is `count`, or what there is if that is less.
    """
    names = sorted(set(camera_names))
    of_camera = {name: [view for view, other in enumerate(camera_names) if other == name] for name in names}
    found: set[tuple[int, ...]] = set()
    attempts = 0
    while len(found) < count and attempts < MOST_ATTEMPTS * count and size <= len(names):
        attempts += 1
        chosen = rng.choice(len(names), size=size, replace=False)
        found.add(tuple(sorted(int(rng.choice(of_camera[names[c]])) for c in chosen)))
    return np.array(sorted(found), dtype=np.int64).reshape(-1, size)
