"""The third sentence: σ∞ against counts of what is visible."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pss.hints import CsvRow
from validate.findings.contenders import CALIBRATED, PHYSICAL
from validate.findings.places import COUNT, SHARE, Place
from validate.findings.process import MOTIONS, at_headline, at_the_scenes, less_counts, level_words, ratio_words
from validate.findings.sentence import LESS_COUNT, Sentence, from_to, own_population
from validate.runs.csv_file import value_of
from validate.runs.numbers import number

__all__ = ["process_sentence"]


# Two ρ that differ by less rank alike.
ALIKE = 0.005


def process_sentence(places: Sequence[Place]) -> Sentence | None:
    """The third sentence; None where σ∞ has not been judged."""
    there, judged = [], []
    for place in places:
        rows = [row for motion in MOTIONS if (row := at_headline(place, CALIBRATED, motion))]
        judged += [found for row in rows if (found := less_counts(row))]
        there += [place] * bool(rows)
    at_scenes, alike = _at_the_scenes(places)
    if not judged:
        claim = "σ∞ has been judged only at the scenes' own process noise"
        claim += ", where it ranks as a count does." if alike else "."
        judged_there = [place for place in places if at_the_scenes(place, CALIBRATED)]
        return Sentence(claim, at_scenes, own_population(judged_there, places)) if at_scenes else None
    better = [found for found in judged if all(low > 0 for _, low, _ in found)]
    where = f" in {len(better)} of {len(judged)} comparisons" * (len(better) < len(judged))
    if not better:
        where = f" in any of {len(judged)} comparisons"
    verb = "ranks better than" if better else "is not shown to rank better than"
    claim = (
        f"Where process and measurement weigh alike (q ≈ c), calibrated σ∞ {verb} both counts of what is visible{where}"
    )
    claim += "; at the scenes' own 1 mm a frame it ranks as one of them does." if alike else "."
    first = there[0]
    row = next(row for motion in MOTIONS if (row := at_headline(first, CALIBRATED, motion)))
    parts = [
        f"less that of the expected {words} {number(row, column)}"
        for words, column in (
            ("count of cameras (at most three a point)", LESS_COUNT),
            ("share of points that two cameras see", "minus_visible_share"),
        )
        if not math.isnan(value_of(row, column))
    ]
    least = from_to(min(value for value, *_ in found) for found in judged)
    numbers = (
        f"In the {first.title}, {level_words(row)} ({ratio_words(row)}): ρ = {number(row, 'spearman')}, "
        f"{', '.join(parts)}; less that of the stronger count {least} over all comparisons. {at_scenes}"
    )
    return Sentence(claim, numbers.strip(), own_population(there, places))


def _at_the_scenes(places: Sequence[Place]) -> tuple[str, bool]:
    """σ∞ beside the counts at the scenes' own process noise, and whether it ranks like one of them in all places."""
    alike, first = [], ""
    for place in places:
        row = at_the_scenes(place, CALIBRATED)
        if row is None:
            continue
        models = (CALIBRATED, PHYSICAL)
        rows = [
            next(filter(None, (at_the_scenes(place, model, name) for model in models)), None) for name in (COUNT, SHARE)
        ]
        counts = [count for count in rows if count is not None]
        if not counts:
            continue
        nearest = min(counts, key=lambda count: abs(_rho(count) - _rho(row)))
        alike.append(abs(_rho(nearest) - _rho(row)) < ALIKE)
        if not first:
            words = {COUNT: "the count of cameras", SHARE: "the share that two cameras see"}[nearest["metric"]]
            rhos = f"{number(row, 'spearman')} against {number(nearest, 'spearman')} of {words}"
            first = f"At 1 mm a frame ρ is {rhos}."
    return first, bool(alike) and all(alike)


def _rho(row: CsvRow | None) -> float:
    return value_of(row, "spearman")
