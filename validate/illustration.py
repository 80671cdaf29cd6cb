"""A configuration in space: room, cameras with their fields of view, and the points coloured by predicted σ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure, SubFigure
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from numpy.typing import NDArray

from pss import PTZCamera, Rectangle, Sphere
from pss.surrogates import Mesh
from render.geometry import plate_corners
from render.state import Room
from scenes import Scene
from validate.sweep import SweepResult

__all__ = ["COLOUR_MAP", "colour_scale", "draw_configuration", "shared_colours"]

Floats = NDArray[np.float64]

COLOUR_MAP = "viridis_r"
"""Of σ: bright is precise; even in lightness, so that it is read without colour vision too."""
PLATE_MODULES = 8.0
# Of a finer mesh every so many faces are drawn.
MOST_FACES_DRAWN = 2000
# So that no camera hides before the ball.
ELEVATION_DEG, AZIMUTH_DEG, CLOSER = 38.0, 62.0, 1.3
VARIED, OTHER, IDLE = "#D55E00", "#0072B2", "0.7"
# Of the numbers between powers of ten those that begin so have room beside a colour scale.
SAID_BETWEEN_DECADES = "235"


def shared_colours(result: SweepResult, steps: Sequence[int]) -> LogNorm:
    """One colour scale, in mm, for several steps of a sweep."""
    sigma = np.concatenate([_sigma_mm(result, step) for step in steps])
    known = sigma[np.isfinite(sigma)]
    low, high = (np.percentile(known, [2, 98])) if len(known) else (1.0, 10.0)
    return LogNorm(low, max(high, low * 1.01))


def colour_scale(figure: Figure | SubFigure, above: Sequence[Axes], norm: LogNorm, **layout: float) -> Colorbar:
    """The scale of the markers' colours beside the axes that show them; `layout` as of `Figure.colorbar`."""
    bar = figure.colorbar(ScalarMappable(norm, COLOUR_MAP), ax=list(above), **layout)
    bar.ax.yaxis.set_major_formatter("{x:g}")
    bar.ax.yaxis.set_minor_formatter(lambda x, _: f"{x:g}" if f"{x:.0e}"[0] in SAID_BETWEEN_DECADES else "")
    return bar


def _sigma_mm(result: SweepResult, step: int) -> Floats:
    return result.assessments[step].predicted[result.noise_models[-1]].single_frame_sigma_m * 1000


def draw_configuration(
    axes: Axes3D, result: SweepResult, step: int, norm: LogNorm, of_cameras: Mapping[str, str] | None = None
) -> None:
    """Draw one step of a sweep; cameras in the colours `of_cameras`, or else those that vary in another one."""
    import matplotlib

    configuration = result.configurations[step]
    scene = configuration.scene
    room = scene.state.room
    sigma = _sigma_mm(result, step)
    colours = matplotlib.colormaps[COLOUR_MAP](norm(np.nan_to_num(sigma, nan=norm.vmax)))
    colours[~np.isfinite(sigma)] = (0.72, 0.72, 0.72, 1)
    _objects(axes, scene)
    plates = [plate_corners(marker, PLATE_MODULES) for marker in scene.state.markers]
    axes.add_collection3d(Poly3DCollection(plates, facecolors=colours, edgecolors="0.3", linewidths=0.3))
    active = {camera.name for camera in configuration.cameras}
    first = {camera.name: camera for camera in result.configurations[0].cameras}
    for camera in scene.cameras:
        if camera.name in active:
            chosen = next(c for c in configuration.cameras if c.name == camera.name)
            varied = configuration.parameter == "selection" or _differs(result, camera.name, first)
            _camera(axes, chosen, (of_cameras or {}).get(camera.name, VARIED if varied else OTHER), room)
        else:
            axes.scatter(*camera.position_m, color=IDLE, s=12)
            axes.text(*camera.position_m, f" {camera.name}", color=IDLE, fontsize=8)
    x, y, z = room.width_m / 2, room.length_m / 2, room.height_m
    axes.set(xlim=(-x, x), ylim=(-y, y), zlim=(0, z))
    axes.set_box_aspect((room.width_m, room.length_m, room.height_m), zoom=CLOSER)
    axes.view_init(elev=ELEVATION_DEG, azim=AZIMUTH_DEG)
    axes.set_xticks([]), axes.set_yticks([]), axes.set_zticks([])
    pss = result.assessments[step].predicted[result.noise_models[-1]].pss_single_frame
    for item in (*axes.lines, *axes.collections):  # the room is larger than its axes
        item.set_clip_on(False)
        item.set_in_layout(False)
    axes.set_title(f"{configuration.label}   PSS of C = {pss:,.0f} /m", fontsize=11)


def _differs(result: SweepResult, name: str, first: dict[str, PTZCamera]) -> bool:
    last = {camera.name: camera for camera in result.configurations[-1].cameras}
    return name not in first or first[name] != last.get(name)


def _objects(axes: Axes3D, scene: Scene) -> None:
    for item in scene.state.objects:
        shape = item.shape
        if isinstance(shape, Rectangle):
            right, up = shape.right * shape.width_m / 2, shape.up * shape.height_m / 2
            centre = np.array(shape.centre_m)
            corners = [centre - right - up, centre + right - up, centre + right + up, centre - right + up]
            axes.add_collection3d(Poly3DCollection([corners], facecolors="0.93", edgecolors="0.6", linewidths=0.6))
        elif isinstance(shape, Mesh):
            faces = shape.corners_m[:: -(-len(shape.faces) // MOST_FACES_DRAWN)]
            axes.add_collection3d(Poly3DCollection(faces, facecolors="0.93", edgecolors="0.6", linewidths=0.2))
        elif isinstance(shape, Sphere):
            u, v = np.mgrid[0 : 2 * np.pi : 25j, 0 : np.pi : 13j]
            x, y, z = shape.centre_m
            r = shape.radius_m * 0.985
            axes.plot_surface(
                x + r * np.cos(u) * np.sin(v),
                y + r * np.sin(u) * np.sin(v),
                z + r * np.cos(v),
                color="0.9",
                lw=0,
                shade=True,
            )


def _camera(axes: Axes3D, camera: PTZCamera, colour: str, room: Room) -> None:
    """Position, number, edges of the field of view up to the focus or the walls, and the plane in focus if inside."""
    position = np.array(camera.position_m)
    width, height = camera.resolution
    half = np.array([width, height]) / 2 / camera.focal_px * camera.focus_distance_m
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    local = np.column_stack([corners, np.full(4, camera.focus_distance_m)])
    rays = local @ camera.rotation
    walls = np.array([[-room.width_m / 2, -room.length_m / 2, 0], [room.width_m / 2, room.length_m / 2, room.height_m]])
    with np.errstate(divide="ignore"):
        exits = ((np.where(rays > 0, walls[1], walls[0]) - position) / rays).min(axis=1)
    for ray, end in zip(rays, np.minimum(exits, 1.0), strict=True):
        axes.plot(*np.column_stack([position, position + end * ray]), color=colour, lw=0.5, alpha=0.55)
    if (exits >= 1).all():
        plane = Poly3DCollection([position + rays], facecolors=colour, alpha=0.06, edgecolors=colour, linewidths=0.4)
        axes.add_collection3d(plane)
    axes.scatter(*position, color=colour, s=26, depthshade=False)
    axes.text(*(position + (0, 0, 0.12)), camera.name, color=colour, fontsize=9, weight="bold")
