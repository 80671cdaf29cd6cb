"""The fourth sentence: whether predicted errors have the right size."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pss.hints import CsvRow
from validate.findings.contenders import CALIBRATED, PHYSICAL, PRINTED, WHOLE_MARKERS
from validate.findings.places import Place
from validate.findings.sentence import Sentence, own_population, share_of
from validate.runs.csv_file import bounds, value_of
from validate.runs.numbers import number

__all__ = ["RIGHT_SIZE", "size_sentence"]


# NEES over its degrees of freedom of a prediction that is called right.
RIGHT_SIZE = (0.9, 1.1)


def size_sentence(places: Sequence[Place]) -> Sentence | None:
    """The fourth sentence; None where no calibrated prediction has a NEES."""
    there = [place for place in places if place.sized(CALIBRATED)]
    if not there:
        return None
    name = "nees_per_dof"
    low, high = RIGHT_SIZE
    right = [place for place in there if low <= value_of(place.sized(CALIBRATED), name) <= high]
    ends = [bounds(place.sized(CALIBRATED), name)[1:] for place in there]
    whole = sum(low <= lower and upper <= high for lower, upper in ends)
    claim = f"Calibrated, NEES/3 lies within {low:g} to {high:g} in {share_of(right, there)}"
    claim += f"; its whole interval does in {whole if whole else 'none'}."
    first = there[0]
    numbers = (
        f"NEES/3 (above 1 errors are larger than predicted) is {number(first.sized(CALIBRATED), name)} in the "
        f"{first.title}, {number(first.sized(PHYSICAL), name)} by the physical R and "
        f"{number(first.sized(WHOLE_MARKERS), name)} with whole markers"
    )
    wrong = [f"{number(each.sized(CALIBRATED), name)} ({each.title})" for each in there if each not in right]
    numbers += f"; calibrated and outside: {', '.join(wrong)}" * bool(wrong)
    known = [times for place in there if math.isfinite(times := _times(place.sized(PRINTED)))]
    if known:
        times = " to ".join(dict.fromkeys((_few(min(known)), _few(max(known)))))
        numbers += f". As printed, errors are predicted {times} times as large as measured"
    return Sentence(claim, numbers + ".", own_population(there, places))


def _times(row: CsvRow | None) -> float:
    """Predicted over measured RMS, in the median of the points."""
    return math.exp(value_of(row, "median_log_ratio"))


def _few(value: float) -> str:
    return f"{float(f'{value:.2g}'):,.0f}" if value >= 10 else f"{value:.1f}"
