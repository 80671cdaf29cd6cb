"""Where the words of a figure lie, once it has been drawn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from numpy.typing import NDArray

from validate.plots.glyphs import glyph_runs

__all__ = ["assert_words_are_legible", "drawable", "extents"]

# px: the extent of letters has room above and below them for accents and tails.
TOUCH_PX = 3.0


def drawable(words: str, otherwise: str) -> str:
    """Some words if a font of this machine has their letters (else they are written by number, which takes room)."""
    return words if "".join(run for _, run in glyph_runs(words)) == words else otherwise


def extents(texts: Sequence[Text]) -> NDArray[np.float64]:
    """Left, bottom, right and top of each text's letters in px, (T, 4)."""
    boxes = [Text.get_window_extent(text) for text in texts]
    return np.array([[*box.min, *box.max] for box in boxes]).reshape(-1, 4)


def shown(figure: Figure) -> list[Text]:
    """The texts of a figure that are drawn: not those of axes without a frame, nor of ticks beyond an axis's ends."""
    hidden: list[Text] = []
    for axes in figure.findobj(Axes):
        frame = axes.get_window_extent().padded(TOUCH_PX)
        for axis, low, high, side in ((axes.xaxis, frame.x0, frame.x1, 0), (axes.yaxis, frame.y0, frame.y1, 1)):
            for text in axis.findobj(Text):
                box = extents([text])[0]
                beyond = not low <= (box[side] + box[side + 2]) / 2 <= high and not text.get_rotation()
                if not axes.axison or (beyond and text is not axis.label):
                    hidden.append(text)
    return [t for t in figure.findobj(Text) if t.get_text().strip() and t.get_visible() and t not in hidden]


def assert_words_are_legible(figure: Figure) -> None:
    """No text leaves the figure, and none lies on another."""
    texts = shown(figure)
    boxes = extents(texts)
    width, height = figure.bbox.size
    for text, (left, bottom, right, top) in zip(texts, boxes, strict=True):
        where = f"{text.get_text()!r} at {left:.0f}, {bottom:.0f}, {right:.0f}, {top:.0f} of {width:.0f} × {height:.0f}"
        assert min(left, bottom) >= -TOUCH_PX, where
        assert right <= width + TOUCH_PX, where
        assert top <= height + TOUCH_PX, where
    level = np.array([text.get_rotation() % 90 == 0 for text in texts], dtype=bool)
    turned = [text for text, is_level in zip(texts, level, strict=True) if not is_level]
    _assert_apart([text for text, is_level in zip(texts, level, strict=True) if is_level], boxes[level])
    _assert_apart(turned, np.array([_along_itself(text) for text in turned]).reshape(-1, 4))


def _assert_apart(texts: Sequence[Text], boxes: NDArray[np.float64]) -> None:
    for number, box in enumerate(boxes):
        others = boxes[number + 1 :]
        apart = (others[:, :2] >= box[2:] - TOUCH_PX).any(axis=1) | (others[:, 2:] <= box[:2] + TOUCH_PX).any(axis=1)
        on = [texts[number + 1 + other].get_text() for other in np.flatnonzero(~apart)]
        assert not on, f"{texts[number].get_text()!r} lies on {on}"


def _along_itself(text: Text) -> list[float]:
    """The box of a turned text that ends at its place, in axes along and across its lines; all turn by one angle."""
    angle = np.radians(text.get_rotation())
    place = text.get_transform().transform(text.get_position())
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    end, foot = turn @ place
    text.set_rotation(0)
    left, bottom, right, top = extents([text])[0]
    text.set_rotation(np.degrees(angle))
    return [end - (right - left), foot, end, foot + top - bottom]
