"""Tables: whether errors are as large as predicted, what holds a prediction back, what is seen and found."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pss.hints import CsvRow
from validate.findings.contenders import contenders_in
from validate.findings.places import HEADLINE, Place
from validate.runs.csv_file import all_of, bounds, first_of, value_of
from validate.runs.numbers import NOTHING, in_powers, number, percent
from validate.runs.table_text import markdown_table
from validate.stats.shares import share_interval

__all__ = [
    "axes_table",
    "detection_table",
    "nees_table",
    "parts_table",
    "ratio_table",
    "reliability_table",
    "scale_table",
    "sensitivity_table",
    "share_found",
]

LEVELS = ("pixel", "single frame", "filter, prior", "filter, posterior")
# Of errors that are right, so many lie within the ellipsoids.
COVERAGE = (50, 90, 95)


def nees_table(places: Sequence[Place]) -> str:
    """NEES over its degrees of freedom, by level and contender.

    That of P⁻ is there for filters at q ≈ c alone: with more process noise it is 1 by construction.
    """
    rows = []
    for level in LEVELS:
        if level == "filter, prior" and not any(place.rows("process") for place in places):
            continue
        for model in _models(places, level):
            cells = [_short(place.sized(model, level), "nees_per_dof") for place in places]
            rows.append([level, model, *cells])
    return markdown_table(["level", "R", *(place.title for place in places)], rows)


def ratio_table(places: Sequence[Place]) -> str:
    """Single frame: predicted over measured RMS, the size of its logarithm, coverage, ρ over points."""
    rows = []
    for place in places:
        for model in _models([place], "single frame"):
            row = place.sized(model)
            if row is None:
                continue
            ratio = math.exp(value_of(row, "median_log_ratio"))
            rows.append(
                [
                    place.title,
                    model,
                    in_powers(ratio, 3) if math.isfinite(ratio) else NOTHING,
                    _two(row, "median_abs_log_ratio"),
                    ", ".join(f"{100 * value_of(row, f'coverage_{level}'):.1f}" for level in COVERAGE),
                    number(row, "point_spearman"),
                ]
            )
    heads = ["where", "R", "predicted / measured RMS", "\\|log ratio\\|", "50, 90, 95 % hold %", "ρ of points"]
    return markdown_table(heads, rows)


def axes_table(places: Sequence[Place]) -> str:
    """How long error ellipsoids are, beside what is predicted after as many trials if that is known."""
    columns = {
        "predicted_axis_ratio_median": "predicted",
        "axis_ratio_after_trials_median": "expected after as many trials",
        "measured_axis_ratio_median": "measured",
    }
    rows = []
    for place in places:
        for model in _models([place], "single frame"):
            row = place.sized(model)
            ratios = [f"{value_of(row, column):.1f}" for column in columns]
            angle = f"{value_of(row, 'axis_angle_median_deg'):.0f}°"
            rows.append([place.title, model, *(NOTHING if "nan" in cell else cell for cell in (*ratios, angle))])
    return markdown_table(["where", "R", *columns.values(), "angle between long axes"], rows)


def parts_table(place: Place) -> str:
    """Each R with each kind of visibility."""
    rows = [
        [
            row["noise_model"],
            row["visibility"],
            number(row, "spearman"),
            number(row, "point_spearman"),
            _two(row, "median_abs_log_ratio"),
            _short(row, "nees_per_dof"),
            ", ".join(f"{100 * value_of(row, f'coverage_{level}'):.1f}" for level in COVERAGE),
        ]
        for row in place.rows("parts")
    ]
    heads = ["R", "visible", "ρ of configurations", "ρ of points", "\\|log ratio\\|", "NEES/3", "50, 90, 95 % hold %"]
    return markdown_table(heads, rows)


def sensitivity_table(places: Sequence[Place]) -> str:
    """ρ with an open constant of the paper ten times smaller or larger, and with one factor alone."""
    keys = list(
        dict.fromkeys(
            (row["noise_model"], row["varied"], row.get("multiplier", ""))
            for place in places
            for row in place.rows("sensitivity")
        )
    )
    rows = []
    for model, varied, times in keys:
        found = [
            first_of(place.rows("sensitivity"), noise_model=model, varied=varied, multiplier=times) for place in places
        ]
        what = varied if varied.endswith("alone") else f"{varied} × {times}"
        rows.append([model, what, *(number(row, "spearman") for row in found)])
    return markdown_table(["R", "varied", *(place.title for place in places)], rows)


def scale_table(places: Sequence[Place]) -> str:
    """ρ of σ∞ by the unit of R: the model times a number, and times the one that fits the training views."""
    keys = dict.fromkeys((row["noise_model"], row["multiplier"]) for place in places for row in place.rows("scale"))
    rows = []
    for model, times in keys:
        found = [first_of(place.rows("scale"), noise_model=model, multiplier=times) for place in places]
        fitted = any(row and row.get("fitted") == "yes" for row in found)
        words = f"× {in_powers(float(times), 3)}" + " (fitted)" * fitted
        rows.append([model, words, *(number(row, "spearman") for row in found)])
    return markdown_table(["R", "times", *(place.title for place in places)], rows)


def detection_table(places: Sequence[Place]) -> str:
    """Shares of pairs of a view and a marker, predicted visible × found; blunders by camera count of the headline."""
    rows = []
    for place in places:
        blunders = first_of(place.rows("blunders"), cameras=HEADLINE)
        for row in place.rows("detection"):
            shares = (row.get(f"{a}_{b}", "") for a in ("visible", "hidden") for b in ("detected", "missed"))
            thrown = percent(blunders.get("rejected_share", "")) if blunders else NOTHING
            scores = (f"{value_of(row, name):.3f}" if _there(row, name) else NOTHING for name in ("brier", "log_loss"))
            rows.append([place.title, row["visibility"], *map(percent, shares), thrown, *scores])
    heads = ["where", "visible by", "seen, found", "seen, missed", "hidden, found", "neither", "thrown out by χ²"]
    heads += ["Brier score", "log loss"]
    return markdown_table(heads, rows)


def reliability_table(places: Sequence[Place]) -> str:
    """What reliability.csv has: predicted probability of detection beside the share found."""
    heads = list(dict.fromkeys(key for place in places for row in place.rows("reliability") for key in row))
    shown = [head for head in heads if not head.endswith(("_ci_low", "_ci_high"))]
    rows = [
        [place.title, *(_cell(row, head) for head in shown)]
        for place in places
        for row in map(_within_a_share, place.rows("reliability"))
    ]
    return markdown_table(["where", *(head.replace("_", " ") for head in shown)], rows)


def share_found(row: CsvRow) -> tuple[float, float, float]:
    """The share found of a row of reliability.csv and the ends of its interval, which are shares too."""
    share, low, high = bounds(row, "found")
    views = value_of(row, "views")
    return share, *share_interval(share, low, high, 0 if math.isnan(views) else int(views))


def _within_a_share(row: CsvRow) -> CsvRow:
    ends = zip(("found", "found_ci_low", "found_ci_high"), share_found(row), strict=True)
    return {**row} | {name: f"{value:.7g}" for name, value in ends if row.get(name)}


def _cell(row: CsvRow, column: str) -> str:
    text = row.get(column, "")
    try:
        value = float(text)
    except ValueError:
        return text or NOTHING
    return number(row, column) if f"{column}_ci_low" in row else (f"{value:.3g}" if value % 1 else f"{value:.0f}")


def _short(row: CsvRow | None, name: str) -> str:
    """A NEES; far below 1 by powers of ten, without an interval that would read 0.00."""
    value = value_of(row, name)
    return in_powers(value, 1) if 0 < value < 0.005 else number(row, name)


def _two(row: CsvRow, name: str) -> str:
    return f"{value_of(row, name):.2f}" if _there(row, name) else NOTHING


def _there(row: CsvRow | None, name: str) -> bool:
    return not math.isnan(value_of(row, name))


def _models(places: Sequence[Place], level: str) -> list[str]:
    rows = [row for place in places for row in all_of(place.rows("consistency"), level=level)]
    return [contender.name for contender in contenders_in(row["noise_model"] for row in rows)]
