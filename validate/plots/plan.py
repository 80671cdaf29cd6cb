"""A scene as a drawing: plan and two elevations, with the cameras' fields of view and the markers by their σ."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon
from matplotlib.patches import Rectangle as Outline
from scipy.spatial import ConvexHull

from pss import Box, PTZCamera, Rectangle, Sphere
from pss.hints import Floats
from pss.surrogates import Mesh
from render.store.folder import atomic_path
from render.world.geometry import plate_corners
from render.world.state import SceneObject
from scenes.schema.dictionaries import DICTIONARIES
from validate.plots.camera_table import MOST_BESIDE, camera_colour, draw_below, draw_beside, height_below_in
from validate.plots.footprint import footprint_m
from validate.plots.glyphs import settle_words
from validate.plots.names_beside import Name, grouped, names_beside, width_of
from validate.plots.room3d import COLOUR_MAP, colour_scale
from validate.prediction.foresight import ENOUGH, Foreseen, headline
from validate.runs.palette import BLUE, LAMP, UNSEEN

__all__ = ["plan_figure", "write_plan"]


DPI = 150
WIDTH_IN, HEIGHT_IN = 12.0, 9.0
# What goes across and up a drawing: 0, 1, 2 for x, y, z.
VIEWS = {"plan": (0, 1), "front": (0, 2), "side": (1, 2)}
TITLES = {"plan": "plan", "front": "elevation over x, see-through", "side": "elevation over y, see-through"}
# Of the room's smaller side: a camera's sign; and in signs, the room around the drawing.
OFF = 0.035
MARGIN = 3.2
NAME_PT, SMALL_NAME_PT = 11.0, 8.0
# Of a sign's size: cameras nearer to each other than this share their name's place.
TOGETHER = 0.3
# Characters of a name that elevations have too.
LONGEST_TWICE = 8
FRAME_PLACES = 60
FILL, EDGE = "0.93", "0.55"
# Of a flat shape seen from its edge there is no hull; it is drawn as thick as this.
THIN_M = 1e-6


def write_plan(path: Path, seen: Foreseen) -> None:
    """Write the drawing as the kind of file that the path's ending names (.png, .pdf, .svg)."""
    figure = plan_figure(seen)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=DPI, format=path.suffix.removeprefix(".").lower())


def plan_figure(seen: Foreseen) -> Figure:
    """Plan with fields of view at the markers' height, two elevations, and a table of the cameras."""
    room = seen.scene.state.room
    more_in = height_below_in(len(seen.scene.cameras))
    whole = Figure(figsize=(WIDTH_IN, HEIGHT_IN + more_in), layout="constrained")
    figure: Figure | SubFigure = whole
    if more_in:
        figure, table = whole.subfigures(2, 1, height_ratios=[HEIGHT_IN, more_in])
        rows = table.add_subplot()
        rows.set_axis_off()
        draw_below(rows, seen)
    title = f"{seen.scene.path.name}: {headline(seen)}".replace("; ", "\n")
    figure.suptitle(title, fontsize=13, parse_math=False)
    sides = (max(room.width_m, room.length_m), room.length_m, room.height_m)
    grid = figure.add_gridspec(
        2, 2, width_ratios=[room.width_m, max(room.height_m, 0.75 * room.width_m)], height_ratios=sides[1:]
    )
    norm = _norm(seen)
    axes = {
        "plan": figure.add_subplot(grid[0, 0]),
        "front": figure.add_subplot(grid[1, 0]),
        "side": figure.add_subplot(grid[1, 1]),
    }
    for name, panel in axes.items():
        _draw(panel, seen, name, norm)
    key = figure.add_subplot(grid[0, 1])
    _key(key, seen)
    bar = colour_scale(figure, list(axes.values()), norm, shrink=0.6, aspect=35, pad=0.01)
    bar.set_label(f"predicted √λmax of C in mm ({seen.shown_model}); × : unobservable")
    bar.ax.tick_params(which="minor", labelsize=7)
    settle_words(whole)
    return whole


def _sigma_mm(seen: Foreseen) -> Floats:
    """mm, (N,), √λmax of C: with a process noise of a millimetre, σ∞ is a millimetre for all that is observable."""
    return seen.evaluations[seen.shown_model].single_frame_sigma_m * 1000


def _norm(seen: Foreseen) -> LogNorm:
    sigma = _sigma_mm(seen)
    known = sigma[np.isfinite(sigma)]
    low, high = np.percentile(known, [2, 98]) if len(known) else (1.0, 10.0)
    return LogNorm(low, max(high, low * 1.1))


