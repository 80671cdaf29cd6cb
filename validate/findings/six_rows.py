"""The README's six rows: a finding, its number with the 95 % interval, and the population that the number is of.

What a row claims follows from the tables by the same rules as the sentences of the findings; a row without tables is
left out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from pss.hints import CsvRow
from validate.findings.contenders import CALIBRATED, IDENTITY, PHYSICAL, PRINTED
from validate.findings.places import Place, places_of_reference
from validate.findings.process import MOTIONS, at_headline, less_counts, level_words
from validate.findings.sentence import DIFFERENCE, LESS_COUNT
from validate.findings.sentence_choosing import lost_rankings, with_ends
from validate.findings.sentence_printed import is_better
from validate.findings.sentence_ranking import NEUTRAL, decided, neutral_row
from validate.findings.sentence_size import RIGHT_SIZE
from validate.runs.csv_file import bounds, read_tables, value_of
from validate.runs.numbers import NOTHING, number, percent_with_range
from validate.runs.table_text import markdown_table

__all__ = ["six_rows"]

HEADS = ("finding", "number [95 % interval]", "population of the number")
REGRET, NEES = "regret_of_20_mean", "nees_per_dof"
# How an error of calibration varies, by its kind in calibration_error.csv.
WHEN = {"frozen": ", fixed while the cameras stand,", "each frame": ", drawn anew each frame,"}
Row = tuple[str, str, str]


def six_rows(reference: Path) -> str:
    """The table in Markdown.

    Args:
        reference: folder with the tables of the banks and calibration_error.csv.
    """
    places = places_of_reference(reference)
    found = [make(places) for make in (_as_printed, _ranking, _process, _size, _choosing)] if places else []
    rows = [row for row in found if row is not None]
    if errors := _calibration(read_tables(reference).get("calibration_error", [])):
        rows.append(errors)
    return markdown_table(HEADS, rows)


def _as_printed(places: Sequence[Place]) -> Row | None:
    there = [place for place in places if place.ranked(PRINTED) and place.ranked(IDENTITY)]
    if not there:
        return None
    better = sum(map(is_better, there))
    verb = "ranks" if better else "is not shown to rank"
    claim = f"The paper's R, as printed, {verb} better than R = I ({better} of {_cases(there)})"
    less = number(there[0].less(PRINTED, IDENTITY), DIFFERENCE)
    return claim, f"ρ less that of R = I: {less}", _configurations(there[0])


def _ranking(places: Sequence[Place]) -> Row | None:
    there = [place for place in places if place.ranked(CALIBRATED)]
    if not there:
        return None
    least = min(value_of(place.ranked(CALIBRATED), "spearman") for place in there)
    claim = f"Calibrated single-frame PSS ranks by measured PSS with ρ of {least:.2f} or more in {_cases(there)}"
    known, count, pss = decided(there, NEUTRAL)
    figures = f"ρ = {number(there[0].ranked(CALIBRATED), 'spearman')}"
    if known:
        claim += (
            "; by the share of points with error below 0.1 mm, the expected count of cameras ranks better in "
            f"{len(count)}, PSS in {len(pss)}"
        )
        figures += f"; below 0.1 mm, less that of the count: {number(neutral_row(known[0], NEUTRAL), LESS_COUNT)}"
    return claim, figures, _configurations(there[0])


def _process(places: Sequence[Place]) -> Row | None:
    found = [(place, row) for place in places for motion in MOTIONS if (row := at_headline(place, CALIBRATED, motion))]
    judged = [less for _, row in found if (less := less_counts(row))]
    if not judged:
        return None
    better = sum(all(low > 0 for _, low, _ in less) for less in judged)
    verb = "ranks" if better else "is not shown to rank"
    claim = (
        "Where process and measurement noise weigh alike, calibrated σ∞ "
        f"{verb} better than both counts of what is visible ({better} of {len(judged)} comparisons)"
    )
    place, row = found[0]
    columns = (LESS_COUNT, "minus_visible_share")
    less = " and ".join(number(row, column) for column in columns if not math.isnan(value_of(row, column)))
    figures = f"ρ = {number(row, 'spearman')}; less those of the counts: {less}"
    return claim, figures, f"{_configurations(place)}, {level_words(row)}"


def _size(places: Sequence[Place]) -> Row | None:
    there = [place for place in places if place.sized(CALIBRATED)]
    if not there:
        return None
    low, high = RIGHT_SIZE
    ends = [bounds(place.sized(CALIBRATED), NEES) for place in there]
    right = sum(low <= value <= high for value, *_ in ends)
    whole = sum(low <= lower and upper <= high for _, lower, upper in ends)
    claim = (
        f"Calibrated, errors have the predicted size (NEES/3 from {low:g} to {high:g}) in {right} of {_cases(there)}, "
        f"with the whole interval in {whole or 'none'}"
    )
    first = there[0]
    figures = f"NEES/3 = {number(first.sized(CALIBRATED), NEES)}; `physical`: {number(first.sized(PHYSICAL), NEES)}"
    return claim, figures, _configurations(first)


def _choosing(places: Sequence[Place]) -> Row | None:
    there = [place for place in places if not math.isnan(value_of(place.ranked(CALIBRATED), REGRET))]
    if not there:
        return None
    most = max(there, key=lambda place: value_of(place.ranked(CALIBRATED), REGRET))
    claim = (
        "Choosing the best of 20 by calibrated PSS loses, on average, at most "
        f"{percent_with_range(most.ranked(CALIBRATED), REGRET)} of the best measured PSS ({most.title})"
    )
    first = there[0]
    figures = f"loses {percent_with_range(first.ranked(CALIBRATED), REGRET)}"
    others = [(model, percent_with_range(first.ranked(model), REGRET)) for model in (PRINTED, IDENTITY)]
    figures += "".join(f"; `{model}`: {text}" for model, text in others if text != NOTHING)
    return claim, figures, _configurations(first)


def _calibration(rows: Sequence[CsvRow]) -> Row | None:
    none, lost = lost_rankings(rows)
    if none is None or not lost:
        return None
    kind, row = min(lost.items(), key=lambda item: value_of(item[1], "pan_tilt_deg"))
    claim = f"An unknown pan and tilt error of {value_of(row, 'pan_tilt_deg'):g}°{WHEN.get(kind, '')} lowers ρ"
    draws = f", mean of {row['draws']} draws" if row.get("draws") else ""
    population = f"room: {none.get('n', NOTHING)} configurations of four cameras, `calibrated, limits`{draws}"
    return claim, f"from {with_ends(none)} to {with_ends(row)}", population


def _cases(places: Sequence[Place]) -> str:
    return f"{len(places)} cases" if len(places) > 1 else "one case"


def _configurations(place: Place) -> str:
    """How many configurations and views the numbers of a place are of."""
    counts = [row["n"] for model in place.models if (row := place.ranked(model)) and row.get("n")]
    text = f"{place.title}: {counts[0]} configurations of four cameras" if counts else place.title
    return text + f", {place.views} views" * bool(place.views)
