"""The figure of the ring light: renders of a bare wall beside D² and cos α, the laws that Eq. 11 stands for."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from benchmarks.sensor_figures import BAND, BLACK, BLUE, DPI
from pss import PTZCamera
from render import backend
from render.lens import thin_lens
from render.lens.sampling import RingLight, Sampling, pixel_means, sample_image
from render.light import lit_scene
from render.light.radiosity import solve_light
from render.world.state import Light, MarkerPrint, Room, SceneState

__all__ = ["draw_ring_light"]

INTENSITY_W_PER_SR, ALBEDO = 0.4, 0.5
WALL_AT_M, EYE_M = 4.0, 1.5
DISTANCES_M = np.geomspace(0.35, 7.0, 14)
# Turned from this far, the axis meets the wall within the room up to the steepest of the angles.
TURNED_AT_M = 1.5
ANGLES_DEG = np.arange(0.0, 76.0, 5.0)

Floats = NDArray[np.float64]


class Wall:
    """A bare room, lit by the camera's own light, and cameras of 0.5° that look at one of its walls."""

    def __init__(self) -> None:
        self._mi = backend.start(backend.choose())
        room = Room(8.0, 8.0, 3.0, wall_albedo=ALBEDO, floor_albedo=0.3, ceiling_albedo=0.7)
        state = SceneState(room, Light(0.0, (), INTENSITY_W_PER_SR), (), (), MarkerPrint("DICT_4X4_50", 1.0, 0.9, 0.05))
        self._scene: Any = lit_scene.load_scene(lit_scene.bake(state, solve_light(state)), self._mi)

    def radiance(self, x_m: float, distance_m: float, turn_deg: float = 0.0) -> float:
        """W/(m² sr), mean over the image of a camera at that distance from the wall."""
        place = (x_m, WALL_AT_M - distance_m, EYE_M)
        camera = PTZCamera(place, turn_deg, 0, zoom=8, resolution=(8, 6), pixel_pitch_m=1e-5, widest_fov_deg=4.0)
        ring = RingLight(place, INTENSITY_W_PER_SR)
        sampler = pixel_means(self._scene, thin_lens.load_sensor(camera, self._mi), self._mi, None, ring)
        many = Sampling(fewest=64, most=64)
        image = sample_image(sampler, camera.resolution, np.ones_like, many, np.random.default_rng(0))
        return float(image.mean.mean())


def draw_ring_light(path: Path) -> float:
    """Light by distance and by angle of incidence, and how far off the laws it is; the largest deviation (relative)."""
    wall = Wall()
    at_1_m = ALBEDO / math.pi * INTENSITY_W_PER_SR
    by_distance = np.array([wall.radiance(0.0, distance) for distance in DISTANCES_M])
    turns = np.radians(ANGLES_DEG)
    # Along the axis the wall is TURNED_AT_M / cos α away: what is left after D² is the cosine's part.
    ranges = TURNED_AT_M / np.cos(turns)
    by_angle = np.array([wall.radiance(-3.5, TURNED_AT_M, angle) for angle in ANGLES_DEG]) * ranges**2 / at_1_m
    deviations = by_distance * DISTANCES_M**2 / at_1_m - 1, by_angle / np.cos(turns) - 1

    plt.rcParams.update({"font.size": 10, "axes.spines.top": False, "axes.spines.right": False})
    figure, ((far, turned), below) = plt.subplots(
        2, 2, figsize=(10.4, 5.6), sharex="col", height_ratios=[3.0, 1], layout="constrained"
    )
    line_m, line_deg = np.geomspace(0.3, 8, 100), np.linspace(0, 80, 100)
    far.loglog(line_m, at_1_m / line_m**2, color=BLUE, lw=1.8)
    far.loglog(DISTANCES_M, by_distance, "o", color=BLACK, ms=5)
    far.text(2.3, 0.022, r"$\frac{\rho}{\pi}\,\frac{I}{D^2}$", color=BLUE, fontsize=17)
    far.text(0.32, 8e-4, "renders of a wall straight ahead,\nunder the camera's own light", color=BLACK, va="bottom")
    far.set(xlim=(0.3, 8), ylabel="radiance in W/(m² sr)")
    far.set_title("Ring light by distance", loc="left", fontsize=12, fontweight="bold")
    turned.plot(line_deg, np.cos(np.radians(line_deg)), color=BLUE, lw=1.8)
    turned.plot(ANGLES_DEG, by_angle, "o", color=BLACK, ms=5)
    turned.text(52, 0.68, r"$\cos\alpha$", color=BLUE, fontsize=14)
    turned.text(3, 0.06, "the camera turned in its place;\nD² divided out", color=BLACK, va="bottom")
    turned.set(xlim=(-2, 80), ylim=(0, 1.05), ylabel="light relative to facing the wall")
    turned.set_title("… and by angle of incidence", loc="left", fontsize=12, fontweight="bold")
    _deviation(below[0], DISTANCES_M, deviations[0], "distance D in m")
    _deviation(below[1], ANGLES_DEG, deviations[1], "angle of incidence α in degrees")
    below[0].set_ylabel("off the law, %")
    ticks = [0.5, 1, 2, 5]
    below[0].set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    below[0].minorticks_off()
    figure.savefig(path, dpi=DPI, metadata={"Software": None})
    plt.close(figure)
    return float(np.abs(np.concatenate(deviations)).max())


def _deviation(axes: Axes, x: Floats, deviation: Floats, what: str) -> None:
    axes.axhspan(-100 * BAND, 100 * BAND, color=BLUE, alpha=0.12, lw=0)
    axes.axhline(0, color=BLUE, lw=1.2)
    axes.plot(x, 100 * deviation, "o", color=BLACK, ms=5)
    axes.set(ylim=(-3.2, 3.2), xlabel=what)
    axes.text(0.01, 0.86, "± 2 %", color=BLUE, fontsize=9, transform=axes.transAxes, va="center")
