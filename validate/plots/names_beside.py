"""Names beside signs in a drawing, placed while it is drawn so that none covers a sign or another name."""

from __future__ import annotations

import math
import unicodedata
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.patheffects import withStroke
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox

from pss.hints import Floats

__all__ = ["Name", "grouped", "names_beside", "shortened", "width_of"]


# How many directions are tried around a sign, and how far from its rim, in heights of a line.
DIRECTIONS = 16
DISTANCES = (0.15, 0.6, 1.2, 2.0, 3.0, 4.5, 6.5)
# Farther out a line leads to the sign.
LEADER_FROM = 0.5
# px, between names, and between a name and a sign.
GAP_PX = 1.0
# What costs more is avoided first: a name's way out, its turn away from where it is best, and what lies under it.
FARTHER, TURNED, UNDER = 1.0, 0.35, 4.0
# Characters of a name in a drawing, and of names that share a place.
LONGEST, LONGEST_TOGETHER = 14, 14


@dataclass(frozen=True)
class Name:
    """A name and the place of its sign, in the axes' data; `towards` (2,) is where it is best, (0, 0) anywhere."""

    text: str
    place: tuple[float, float]
    colour: str = "black"
    towards: tuple[float, float] = (0.0, 0.0)


def shortened(name: str, longest: int = LONGEST) -> str:
    """A name of at most so many characters, of which one of a wide script counts two.

    Of a longer name both ends are kept, since numbers stand at the end.
    """
    if width_of(name) <= longest:
        return name
    before, after = name, ""
    while width_of(before) > (longest - 1) // 2:
        before = before[:-1]
    for sign in reversed(name):
        if width_of(before + "…" + sign + after) > longest:
            break
        after = sign + after
    return f"{before}…{after}"


def width_of(words: str) -> int:
    """How wide a text is, in characters, of which one of a wide script counts two."""
    return sum(2 if unicodedata.east_asian_width(sign) in "WF" else 1 for sign in words)


def grouped(names: Sequence[Name], within: float, mixed: str) -> list[Name]:
    """The same with one name for those whose places are `within` of each other; of several in the colour `mixed`."""
    groups: list[list[Name]] = []
    for name in names:
        home = next((group for group in groups if math.dist(group[0].place, name.place) <= within), None)
        if home is None:
            groups.append([name])
        else:
            home.append(name)
    found = []
    for group in groups:
        text = _together([name.text for name in group])
        towards = np.mean([name.towards for name in group], axis=0)
        colour = group[0].colour if len(group) == 1 else mixed
        found.append(Name(text, group[0].place, colour, (float(towards[0]), float(towards[1]))))
    return found


def _together(names: Sequence[str]) -> str:
    """As many of some names as are short together, and the number of the others."""
    shown = [shortened(names[0])]
    while len(shown) < len(names) and width_of(", ".join((*shown, shortened(names[len(shown)])))) <= LONGEST_TOGETHER:
        shown.append(shortened(names[len(shown)]))
    rest = len(names) - len(shown)
    return ", ".join(shown) + (f" + {rest}" if rest else "")


def names_beside(
    axes: Axes,
    names: Sequence[Name],
    size_pt: float,
    sign_pt: float,
    under: Floats | None = None,
    sign_data: float = 0.0,
) -> list[Annotation]:
    """Write names beside their signs within the axes; those for which there is no room are not drawn.

    Args:
        size_pt: of the letters, points.
        sign_pt: radius of the signs, points, which no name covers.
        under: (M, 2), places in the axes' data that names had better not cover.
        sign_data: what is added to the radius, in the axes' data.
    """
    halo = [withStroke(linewidth=2.5, foreground="white")]
    texts = []
    for name in names:
        leader = {"arrowstyle": "-", "color": name.colour, "lw": 0.6, "shrinkA": 0, "shrinkB": 0.8 * sign_pt}
        text = axes.annotate(
            name.text, name.place, (0, 0), textcoords="offset points", color=name.colour, fontsize=size_pt,
            weight="bold", ha="center", va="center", path_effects=halo, zorder=20, arrowprops=leader,
            annotation_clip=False,
        )  # fmt: skip
        text.set_in_layout(False)
        texts.append(text)
    axes.add_artist(_Places(names, texts, sign_pt, sign_data, np.zeros((0, 2)) if under is None else under))
    return texts


