"""Parts of docs/results.md and docs/hallway.md on the people who walk, from the tables in results/reference/hallway."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from pss.hints import CsvRow
from validate.findings.blocks_of_sweeps import table_text
from validate.runs.csv_file import all_of, read_tables
from validate.runs.numbers import number, with_range

__all__ = ["HALLWAY_BLOCKS"]

CLOSER = "swapping to the closer avatar (2b) is better on average than to the farther (2a)"
# A share and no ratio: it has no factors.
SPIKE = "a spike where an avatar enters"
# (claim as it begins in claims.csv, kind, in words)
CLAIMS = (
    (CLOSER, "filter", "(2b) swapping to the closer person is better on average than (2a) to the farther (σ∞)"),
    (CLOSER, "filter, q ≈ c", "the same where process and frame are alike (σ∞, q ≈ c)"),
    (CLOSER, "single frame", "the same, single frame"),
    ("PSS first rises, strategy (1)", "single frame", "with (1), PSS first rises (single frame)"),
    ("PSS then falls, strategy (1)", "single frame", "… then falls"),
    (SPIKE, "single frame", "a spike where both people are in all views (share of PSS)"),
    ("the zoom limit lowers PSS", "single frame", "a zoom limit lowers PSS at a distance (single frame)"),
)
SIDES = (("predicted", "corrected"), ("predicted", "calibrated"), ("measured", ""))
LISTED = (
    "as-printed",
    "corrected",
    "identity",
    "physical",
    "physical, whole markers",
    "calibrated, limits",
    "calibrated",
)


def _ranks(reference: Path) -> str:
    """ρ over all strategies and steps, a row for each R."""
    rows = all_of(_tables(reference)["agreement"], avatar="both", zoom_limit="none", strategy="all")
    kinds = list(dict.fromkeys(row["kind"] for row in rows))
    counted = "visible_share_spearman" in rows[0]
    heads = ["R"]
    for kind in kinds:
        heads += [f"{kind}: ρ", f"{kind}: ρ of the visible share"] if counted else [f"{kind}: ρ"]
    lines = []
    for model in LISTED:
        of_model = {row["kind"]: row for row in all_of(rows, noise_model=model)}
        if of_model:
            names = ("spearman", "visible_share_spearman") if counted else ("spearman",)
            lines.append([model, *(number(of_model[kind], name) for kind in kinds for name in names)])
    return table_text(heads, lines)


def _claims(reference: Path) -> str:
    """The paper's claims on Figure 4, predicted and measured."""
    rows = _tables(reference)["claims"]
    lines = []
    for claim, kind, words in CLAIMS:
        found = [
            row
            for row in all_of(rows, kind=kind)
            if row["claim"].startswith(claim) and "alone" not in row["claim"] and row["value"]
        ]
        if found:
            first = [row for row in found if _place(row) == _place(found[0])]
            lines.append([words, *(_cell(first, side, model) for side, model in SIDES)])
    heads = ("claim (Figure 4)", *(", ".join(filter(None, side)) + " R" * (side[1] == "corrected") for side in SIDES))
    return table_text(heads, lines)


def _place(row: CsvRow) -> str:
    """The zoom limit; not where a figure is highest."""
    return row["where"] if row["where"].startswith(("zoom limit", "x")) else ""


def _cell(rows: list[CsvRow], side: str, model: str) -> str:
    """Whether it holds, the ratio, and its two factors: of the counts of markers, and of PSS per marker."""
    found = all_of(rows, side=side, noise_model=model)
    if not found:
        return ""
    (row, *_) = found
    text = f"{row['holds']}, {with_range(*(row[name] for name in ('value', 'ci_low', 'ci_high')))}"
    if row.get("of_counts") and row.get("per_marker") and not row["claim"].startswith(SPIKE):
        text += f" = {float(row['of_counts']):.2f} × {float(row['per_marker']):.2f}"
    return text


def _walk(reference: Path) -> str:
    """NEES over the real walk."""
    tables = _tables(reference)
    if "walk_consistency" not in tables:
        return "the real walk has not been rendered"
    (whole,) = all_of(tables["walk_consistency"], group="both", min_views="0")
    return f"NEES/3 is {number(whole, 'posterior_nees_per_dof')} after an update"


def _tables(reference: Path) -> dict[str, list[dict[str, str]]]:
    return read_tables(reference / "hallway")


HALLWAY_BLOCKS: Mapping[str, Callable[[Path], str]] = {
    "hallway: ranks": _ranks,
    "hallway: claims": _claims,
    "hallway: walk": _walk,
}
