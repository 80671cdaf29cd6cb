"""A comparison's plan of points: where measured errors increased and where they decreased."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from validate.comparison.matching import Quantity, matched
from validate.comparison.series import same_measurement
from validate.comparison.sides import Side
from validate.pages.figure import Choice, Columns, Figure, plain, ref
from validate.pages.style import layout
from validate.runs.palette import GRID, OUTLINE, PURPLE_ORANGE

__all__ = ["map_figure"]

POINTS = Quantity("points", "measured_rms_m", "", "", ("sweep", "configuration", "point"), True)
# Ratios of 1/4 and 4 are the ends of the colours.
MOST_LOG2 = 2.0
# |log2| of a ratio that is drawn as no change: a tenth.
EVEN_LOG2 = math.log2(1.1)
EVERY_STEP = "every step"
# Width of a bar of the distribution: a factor of 1.19.
BIN_LOG2 = 0.25
EDGES = np.arange(-MOST_LOG2 - BIN_LOG2 / 2, MOST_LOG2 + BIN_LOG2, BIN_LOG2)


def map_figure(sweep: str, sides: Sequence[Side], names: Sequence[str]) -> Figure | None:
    """Plan view of a sweep's points by the ratio of their measured RMS errors to the first side's.

    None where the sides have no points alike, or are one measurement.
    """
    others = [
        (side, str(number)) for number, side in enumerate(sides) if number and not same_measurement(sides[0], side)
    ]
    rows = [row for row in matched(sides, POINTS) if row.get("sweep", sweep) == sweep] if others else []
    if not rows or "point" not in rows[0]:
        return None
    about = {
        row["point"]: (row["x_m"], row["y_m"], row.get("object", ""))
        for row in sides[0].table("points") or []
        if row.get("sweep", sweep) == sweep and row.get("x_m") and row.get("y_m")
    }
    points = list(about)
    steps = list(dict.fromkeys(str(row.get("configuration", "")) for row in rows))
    columns: Columns = {}
    for side, number in others:
        ratios = {
            (str(row.get("configuration", "")), row["point"]): float(str(row[f"{side.label}_ratio"])) for row in rows
        }
        table = np.array([[ratios.get((step, point), math.nan) for point in points] for step in steps])
        with np.errstate(invalid="ignore", divide="ignore"):
            logs = np.log2(table)
        if not np.isfinite(logs).any():
            continue
        for step, values in zip((EVERY_STEP, *steps), (_median(logs), *logs), strict=True):
            columns |= _columns(f"{number}|{step}", values, points, about)
    known = [number for _, number in others if f"x|{number}|{EVERY_STEP}" in columns]
    if not known:
        return None
    which = "{other}" if len(known) > 1 else known[0]
    bar = {
        "x": 0.57,
        "title": {"text": "ratio"},
        "tickvals": [-2, -1, 0, 1, 2],
        "ticktext": ["¼", "½", "1", "2", "4"],
        "thickness": 12,
        "outlinewidth": 0,
    }
    trace: dict[str, Any] = {
        "type": "scatter",
        "mode": "markers",
        "showlegend": False,
        "x": ref(f"x|{which}|{{step}}"),
        "y": ref(f"y|{which}|{{step}}"),
        "text": ref(f"words|{which}|{{step}}"),
        "hovertemplate": "%{text}<extra></extra>",
        "marker": {
            "color": ref(f"log|{which}|{{step}}"),
            "symbol": ref(f"symbol|{which}|{{step}}"),
            "size": 13,
            "cmin": -MOST_LOG2,
            "cmax": MOST_LOG2,
            "colorscale": PURPLE_ORANGE,
            "colorbar": bar,
            "line": {"width": 1, "color": OUTLINE},
        },
    }
    return Figure(
        "map",
        "Where errors grew, and where they shrank",
        f"The room from above. Each sign is a marker: its measured RMS error over that of {names[0]}, of “every step” "
        "the median ratio. Triangles that point up have grown by more than a tenth, those that point down have shrunk; "
        "circles have done neither. Beside it, how many markers have which ratio: one hump shows that a change acts on "
        "all alike, two that it depends on where a marker is. Markers that either side did not triangulate are left "
        "out. Few trials make single markers scatter: look for regions, not for signs.",
        "Plan view of the markers, by the ratio of their measured errors, beside the distribution of these ratios.",
        [trace, _histogram(which)],
        layout(
            {"title": {"text": "x in m"}, "constrain": "domain", "domain": [0, 0.55]},
            {"title": {"text": "y in m"}, "scaleanchor": "x", "constrain": "domain"},
            hovermode="closest",
            annotations=[
                {
                    "text": ref(f"summary|{which}|{{step}}"),
                    "xref": "paper",
                    "yref": "paper",
                    "x": 0,
                    "y": 1.0,
                    "yanchor": "bottom",
                    "xanchor": "left",
                    "showarrow": False,
                }
            ],
            margin={"l": 60, "r": 16, "t": 30, "b": 48},
            xaxis2={
                "title": {"text": "ratio of errors", "font": {"size": 13}},
                "domain": [0.7, 1],
                "anchor": "y2",
                "tickvals": bar["tickvals"],
                "ticktext": bar["ticktext"],
                "range": [-MOST_LOG2 - BIN_LOG2, MOST_LOG2 + BIN_LOG2],
            },
            yaxis2={
                "title": {"text": "markers", "font": {"size": 13}},
                "anchor": "x2",
                "rangemode": "tozero",
                "gridcolor": GRID,
            },
            bargap=0.05,
        ),
        (
            Choice("step", "Step", tuple((step, step) for step in (EVERY_STEP, *steps)), EVERY_STEP),
            *(
                (Choice("other", "Run", tuple((number, names[int(number)]) for number in known), known[0]),)
                if len(known) > 1
                else ()
            ),
        ),
        columns,
        wide=True,
        height_px=480,
    )


def _histogram(which: str) -> dict[str, Any]:
    """How many markers have which ratio; those beyond the colours' ends stand at them."""
    centres = EDGES[:-1] + BIN_LOG2 / 2
    return {
        "type": "bar",
        "showlegend": False,
        "x": plain(centres),
        "y": ref(f"count|{which}|{{step}}"),
        "xaxis": "x2",
        "yaxis": "y2",
        "text": [f"×{2**centre:.2g}" for centre in centres],
        "textposition": "none",
        "hovertemplate": "%{y} markers at about %{text}<extra></extra>",
        "marker": {
            "color": plain(centres),
            "cmin": -MOST_LOG2,
            "cmax": MOST_LOG2,
            "colorscale": PURPLE_ORANGE,
            "line": {"width": 1, "color": OUTLINE},
        },
    }


