"""The hallway's findings: strategies over the steps of a walk, the paper's claims, and the real walk.

Columns, kinds and noise models that older tables lack are left out.
"""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Sequence

from pss.hints import CsvRow
from validate.runs.csv_file import Tables, all_of, one_of
from validate.runs.numbers import NOTHING, number, percent, with_range
from validate.runs.table_text import markdown_table

__all__ = ["hallway_findings"]

MODELS = (
    "as-printed",
    "corrected",
    "identity",
    "as-printed, scaled",
    "corrected, scaled",
    "identity, scaled",
    "physical",
    "physical, whole markers",
    "calibrated, limits",
    "calibrated",
)
# Measures that sentences are made of; the table has them all.
STATED = (
    "measured PSS, filter",
    "measured PSS, filter, q ≈ c",
    "measured PSS, single frame",
    "share under 0.05 mm",
    "share under 5 mm",
    "median RMS",
)
# Their PSS has an order, but no size.
OF_THE_PAPER = ("as-printed", "corrected", "identity")
KINDS = {
    "filter": "the paper's PSS (σ∞) beside the filter's, at the schedule's own process",
    "filter, q ≈ c": "the paper's PSS (σ∞) beside the filter's, where process and frame are alike (q ≈ c)",
    "single frame": "single-frame PSS",
}
# Of the table by strategy.
SHOWN = ("corrected", "physical", "calibrated")
# Columns of the claims' table.
SIDES = (("predicted", "corrected"), ("predicted", "calibrated"), ("measured", ""))


def hallway_findings(tables: Tables) -> str:
    """Tables and sentences, in Markdown; the real walk's if it was rendered."""
    parts = [_agreement(tables["agreement"])]
    if "process" in tables:
        parts.append(_process(tables["process"]))
    parts += [_claims(tables["claims"]), _strategies(tables)]
    if "walk_consistency" in tables:
        parts.append(_real_walk(tables["walk_consistency"], tables["walk_misfit"], tables["walk"]))
    return "\n\n".join(parts)


def _found(rows: Sequence[CsvRow], column: str, names: Iterable[str]) -> list[str]:
    """Those of the names that the rows have in a column."""
    every = {row[column] for row in rows}
    return [name for name in names if name in every]


def _agreement(rows: Sequence[CsvRow]) -> str:
    """Predicted against measured PSS over the steps."""
    chosen = all_of(rows, avatar="both", zoom_limit="none")
    kinds, models = _found(chosen, "kind", KINDS), _found(chosen, "noise_model", MODELS)
    head = ["strategy", *(f"{model}, {kind}" for kind in kinds for model in SHOWN)]
    lines = [_line(head), "|" + "---|" * len(head)]
    for strategy in dict.fromkeys(row["strategy"] for row in chosen):
        cells = []
        for kind in kinds:
            for model in SHOWN:
                row = one_of(chosen, strategy=strategy, kind=kind, noise_model=model)
                cells.append(f"{number(row, 'spearman')}; {float(row['median_abs_log_ratio']):.2f}")
        lines.append(_line([strategy, *cells]))
    over_all, stated = [], []
    for kind in kinds:
        of_all = [one_of(chosen, strategy="all", kind=kind, noise_model=model) for model in models]
        for row in of_all:
            ratio = "no size" if row["noise_model"] in OF_THE_PAPER else number(row, "median_abs_log_ratio")
            over_all.append([kind, row["noise_model"], number(row, "spearman"), ratio])
        stated += [f"*{kind}*: {KINDS[kind]}."]
        stated += _beside_the_count(one_of(of_all, noise_model="calibrated"))
    all_steps = markdown_table(["PSS", "R", "ρ over all strategies and steps", "median \\|log ratio\\|"], over_all)
    by_strategy = "By strategy, ρ over its steps with its interval, and the median |log ratio|:"
    return "\n\n".join([" ".join(stated), all_steps, by_strategy, "\n".join(lines)])


def _beside_the_count(row: CsvRow) -> list[str]:
    """What counting markers does, where PSS of a kind has a ρ."""
    if not row.get("visible_share_spearman"):
        return []
    of_count, less = (number(row, name) for name in ("visible_share_spearman", "minus_visible_share"))
    words = (
        f"Beside it, the share of markers that calibrated expects to be seen ranks with ρ = {of_count}; calibrated "
        f"PSS less that: {less}. Measured PSS and the share triangulated have ρ = "
        f"{_two(row['triangulated_share_spearman'])}."
    )
    return [words]


