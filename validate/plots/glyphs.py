"""Words of users in figures, in any script: letters that the figures' font lacks come from another one of the system.

A letter that no font has is written as its number, U+5317, so that two names stay two.
"""

from __future__ import annotations

from functools import cache
from itertools import groupby

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure, SubFigure
from matplotlib.font_manager import FontProperties, findfont, fontManager, get_font
from matplotlib.text import Text

__all__ = ["glyph_runs", "settle_words"]

# Draws a box for every letter of the world, and is no help to a reader.
NO_HELP = "Last Resort"


def settle_words(figure: Figure | SubFigure) -> None:
    """Give each text of a figure the fonts that have its letters. To be called before the figure is drawn."""
    for text in figure.findobj(Text):
        words, families = _written(text.get_text(), tuple(text.get_fontfamily()))
        if families:
            text.set_fontfamily([*text.get_fontfamily(), *families])
            text.set_fontweight("normal")  # many of them come in no other, which would be reported
        if words != text.get_text():
            text.set_text(words)
    for axes in figure.findobj(Axes):
        for axis in (axes.xaxis, axes.yaxis):
            _settle_ticks(axis)


def _settle_ticks(axis: Axis) -> None:
    """The same for the words of ticks, which are made anew whenever they are drawn."""
    places = axis.get_majorticklocs()
    labels = axis.get_major_formatter().format_ticks(places)
    default = tuple(FontProperties().get_family())
    written = [_written(words, default) for words in labels]
    families = dict.fromkeys(family for _, found in written for family in found)
    if families or [words for words, _ in written] != labels:
        axis.set_ticks(places, labels=[words for words, _ in written])
        axis.set_tick_params(labelfontfamily=[*default, *families])


def glyph_runs(words: str) -> list[tuple[str, str]]:
    """Parts of one text in order, each with the path of a font that has its letters."""
    default = findfont(FontProperties())
    text, families = _written(words, tuple(FontProperties().get_family()))
    files = [default, *(findfont(FontProperties(family=[family])) for family in families)]
    own = [next((file for file in files if ord(sign) in _letters(file)), default) for sign in text]
    return [
        (file, "".join(sign for sign, _ in part))
        for file, part in groupby(zip(text, own, strict=True), key=lambda pair: pair[1])
    ]


def _written(words: str, families: tuple[str, ...]) -> tuple[str, tuple[str, ...]]:
    """A text as it can be drawn, and the families that it needs beside its own."""
    missing = _missing(words, families)
    if not missing:
        return words, ()
    found, nowhere = _families_with(missing)
    return "".join(f"U+{ord(sign):04X}" if sign in nowhere else sign for sign in words), found


def _missing(words: str, families: tuple[str, ...]) -> frozenset[str]:
    if words.isascii():
        return frozenset()
    known = _letters(findfont(FontProperties(family=list(families))))
    return frozenset(sign for sign in words if not sign.isspace() and ord(sign) not in known)


@cache
def _families_with(signs: frozenset[str]) -> tuple[tuple[str, ...], frozenset[str]]:
    """Families of installed fonts that together have the most of some letters, and the letters that none has."""
    left, found = set(signs), []
    fonts = [(font.name, font.fname) for font in fontManager.ttflist if NO_HELP not in font.name]
    while left:
        name, file = max(fonts, key=lambda font: (sum(ord(sign) in _letters(font[1]) for sign in left), font[0]))
        has = {sign for sign in left if ord(sign) in _letters(file)}
        if not has:
            break
        left -= has
        found.append(name)
    return tuple(found), frozenset(left)


@cache
def _letters(file: str) -> frozenset[int]:
    return frozenset(get_font(file).get_charmap())
