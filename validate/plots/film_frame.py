"""One picture of a run of the hallway: what each camera sees, beside the hallway from above."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import cv2
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, Polygon
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from pss import PTZCamera, RangeError, ShapeError
from pss.hints import Floats, Pixels
from render.world.state import Room
from validate.plots.footprint import footprint_m, wedge_m
from validate.plots.glyphs import settle_words
from validate.runs.palette import CATEGORIES, FOUND, MEASURED

__all__ = ["PICTURE_PX", "FilmFrame", "draw_frame"]


PICTURE_PX = (1280, 720)
"""Width and height of a picture."""
# As for the contact sheets: an image that is linear in light looks black on a screen.
GAMMA = 2.2
# Stands out from grey images, and is no avatar's colour.
DPI = 100
# The picture's parts, in pixels: the line at the top, a caption over each view, and the plan at the right.
MARGIN_PX, GAP_PX, HEADER_PX, CAPTION_PX = 16, 12, 44, 24
VIEWS_PX, PLAN_PX = (828, 668), (396, 618)
# A person's disc in the plan, and the tip of the arrow of its heading.
DISC_M, ARROW_M = 0.25, 0.52
# Light enough that the wedges of all cameras can lie over each other; what the whole image shows has an outline.
WEDGE_ALPHA, IMAGE_ALPHA = 0.09, 0.10


@dataclass(frozen=True, eq=False)
class FilmFrame:
    """What one picture shows.

    Attributes:
        step: number of the step, from 0.
        time_s: s, since the walk began.
        cameras: the C cameras with their settings.
        assignments: the name of the avatar that each camera follows, C.
        images: what each camera sees, C arrays (H, W), in the camera's resolution or smaller: floats from 0 to 1 that
            are linear in light (brightened by a gamma of 2.2), or uint8 as it is to be shown.
        detections_px: px of the camera's resolution, the markers found in each image, C arrays (M, 2).
        avatars: m, where each avatar's middle is, by name, (3,) each.
        headings_deg: degrees, where each walks, as a camera pans.
        expected_m: m, where a tracker expects each, (3,); an avatar may be left out.

    Raises:
        ShapeError: not as many assignments, images or detections as cameras, or arrays of other shapes.
        RangeError: an image that is neither floats nor uint8; an avatar without a heading, or one that is not there.
    """

    step: int
    time_s: float
    cameras: tuple[PTZCamera, ...]
    assignments: tuple[str, ...]
    images: tuple[NDArray[np.generic], ...]
    detections_px: tuple[Floats, ...]
    avatars: Mapping[str, Floats]
    headings_deg: Mapping[str, float]
    expected_m: Mapping[str, Floats]

    def __post_init__(self) -> None:
        for name in ("assignments", "images", "detections_px"):
            if len(getattr(self, name)) != len(self.cameras):
                raise ShapeError(f"{name} has {len(getattr(self, name))}; allowed: {len(self.cameras)}, as the cameras")
        for image in self.images:
            if np.ndim(image) != 2:
                raise ShapeError(f"an image has shape {np.shape(image)}; allowed is (H, W)")
            if image.dtype != np.uint8 and not np.issubdtype(image.dtype, np.floating):
                raise RangeError(f"an image is of {image.dtype}; allowed: floats from 0 to 1, or uint8")
        for pixels in self.detections_px:
            if np.ndim(pixels) != 2 or np.shape(pixels)[1] != 2:
                raise ShapeError(f"detections_px has an array of shape {np.shape(pixels)}; allowed is (M, 2)")
        for place in (*self.avatars.values(), *self.expected_m.values()):
            if np.shape(place) != (3,):
                raise ShapeError(f"an avatar's position has shape {np.shape(place)}; allowed is (3,)")
        for name in (*self.assignments, *self.headings_deg, *self.expected_m):
            if name not in self.avatars:
                raise RangeError(f"there is no avatar {name!r}; allowed: {', '.join(self.avatars)}")
        if missing := set(self.avatars) - set(self.headings_deg):
            raise RangeError(f"headings_deg lacks {sorted(missing)}; allowed: one for each avatar")


def draw_frame(frame: FilmFrame, room: Room, strategy: str, walked_m: Mapping[str, Floats] | None = None) -> Pixels:
    """The picture of a frame, RGB, (height, width, 3) of `PICTURE_PX`.

    Views lie as their cameras do in the plan: those at greater y above, from left to right by x. The plan has, in the
    colour of the avatar that the camera follows, what its view shows at the height of that avatar's middle.

    Args:
        strategy: its name, for the line at the top.
        walked_m: m, where each avatar's middle was so far, by name, (P, 3) each; None for nothing.
    """
    colours = {name: CATEGORIES[k % len(CATEGORIES)] for k, name in enumerate(frame.avatars)}
    width, height = PICTURE_PX
    figure = Figure(figsize=(width / DPI, height / DPI), dpi=DPI, facecolor="white")
    canvas = FigureCanvasAgg(figure)
    baseline = 1 - 0.55 * HEADER_PX / height
    style = {"va": "center", "fontsize": 15, "color": MEASURED}
    figure.text(MARGIN_PX / width, baseline, f"strategy: {strategy}", weight="bold", **style)
    right = 1 - MARGIN_PX / width
    figure.text(right, baseline, f"t = {frame.time_s:.2f} s    step {frame.step}", ha="right", **style)
    _draw_views(figure, frame, colours)
    left = width - MARGIN_PX - PLAN_PX[0]
    _draw_plan(_axes(figure, left, HEADER_PX, *PLAN_PX), frame, room, colours, walked_m or {})
    _draw_legend(_axes(figure, left, HEADER_PX + PLAN_PX[1], PLAN_PX[0], VIEWS_PX[1] - PLAN_PX[1]))
    settle_words(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _axes(figure: Figure, left_px: float, top_px: float, width_px: float, height_px: float) -> Axes:
    """Axes without ticks at a place that is counted from the picture's top left corner."""
    width, height = PICTURE_PX
    axes = figure.add_axes((left_px / width, 1 - (top_px + height_px) / height, width_px / width, height_px / height))
    axes.set(xticks=[], yticks=[])
    return axes


