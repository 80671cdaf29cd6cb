"""A configuration in space: room, cameras with their fields of view, and the points coloured by predicted σ."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colorbar import Colorbar
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure, SubFigure

from pss import PTZCamera
from pss.hints import Floats
from render.world.geometry import plate_corners
from render.world.state import SceneState
from validate.plots.names_beside import Name, grouped, names_beside
from validate.plots.projected import CELL_M, Eye, Patches, patches_of, room_edges, wall_patches
from validate.prediction.frusta import frustum
from validate.runs.palette import BLUE, VERMILION
from validate.sweeps.sweep import SweepResult

__all__ = [
    "COLOUR_MAP", "OTHER", "SIGNS", "VARIED", "colour_scale", "draw_configuration", "draw_state",
    "shared_colours",
]  # fmt: skip


COLOUR_MAP = "viridis_r"
"""Of σ: bright is precise; even in lightness, so that it is read without colour vision too."""
PLATE_MODULES = 8.0
# So that no camera hides before the ball.
ELEVATION_DEG, AZIMUTH_DEG = 38.0, 62.0
VARIED, OTHER, IDLE = VERMILION, BLUE, "0.55"
UNOBSERVABLE = (0.72, 0.72, 0.72, 1.0)
# Of the numbers between powers of ten those that begin so have room beside a colour scale.
LABELLED_BETWEEN_DECADES = "235"
# What is nearer is drawn over what is farther: in this order, walls, objects with markers, fields of view, signs.
WALLS, SOLIDS, FIELDS, SIGNS = 1, 2, 3, 4
# Of the drawing's size, around it, for names.
MARGIN = 0.05
SIGN_PT, NAME_PT = 3.0, 9.0
# Lines of more cameras are paler, since they lie over each other.
MANY = 8


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
    bar.ax.yaxis.set_minor_formatter(lambda x, _: f"{x:g}" if f"{x:.0e}"[0] in LABELLED_BETWEEN_DECADES else "")
    return bar


def _sigma_mm(result: SweepResult, step: int) -> Floats:
    return result.assessments[step].predicted[result.shown_model].single_frame_sigma_m * 1000


def draw_configuration(
    axes: Axes,
    result: SweepResult,
    step: int,
    norm: LogNorm,
    of_cameras: Mapping[str, str] | None = None,
    elevation_deg: float = ELEVATION_DEG,
    azimuth_deg: float = AZIMUTH_DEG,
) -> Eye:
    """Draw one step of a sweep; cameras in the colours `of_cameras`, or else those that vary in another one.

    The eye that sees the room so, for what is drawn into it afterwards.
    """
    configuration = result.configurations[step]
    scene = configuration.scene
    eye = Eye(scene.state.room, elevation_deg, azimuth_deg)
    sigma = _sigma_mm(result, step)
    colours = matplotlib.colormaps[COLOUR_MAP](norm(np.nan_to_num(sigma, nan=norm.vmax)))
    colours[~np.isfinite(sigma)] = UNOBSERVABLE
    draw_state(axes, scene.state, eye, colours)
    active = {camera.name for camera in configuration.cameras}
    first = {camera.name: camera for camera in result.configurations[0].cameras}
    names = []
    for camera in scene.cameras:
        place = eye.flat(np.array(camera.position_m))
        colour = IDLE
        if camera.name in active:
            chosen = next(c for c in configuration.cameras if c.name == camera.name)
            varied = configuration.parameter == "selection" or _differs(result, camera.name, first)
            colour = (of_cameras or {}).get(camera.name, VARIED if varied else OTHER)
            _field(axes, chosen, colour, eye, min(1.0, MANY / len(active)))
        axes.plot(*place, "o", color=colour, ms=2 * SIGN_PT, mec="white", mew=0.5, zorder=SIGNS)
        names.append(Name(camera.name, (float(place[0]), float(place[1])), colour, (0.0, 1.0)))
    names_beside(axes, grouped(names, 1e-6, "0.25"), NAME_PT, SIGN_PT)
    pss = result.assessments[step].predicted[result.shown_model].pss_single_frame
    axes.set_title(f"{configuration.label}   PSS of C = {pss:,.0f} /m", fontsize=11)
    return eye


def draw_state(axes: Axes, state: SceneState, eye: Eye, plates: Floats) -> None:
    """Draw room, objects and markers, of which the colours `plates` (N, 4) are given, in axes without ticks."""
    axes.set_axis_off()
    axes.set_aspect("equal")
    behind, before = room_edges(eye)
    _draw_patches(axes, wall_patches(eye), eye, WALLS)
    for edges, style in ((behind, {"color": "0.45", "lw": 0.8}), (before, {"color": "0.7", "lw": 0.6, "ls": ":"})):
        zorder = WALLS + 0.5 if edges is behind else FIELDS
        axes.add_collection(LineCollection([eye.flat(edge) for edge in edges], zorder=zorder, **style))
    solid = Patches.joined([patches_of(item.shape) for item in state.objects])
    _draw_patches(axes, solid, eye, SOLIDS, _seen_plates(state, eye, plates))
    low = np.min([eye.flat(edge).min(axis=0) for edge in (*behind, *before)], axis=0)
    high = np.max([eye.flat(edge).max(axis=0) for edge in (*behind, *before)], axis=0)
    margin = MARGIN * (high - low).max()
    axes.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))


def _seen_plates(state: SceneState, eye: Eye, colours: Floats) -> list[tuple[Floats, Floats]]:
    """Corners (4, 3) and colour (4,) of the markers whose front the eye sees."""
    seen = eye.faces(state.points_m, state.normals)
    return [
        (plate_corners(marker, PLATE_MODULES), colour)
        for marker, colour, shows in zip(state.markers, colours, seen, strict=True)
        if shows
    ]


def _draw_patches(
    axes: Axes, patches: Patches, eye: Eye, zorder: float, plates: Sequence[tuple[Floats, Floats]] = ()
) -> None:
    """Draw pieces of surfaces and the plates on them, the farthest first."""
    corners = [*patches.corners_m, *(plate for plate, _ in plates)]
    if not corners:
        return
    depth = np.array([eye.depth_m(each).mean() for each in corners])
    # Lines are before the surface that they bound, and plates before the one that they are fixed to.
    depth[: len(patches.edges)] -= np.where(patches.edges, CELL_M / 2, 0)
    depth[len(patches.edges) :] -= CELL_M
    faces = np.array([*(np.r_[[grey] * 3, 1.0] for grey in patches.greys), *(colour for _, colour in plates)])
    borders = faces.copy()
    borders[len(patches.edges) :, :3] = 0.3
    widths = np.r_[np.where(patches.edges, 0.6, 0.3), np.full(len(plates), 0.3)]
    order = np.argsort(-depth)
    axes.add_collection(
        PolyCollection(
            [eye.flat(corners[number]) for number in order],
            facecolors=faces[order],
            edgecolors=borders[order],
            linewidths=widths[order],
            zorder=zorder,
        )
    )


def _differs(result: SweepResult, name: str, first: dict[str, PTZCamera]) -> bool:
    last = {camera.name: camera for camera in result.configurations[-1].cameras}
    return name not in first or first[name] != last.get(name)


def _field(axes: Axes, camera: PTZCamera, colour: str, eye: Eye, strength: float) -> None:
    """Edges of the field of view up to the focus or the walls, and the part of the plane in focus inside the room."""
    shape = frustum(camera, eye.room)
    edges = [eye.flat(np.array([shape.apex, end])) for end in shape.ends]
    axes.add_collection(LineCollection(edges, color=colour, lw=0.7, alpha=0.6 * strength, zorder=FIELDS))
    if len(shape.faces):
        flat = eye.flat(shape.plane)
        axes.add_collection(
            PolyCollection(flat[shape.faces], facecolors=colour, alpha=0.07 * strength, lw=0, zorder=FIELDS)
        )
        if len(shape.plane) == 4:
            outline = PolyCollection([flat], facecolors="none", edgecolors=colour, alpha=0.6 * strength, lw=0.5)
            outline.set_zorder(FIELDS)
            axes.add_collection(outline)
