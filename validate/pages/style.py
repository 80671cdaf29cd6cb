"""Colours, symbols and layouts that the figures of a report share: legible in print and without colour vision."""

from __future__ import annotations

from typing import Any

from validate.runs.palette import CATEGORIES, GREY, GRID, INK

__all__ = [
    "LOG_AXIS",
    "NUMBERS",
    "SCALE",
    "layout",
    "line_at",
    "model_style",
    "object_styles",
]

# Of each of the palette's categories.
SYMBOLS = ("square", "diamond", "triangle-up", "cross", "triangle-down", "x")
DASHES = ("dash", "dot", "dashdot", "longdash", "longdashdot", "dash")
SCALE = "Viridis"
NUMBERS = ".6~g"
"""d3's format of an axis's numbers: each written out."""
LOG_AXIS = {"type": "log", "tickformat": NUMBERS, "nticks": 3}
"""A logarithmic axis: without a format plotly writes the first digit alone, 2 for 0.02 and for 20.

With three ticks requested it writes 1, 2 and 5 in one or two decades, powers of ten in more, and few others in less.
"""
FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', sans-serif"


def model_style(number: int) -> tuple[str, str, str]:
    """Colour, symbol and dash of a noise model."""
    return CATEGORIES[number % len(CATEGORIES)], SYMBOLS[number % len(SYMBOLS)], DASHES[number % len(DASHES)]


def object_styles(objects: tuple[str, ...]) -> dict[str, tuple[str, str]]:
    """Colour and symbol of each object that carries markers."""
    names = list(dict.fromkeys(objects))
    return {name: (CATEGORIES[n % len(CATEGORIES)], ("circle", *SYMBOLS)[n % 7]) for n, name in enumerate(names)}


def line_at(x: Any) -> dict[str, Any]:
    """Plotly's shape of an upright dotted line at `x`: the step that the slider shows."""
    where = {"xref": "x", "yref": "paper", "x0": x, "x1": x, "y0": 0, "y1": 1}
    return {"type": "line", **where, "line": {"color": GREY, "width": 1.5, "dash": "dot"}}


def layout(x: dict[str, Any], y: dict[str, Any], **more: Any) -> dict[str, Any]:
    """A plain layout: no box, a light grid, the legend above."""
    axis = {"gridcolor": GRID, "linecolor": GREY, "zerolinecolor": GRID, "ticks": "outside", "automargin": True}
    x, y = ({**own, "title": {"font": {"size": 13}, **own.get("title", {})}} for own in (x, y))
    return {
        "font": {"family": FONT, "size": 13, "color": INK},
        "paper_bgcolor": "white",
        "plot_bgcolor": "white",
        "margin": {"l": 60, "r": 16, "t": 8, "b": 48},
        "legend": {"orientation": "h", "yanchor": "bottom", "y": 1.02, "x": 0, "font": {"size": 12}},
        "hoverlabel": {"bgcolor": "white", "font": {"color": INK, "family": FONT}},
        "xaxis": axis | x,
        "yaxis": axis | y,
        **more,
    }
