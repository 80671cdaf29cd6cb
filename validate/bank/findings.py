"""The findings of a bank's tables, a sentence each with its number and interval, made from the CSV files."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

__all__ = ["findings", "read_tables"]

Row = Mapping[str, str]
Tables = Mapping[str, Sequence[Row]]

HEADLINE = "4"
SINGLE_FRAME, FILTER, UNDER = "measured_pss_single_frame", "measured_pss_filter", "share_under_5mm"
OF_THE_PAPER = ("as-printed", "corrected", "identity")
# Ties are said aloud: metrics whose rank intervals reach this one's.
BEST_SHOWN = 5


def read_tables(folder: Path) -> dict[str, list[dict[str, str]]]:
    """The CSV files of a bank's results, by name without the ending."""
    found = {}
    for path in sorted(folder.glob("*.csv")):
        with path.open(encoding="utf-8", newline="") as file:
            found[path.stem] = list(csv.DictReader(file))
    return found


def findings(tables: Tables, second: str = "atrium") -> str:
    """The page's text, in Markdown."""
    parts = [
        ("Does it rank configurations?", _ranking(tables)),
        ("What is the ceiling?", _ceiling(tables)),
        ("Against the rivals", _rivals(tables)),
        ("What does choosing by it cost?", _regret(tables)),
        ("Is the error as large as predicted?", _size(tables, "consistency")),
        ("What holds it back?", _parts(tables)),
        ("The filter", _filter(tables)),
        ("Pixels", _pixels(tables)),
        ("What is seen and found", _detection(tables)),
    ]
    if f"{second}-consistency" in tables:
        parts.append(("In another room, without refitting", _second(tables, second)))
    return "\n\n".join(f"## {title}\n\n" + "\n".join(f"- {line}" for line in lines) for title, lines in parts) + "\n"


def _ranking(tables: Tables) -> list[str]:
    lines = []
    for model, how in (("calibrated", "fitted on other views"), ("physical", "without any fit")):
        row = _pss(tables, model)
        partial = _number(row, "partial_given_visible")
        lines.append(
            f"Among {row['n']} held-out configurations of four cameras, single-frame PSS with the {model} R "
            f"({how}) ranks by "
            f"measured PSS with ρ = {_number(row, 'spearman')}; given the visible share, {partial}."
        )
    said = [f"{model} {_number(_pss(tables, model), 'spearman')}" for model in OF_THE_PAPER]
    lines.append("The same with the other R (identity is R = I): " + "; ".join(said) + ".")
    for model in ("calibrated", "physical", "as-printed"):
        row = _of(tables["leaderboard"], cameras=HEADLINE, yardstick=FILTER, metric="pss", noise_model=model)
        lines.append(
            f"The paper's PSS (σ∞) with the {model} R ranks by the filter's measured PSS with ρ = "
            f"{_number(row, 'spearman')}."
        )
    counts = sorted({row["cameras"] for row in tables["leaderboard"]}, key=int)
    by_count = [f"{count}: {_number(_pss(tables, 'calibrated', cameras=count), 'spearman')}" for count in counts]
    lines.append("By the number of cameras, calibrated: " + "; ".join(by_count) + ".")
    return lines


def _ceiling(tables: Tables) -> list[str]:
    lines = []
    for row in tables["ceiling"]:
        if row["cameras"] != HEADLINE:
            continue
        ratio = row["median_abs_log_ratio"]
        tail = f"; |log(predicted/measured RMS)| has the median {float(ratio):.2f}" if ratio else ""
        lines.append(f"{row['ceiling'].capitalize()}: ρ = {_number(row, 'spearman')}{tail}.")
    lines.append("The oracle's R are the pixel errors of one half of the trials; it is judged on the other half.")
    return lines


def _rivals(tables: Tables) -> list[str]:
    rows = _all(tables["leaderboard"], cameras=HEADLINE, yardstick=SINGLE_FRAME)
    rows = [row for row in rows if row["spearman"]]
    rows.sort(key=lambda row: -float(row["spearman"]))
    own = _of(rows, metric="pss-single-frame", noise_model="calibrated")
    tied = [row for row in rows if row is not own and int(row["rank_ci_low"]) <= int(own["rank_ci_high"])]
    tied = [row for row in tied if int(row["rank_ci_high"]) >= int(own["rank_ci_low"])]
    lines = [
        (
            f"Of {len(rows)} pairs of a metric and a noise model, calibrated single-frame PSS has the rank "
            f"{own['rank']} [{own['rank_ci_low']}, {own['rank_ci_high']}]; the rank intervals of {len(tied)} others "
            "reach into its own."
        )
    ]
    for row in rows[:BEST_SHOWN]:
        lines.append(f"{row['rank']}. {row['metric']} ({row['noise_model']}): ρ = {_number(row, 'spearman')}.")
    free = [row for row in rows if "pss" not in row["metric"] and "optimality" not in row["metric"]]
    if free:
        row = free[0]
        lines.append(
            f"The best that knows no covariance of its own kind is {row['metric']}: ρ = "
            f"{_number(row, 'spearman')}; its "
            f"difference to calibrated single-frame PSS is {_number(row, 'minus_pss_single_frame')}."
        )
    count = _of(rows, metric="visibility-count")
    lines.append(f"Counting visible points: ρ = {_number(count, 'spearman')}.")
    under = _pss(tables, "calibrated", yardstick=UNDER)
    lines.append(
        f"By a yardstick that is nobody's, the share of all points within 5 mm, calibrated single-frame PSS "
        f"has the rank "
        f"{under['rank']} [{under['rank_ci_low']}, {under['rank_ci_high']}] with ρ = {_number(under, 'spearman')}."
    )
    return lines