def _median(logs: np.ndarray) -> np.ndarray:
    """Over the steps, of the points that some step has."""
    found = np.full(logs.shape[1], np.nan)
    for point in range(logs.shape[1]):
        known = logs[np.isfinite(logs[:, point]), point]
        if len(known):
            found[point] = np.median(known)
    return found


def _columns(stem: str, logs: np.ndarray, points: list[str], about: dict[str, tuple[str, str, str]]) -> Columns:
    known = np.flatnonzero(np.isfinite(logs))
    values = logs[known]
    up, down = int((values > EVEN_LOG2).sum()), int((values < -EVEN_LOG2).sum())
    summary = (
        f"median ×{2 ** np.median(values):.3g} over {len(values)} markers: {up} grew, {down} shrank"
        if len(values)
        else "no marker was triangulated by both"
    )
    return {
        f"x|{stem}": [float(about[points[n]][0]) for n in known],
        f"y|{stem}": [float(about[points[n]][1]) for n in known],
        f"log|{stem}": plain(np.clip(values, -MOST_LOG2, MOST_LOG2), 3),
        f"symbol|{stem}": [
            "triangle-up" if v > EVEN_LOG2 else "triangle-down" if v < -EVEN_LOG2 else "circle" for v in values
        ],
        f"words|{stem}": [
            f"marker {points[n]} on {about[points[n]][2]}: ×{2**v:.3g}" for n, v in zip(known, values, strict=True)
        ],
        f"summary|{stem}": summary,
        f"count|{stem}": np.histogram(np.clip(values, -MOST_LOG2, MOST_LOG2), EDGES)[0].tolist(),
    }
