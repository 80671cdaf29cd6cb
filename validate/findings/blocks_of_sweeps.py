"""Parts of docs/results.md on the room's sweeps, from correlation.csv, optima.csv, claims.csv and detection.csv."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from pss.hints import CsvRow
from validate.runs.csv_file import all_of, one_of, read_tables
from validate.runs.numbers import number, percent, with_range

__all__ = ["SWEEP_BLOCKS", "table_text"]

MODELS = ("as-printed", "corrected", "physical", "calibrated")
FRAME, FILTER = "measured_pss_single_frame", "measured_pss_filter"
# (sweep, claim in claims.csv, in words)
CLAIMS = (
    ("zoom", "PSS rises from the first value", "Fig. 1: PSS rises with zoom (optimum / first step)"),
    ("zoom", "PSS falls to the last value", "… and then falls (optimum / last step)"),
    ("focus", "PSS rises from the first value", "Fig. 2: PSS rises with focus distance (optimum / first step)"),
    ("focus", "PSS falls to the last value", "… and then falls (optimum / last step)"),
    (
        "selection",
        "PSS rises with the angle between the cameras",
        "Fig. 3: PSS rises with the angle between two cameras (ρ)",
    ),
)
FLAT = "the ∞-norm has flat regions where PSS has none"
BUDGET = (
    ("visibility", "visibility"),
    ("noise_model", "noise model"),
    ("detector", "detector"),
    ("geometry", "geometry"),
)


def table_text(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """A Markdown table."""
    lines = [f"| {' | '.join(cells)} |" for cells in (heads, *rows)]
    return "\n".join([lines[0], "|" + "---|" * len(heads), *lines[1:]])


def _ranks(reference: Path) -> str:
    """How the prediction ranks the steps of each sweep, and where it has its optimum."""
    tables = read_tables(reference)
    rows = []
    for sweep in dict.fromkeys(row["sweep"] for row in tables["correlation"]):
        best = one_of(tables["optima"], sweep=sweep, side="measured", kind="single frame")["optimum"]
        for model in MODELS:
            of_model = all_of(tables["correlation"], sweep=sweep, noise_model=model, level="configuration")
            frame = one_of(of_model, metric="pss-single-frame", measure=FRAME)
            predicted = one_of(tables["optima"], sweep=sweep, side="predicted", noise_model=model, kind="single frame")
            rows.append(
                (
                    sweep,
                    model,
                    number(frame, "spearman"),
                    f"{predicted['optimum']} ({best})",
                    f"{percent(frame['regret'])} ({percent(frame['oracle_regret'])})",
                    number(one_of(of_model, metric="pss", measure=FILTER), "spearman"),
                    number(one_of(of_model, metric="visible-share", measure=FILTER), "spearman"),
                )
            )
    heads = ("sweep", "R", "single frame: ρ", "optimum predicted (measured)", "regret (oracle's)", "σ∞: ρ",
             "share of visible points: ρ with the filter's PSS")  # fmt: skip
    return table_text(heads, rows)


def _found(reference: Path) -> str:
    """How many of the markers that are predicted visible are found."""
    parts = []
    for row in read_tables(reference)["detection"]:
        found, missed = int(row["visible_detected"]), int(row["visible_missed"])
        parts.append(f"{row['sweep']} {found:,} of {found + missed:,}")
    return f"Found of the markers whose centre is predicted visible: {', '.join(parts)}."


def _claims(reference: Path) -> str:
    """The paper's claims about its Figures 1 to 3, predicted and measured."""
    rows = read_tables(reference)["claims"]
    sides = [("predicted", model) for model in MODELS] + [("measured", "")]
    lines = []
    for sweep, claim, words in CLAIMS:
        cells = []
        for side, model in sides:
            row = one_of(rows, sweep=sweep, claim=claim, side=side, noise_model=model)
            holds = "yes" if row["holds"] == "yes" else "not shown"
            cells.append(f"{holds}, {with_range(row['value'], row['ci_low'], row['ci_high'])}")
        lines.append((words, *cells))
    sweeps = list(dict.fromkeys(row["sweep"] for row in all_of(rows, claim=FLAT)))
    shares = []
    for side, model in sides:
        of_side = [one_of(rows, sweep=sweep, claim=FLAT, side=side, noise_model=model)["value"] for sweep in sweeps]
        shares.append(", ".join(f"{float(value):.2g}" for value in of_side))
    lines.append((f"Sec. 3.3: the ∞-norm is flat where PSS is not (share of steps: {', '.join(sweeps)})", *shares))
    heads = ("claim", *(f"predicted, {model}" for model in MODELS), "measured")
    return table_text(heads, lines)


def _sizes(reference: Path) -> str:
    """How large errors are predicted."""
    rows = read_tables(reference)["configurations"]

    def ratios(*models: str) -> list[float]:
        chosen = [row for row in rows if row["noise_model"] in models]
        pairs = (
            (float(row["predicted_rms_common_m"] or "nan"), float(row["measured_rms_common_m"] or "nan"))
            for row in chosen
        )
        return sorted(ratio for a, b in pairs if math.isfinite(ratio := a / b))

    paper, physical = ratios("as-printed", "corrected"), ratios("physical")
    return (
        f"as printed and corrected it predicts {paper[0]:.0f} to {paper[-1]:.0f} times the measured RMS of a step, "
        f"`physical` {physical[0]:.2f} to {physical[-1]:.2f} times ({statistics.median(physical):.2f} in the median)"
    )


def _budget(reference: Path) -> str:
    """What is lost between predicted and measured PSS."""
    rows = all_of(read_tables(reference)["configurations"], noise_model="physical")
    whole = [float(row["measured_pss_single_frame"]) / float(row["pss_single_frame"]) for row in rows]
    parts = ", ".join(f"{words} ({_range(rows, f'budget_{name}')})" for name, words in BUDGET)
    return (
        f"measured single-frame PSS is {min(whole):.2f} to {max(whole):.2f} times what `physical` predicts, as a "
        f"product of {parts}"
    )


def _range(rows: Sequence[CsvRow], name: str) -> str:
    low, high = (f"{of(float(row[name]) for row in rows):.2f}" for of in (min, max))
    return low if low == high else f"{low} to {high}"


SWEEP_BLOCKS: Mapping[str, Callable[[Path], str]] = {
    "sweeps: ranks": _ranks,
    "sweeps: found": _found,
    "sweeps: claims": _claims,
    "sweeps: sizes": _sizes,
    "sweeps: budget": _budget,
}
