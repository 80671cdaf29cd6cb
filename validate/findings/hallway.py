"""The hallway's findings: strategies over the steps of a walk, the paper's claims, and the real walk."""

from __future__ import annotations

from collections.abc import Sequence

from validate.findings.tables import Row, Tables, all_of, number, one_of, with_range

__all__ = ["hallway_findings"]

MODELS = ("as-printed", "corrected", "physical", "physical, whole markers", "calibrated")
# Yardsticks that sentences are made of; the table has them all.
SAID = ("measured PSS, filter", "measured PSS, single frame", "share under 0.05 mm", "share under 5 mm", "median RMS")
OF_THE_PAPER = ("as-printed", "corrected")
KINDS = ("filter", "single frame")
# Columns of the claims' table.
SIDES = (("predicted", "corrected"), ("predicted", "calibrated"), ("measured", ""))


def hallway_findings(tables: Tables) -> str:
    """Tables and sentences, in Markdown; the real walk's if it was rendered."""
    parts = [_agreement(tables["agreement"]), _claims(tables["claims"]), _strategies(tables)]
    if "walk_consistency" in tables:
        parts.append(_real_walk(tables["walk_consistency"], tables["walk_misfit"], tables["walk"]))
    return "\n\n".join(parts)


def _agreement(rows: Sequence[Row]) -> str:
    """Predicted against measured PSS over the steps."""
    chosen = all_of(rows, avatar="both", zoom_limit="none")
    head = ["strategy", *(f"{model}, {kind}" for kind in KINDS for model in ("corrected", "physical", "calibrated"))]
    lines = [_line(head), "|" + "---|" * len(head)]
    for strategy in dict.fromkeys(row["strategy"] for row in chosen):
        cells = []
        for kind in KINDS:
            for model in ("corrected", "physical", "calibrated"):
                row = one_of(chosen, strategy=strategy, kind=kind, noise_model=model)
                cells.append(f"{number(row, 'spearman')}; {float(row['median_abs_log_ratio']):.2f}")
        lines.append(_line([strategy, *cells]))
    said = []
    for kind, words in zip(KINDS, ("the paper's PSS (σ∞) beside the filter's", "single-frame PSS"), strict=True):
        of_all = [one_of(chosen, strategy="all", kind=kind, noise_model=model) for model in MODELS]
        each = "; ".join(f"{row['noise_model']} {number(row, 'spearman')}" for row in of_all)
        in_metres = [row for row in of_all if row["noise_model"] not in OF_THE_PAPER]
        ratios = "; ".join(f"{row['noise_model']} {number(row, 'median_abs_log_ratio')}" for row in in_metres)
        said.append(f"- Over all strategies and steps, {words}: ρ = {each}.")
        said.append(f"- The median of |log(predicted/measured)|, {words}: {ratios}.")
    by_strategy = "By strategy, ρ over its steps with its interval, and the median |log ratio|:"
    return "\n\n".join(["\n".join(said), by_strategy, "\n".join(lines)])


def _claims(rows: Sequence[Row]) -> str:
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
            figure = row["figure"]
            places.append(row["at"].removeprefix("highest at ").replace("-", "−"))
            cells.append(
                f"{row['holds']}: {with_range(row['value'], row['ci_low'], row['ci_high'])}"
                if row["value"]
                else row["holds"]
            )
        where = ", ".join(dict.fromkeys(place for place in places if place))
        lines.append(_line([claim, kind, *cells, figure.partition(" (median")[0], where]))
    return "\n".join(lines)


def _place(row: Row) -> str:
    """What tells two rows of one claim apart: the zoom limit, and not where the figure was found."""
    return row["at"] if row["at"].startswith(("zoom limit", "x")) else row["figure"] if not row["at"] else ""


def _strategies(tables: Tables) -> str:
    """Ranks by prediction and by every yardstick, without a zoom limit."""
    rows = all_of(tables["strategies"], avatar="both", zoom_limit="none")
    names = list(dict.fromkeys(row["strategy"] for row in rows))
    lines = [_line(["rank by", *names]), "|" + "---|" * (len(names) + 1)]
    for model, figure in dict.fromkeys((row["noise_model"], row["figure"]) for row in rows):
        if model not in ("", "corrected", "calibrated"):
            continue
        of_figure = {row["strategy"]: row for row in all_of(rows, noise_model=model, figure=figure)}
        cells = [
            f"{float(row['rank']):g} [{float(row['rank_ci_low']):g}, {float(row['rank_ci_high']):g}]"
            for row in (of_figure[name] for name in names)
        ]
        lines.append(_line([f"{figure}, {model}" if model else figure, *cells]))
    ranking = [
        row
        for row in all_of(tables["ranking"], avatar="both", zoom_limit="none", noise_model="calibrated")
        if row["yardstick"] in SAID
    ]
    said = [
        f"- By {row['kind']} PSS (calibrated) against {row['yardstick']}: ρ = {number(row, 'spearman')} over "
        f"{row['strategies']} strategies; it chooses {row['chosen']}, the best is {row['best']}"
        + (f", and that loses {100 * float(row['regret']):.1f} %." if row["regret"] else ".")
        for row in ranking
    ]
    return "\n".join(lines) + "\n\n" + "\n".join(said)


def _real_walk(consistency: Sequence[Row], misfit: Sequence[Row], frames: Sequence[Row]) -> str:
    heads = ["markers", "tracked", "NEES/3 before an update", "after", "within 95 %, after", "RMS after: measured",
             "believed", "lost", "density of acceleration"]  # fmt: skip
    lines = [_line(heads), "|" + "---|" * len(heads)]
    for row in all_of(consistency, least_views="2"):
        density = one_of(misfit, group=row["group"])["density_m2_s3"]
        errors = (_millimetres(row[f"posterior_{name}"]) for name in ("rms_m", "believed_rms_m"))
        lines.append(
            _line(
                [
                    row["group"],
                    f"{100 * float(row['share_tracked']):.0f} %",
                    number(row, "prior_nees_per_dof"),
                    number(row, "posterior_nees_per_dof"),
                    f"{100 * float(row['posterior_coverage_95'] or 'nan'):.0f} %",
                    *errors,
                    f"{row['losses']} ({row['found_again']} found again)",
                    f"{float(density):.2g} m²/s³",
                ]
            )
        )
    (whole,) = all_of(consistency, group="both", least_views="0")
    of_both = all_of(frames, avatar="both")
    medians = {name: _median([row[f"{name}_median_m"] for row in of_both]) for name in ("measured", "predicted")}
    nees = (number(whole, f"{when}_nees_per_dof") for when in ("prior", "posterior"))
    found, foreseen = (_millimetres(str(medians[name])) for name in ("measured", "predicted"))
    walked = (
        "- The real walk, {} frames of {} trials: over all tracked cells NEES/3 is {} before an update and {} after, "
        "against the covariance of the time-varying Riccati recursion."
    ).format(whole["frames"], whole["trials"], *nees)
    erred = (
        f"- In the median frame the median marker's error is {found}; the metric's own recursion, which knows no "
        f"detection, says {foreseen}."
    )
    said = [walked, erred]
    table = "Of frames in which two views or more updated a marker, by avatar and part of the body:"
    return "\n\n".join(["\n".join(said), table, "\n".join(lines)])


def _median(values: Sequence[str]) -> float:
    known = sorted(float(value) for value in values if value)
    return known[len(known) // 2] if known else float("nan")


def _millimetres(metres: str) -> str:
    return f"{1000 * float(metres):.2g} mm" if metres else ""


def _line(cells: list[str]) -> str:
    return "| " + " | ".join(cells) + " |"
