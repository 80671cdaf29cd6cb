"""The factor sweeps' findings: how errors grow with one factor, predicted and measured, from `slopes.csv`."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

from pss.hints import CsvRow
from validate.runs.csv_file import all_of
from validate.runs.numbers import NOTHING, number
from validate.runs.table_text import markdown_table

__all__ = ["factor_findings"]

MODELS = ("physical", "corrected", "as-printed")
NO_SLOPE = 0.05
# What a sweep varies, in words; others go by their own names.
WORDS = {
    "distance": "distance of a target, with the same lens",
    "distance-same-size": "distance, zoomed so that markers keep their size",
    "ring-distance": "distance, lit by each camera's ring light",
    "incidence": "incidence angle, as its cosine",
    "exposure": "exposure time",
    "aperture": "f-number",
    "resolution": "pixels across the same sensor",
    "cameras": "number of cameras",
}


def factor_findings(rows: Sequence[CsvRow]) -> str:
    """A table of log-log slopes, and one of how near each model's are."""
    lines = []
    for sweep in dict.fromkeys(row["sweep"] for row in rows):
        of_sweep = {row["noise_model"]: row for row in all_of(rows, sweep=sweep)}
        measured = next(iter(of_sweep.values()))
        slopes = (_slope(of_sweep[model]) if model in of_sweep else NOTHING for model in MODELS)
        lines.append([WORDS.get(sweep, sweep), sweep, number(measured, "measured_slope"), *slopes])
    near = []
    for model in MODELS:
        of_model = all_of(rows, noise_model=model)
        if not of_model:
            continue
        inside = [row for row in of_model if _inside(row)]
        off = [abs(float(row["predicted_slope"]) - float(row["measured_slope"])) for row in of_model]
        wrong = [row["sweep"] for row in of_model if _wrong_sign(row)]
        size = (f"{statistics.median(off):.2f}", f"{max(off):.2f}")
        near.append([model, f"{len(inside)} of {len(of_model)}", *size, ", ".join(wrong) or "none"])
    slopes_table = markdown_table(["what is varied", "sweep", "measured slope", *MODELS], lines)
    heads = ["R", "slopes in the measured interval", "off by, median", "off by, at most", "wrong sign"]
    return slopes_table + "\n\n" + markdown_table(heads, near)


def _inside(row: CsvRow) -> bool:
    low, high = (float(row[f"measured_slope_ci_{end}"]) for end in ("low", "high"))
    return low <= float(row["predicted_slope"]) <= high


def _wrong_sign(row: CsvRow) -> bool:
    """Predicted to grow where it falls, or the other way; a slope of hardly anything has no sign."""
    predicted, low, high = (
        float(row[name]) for name in ("predicted_slope", "measured_slope_ci_low", "measured_slope_ci_high")
    )
    return abs(predicted) > NO_SLOPE and ((predicted > 0 and high < 0) or (predicted < 0 and low > 0))


def _slope(row: CsvRow) -> str:
    return f"{float(row['predicted_slope']):.2f}".replace("-", "−")