def _regret(tables: Tables) -> list[str]:
    lines = []
    for model in ("calibrated", "physical", "corrected", "as-printed", "identity"):
        row = _pss(tables, model)
        parts = [
            f"of {size}: {_percent(row[f'regret_of_{size}_median'])} (mean {_percent(row[f'regret_of_{size}_mean'])})"
            for size in (5, 20, 100)
        ]
        lines.append(
            f"Choosing by single-frame PSS, {model} R, loses of the best measured PSS in the median {'; '.join(parts)}."
        )
    row = _of(
        tables["leaderboard"],
        cameras=HEADLINE,
        yardstick=SINGLE_FRAME,
        metric="pss-single-frame",
        noise_model="calibrated",
    )
    lines.append(
        f"The oracle, who chooses by the other half of the trials, loses "
        f"{_percent(row['oracle_regret_of_20_median'])} of 20."
    )
    return lines


def _size(tables: Tables, name: str) -> list[str]:
    lines = []
    for model in ("calibrated", "physical", "as-printed", "corrected"):
        row = _of(tables[name], level="single frame", cameras=HEADLINE, noise_model=model)
        coverage = ", ".join(f"{100 * float(row[f'coverage_{level}']):.1f}" for level in (50, 90, 95))
        lines.append(
            f"{model}: |log(predicted/measured RMS)| of a point has the median "
            f"{float(row['median_abs_log_ratio']):.2f}; "
            f"NEES/3 = {_number(row, 'nees_per_dof')}; the 50, 90 and 95 % ellipsoids hold {coverage} %; over "
            f"all points "
            f"ρ = {_number(row, 'point_spearman')}."
        )
    row = _of(tables[name], level="single frame", cameras=HEADLINE, noise_model="calibrated")
    lines.append(
        f"Ellipsoids, calibrated: axis ratio in the median {float(row['predicted_axis_ratio_median']):.1f} "
        f"predicted and "
        f"{float(row['measured_axis_ratio_median']):.1f} measured; long axes differ by "
        f"{float(row['axis_angle_median_deg']):.0f}° in the median."
    )
    return lines


def _parts(tables: Tables) -> list[str]:
    lines = []
    for row in tables["parts"]:
        coverage = ", ".join(f"{100 * float(row[f'coverage_{level}']):.1f}" for level in (50, 90, 95))
        lines.append(
            f"{row['prediction']}: ρ = {_number(row, 'spearman')} over configurations, "
            f"{_number(row, 'point_spearman')} over points; |log ratio| {float(row['median_abs_log_ratio']):.2f}; "
            f"NEES/3 = {_number(row, 'nees_per_dof')}; ellipsoids hold {coverage} %."
        )
    return lines


def _filter(tables: Tables) -> list[str]:
    lines = []
    for model in ("calibrated", "physical", "as-printed", "corrected"):
        rows = [
            _of(tables["consistency"], level=f"filter, {kind}", cameras=HEADLINE, noise_model=model)
            for kind in ("prior", "posterior")
        ]
        lines.append(
            f"{model}: predicted over measured RMS of the filter's a-priori error "
            f"{float(rows[0]['predicted_over_measured_rms_median']):.2f} "
            f"in the median, a-posteriori {float(rows[1]['predicted_over_measured_rms_median']):.2f}; a filter "
            f"that used this R itself "
            f"would err {float(rows[0]['sandwich_over_claimed_median']):.2f} times what it claims."
        )
    return lines


def _pixels(tables: Tables) -> list[str]:
    lines = []
    for row in tables["consistency"]:
        if row["level"] == "pixel":
            lines.append(
                f"{row['noise_model']}: NEES/2 = {_number(row, 'nees_per_dof')}; |log ratio| of σ in the median "
                f"{float(row['median_abs_log_ratio']):.2f}, its scatter less the trials' own "
                f"{float(row['log_scatter']):.2f}."
            )
    return lines


def _detection(tables: Tables) -> list[str]:
    row = tables["detection"][0]
    return [
        (
            f"Of all pairs of a view and a marker, {_percent(row['visible_detected'])} are predicted visible and "
            "found, "
            f"{_percent(row['visible_missed'])} predicted visible and missed, {_percent(row['hidden_detected'])} "
            f"predicted hidden "
            f"and found, {_percent(row['hidden_missed'])} neither."
        )
    ]


def _second(tables: Tables, second: str) -> list[str]:
    board = f"{second}-leaderboard"
    lines = []
    for model in ("calibrated", "physical"):
        row = _pss(tables, model, board)
        lines.append(f"{model}: ρ = {_number(row, 'spearman')} over {row['n']} configurations of four cameras.")
    return lines + _size(tables, f"{second}-consistency")


def _pss(
    tables: Tables, model: str, board: str = "leaderboard", cameras: str = HEADLINE, yardstick: str = SINGLE_FRAME
) -> Row:
    """The row of single-frame PSS under a noise model."""
    return _of(tables[board], cameras=cameras, yardstick=yardstick, metric="pss-single-frame", noise_model=model)


def _all(rows: Sequence[Row], **wanted: str) -> list[Row]:
    return [row for row in rows if all(row[key] == value for key, value in wanted.items())]


def _of(rows: Sequence[Row], **wanted: str) -> Row:
    return _all(rows, **wanted)[0]


def _number(row: Row, name: str) -> str:
    if not row[name]:
        return "undefined"
    value, low, high = (float(row[key] or "nan") for key in (name, f"{name}_ci_low", f"{name}_ci_high"))
    return f"{value:.2f} [{low:.2f}, {high:.2f}]"


def _percent(value: str) -> str:
    return f"{100 * float(value):.1f} %"
