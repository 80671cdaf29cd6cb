"""A scene as a drawing: plan and two elevations, with the cameras' fields of view and the markers by their σ."""

from __future__ import annotations

from pathlib import Path

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon
from matplotlib.patches import Rectangle as Outline
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from pss import Box, PTZCamera, Rectangle, Sphere
from pss.surrogates import Mesh
from render.geometry import plate_corners
from render.state import SceneObject
from scenes.dictionaries import DICTIONARIES
from validate.check.foreseen import ENOUGH, Foreseen, headline
from validate.figures import MODEL_COLOURS
from validate.hallway.wedge import footprint_m
from validate.illustration import COLOUR_MAP, colour_scale
from validate.store import atomic_path

__all__ = ["plan_figure", "write_plan"]

Floats = NDArray[np.float64]

DPI = 150
WIDTH_IN = 12.0
# What goes across and up a drawing: 0, 1, 2 for x, y, z.
VIEWS = {"plan": (0, 1), "front": (0, 2), "side": (1, 2)}
TITLES = {"plan": "plan", "front": "elevation over x, see-through", "side": "elevation over y, see-through"}
# Of the room's smaller side: how far a camera's number stands off.
OFF = 0.035
UNSEEN = "#D00000"
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
    figure = Figure(figsize=(WIDTH_IN, 9.0), layout="constrained")
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
    return figure


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
    room = state.room
    low = np.array([-room.width_m / 2, -room.length_m / 2, 0.0])
    high = np.array([room.width_m / 2, room.length_m / 2, room.height_m])
    size = high - low
    axes.add_patch(
        Outline((low[across], low[up]), size[across], size[up], facecolor="none", edgecolor="0.2", lw=1.5, zorder=5)
    )
    if name == "plan":
        for panel in state.light.panels:
            corner = np.array(panel.centre_m) - np.array(panel.size_m) / 2
            axes.add_patch(Outline(tuple(corner), *panel.size_m, facecolor="none", edgecolor="#c9a400", lw=0.8, ls=":"))
    for item in sorted(state.objects, key=lambda item: _top_m(item)):
        _object(axes, item, (across, up))
    for number, camera in enumerate(seen.scene.cameras):
        _camera(axes, seen, camera, _colour(number), name)
    _markers(axes, seen, (across, up), norm)
    margin = 2.6 * _unit_m(seen)
    axes.set(xlim=(low[across] - margin, high[across] + margin), ylim=(low[up] - margin, high[up] + margin))
    axes.set_aspect("equal")
    _numbers(axes, seen, (across, up))
    axes.set_title(TITLES[name], fontsize=10)
    axes.spines[:].set_visible(False)
    axes.set_xlabel(f"{'xyz'[across]} in m")
    axes.set_ylabel(f"{'xyz'[up]} in m")
    axes.grid(alpha=0.25, lw=0.5)
    axes.set_axisbelow(True)


def _colour(number: int) -> str:
    return MODEL_COLOURS[number % len(MODEL_COLOURS)]


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
    ahead = camera.rotation[2]
    if name == "plan":
        height = float(np.median(seen.scene.state.points_m[:, 2]))
        field = footprint_m(camera, room, height)
        if len(field):
            axes.add_patch(Polygon(field, facecolor=colour, alpha=0.07, edgecolor="none", zorder=1))
            axes.add_patch(Polygon(field, facecolor="none", edgecolor=colour, alpha=0.7, lw=0.9, zorder=3))
    focus = position + ahead * camera.focus_distance_m
    axes.plot(*np.array([position, focus])[:, plane].T, color=colour, lw=0.9, ls=(0, (4, 3)), zorder=4)
    axes.plot(*focus[plane], marker="|" if name == "plan" else "x", color=colour, ms=5, zorder=4)
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
    return OFF * min(room.width_m, room.length_m, 2 * room.height_m)


def _forward(camera: PTZCamera, plane: list[int]) -> Floats:
    """Unit vector in the drawing, (2,); downwards for a camera that looks straight at the reader, or away."""
    flat = camera.rotation[2][plane]
    length = float(np.linalg.norm(flat))
    return np.asarray(flat / length) if length > THIN_M else np.array([0.0, -1.0])