def _draw(axes: Axes, seen: Foreseen, name: str, norm: LogNorm) -> None:
    state, (across, up) = seen.scene.state, VIEWS[name]
    low, high = _ends(seen)
    size = high - low
    axes.add_patch(
        Outline((low[across], low[up]), size[across], size[up], facecolor="none", edgecolor="0.2", lw=1.5, zorder=5)
    )
    if name == "plan":
        for panel in state.light.panels:
            corner = np.array(panel.centre_m) - np.array(panel.size_m) / 2
            axes.add_patch(Outline(tuple(corner), *panel.size_m, facecolor="none", edgecolor=LAMP, lw=0.8, ls=":"))
    for item in sorted(state.objects, key=lambda item: _top_m(item)):
        _object(axes, item, (across, up))
    for number, camera in enumerate(seen.scene.cameras):
        _camera(axes, seen, camera, camera_colour(number), name)
    _markers(axes, seen, (across, up), norm)
    margin = MARGIN * _unit_m(seen) * _crowd(seen) ** -0.5
    axes.set(xlim=(low[across] - margin, high[across] + margin), ylim=(low[up] - margin, high[up] + margin))
    axes.set_aspect("equal")
    for axis, side in ((axes.xaxis, across), (axes.yaxis, up)):
        places = axis.get_majorticklocs()
        axis.set_ticks(places[(places >= low[side] - THIN_M) & (places <= high[side] + THIN_M)])
    _names(axes, seen, (across, up))
    axes.set_title(TITLES[name], fontsize=10)
    axes.spines[:].set_visible(False)
    axes.set_xlabel(f"{'xyz'[across]} in m")
    axes.set_ylabel(f"{'xyz'[up]} in m")
    axes.grid(alpha=0.25, lw=0.5)
    axes.set_axisbelow(True)


def _top_m(item: SceneObject) -> float:
    return float(_corners(item)[:, 2].max())


