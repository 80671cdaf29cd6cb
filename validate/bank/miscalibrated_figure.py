"""Ranking by PSS against the size of calibration errors, with and without a term for them in R."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from validate.drawing import plt
from validate.store import atomic_path

__all__ = ["draw"]

Floats = NDArray[np.float64]
Rows = Sequence[dict[str, object]]

# Colour-blind safe (Okabe and Ito).
PLAIN, WITH_TERM, NONE = "#D55E00", "#0072B2", "#555555"
DPI = 150
# (column, its unit's scale, title, label of x)
KINDS = (
    ("pan_tilt_deg", 1.0, "pan and tilt", "σ in degrees"),
    ("focal_share", 100.0, "focal length", "σ in %"),
    ("position_m", 1000.0, "place", "σ in mm"),
)


def draw(path: Path, rows: Rows) -> None:
    """Write the figure: a panel for each kind of error by itself, and one for all together."""
    figure, panels = plt.subplots(1, len(KINDS) + 1, figsize=(15, 4.6), sharey=True, layout="constrained")
    none = next(row for row in rows if not any(_value(row, column) for column, *_ in KINDS))
    for axes, (column, scale, title, label) in zip(panels, KINDS, strict=False):
        others = [name for name, *_ in KINDS if name != column]
        alone = [row for row in rows if _value(row, column) and not any(_value(row, name) for name in others)]
        _curves(axes, alone, [scale * _value(row, column) for row in alone])
        axes.axhline(_value(none, "spearman_plain"), color=NONE, ls="--", lw=1, label="no error")
        axes.set_xscale("log")
        axes.xaxis.set_major_formatter("{x:g}")
        axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_title(title)
        axes.set_xlabel(label)
    together = [row for row in rows if all(_value(row, column) for column, *_ in KINDS)]
    _curves(panels[-1], [none, *together], [float(n) for n in range(len(together) + 1)])
    panels[-1].set_title("all three")
    names = ["none", *(" / ".join(f"{s * _value(row, c):g}" for c, s, *_ in KINDS) for row in together)]
    panels[-1].set_xticks(range(len(names)), names, rotation=20, fontsize=8)
    panels[-1].set_xlabel("σ in degrees / % / mm")
    panels[0].set_ylabel("Spearman's ρ, predicted with measured PSS")
    panels[0].set_ylim(0, 1.02)
    panels[0].legend(loc="lower left")
    figure.suptitle("Four cameras whose calibration is wrong by an unknown error, new for every frame", fontsize=14)
    with atomic_path(path) as temporary:
        figure.savefig(temporary, dpi=DPI, format="png")
    plt.close(figure)


def _curves(axes: Axes, rows: Rows, x: Sequence[float]) -> None:
    for name, colour, said in (
        ("plain", PLAIN, "R knows nothing of it"),
        ("with_term", WITH_TERM, "with a term for it in R"),
    ):
        value, low, high = (
            np.array([_value(row, f"spearman_{name}{end}") for row in rows]) for end in ("", "_low", "_high")
        )
        axes.plot(x, value, "o-", color=colour, label=said)
        axes.fill_between(x, low, high, color=colour, alpha=0.2, lw=0)
    axes.grid(alpha=0.3, lw=0.5)


def _value(row: dict[str, object], name: str) -> float:
    return float(str(row[name]))