def _numbers(axes: Axes, seen: Foreseen, plane: tuple[int, int]) -> None:
    """The cameras' names behind them; those that lie behind each other share a place."""
    places: dict[tuple[float, ...], list[int]] = {}
    for number, camera in enumerate(seen.scene.cameras):
        places.setdefault(tuple(np.round(np.array(camera.position_m)[list(plane)], 2)), []).append(number)
    for place, numbers in places.items():
        forward = np.mean([_forward(seen.scene.cameras[number], list(plane)) for number in numbers], axis=0)
        x, y = np.array(place) - 1.75 * _unit_m(seen) * forward
        names = ", ".join(seen.scene.cameras[number].name for number in numbers)
        stroke = [withStroke(linewidth=2.5, foreground="white")]
        colour = _colour(numbers[0]) if len(numbers) == 1 else "0.25"
        said = {"color": colour, "weight": "bold", "ha": "center", "va": "center"}
        axes.text(x, y, names, fontsize=11, clip_on=False, zorder=8, path_effects=stroke, **said)


def _markers(axes: Axes, seen: Foreseen, plane: tuple[int, int], norm: LogNorm) -> None:
    state = seen.scene.state
    modules = DICTIONARIES[state.print.dictionary].modules + 2 * state.print.quiet_zone_modules
    sigma = _sigma_mm(seen)
    colours = matplotlib.colormaps[COLOUR_MAP](norm(np.nan_to_num(sigma, nan=norm.vmax)))
    lost = ~np.isfinite(sigma)
    colours[lost] = (1, 1, 1, 1)
    plates = np.array([plate_corners(marker, modules) for marker in state.markers])[:, :, plane]
    # What one looks at from here lies over what it hides.
    away = next(axis for axis in range(3) if axis not in plane)
    order = np.argsort(state.points_m[:, away])
    for chosen, level in ((order[lost[order]], 5.5), (order[~lost[order]], 6)):
        axes.add_collection(
            PolyCollection(plates[chosen], facecolors=colours[chosen], edgecolors="0.25", linewidths=0.4, zorder=level)
        )
    # Under the plates that are resolved: of a board from its edge, or a person, they cover each other.
    axes.plot(*state.points_m[lost][:, plane].T, "x", color=UNSEEN, ms=4.5, mew=1.1, zorder=5.8)


def _key(axes: Axes, seen: Foreseen) -> None:
    """A line for each camera, and what the signs mean."""
    axes.set_axis_off()
    head = ("camera", "view", "focus", "sees", "finds", "module", "blur")
    unit = ("", "deg", "m", "markers", "most likely", "px", "px")
    rows = [head, unit]
    for number, camera in enumerate(seen.scene.cameras):
        of = seen.visible[number]
        middle = [
            f"{np.median(values[number][of]):.1f}" if of.any() else "–" for values in (seen.module_px, seen.blur_px)
        ]
        rows.append(
            (
                camera.name, f"{camera.horizontal_fov_deg:.0f}", f"{camera.focus_distance_m:g}",
                f"{of.sum()}", f"{seen.legible[number].sum()}", *middle,
            )
        )  # fmt: skip
    right = np.array([0.16, 0.27, 0.40, 0.55, 0.72, 0.87, 1.0])
    step = min(0.055, 0.72 / len(rows))
    for line, row in enumerate(rows):
        for column, (x, word) in enumerate(zip(right, row, strict=True)):
            style = {"color": "0.45", "fontsize": 8} if line < 2 else {"fontsize": 10}
            if line >= 2 and column == 0:
                style |= {"color": _colour(line - 2), "weight": "bold"}
            axes.text(x, 1 - step * line, word, ha="right", va="top", transform=axes.transAxes, **style)
    handles = [
        Line2D(
            [], [], marker="x", color=UNSEEN, ls="", ms=6, mew=1.5, label=f"marker that fewer than {ENOUGH} cameras see"
        ),
        Patch(facecolor=matplotlib.colormaps[COLOUR_MAP](0.3), edgecolor="0.25", label="marker, coloured by its σ"),
        Line2D([], [], color="0.3", ls=(0, (4, 3)), lw=0.9, label="axis of a camera, up to its focus"),
        Patch(facecolor=(0, 0.45, 0.7, 0.1), edgecolor="#0072B2", label="field of view at the markers' median height"),
    ]
    below = 1 - step * (len(rows) + 0.5)
    axes.legend(handles=handles, loc="upper right", bbox_to_anchor=(1, below), fontsize=9, frameon=False)