class _Places(Artist):
    """Draws nothing: when its axes are drawn it comes first, and finds the places of their names."""

    def __init__(
        self, names: Sequence[Name], texts: Sequence[Annotation], sign_pt: float, sign_data: float, under: Floats
    ) -> None:
        super().__init__()
        self.set_zorder(-math.inf)
        self.set_in_layout(False)
        self.names, self.texts, self.under = names, texts, under
        self.sign_pt, self.sign_data = sign_pt, sign_data

    def draw(self, renderer: RendererBase) -> None:
        """Move the texts to where they find room, those with the most signs around them first."""
        axes = self.axes
        if axes is None or not self.names:
            return
        dpi = axes.get_figure(root=True).dpi  # type: ignore[union-attr]
        to_px = axes.transData.transform
        signs = to_px(np.array([name.place for name in self.names]))
        under = to_px(self.under)
        across = to_px(np.array([(0.0, 0.0), (1.0, 0.0)]))
        radius = self.sign_pt * dpi / 72 + self.sign_data * float(np.linalg.norm(across[1] - across[0]))
        sizes = [_size_px(text, renderer) for text in self.texts]
        within = axes.get_window_extent(renderer)
        apart = np.linalg.norm(signs[:, None] - signs, axis=-1)
        crowd = (apart < 8 * radius).sum(axis=1)
        taken: list[Bbox] = []
        for number in sorted(range(len(signs)), key=lambda number: -crowd[number]):
            found = _room_for(
                signs[number], sizes[number], self._best(number, to_px), (signs, radius), taken, within, under
            )
            text = self.texts[number]
            text.set_visible(found is not None)
            if found is None:
                continue
            middle, is_far = found
            taken.append(_box(middle, sizes[number]))
            shift = (middle - signs[number]) * 72 / dpi
            text.set_position((float(shift[0]), float(shift[1])))
            assert text.arrow_patch is not None
            text.arrow_patch.set_visible(is_far)

    def _best(self, number: int, to_px: Callable[[Floats], Floats]) -> float | None:
        """The angle, in radians on the page, at which a name is best; None for any."""
        towards = np.array(self.names[number].towards)
        if not towards.any():
            return None
        place = np.array(self.names[number].place)
        shift = to_px(place + towards) - to_px(place)
        return math.atan2(shift[1], shift[0])


def _size_px(text: Annotation, renderer: RendererBase) -> Floats:
    """Width and height of the letters, without their line to the sign, (2,)."""
    text.set_visible(True)
    bounds = Text.get_window_extent(text, renderer)
    return np.array([bounds.width, bounds.height])


def _box(middle: Floats, size: Floats) -> Bbox:
    return Bbox([middle - size / 2, middle + size / 2])


def _room_for(
    sign: Floats,
    size: Floats,
    best: float | None,
    signs: tuple[Floats, float],
    taken: Sequence[Bbox],
    within: Bbox,
    under: Floats,
) -> tuple[Floats, bool] | None:
    """The middle of the cheapest free place beside a sign, and whether it is far from it; None without one."""
    places, radius = signs
    cheapest, found = math.inf, None
    for out in DISTANCES:
        for turn in np.arange(DIRECTIONS) * 2 * math.pi / DIRECTIONS:
            angle = turn + (best if best is not None else math.pi / 2)
            away = np.array([math.cos(angle), math.sin(angle)])
            # From the rim of the sign to the rim of the box.
            half = min(size[0] / 2 / max(abs(away[0]), 1e-9), size[1] / 2 / max(abs(away[1]), 1e-9))
            middle = sign + away * (radius + half + out * size[1])
            cost = FARTHER * out + TURNED * (1 - math.cos(turn))
            box = _box(middle, size)
            if cost >= cheapest or not _inside(box, within):
                continue
            low, high = box.min - GAP_PX, box.max + GAP_PX
            if any(box.padded(GAP_PX).overlaps(other) for other in taken) or _touches(places, radius, low, high):
                continue
            if len(under):
                cost += UNDER * float(((under > low) & (under < high)).all(axis=1).any())
            if cost < cheapest:
                cheapest, found = cost, (middle, out > LEADER_FROM)
    return found


def _inside(box: Bbox, within: Bbox) -> bool:
    return bool((box.min >= within.min).all() and (box.max <= within.max).all())


def _touches(places: Floats, radius: float, low: Floats, high: Floats) -> bool:
    """Whether a box covers a part of any sign."""
    nearest = np.clip(places, low, high)
    return bool((np.linalg.norm(places - nearest, axis=1) < radius).any())
