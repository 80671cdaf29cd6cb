"""The sweeps' error budget: the factors between measured and predicted PSS, from `configurations.csv`."""

from __future__ import annotations

from collections.abc import Sequence

from pss.hints import CsvRow
from validate.runs.csv_file import all_of

__all__ = ["budget_findings"]

MODEL = "physical"
FACTORS = {"visibility": "visibility", "noise_model": "noise model", "detector": "detector", "geometry": "geometry"}


def budget_findings(rows: Sequence[CsvRow]) -> str:
    """A table of the factors' lowest and highest over the steps of each sweep, by the physical noise model."""
    heads = ("sweep", "steps", "measured / predicted", *FACTORS.values())
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for sweep in dict.fromkeys(row["sweep"] for row in rows):
        of_sweep = all_of(rows, sweep=sweep, noise_model=MODEL)
        total = [float(row["measured_pss_single_frame"]) / float(row["pss_single_frame"]) for row in of_sweep]
        factors = [_from_to([float(row[f"budget_{name}"]) for row in of_sweep]) for name in FACTORS]
        lines.append("| " + " | ".join((sweep, str(len(of_sweep)), _from_to(total), *factors)) + " |")
    return "\n".join(lines)


def _from_to(values: Sequence[float]) -> str:
    """0.64 to 0.82, or one number if both are the same."""
    low, high = f"{min(values):.2f}", f"{max(values):.2f}"
    return low if low == high else f"{low} to {high}"
