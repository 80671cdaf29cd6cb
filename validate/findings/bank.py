"""The findings of a bank's tables, a sentence each with its number and interval, made from the CSV files."""

from __future__ import annotations

from validate.findings.tables import Row, Tables, all_of, number, one_of, percent

__all__ = ["bank_findings", "written"]

HEADLINE = "4"
SINGLE_FRAME, FILTER, UNDER = "measured_pss_single_frame", "measured_pss_filter", "share_under_5mm"
OF_THE_PAPER = ("as-printed", "corrected", "identity")
JUDGED = (
    ("calibrated", "R and limits of detection fitted on other views"),
    ("physical, whole markers", "the physical R and whole markers, without any fit,"),
    ("calibrated R", "R fitted on other views and the paper's visibility"),
    ("physical", "the physical R and the paper's visibility, without any fit,"),
)
COUNTED = (
    ("physical", "points"),
    ("physical, whole markers", "whole markers"),
    ("calibrated", "markers within the limits"),
)
SIZED = ("calibrated", "physical, whole markers", "calibrated R", "physical", "as-printed", "corrected")
# Ties are said aloud: metrics whose rank intervals reach this one's.
BEST_SHOWN = 5


def bank_findings(tables: Tables, second: str = "atrium") -> str:
    """The page's text, in Markdown."""
    parts: list[tuple[str, str | list[str]]] = [
        ("Does it rank configurations?", _ranking(tables)),
        ("What is the ceiling?", _ceiling(tables)),
        ("Against the rivals", _rivals(tables)),
        ("What does choosing by it cost?", _regret(tables)),
        ("Is the error as large as predicted?", _size(tables, "consistency")),
        ("What holds it back?", _parts(tables)),
        ("How much depends on the open constants?", _sensitivity(tables)),
        ("The filter", _filter(tables)),
        ("Pixels", _pixels(tables)),
        ("What is seen and found", _detection(tables)),
    ]
    if f"{second}-consistency" in tables:
        parts.append(("In another room, without refitting", _second(tables, second)))
    return "\n\n".join(f"## {title}\n\n" + written(said) for title, said in parts) + "\n"


def written(said: str | list[str]) -> str:
    """A table as it is, sentences as a list."""
    return said if isinstance(said, str) else "\n".join(f"- {line}" for line in said)


def _ranking(tables: Tables) -> list[str]:
    lines = []
    for name, how in JUDGED:
        row = _pss(tables, name)
        partial = number(row, "partial_given_visible")
        lines.append(
            f"Among {row['n']} held-out configurations of four cameras, single-frame PSS with {how} ranks by "
            f"measured PSS with ρ = {number(row, 'spearman')}; given the visible share, {partial}."
        )
    said = [f"{model} {number(_pss(tables, model), 'spearman')}" for model in OF_THE_PAPER]
    lines.append("The same with the other R (identity is R = I): " + "; ".join(said) + ".")
    for name in ("calibrated", "physical, whole markers", "calibrated R", "physical", "corrected", "as-printed"):
        row = one_of(tables["leaderboard"], cameras=HEADLINE, yardstick=FILTER, metric="pss", noise_model=name)
        lines.append(
            f"The paper's PSS (σ∞), {name}, ranks by the filter's measured PSS with ρ = {number(row, 'spearman')}."
        )
    counts = sorted({row["cameras"] for row in tables["leaderboard"]}, key=int)
    for name in ("calibrated", "physical"):
        by_count = [f"{count}: {number(_pss(tables, name, cameras=count), 'spearman')}" for count in counts]
        lines.append(f"By the number of cameras, {name}: " + "; ".join(by_count) + ".")
    return lines


def _ceiling(tables: Tables) -> list[str]:
    lines = []
    for row in tables["ceiling"]:
        if row["cameras"] != HEADLINE:
            continue
        ratio = row["median_abs_log_ratio"]
        tail = f"; |log(predicted/measured RMS)| has the median {float(ratio):.2f}" if ratio else ""
        lines.append(f"{row['ceiling'].capitalize()}: ρ = {number(row, 'spearman')}{tail}.")
    lines.append("The oracle's R are the pixel errors of one half of the trials; it is judged on the other half.")
    return lines


