"""What markers in space are coloured by: scales that hold over a run. The page finds each marker's shade."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pss.hints import Floats
from validate.pages.data import KINDS, SweepTable
from validate.pages.figure import Columns, plain
from validate.runs.palette import PURPLE_ORANGE, UNKNOWN_GREY, VIRIDIS

__all__ = ["plate_colours", "scales"]


# Decades that a scale of ratios shows at least on each side of 1.
LEAST_DECADES = 0.3
# Of a scale's length, at its lower end: markers that are not known.
GREY_SHARE = 0.06


def scales(table: SweepTable) -> Columns:
    """Scales of colour, the same at every step."""
    grey = [[0, UNKNOWN_GREY], [GREY_SHARE - 1e-6, UNKNOWN_GREY]]

    def beside(scale: Sequence[Sequence[Any]]) -> list[list[Any]]:
        return grey + [[GREY_SHARE + (1 - GREY_SHARE) * at, colour] for at, colour in scale]

    columns: Columns = {
        "scale|predicted": beside(VIRIDIS),
        "scale|measured": beside(VIRIDIS),
        "scale|ratio": beside(PURPLE_ORANGE),
    }
    for kind in KINDS:
        columns[f"bar|predicted|{kind.name}"] = f"predicted {kind.symbol} in mm"
        columns[f"bar|measured|{kind.name}"] = "measured √λmax in mm"
        columns[f"bar|ratio|{kind.name}"] = "measured / predicted"
        for model in table.models:
            for colour, values in _coloured(table, kind.name, model).items():
                low, high = _ends(values, colour == "ratio")
                bottom = low - (high - low) * GREY_SHARE / (1 - GREY_SHARE)
                ticks = _ticks(low, high)
                name = f"{colour}|{kind.name}|{model}"
                columns[f"low|{name}"], columns[f"high|{name}"] = round(bottom, 4), round(high, 4)
                # The scale's own lower end: grey, below it, marks unknown values.
                columns[f"known_from|{name}"] = round(low, 4)
                columns[f"ticks|{name}"] = [round((bottom + low) / 2, 4), *plain(np.log10(ticks))]
                columns[f"ticktexts|{name}"] = ["unknown", *(f"{tick:g}" for tick in ticks)]
    return columns


def _coloured(table: SweepTable, kind_name: str, model: str) -> dict[str, Floats]:
    """log10 of what markers are coloured by, (S, N)."""
    kind = next(kind for kind in KINDS if kind.name == kind_name)
    predicted, measured = np.log10(table.predicted_mm(model, kind)), np.log10(table.measured_mm(kind))
    return {"predicted": predicted, "measured": measured, "ratio": measured - predicted}


def _ends(values: Floats, symmetric: bool) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    if not len(known):
        return -1.0, 1.0
    low, high = (float(end) for end in np.percentile(known, (2, 98)))
    if symmetric:
        most = max(-low, high, LEAST_DECADES)
        return -most, most
    middle = (low + high) / 2
    return min(low, middle - LEAST_DECADES / 2), max(high, middle + LEAST_DECADES / 2)


def _ticks(low: float, high: float) -> list[float]:
    """Round numbers between two powers of ten, a handful."""
    steps = (1, 2, 5) if high - low < 2.5 else (1,)
    every = [digit * 10.0**power for power in range(int(np.floor(low)), int(np.ceil(high)) + 1) for digit in steps]
    inside = [tick for tick in every if 10**low * 0.999 <= tick <= 10**high * 1.001]
    return inside or [float(f"{10 ** ((low + high) / 2):.2g}")]


def plate_colours(table: SweepTable, step: int, kind: str, model: str) -> list[tuple[int, ...]]:
    """Red, green and blue (sRGB, 0 to 255) of each marker by its predicted σ, grey where that is not known."""
    columns = scales(table)
    name = f"predicted|{kind}|{model}"
    bottom, low, high = (columns[f"{end}|{name}"] for end in ("low", "known_from", "high"))
    values = _coloured(table, kind, model)["predicted"][step]
    shade = np.where(np.isfinite(values), np.clip(values, low, high), bottom)
    scale = columns["scale|predicted"]
    at = [float(stop) for stop, _ in scale]
    rgb = np.array([[int(colour[n : n + 2], 16) for n in (1, 3, 5)] for _, colour in scale])
    share = np.clip((shade - bottom) / (high - bottom), 0, 1)
    mixed = np.column_stack([np.interp(share, at, rgb[:, channel]) for channel in range(3)])
    return [tuple(round(float(value)) for value in row) for row in mixed]
