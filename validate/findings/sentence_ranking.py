"""The second sentence: how calibrated PSS ranks configurations, and how counting does."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pss.hints import CsvRow
from validate.findings.contenders import CALIBRATED, PHYSICAL, WHOLE_MARKERS
from validate.findings.places import Place
from validate.findings.sentence import LESS_COUNT, Sentence, from_to, own_population
from validate.runs.csv_file import bounds, value_of
from validate.runs.numbers import in_powers, number

__all__ = ["NEUTRAL", "decided", "neutral_row", "ranking_sentence"]


# Measures that have no metric's form: the first decides what a sentence claims, in the room twice the median error.
NEUTRAL, MEDIAN = "share_under_0.1mm", "median_rms_m"
# Factors of a calibration that are not the paper's.
OWN_FACTORS = ("brightness-contrast", "floor")


def ranking_sentence(places: Sequence[Place]) -> Sentence | None:
    """The second sentence; None where no calibrated prediction is ranked."""
    there = [place for place in places if place.ranked(CALIBRATED)]
    if not there:
        return None
    rhos = [value_of(place.ranked(CALIBRATED), "spearman") for place in there]
    claim = (
        f"Calibrated on other views, single-frame PSS ranks with ρ of {min(rhos):.2f} or more by measured PSS, which "
        f"is the metric's own form{_by_neutral(there)}."
    )
    first = there[0]
    rho = (
        f"In the {first.title} ρ = {number(first.ranked(CALIBRATED), 'spearman')}; "
        f"{number(first.ranked(PHYSICAL), 'spearman')} with the physical R, which is fitted to nothing, and "
        f"{number(first.ranked(WHOLE_MARKERS), 'spearman')} for whole markers."
    )
    numbers = [rho]
    for place in there:
        if place.commits:
            steps = " and ".join(f"{what} in commit `{commit}`" for what, commit in place.commits.items())
            rho = number(place.ranked(CALIBRATED), "spearman")
            numbers.append(f"The {place.title} is prospective, {steps}: ρ = {rho}.")
    numbers += [_less_its_count(there), _weights(there)]
    return Sentence(claim, " ".join(filter(None, numbers)), own_population(there, places))


def decided(places: Sequence[Place], measure: str) -> tuple[list[Place], list[Place], list[Place]]:
    """The places with a difference to the count by this measure, those where the count is better, and where PSS is."""
    found = [(place, bounds(neutral_row(place, measure), LESS_COUNT)) for place in places]
    known = [(place, ends) for place, ends in found if not math.isnan(ends[1])]
    count, pss = ([place for place, ends in known if test(ends)] for test in (_below_zero, _above_zero))
    return [place for place, _ in known], count, pss


def neutral_row(place: Place, measure: str) -> CsvRow | None:
    """The leaderboard's row of calibrated single-frame PSS by a measure."""
    return place.ranked(CALIBRATED, "pss-single-frame", measure)


def _below_zero(ends: tuple[float, float, float]) -> bool:
    return ends[2] < 0


def _above_zero(ends: tuple[float, float, float]) -> bool:
    return ends[1] > 0


def _by_neutral(places: Sequence[Place]) -> str:
    known, count, pss = decided(places, NEUTRAL)
    if not known:
        return ""
    parts = [f"{words} in {len(where)}" for words, where in (("counting ranks better", count), ("PSS", pss)) if where]
    text = (
        f"{' and '.join(parts)} of {len(known)} cases" if parts else "neither it nor counting is shown to rank better"
    )
    return f"; by the share of points within 0.1 mm {text}"


def _less_its_count(places: Sequence[Place]) -> str:
    """ρ less that of the expected count, by the measures that have no metric's form."""
    known, count, pss = decided(places, NEUTRAL)
    if not known:
        return ""
    named = [place for place in known if place in count or place in pss] or known[:1]
    each = ", ".join(f"{number(neutral_row(place, NEUTRAL), LESS_COUNT)} ({place.title})" for place in named)
    text = f"Within 0.1 mm its ρ less that of the expected count is {each}"
    known, count, pss = decided(places, MEDIAN)
    if known:
        least = min(known, key=lambda place: value_of(neutral_row(place, MEDIAN), LESS_COUNT))
        ranks = [
            f"{words} ranks better in {len(where)}" for words, where in (("the count", count), ("PSS", pss)) if where
        ]
        of = f" of {len(known)}"
        text += f"; by the median RMS {(' and '.join(ranks) or 'neither is shown to rank better in any') + of}"
        text += f", by most in the {least.title}: {number(neutral_row(least, MEDIAN), LESS_COUNT)}" * bool(count)
    return f"{text}."


def _weights(places: Sequence[Place]) -> str:
    """What the calibrations make of the paper's factors."""
    fitted = [place.weights for place in places if place.weights]
    if not fitted:
        return ""
    scales = [weights.get(OWN_FACTORS[0], math.nan) for weights in fitted]
    times = from_to(scales)
    others = [
        f"{name} {in_powers(weight)} in the {place.title}"
        for place in places
        for name, weight in sorted(place.weights.items())
        if name not in OWN_FACTORS
    ]
    if others:
        return f"Of the paper's factors some have a weight: {', '.join(others)}. The physical factor's is {times}."
    return f"Every calibration gives the paper's factors no weight: the fitted R is the physical one times {times}."