def _rivals(tables: Tables) -> list[str]:
    rows = all_of(tables["leaderboard"], cameras=HEADLINE, yardstick=SINGLE_FRAME)
    rows = [row for row in rows if row["spearman"]]
    rows.sort(key=lambda row: -float(row["spearman"]))
    own = one_of(rows, metric="pss-single-frame", noise_model="calibrated")
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
        lines.append(f"{row['rank']}. {row['metric']} ({row['noise_model']}): ρ = {number(row, 'spearman')}.")
    free = [row for row in rows if "pss" not in row["metric"] and "optimality" not in row["metric"]]
    if free:
        row = free[0]
        lines.append(
            f"The best that knows no covariance of its own kind is {row['metric']}: ρ = "
            f"{number(row, 'spearman')}; its "
            f"difference to calibrated single-frame PSS is {number(row, 'minus_pss_single_frame')}."
        )
    for name, what in COUNTED:
        count = one_of(rows, metric="visibility-count", noise_model=name)
        lines.append(f"Counting visible {what}: ρ = {number(count, 'spearman')}.")
    under = _pss(tables, "calibrated", yardstick=UNDER)
    lines.append(
        f"By a yardstick that is nobody's, the share of all points within 5 mm, calibrated single-frame PSS "
        f"has the rank "
        f"{under['rank']} [{under['rank_ci_low']}, {under['rank_ci_high']}] with ρ = {number(under, 'spearman')}."
    )
    return lines


def _regret(tables: Tables) -> list[str]:
    lines = []
    for model in (*(name for name, _ in JUDGED), "corrected", "as-printed", "identity"):
        row = _pss(tables, model)
        parts = [
            f"of {size}: {percent(row[f'regret_of_{size}_median'])} (mean {percent(row[f'regret_of_{size}_mean'])})"
            for size in (5, 20, 100)
        ]
        lines.append(
            f"Choosing by single-frame PSS, {model}, loses of the best measured PSS in the median {'; '.join(parts)}."
        )
    row = one_of(
        tables["leaderboard"],
        cameras=HEADLINE,
        yardstick=SINGLE_FRAME,
        metric="pss-single-frame",
        noise_model="calibrated",
    )
    lines.append(
        f"The oracle, who chooses by the other half of the trials, loses "
        f"{percent(row['oracle_regret_of_20_median'])} of 20."
    )
    return lines


def _size(tables: Tables, name: str) -> list[str]:
    lines = []
    for model in SIZED:
        row = one_of(tables[name], level="single frame", cameras=HEADLINE, noise_model=model)
        lines.append(
            f"{model}: |log(predicted/measured RMS)| of a point has the median "
            f"{float(row['median_abs_log_ratio']):.2f}; "
            f"NEES/3 = {number(row, 'nees_per_dof')}; the 50, 90 and 95 % ellipsoids hold {_coverage(row)} %; over "
            f"all points "
            f"ρ = {number(row, 'point_spearman')}."
        )
    row = one_of(tables[name], level="single frame", cameras=HEADLINE, noise_model="calibrated")
    lines.append(
        f"Ellipsoids, calibrated: axis ratio in the median {float(row['predicted_axis_ratio_median']):.1f} "
        f"predicted and "
        f"{float(row['measured_axis_ratio_median']):.1f} measured; long axes differ by "
        f"{float(row['axis_angle_median_deg']):.0f}° in the median."
    )
    return lines


