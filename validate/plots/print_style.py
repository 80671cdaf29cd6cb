"""Figures as files for print: the same run gives the same bytes."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure, SubFigure

from render.store.folder import atomic_path
from validate.plots.glyphs import settle_words
from validate.plots.room3d import colour_scale

__all__ = ["WIDTH_IN", "for_print", "print_colour_scale", "print_style", "save"]

WIDTH_IN = 7.0
"""Inches: a text's width on letter or A4 paper."""
FORMATS = ("pdf", "svg")
SIZES_PT = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 6.5,
    "lines.linewidth": 1.2,
}


# Of what is drawn for the screen at nearly twice the size.
SMALLER = 0.62


@contextmanager
def print_style() -> Iterator[None]:
    """Sizes for print, fonts that stay text in PDF, and names in SVG that do not differ from run to run."""
    # 42: TrueType, which publishers require.
    with matplotlib.rc_context(SIZES_PT | {"pdf.fonttype": 42, "svg.hashsalt": "print"}):
        yield


def save(figure: Figure, folder: Path, name: str) -> list[Path]:
    """Write NAME.pdf and NAME.svg into `folder`, without the date of writing; their paths."""
    settle_words(figure)
    paths = [folder / f"{name}.{kind}" for kind in FORMATS]
    for path, date in zip(paths, ("CreationDate", "Date"), strict=True):
        with atomic_path(path) as temporary:
            figure.savefig(temporary, format=path.suffix[1:], metadata={date: None})
    return paths


def for_print(axes: Axes) -> None:
    """Make signs, lines and words that were drawn for the screen as small as a figure of `WIDTH_IN` needs them."""
    axes.title.set_fontsize(SIZES_PT["axes.titlesize"])
    for line in axes.lines:
        line.set_markersize(SMALLER * line.get_markersize())
        line.set_linewidth(SMALLER * line.get_linewidth())
    for text in axes.texts:
        text.set_fontsize(7)
    if axes.get_legend() is not None:
        axes.legend(fontsize=SIZES_PT["legend.fontsize"], frameon=False, handlelength=1.6)


def print_colour_scale(figure: Figure | SubFigure, above: list[Axes], norm: LogNorm, model: str) -> None:
    """The scale of the markers' colours, beside the axes that show them."""
    bar = colour_scale(figure, above, norm, shrink=0.8, pad=0.01, aspect=30)
    bar.ax.tick_params(which="both", labelsize=6)
    bar.set_label(f"predicted √λmax of C in mm\n({model}); grey: unobservable", fontsize=7)
