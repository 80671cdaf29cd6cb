"""Ranking by PSS against the size of calibration errors of both kinds, with and without a term for them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter

from render.store.folder import atomic_path
from validate.bank.calibration_study import EACH_FRAME, FROZEN, IN_WEIGHTS, OVER, OWN, WITHIN
from validate.plots.drawing import plt
from validate.runs.palette import BLUE, GREEN, REFERENCE, VERMILION

__all__ = ["draw"]

Rows = Sequence[dict[str, object]]

DPI = 150
# (column, its unit's scale, title, label of x)
KINDS = (
    ("pan_tilt_deg", 1.0, "pan and tilt", "σ in degrees"),
    ("focal_share", 100.0, "focal length", "σ in %"),
    ("position_m", 1000.0, "place", "σ in mm"),
)
# A row of panels each: label, and which rows of the table.
POPULATIONS = (
    ("new in each frame:\nover calibrations", EACH_FRAME, OVER),
    ("frozen:\nwithin one calibration", FROZEN, WITHIN),
)
# (weights of triangulation, prediction, colour (blind-safe, Okabe and Ito), style, label)
CURVES = (
    (OWN, "plain", VERMILION, "o-", "no term for it"),
    (OWN, "with_term", BLUE, "s-", "a term in the predicted R"),
    (IN_WEIGHTS, "with_term", GREEN, "^-", "a term in R and in triangulation's weights"),
    (IN_WEIGHTS, "other_draws", REFERENCE, ":", "as measured in the mean of other calibrations"),
)


def draw(path: Path, rows: Rows) -> None:
    """Write the figure: a row for each population; a panel for each kind of error by itself, and one for all three."""
    figure, panels = plt.subplots(
        len(POPULATIONS), len(KINDS) + 1, figsize=(15, 8), sharex="col", sharey=True, layout="constrained"
    )
    none = next(row for row in rows if not any(_value(row, column) for column, *_ in KINDS))
    for line, (label, kind, judged) in zip(panels, POPULATIONS, strict=True):
        chosen = [row for row in rows if (row["kind"], row["judged"]) == (kind, judged)]
        _line(line, none, chosen)
        line[0].set_ylabel(f"{label}\n\nSpearman's ρ, predicted with measured PSS")
    for axes, (_, _, title, below) in zip(panels[0], KINDS, strict=False):
        axes.set_title(title)
        panels[-1, list(panels[0]).index(axes)].set_xlabel(below)
    panels[0, -1].set_title("all three")
    panels[-1, -1].set_xlabel("σ in degrees / % / mm")
    panels[0, 0].set_ylim(0, 1.02)
    figure.legend(*panels[-1, 0].get_legend_handles_labels(), loc="outside lower center", ncols=len(CURVES) + 1)
    figure.suptitle("Four cameras whose calibration is wrong by an unknown error", fontsize=14)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=DPI, format="png")
    plt.close(figure)


def _line(panels: Sequence[Axes], none: dict[str, object], rows: Rows) -> None:
    """The panels of one population."""
    for axes, (column, scale, _, _) in zip(panels, KINDS, strict=False):
        others = [name for name, *_ in KINDS if name != column]
        alone = [row for row in rows if _value(row, column) and not any(_value(row, name) for name in others)]
        _curves(axes, alone, lambda row, column=column, scale=scale: scale * _value(row, column))
        axes.axhline(_value(none, "spearman_plain"), color=REFERENCE, ls="--", lw=1, label="no error")
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(NullFormatter())
    together = [row for row in rows if all(_value(row, column) for column, *_ in KINDS)]
    names = list(dict.fromkeys(_sizes(row) for row in together))
    _curves(panels[-1], together, lambda row: names.index(_sizes(row)))
    panels[-1].axhline(_value(none, "spearman_plain"), color=REFERENCE, ls="--", lw=1)
    panels[-1].set_xticks(range(len(names)), names, rotation=20, fontsize=8)


def _sizes(row: dict[str, object]) -> str:
    return " / ".join(f"{scale * _value(row, column):g}" for column, scale, *_ in KINDS)


def _curves(axes: Axes, rows: Rows, x_of: Callable[[dict[str, object]], float]) -> None:
    for weights, name, colour, style, label in CURVES:
        chosen = [row for row in rows if row["weights"] == weights]
        x = [x_of(row) for row in chosen]
        value, low, high = (
            np.array([_value(row, f"spearman_{name}{end}") for row in chosen]) for end in ("", "_low", "_high")
        )
        if not np.isfinite(value).any():
            continue
        axes.plot(x, value, style, color=colour, label=label, ms=4)
        if name != "other_draws":
            axes.fill_between(x, low, high, color=colour, alpha=0.15, lw=0)
    axes.grid(alpha=0.3, lw=0.5)


def _value(row: dict[str, object], name: str) -> float:
    text = str(row[name])
    return float(text) if text else float("nan")