def _parts(tables: Tables) -> str:
    """A table: each R with each kind of visibility."""
    heads = ("R", "visible", "ρ of configurations", "ρ of points", "\\|log ratio\\|", "NEES/3", "50, 90, 95 % hold")
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for row in tables["parts"]:
        cells = (
            row["noise_model"],
            row["visibility"],
            number(row, "spearman"),
            number(row, "point_spearman"),
            f"{float(row['median_abs_log_ratio']):.2f}",
            number(row, "nees_per_dof"),
            _coverage(row),
        )
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _sensitivity(tables: Tables) -> list[str]:
    lines = []
    for model in ("as-printed", "corrected"):
        rows = [row for row in tables["sensitivity"] if row["noise_model"] == model]
        alone = [row for row in rows if row["varied"].endswith("alone")]
        band = [float(row["spearman"]) for row in rows if row not in alone]
        lines.append(
            f"{model}: with the scale of Eq. 11 or the CCDnoise of Eqs. 12 and 13 ten times smaller or larger, ρ is "
            f"{min(band):.2f} to {max(band):.2f}."
        )
        said = "; ".join(f"{row['varied'].removesuffix(' alone')} {number(row, 'spearman')}" for row in alone)
        lines.append(f"{model}, each factor alone: {said}.")
    return lines


def _filter(tables: Tables) -> list[str]:
    lines = []
    for model in SIZED:
        prior, posterior = (
            one_of(tables["consistency"], level=f"filter, {kind}", cameras=HEADLINE, noise_model=model)
            for kind in ("prior", "posterior")
        )
        name = "predicted_over_measured_rms_median"
        lines.append(
            f"{model}: predicted over measured RMS of the filter's a-priori error {float(prior[name]):.2f} in the "
            f"median, a-posteriori {float(posterior[name]):.2f}; NEES/3 = {number(prior, 'nees_per_dof')} a-priori, "
            f"{number(posterior, 'nees_per_dof')} a-posteriori; the 50, 90 and 95 % ellipsoids of the latter hold "
            f"{_coverage(posterior)} %; a filter that used this R itself would err "
            f"{float(prior['sandwich_over_claimed_median']):.2f} times what it claims."
        )
    return lines


def _pixels(tables: Tables) -> list[str]:
    lines = []
    for row in tables["consistency"]:
        if row["level"] == "pixel":
            lines.append(
                f"{row['noise_model']}: NEES/2 = {number(row, 'nees_per_dof')}; |log ratio| of σ in the median "
                f"{float(row['median_abs_log_ratio']):.2f}, its scatter less the trials' own "
                f"{float(row['log_scatter']):.2f}."
            )
    return lines


def _detection(tables: Tables) -> list[str]:
    blunders = one_of(tables["blunders"], cameras=HEADLINE)
    said = (
        f"Of the detections that went into configurations of four cameras, {percent(blunders['rejected_share'])} "
        f"({blunders['detections_rejected']} of "
        f"{int(blunders['detections_rejected']) + int(blunders['detections_kept'])}) were thrown out by their "
        "reprojection χ², which needs no truth."
    )
    return [
        (
            f"Of all pairs of a view and a marker, by {row['visibility']}, {percent(row['visible_detected'])} are "
            f"predicted visible and found, {percent(row['visible_missed'])} predicted visible and missed, "
            f"{percent(row['hidden_detected'])} predicted hidden and found, {percent(row['hidden_missed'])} neither."
        )
        for row in tables["detection"]
    ] + [said]


def _second(tables: Tables, second: str) -> list[str]:
    board = f"{second}-leaderboard"
    lines = []
    for model, _ in JUDGED:
        row = _pss(tables, model, board)
        lines.append(f"{model}: ρ = {number(row, 'spearman')} over {row['n']} configurations of four cameras.")
    return lines + _size(tables, f"{second}-consistency")


def _pss(
    tables: Tables, model: str, board: str = "leaderboard", cameras: str = HEADLINE, yardstick: str = SINGLE_FRAME
) -> Row:
    """The row of single-frame PSS under a noise model."""
    return one_of(tables[board], cameras=cameras, yardstick=yardstick, metric="pss-single-frame", noise_model=model)


def _coverage(row: Row) -> str:
    return ", ".join(f"{100 * float(row[f'coverage_{level}']):.1f}" for level in (50, 90, 95))