def _process(rows: Sequence[CsvRow]) -> str:
    """The filter at each level of process noise, by the calibrated model."""
    head = ["q/c", "frames per second that are alike", "ρ of calibrated PSS", "ρ of the share seen", "difference",
            "ρ of measured PSS and the share triangulated", "(2b) / (2a), predicted: counts × per marker",
            "measured: counts × per marker"]  # fmt: skip
    lines = [_line(head), "|" + "---|" * len(head)]
    for row in sorted(all_of(rows, noise_model="calibrated"), key=lambda row: -float(row["q_over_c"])):
        mark = (
            ", headline"
            if row["headline"] == "yes"
            else ", the schedule's own"
            if row["is_schedule_process"] == "yes"
            else ""
        )
        ratios = [
            _product(row[f"{side}_closer_over_farther"], row[f"{side}_closer_over_farther_of_counts"])
            for side in ("predicted", "measured")
        ]
        lines.append(
            _line(
                [
                    f"{float(row['q_over_c']):,.4g}{mark}",
                    f"{float(row['equivalent_frame_rate_hz']):,.0f}",
                    *(number(row, name) for name in ("spearman", "visible_share_spearman", "minus_visible_share")),
                    _two(row["triangulated_share_spearman"]),
                    *ratios,
                ]
            )
        )
    words = (
        "The filter at other process noise: q is the variance that a marker's position gathers between two frames, c "
        "that of a single frame as the physical R predicts it for the training views. Where q is far above c, the "
        "measured PSS of the filter is the share of markers triangulated times a constant. The headline is at q = c."
    )
    return words + "\n\n" + "\n".join(lines)


def _product(ratio: str, of_counts: str) -> str:
    """0.87 = 0.90 × 0.97; empty where it is not defined."""
    if not ratio or not of_counts or float(of_counts) == 0:
        return ""
    return f"{_two(ratio)} = {_two(of_counts)} × {float(ratio) / float(of_counts):.2f}"


def _two(value: str) -> str:
    return f"{float(value):.2f}".replace("-", "−") if value else "undefined"


def _claims(rows: Sequence[CsvRow]) -> str:
    heads = ["the paper's claim", "kind", *(" ".join(filter(None, side)) for side in SIDES), "figure", "where"]
    lines = [_line(heads), "|" + "---|" * len(heads)]
    for claim, kind, at in dict.fromkeys((row["claim"], row["kind"], _place(row)) for row in rows):
        cells, figure, places = [], "", []
        for side, model in SIDES:
            found = [r for r in all_of(rows, claim=claim, kind=kind, side=side, noise_model=model) if _place(r) == at]
            if not found:
                cells.append("")
                continue
            row = found[0]
            figure = row["statistic"]
            places.append(row["where"].removeprefix("highest at ").replace("-", "−"))
            cells.append(
                f"{row['holds']}: {with_range(row['value'], row['ci_low'], row['ci_high'])}{_factors(row)}"
                if row["value"]
                else row["holds"]
            )
        where = ", ".join(dict.fromkeys(place for place in places if place))
        lines.append(_line([claim, kind, *cells, figure.partition(" (median")[0], where]))
    if not any(row.get("of_counts") for row in rows):
        return "\n".join(lines)
    words = (
        "In brackets behind a ratio, how much of it is a ratio of counts (of markers expected to be seen, or "
        "triangulated) and how much is per marker that counts; of a share, the same share of the count:"
    )
    return words + "\n\n" + "\n".join(lines)


def _factors(row: CsvRow) -> str:
    """What of a claim's figure is a count."""
    if not row.get("of_counts"):
        return ""
    if not row.get("per_marker_ci_low"):
        return f" (of counts {_two(row['of_counts'])})"
    return f" (counts {_two(row['of_counts'])} × per marker {number(row, 'per_marker')})"


def _place(row: CsvRow) -> str:
    """What distinguishes two rows of one claim: the zoom limit, not the place of the figure."""
    return (
        row["where"] if row["where"].startswith(("zoom limit", "x")) else row["statistic"] if not row["where"] else ""
    )