# ---- the views -------------------------------------------------------------------------------------------------------


def _draw_views(figure: Figure, frame: FilmFrame, colours: Mapping[str, str]) -> None:
    """All views, in rows from the far end of the hallway to the near one."""
    count = len(frame.cameras)
    columns = math.ceil(math.sqrt(count))
    rows = math.ceil(count / columns)
    cell_width, cell_height = (VIEWS_PX[0] - (columns - 1) * GAP_PX) // columns, VIEWS_PX[1] // rows
    by_row = sorted(range(count), key=lambda index: -frame.cameras[index].position_m[1])
    for row in range(rows):
        indices = by_row[row * columns : (row + 1) * columns]
        for column, index in enumerate(sorted(indices, key=lambda index: frame.cameras[index].position_m[0])):
            left, top = MARGIN_PX + column * (cell_width + GAP_PX), HEADER_PX + row * cell_height
            pixels = frame.cameras[index].resolution
            scale = min(cell_width / pixels[0], (cell_height - CAPTION_PX) / pixels[1])
            size = max(round(pixels[0] * scale), 1), max(round(pixels[1] * scale), 1)
            _draw_view(_axes(figure, left, top + CAPTION_PX, *size), frame, index, size, colours)


def _draw_view(axes: Axes, frame: FilmFrame, index: int, size_px: tuple[int, int], colours: Mapping[str, str]) -> None:
    """One view in axes of `size_px`, with its caption above, which keeps clear of the view beside it."""
    camera, name = frame.cameras[index], frame.assignments[index]
    width, height = camera.resolution
    grey = _displayed(frame.images[index], size_px)
    extent = (-0.5, width - 0.5, height - 0.5, -0.5)  # OpenCV's pixels: the centre of the top left one is (0, 0)
    axes.imshow(grey, cmap="gray", vmin=0, vmax=255, extent=extent, aspect="auto", interpolation="nearest")
    found = frame.detections_px[index]
    axes.plot(*np.asarray(found, dtype=float).T, "o", mfc="none", mec=FOUND, ms=5, mew=1.2)
    axes.set(xlim=extent[:2], ylim=extent[2:])
    for spine in axes.spines.values():
        spine.set(color=colours[name], lw=2)
    style = {"transform": axes.transAxes, "fontsize": 11, "va": "bottom"}
    above = 1 + 5 / size_px[1]
    axes.text(0, above, f"camera {_label(camera, index)} follows {name}", color=colours[name], weight="bold", **style)
    markers = f"{len(found)} marker{'' if len(found) == 1 else 's'}"
    axes.text(1, above, f"zoom ×{camera.zoom:.1f}, {markers}", ha="right", color=MEASURED, **style)


def _displayed(image: NDArray[np.generic], size_px: tuple[int, int]) -> Pixels:
    """An image as it is shown, (height, width): made smaller while it is linear in light, then brightened."""
    # Averaging is for what gets smaller only.
    area = image.shape[1] >= size_px[0] and image.shape[0] >= size_px[1]
    resized = cv2.resize(
        np.asarray(image, dtype=np.float32), size_px, interpolation=cv2.INTER_AREA if area else cv2.INTER_LINEAR
    )
    if image.dtype != np.uint8:
        resized = 255 * np.clip(resized, 0, 1) ** (1 / GAMMA)
    return np.rint(resized).astype(np.uint8)