def _corners(item: SceneObject) -> Floats:
    """Metres, (V, 3): points whose hull is the shape's outline from any side; a mesh's own."""
    shape = item.shape
    if isinstance(shape, Rectangle):
        right, up = shape.right * shape.width_m / 2, shape.up * shape.height_m / 2
        return np.array(shape.centre_m) + [-right - up, right - up, right + up, -right + up]
    if isinstance(shape, Box):
        ends = np.array([shape.lowest_m, shape.highest_m])
        return np.array([(ends[i, 0], ends[j, 1], ends[k, 2]) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
    if isinstance(shape, Sphere):
        x, y, z = shape.centre_m
        return np.array([(x, y, z - shape.radius_m), (x, y, z + shape.radius_m)])
    return np.asarray(shape.vertices_m)


def _object(axes: Axes, item: SceneObject, plane: tuple[int, int]) -> None:
    shape = item.shape
    if isinstance(shape, Sphere):
        centre = np.array(shape.centre_m)[list(plane)]
        axes.add_patch(Circle(tuple(centre), shape.radius_m, facecolor=FILL, edgecolor=EDGE, lw=0.8, zorder=2))
        return
    flat = _corners(item)[:, plane]
    if isinstance(shape, Mesh):
        axes.add_collection(
            PolyCollection(shape.corners_m[:, :, plane], facecolors="0.86", edgecolors="none", zorder=2)
        )
        return
    # A board from its edge is a line.
    if np.linalg.matrix_rank(flat - flat[0], tol=THIN_M) < 2:
        axes.plot(*flat.T, color=EDGE, lw=2, zorder=2)
        return
    axes.add_patch(Polygon(flat[ConvexHull(flat).vertices], facecolor=FILL, edgecolor=EDGE, lw=0.8, zorder=2))


def _camera(axes: Axes, seen: Foreseen, camera: PTZCamera, colour: str, name: str) -> None:
    room, plane = seen.scene.state.room, list(VIEWS[name])
    position = np.array(camera.position_m)
    ahead, pale = camera.rotation[2], _crowd(seen)
    if name == "plan":
        height = float(np.median(seen.scene.state.points_m[:, 2]))
        field = footprint_m(camera, room, height)
        if len(field):
            axes.add_patch(Polygon(field, facecolor=colour, alpha=0.07 * pale, edgecolor="none", zorder=1))
            axes.add_patch(Polygon(field, facecolor="none", edgecolor=colour, alpha=0.7 * pale, lw=0.9, zorder=3))
    focus = position + ahead * camera.focus_distance_m
    line = {"color": colour, "alpha": pale**0.5, "zorder": 4}
    axes.plot(*np.array([position, focus])[:, plane].T, lw=0.9, ls=(0, (4, 3)), **line)
    axes.plot(*focus[plane], marker="|" if name == "plan" else "x", ms=5, **line)
    # The tip of the symbol points where the camera looks.
    forward = _forward(camera, plane)
    unit, here = _unit_m(seen), position[plane]
    side = np.array([-forward[1], forward[0]])
    body = [here + unit * forward, here - 0.6 * unit * forward + 0.7 * unit * side]
    body.append(here - 0.6 * unit * forward - 0.7 * unit * side)
    axes.add_patch(Polygon(body, facecolor=colour, edgecolor="white", lw=0.6, zorder=7))


def _unit_m(seen: Foreseen) -> float:
    """Metres, by which the symbols are measured."""
    room = seen.scene.state.room
    return OFF * min(room.width_m, room.length_m, 2 * room.height_m) * _crowd(seen) ** 0.5


def _crowd(seen: Foreseen) -> float:
    """From 1, of few cameras, towards 0: signs of more are smaller and their fields of view paler."""
    return min(1.0, MOST_BESIDE / len(seen.scene.cameras))


def _forward(camera: PTZCamera, plane: list[int]) -> Floats:
    """Unit vector in the drawing, (2,); downwards for a camera that looks straight at the reader, or away."""
    flat = camera.rotation[2][plane]
    length = float(np.linalg.norm(flat))
    return np.asarray(flat / length) if length > THIN_M else np.array([0.0, -1.0])


def _names(axes: Axes, seen: Foreseen, plane: tuple[int, int]) -> None:
    """The cameras' names, best behind them; those that lie behind each other share a place.

    Of many cameras, or long names, the plan alone has them: in the elevations they would cover the markers.
    """
    if _named_once(seen) and plane != VIEWS["plan"]:
        return
    names = []
    for number, camera in enumerate(seen.scene.cameras):
        place, forward = np.array(camera.position_m)[list(plane)], _forward(camera, list(plane))
        behind = (-float(forward[0]), -float(forward[1]))
        names.append(Name(camera.name, (float(place[0]), float(place[1])), camera_colour(number), behind))
    size_pt = NAME_PT if len(names) <= MOST_BESIDE else SMALL_NAME_PT
    under = np.concatenate([_frame(seen, plane), seen.scene.state.points_m[:, plane]])
    names_beside(axes, grouped(names, TOGETHER * _unit_m(seen), "0.25"), size_pt, 1.0, under, 0.8 * _unit_m(seen))


def _named_once(seen: Foreseen) -> bool:
    cameras = seen.scene.cameras
    return len(cameras) > MOST_BESIDE or max(width_of(camera.name) for camera in cameras) > LONGEST_TWICE


def _frame(seen: Foreseen, plane: tuple[int, int]) -> Floats:
    """Places along the walls, (M, 2), as close as letters are large."""
    low, high = _ends(seen)
    (left, bottom), (right, top) = low[list(plane)], high[list(plane)]
    along = np.arange(0, 1, 1 / FRAME_PLACES)
    x, y = left + along * (right - left), bottom + along * (top - bottom)
    sides = [(x, bottom + 0 * x), (x, top + 0 * x), (left + 0 * y, y), (right + 0 * y, y)]
    return np.concatenate([np.column_stack(side) for side in sides])


def _ends(seen: Foreseen) -> tuple[Floats, Floats]:
    room = seen.scene.state.room
    half = np.array([room.width_m / 2, room.length_m / 2])
    return np.array([*-half, 0.0]), np.array([*half, room.height_m])


def _markers(axes: Axes, seen: Foreseen, plane: tuple[int, int], norm: LogNorm) -> None:
    state = seen.scene.state
    modules = DICTIONARIES[state.print.dictionary].modules + 2 * state.print.quiet_zone_modules
    sigma = _sigma_mm(seen)
    colours = matplotlib.colormaps[COLOUR_MAP](norm(np.nan_to_num(sigma, nan=norm.vmax)))
    lost = ~np.isfinite(sigma)
    colours[lost] = (1, 1, 1, 1)
    plates = np.array([plate_corners(marker, modules) for marker in state.markers])[:, :, plane]
    # Nearer objects are drawn over what they hide.
    away = next(axis for axis in range(3) if axis not in plane)
    order = np.argsort(state.points_m[:, away])
    for chosen, level in ((order[lost[order]], 5.5), (order[~lost[order]], 6)):
        axes.add_collection(
            PolyCollection(plates[chosen], facecolors=colours[chosen], edgecolors="0.25", linewidths=0.4, zorder=level)
        )
    # Under the plates that are resolved: of a board from its edge, or a person, they cover each other.
    axes.plot(*state.points_m[lost][:, plane].T, "x", color=UNSEEN, ms=4.5, mew=1.1, zorder=5.8)


def _key(axes: Axes, seen: Foreseen) -> None:
    """What the signs mean, under the table of the cameras if it is here."""
    axes.set_axis_off()
    beside = len(seen.scene.cameras) <= MOST_BESIDE
    below = draw_beside(axes, seen) if beside else 1.0
    handles = [
        Line2D(
            [], [], marker="x", color=UNSEEN, ls="", ms=6, mew=1.5, label=f"marker that fewer than {ENOUGH} cameras see"
        ),
        Patch(facecolor=matplotlib.colormaps[COLOUR_MAP](0.3), edgecolor="0.25", label="marker, coloured by its σ"),
        Line2D([], [], color="0.3", ls=(0, (4, 3)), lw=0.9, label="axis of a camera, up to its focus"),
        Patch(facecolor=(0, 0.45, 0.7, 0.1), edgecolor=BLUE, label="field of view at the markers' median height"),
    ]
    if _named_once(seen):
        handles.append(Line2D([], [], ls="", label="names: in the plan, where there is room, and the table"))
    axes.legend(handles=handles, loc="upper right", bbox_to_anchor=(1, below), fontsize=9, frameon=False)
