"""Colours, symbols and layouts that the figures of a report share: legible in print and without colour vision."""

from __future__ import annotations

from typing import Any

__all__ = [
    "GREY",
    "INK",
    "LOG_AXIS",
    "NUMBERS",
    "PURPLE_ORANGE",
    "SCALE",
    "layout",
    "line_at",
    "model_style",
    "object_styles",
]

INK, GREY, GRID = "#1a1a1a", "#8a8a8a", "#e4e4e4"
# Okabe and Ito, each with a symbol and a dash of its own.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#56B4E9", "#E69F00")
SYMBOLS = ("square", "diamond", "triangle-up", "cross", "triangle-down", "x")
DASHES = ("dash", "dot", "dashdot", "longdash", "longdashdot", "dash")
SCALE = "Viridis"
# Light in the middle, dark at both ends, and told apart by all kinds of colour vision (ColorBrewer's PuOr).
PURPLE_ORANGE = [[0, "#2d004b"], [0.25, "#8073ac"], [0.5, "#f0f0f0"], [0.75, "#e08214"], [1, "#7f3b08"]]
NUMBERS = ".6~g"
"""d3's format of an axis's numbers: each written out."""
LOG_AXIS = {"type": "log", "tickformat": NUMBERS, "nticks": 3}
"""A logarithmic axis: without a format plotly writes the first digit alone, 2 for 0.02 and for 20.

With three ticks asked for it writes 1, 2 and 5 in one or two decades, powers of ten in more, and few others in less.
"""
FONT = "system-ui, -apple-system, 'Segoe UI', Roboto, 'Helvetica Neue', sans-serif"


def model_style(number: int) -> tuple[str, str, str]:
    """Colour, symbol and dash of a noise model."""
    return COLOURS[number % len(COLOURS)], SYMBOLS[number % len(SYMBOLS)], DASHES[number % len(DASHES)]


def object_styles(objects: tuple[str, ...]) -> dict[str, tuple[str, str]]:
    """Colour and symbol of each object that carries markers."""
    names = list(dict.fromkeys(objects))
    return {name: (COLOURS[n % len(COLOURS)], ("circle", *SYMBOLS)[n % 7]) for n, name in enumerate(names)}


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