def _label(camera: PTZCamera, index: int) -> str:
    return camera.name or str(index + 1)


# ---- the plan --------------------------------------------------------------------------------------------------------


def _draw_plan(
    axes: Axes, frame: FilmFrame, room: Room, colours: Mapping[str, str], walked_m: Mapping[str, Floats]
) -> None:
    """The hallway from above, y upwards."""
    x, y = room.width_m / 2, room.length_m / 2
    axes.set(xlim=(-x, x), ylim=(-y, y), facecolor="0.97")
    axes.set_aspect("equal", anchor="E")
    for spine in axes.spines.values():
        spine.set(color="0.4", lw=1.5)
    for camera, name in zip(frame.cameras, frame.assignments, strict=True):
        middle_m, colour = float(frame.avatars[name][2]), colours[name]
        for outline, alpha, width in ((wedge_m, WEDGE_ALPHA, 0.5), (footprint_m, IMAGE_ALPHA, 1.6)):
            corners = outline(camera, room, middle_m)
            if len(corners):
                axes.add_patch(Polygon(corners, fc=colour, alpha=alpha, lw=0))
                axes.add_patch(Polygon(corners, fill=False, ec=colour, lw=width, joinstyle="round"))
    for name, places in walked_m.items():
        axes.plot(*np.asarray(places)[:, :2].T, ".-", color=colours[name], ms=4, lw=1.2, zorder=3)
    for name, place in frame.avatars.items():
        _draw_avatar(axes, name, place, math.radians(frame.headings_deg[name]), colours[name])
    for place in frame.expected_m.values():
        axes.plot(place[0], place[1], "x", color=MEASURED, ms=8, mew=1.8, zorder=6)
    for index, (camera, name) in enumerate(zip(frame.cameras, frame.assignments, strict=True)):
        box = {"boxstyle": "round,pad=0.3", "fc": colours[name], "ec": "white", "lw": 1}
        style = {"color": "white", "weight": "bold", "fontsize": 10, "zorder": 7, "bbox": box}
        axes.text(*camera.position_m[:2], _label(camera, index), ha="center", va="center", **style)


def _draw_avatar(axes: Axes, name: str, place_m: Floats, heading: float, colour: str) -> None:
    """A disc with an arrow's tip, and the name on the side of the nearer wall."""
    here = np.asarray(place_m, dtype=float)[:2]
    forwards = np.array([math.sin(heading), math.cos(heading)])
    across = np.array([forwards[1], -forwards[0]])
    tip = [ARROW_M * forwards, 0.8 * DISC_M * (forwards + across), 0.8 * DISC_M * (forwards - across)]
    axes.add_patch(Polygon(here + tip, fc=colour, ec="white", lw=1, zorder=4))
    axes.add_patch(Circle(tuple(here), DISC_M, fc=colour, ec="white", lw=1, zorder=5))
    side = 1 if here[0] >= 0 else -1
    beside = here + [side * 1.4 * DISC_M, 0]
    # Outlines and paths of others may run behind the name.
    halo = [withStroke(linewidth=3, foreground="white")]
    style = {"color": colour, "weight": "bold", "fontsize": 12, "zorder": 6, "path_effects": halo}
    axes.text(*beside, name, ha="left" if side > 0 else "right", va="center", **style)


def _draw_legend(axes: Axes) -> None:
    axes.set_axis_off()
    marks = {
        "avatar": Line2D([], [], marker="o", ls="", color="0.35", ms=10),
        "walked so far": Line2D([], [], marker=".", color="0.35", ms=4, lw=1.2),
        "where it is expected": Line2D([], [], marker="x", ls="", color=MEASURED, ms=7, mew=1.8),
        "found marker": Line2D([], [], marker="o", ls="", mfc="0.25", mec=FOUND, ms=7, mew=1.5),
        "between a view's sides": Patch(fc="0.85", ec="0.35", lw=0.5),
        "within the view": Patch(fc="0.75", ec="0.35", lw=1.6),
    }
    axes.legend(
        marks.values(), marks.keys(), ncols=2, loc="upper center", bbox_to_anchor=(0.5, 1.0), frameon=False,
        fontsize=9, borderpad=0.3, handlelength=1.6, columnspacing=1.5, labelspacing=0.25,
    )  # fmt: skip
