"""Draw docs/figures/first-screen.png, the picture at the top of the README: `make first-screen`.

On the left the room as Mitsuba renders it without its ceiling and two of its walls (the light is that of the closed
room), each marker in the colour of its predicted error and the cameras drawn in; on the right the zoom sweep's PSS,
predicted and measured. What the store lacks is made.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray
from rich.console import Console

import scenes
from pss import PTZCamera
from render import backend
from render.lens.sampling import Sampling
from render.light.lit_scene import GlowMeshes
from render.renderer import RenderedView, Renderer
from render.store.folder import atomic_path
from render.store.light import baked
from render.store.remote import open_store
from render.world.state import Room
from scenes import load_sweep
from validate.acquire.acquire import acquire
from validate.plots.room3d import COLOUR_MAP, OTHER, VARIED, colour_scale, shared_colours
from validate.plots.sweep import draw_curves
from validate.prediction.frusta import frustum
from validate.runs.progress import ViewProgress
from validate.sweeps.sweep import SweepResult, assess_sweep, plan

Floats = NDArray[np.float64]

PICTURE = Path(__file__).resolve().parent / "figures" / "first-screen.png"
SWEEP, SHOWN = "zoom", "zoom=2.5"
# From above a corner, so that board, ball and all seven cameras are in the picture.
EYE_M, AIM_M, ZOOM, SIZE_PX = (4.4, 8.2, 6.6), (-0.5, 0.0, 0.95), 2.0, (1500, 1080)
# What hangs so close under the ceiling goes with it.
CEILING_M = 0.1
# A pinhole, nearly: all of the room is sharp.
F_NUMBER = 16.0
WHITE_PERCENTILE, GAMMA = 99.0, 2.2
# What is black on a marker keeps this share of its colour, so that the colour can be read from afar.
DARKEST = 0.35
UNOBSERVABLE = (0.62, 0.62, 0.62)
DPI = 130


def made_sweep() -> tuple[SweepResult, RenderedView]:
    """The sweep's result, and its room from `EYE_M`."""
    store, chosen = open_store("results/store"), backend.choose(None)
    sweep = load_sweep(SWEEP)
    scene = scenes.load(sweep.scene_path)
    planned = plan(sweep, scene, chosen.identity, Sampling(noise_ratio=sweep.render_noise_ratio))
    wanted = [item for views in planned.views for item in views]
    acquired = acquire(wanted, store, chosen, lambda total: ViewProgress(total, Console(stderr=True)))
    renderer = Renderer(scene.state, opened(baked(scene.state, store, chosen), scene.state.room), chosen)
    eye = PTZCamera(EYE_M, 0.0, 0.0, ZOOM, f_number=F_NUMBER, resolution=SIZE_PX).aimed_at(AIM_M)
    return assess_sweep(planned, acquired), renderer.render(renderer.request(eye, scene.sensor, Sampling()))


def opened(meshes: GlowMeshes, room: Room) -> GlowMeshes:
    """The lit room without ceiling, lamps, and the two walls that are before `EYE_M`."""
    corners = meshes.vertices_m[meshes.faces]
    gone = (corners[..., 2] > room.height_m - CEILING_M).all(axis=1)
    for axis, side_m in ((0, room.width_m), (1, room.length_m)):
        gone |= np.isclose(corners[..., axis], side_m / 2).all(axis=1)
    return replace(meshes, faces=meshes.faces[~gone])


def coloured(view: RenderedView, marker_ids: Floats, sigma_mm: Floats, norm: LogNorm) -> Floats:
    """The rendered picture, (height, width, 3) from 0 to 1; what is white on a marker has the colour of its σ."""
    inside = np.isfinite(view.depth_m)
    light = np.clip(view.radiance / np.percentile(view.radiance[inside], WHITE_PERCENTILE), 0, 1) ** (1 / GAMMA)
    light[~inside] = 1
    picture = np.repeat(light[..., None], 3, axis=2).astype(np.float64)
    for number, sigma in zip(marker_ids, sigma_mm, strict=True):
        seen = view.marker_id == number
        if not seen.any():
            continue
        colour = matplotlib.colormaps[COLOUR_MAP](norm(sigma))[:3] if np.isfinite(sigma) else UNOBSERVABLE
        share = np.clip(light[seen] / np.percentile(light[seen], 95), 0, 1)
        picture[seen] = (DARKEST + (1 - DARKEST) * share)[:, None] * np.array(colour)
    return picture


def draw_room(axes: Axes, result: SweepResult, view: RenderedView, norm: LogNorm) -> None:
    """The room with colours and cameras."""
    step = [configuration.label for configuration in result.configurations].index(SHOWN)
    configuration = result.configurations[step]
    state = configuration.scene.state
    sigma_mm = result.assessments[step].predicted[result.shown_model].single_frame_sigma_m * 1000
    axes.imshow(coloured(view, np.array([marker.id for marker in state.markers]), sigma_mm, norm))
    first = {camera.name: camera for camera in result.configurations[0].cameras}
    halo = [withStroke(linewidth=2.5, foreground="white")]
    for camera in configuration.cameras:
        colour = VARIED if camera != first[camera.name] else OTHER
        shape = frustum(camera, state.room)
        for end, next_end in zip(shape.ends, np.roll(shape.ends, 1, axis=0), strict=True):
            for start, width in ((shape.apex, 0.9), (next_end, 0.5)):
                axes.plot(*segment_px(view.camera, start, end).T, color=colour, lw=width, alpha=0.7)
        (pixel,), (depth,) = view.camera.project([camera.position_m])
        if depth > 0:
            axes.plot(*pixel, "o", color=colour, ms=7, mec="white")
            axes.annotate(
                camera.name, pixel, (7, 3), textcoords="offset points", color=colour, weight="bold", path_effects=halo
            )
    axes.set(xlim=(0, SIZE_PX[0]), ylim=(SIZE_PX[1], 0))
    axes.set_axis_off()


def segment_px(camera: PTZCamera, start_m: Floats, end_m: Floats) -> Floats:
    """(2, 2), what of a line in space lies before the camera, in pixels."""
    points = start_m + np.linspace(0, 1, 200)[:, None] * (end_m - start_m)
    pixels, depth_m = camera.project(points)
    before = pixels[depth_m > 0.05]
    return before[[0, -1]] if len(before) else np.full((2, 2), np.nan)


def first_screen(result: SweepResult, view: RenderedView) -> Figure:
    """Room and curve beside each other."""
    figure, (room, curve) = plt.subplots(
        1, 2, figsize=(14, 5.6), width_ratios=[1.75, 1], layout="constrained", gridspec_kw={"wspace": 0.03}
    )
    norm = shared_colours(result, range(len(result.configurations)))
    draw_room(room, result, view, norm)
    room.set_title(f"The room at {SHOWN.replace('=', ' ×')}: markers by predicted error, cameras 2, 4 and 6 zoom")
    bar = colour_scale(figure, [room], norm, shrink=0.85, pad=0.01, aspect=30)
    bar.set_label("predicted √λmax of C in mm; grey: unobservable")
    draw_curves(curve, result, single_frame=True)
    curve.set_title("PSS over zoom, predicted and measured", fontsize=12)
    return figure


if __name__ == "__main__":
    figure = first_screen(*made_sweep())
    with atomic_path(PICTURE) as temporary:
        figure.savefig(temporary, dpi=DPI, format="png")