def _strategies(tables: Tables) -> str:
    """Ranks by prediction and by every measure, without a zoom limit."""
    rows = all_of(tables["strategies"], avatar="both", zoom_limit="none")
    names = list(dict.fromkeys(row["strategy"] for row in rows))
    lines = [_line(["rank by", *names]), "|" + "---|" * (len(names) + 1)]
    for model, figure in dict.fromkeys((row["noise_model"], row["statistic"]) for row in rows):
        if model not in ("", "corrected", "calibrated"):
            continue
        of_figure = {row["strategy"]: row for row in all_of(rows, noise_model=model, statistic=figure)}
        cells = [
            f"{float(row['rank']):g} [{float(row['rank_ci_low']):g}, {float(row['rank_ci_high']):g}]"
            for row in (of_figure[name] for name in names)
        ]
        lines.append(_line([f"{figure}, {model}" if model else figure, *cells]))
    ranking = [
        row
        for row in all_of(tables["ranking"], avatar="both", zoom_limit="none", noise_model="calibrated")
        if row["measure"] in STATED
    ]
    choices = [
        [
            row["kind"],
            row["measure"],
            number(row, "spearman"),
            row["chosen"],
            row["best"],
            percent(row["regret"]),
            number(row, "visible_share_spearman"),
            row.get("visible_share_chosen") or NOTHING,
            percent(row.get("visible_share_regret", "")),
        ]
        for row in ranking
    ]
    heads = ["calibrated PSS", "measured by", "ρ over the strategies", "chooses", "best", "loses"]
    heads += ["ρ of the expected share of markers", "it chooses", "it loses"]
    return "\n".join(lines) + "\n\n" + markdown_table(heads, choices)


def _real_walk(consistency: Sequence[CsvRow], misfit: Sequence[CsvRow], frames: Sequence[CsvRow]) -> str:
    heads = ["markers", "tracked", "NEES/3 before an update (of the process)", "after", "within 95 %, after",
             "RMS after: measured", "claimed", "lost", "density of acceleration"]  # fmt: skip
    lines = [_line(heads), "|" + "---|" * len(heads)]
    for row in all_of(consistency, min_views="2"):
        density = one_of(misfit, group=row["group"])["density_m2_s3"]
        errors = (_millimetres(row[f"posterior_{name}"]) for name in ("rms_m", "claimed_rms_m"))
        lines.append(
            _line(
                [
                    row["group"],
                    f"{100 * float(row['share_tracked']):.0f} %",
                    number(row, "prior_nees_per_dof"),
                    number(row, "posterior_nees_per_dof"),
                    f"{100 * float(row['posterior_coverage_95'] or 'nan'):.0f} %",
                    *errors,
                    f"{row['track_losses']} ({row['reacquired']} found again)",
                    f"{float(density):.2g} m²/s³",
                ]
            )
        )
    (whole,) = all_of(consistency, group="both", min_views="0")
    of_both = all_of(frames, avatar="both")
    medians = {name: _median([row[f"{name}_median_m"] for row in of_both]) for name in ("measured", "predicted")}
    found, foreseen = (_millimetres(str(medians[name])) for name in ("measured", "predicted"))
    walked = (
        "The real walk, {} frames of {} trials, by a real filter over rendered motion: over all tracked cells NEES/3 "
        "is {} after an update, against the covariance of the time-varying Riccati recursion. Before an update it "
        "tests whether the gait is as lively as the process assumes, and not R or the views."
    ).format(whole["frames"], whole["trials"], number(whole, "posterior_nees_per_dof"))
    erred = (
        f"In the median frame the median marker's error is {found}; the metric's own recursion, which uses no "
        f"detection, predicts {foreseen}."
    )
    stated = [walked, erred]
    table = "Of frames in which two views or more updated a marker, by avatar and part of the body:"
    return "\n\n".join([*stated, table, "\n".join(lines)])


def _median(values: Sequence[str]) -> float:
    known = [float(value) for value in values if value]
    return statistics.median(known) if known else float("nan")


def _millimetres(metres: str) -> str:
    return f"{1000 * float(metres):.2g} mm" if metres else ""


def _line(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"
