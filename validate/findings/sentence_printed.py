"""The first sentence: whether the paper's R, as printed, ranks better than R = I."""

from __future__ import annotations

from collections.abc import Sequence

from validate.findings.contenders import CALIBRATED, IDENTITY, PHYSICAL, PRINTED
from validate.findings.places import FILTER, Place
from validate.findings.sentence import DIFFERENCE, Sentence, any_of, from_to, own_population, share_of
from validate.runs.csv_file import bounds, value_of
from validate.runs.numbers import number

__all__ = ["is_better", "printed_sentence"]


def printed_sentence(places: Sequence[Place]) -> Sentence | None:
    """The first sentence, with the paired differences to R = I; None without both in any place."""
    there = [place for place in places if place.ranked(PRINTED) and place.ranked(IDENTITY)]
    if not there:
        return None
    better = [place for place in there if is_better(place)]
    if better:
        claim = f"The paper's R, as printed, ranks better than R = I in {share_of(better, there)}."
    else:
        claim = f"The paper's R, as printed, is not shown to rank better than R = I in {any_of(there)}."
    first, less = there[0], there[0].less(PRINTED, IDENTITY)
    numbers = (
        f"In the {first.title} single-frame PSS has ρ = {number(first.ranked(PRINTED), 'spearman')} as printed and "
        f"{number(first.ranked(IDENTITY), 'spearman')} with R = I"
    )
    numbers += f", a paired difference of {number(less, DIFFERENCE)}" if less else ""
    numbers += f"; over all of them {from_to(map(_difference, there))}." if len(there) > 1 else "."
    return Sentence(
        claim, " ".join(filter(None, (numbers, _power(there), _at_one_mm(there)))), own_population(there, places)
    )


def _difference(place: Place) -> float:
    printed, identity = (value_of(place.ranked(name), "spearman") for name in (PRINTED, IDENTITY))
    return printed - identity


def is_better(place: Place) -> bool:
    """By the interval of the paired difference; without one, by the interval of the worse against the better's ρ."""
    printed, identity = place.ranked(PRINTED), place.ranked(IDENTITY)
    if less := place.less(PRINTED, IDENTITY):
        return bounds(less, DIFFERENCE)[1] > 0
    return bounds(printed, "spearman")[1] > bounds(identity, "spearman")[0]


def _power(places: Sequence[Place]) -> str:
    """What the same test shows of other contenders."""
    shown = []
    for model in ("corrected", PHYSICAL, CALIBRATED):
        ends = [bounds(less, DIFFERENCE)[1] for place in places if (less := place.less(model, IDENTITY))]
        if ends:
            shown.append((model, sum(low > 0 for low in ends), len(ends)))
    if not shown:
        return ""
    weak = "The test has little power: it" if any(count < total for *_, count, total in shown) else "The same test"
    better = ", ".join(f"`{model}` in {count}" for model, count, _ in shown)
    return f"{weak} shows as better than R = I {better} of {shown[0][2]}."


def _at_one_mm(places: Sequence[Place]) -> str:
    """The paper's own metric, σ∞, at the scenes' process noise."""
    there = [(place, less) for place in places if (less := place.less(PRINTED, IDENTITY, FILTER))]
    if not there:
        return ""
    worse = sum(bounds(less, DIFFERENCE)[2] < 0 for _, less in there)
    better = sum(bounds(less, DIFFERENCE)[1] > 0 for _, less in there)
    place, less = there[0]
    text = f"For σ∞ at 1 mm a frame the difference is {number(less, DIFFERENCE)} in the {place.title}"
    counts = [f"{words} in {count}" for words, count in (("worse", worse), ("better", better)) if count]
    text += f" ({', '.join(counts)} of {len(there)})" if counts else ""
    if scaled := place.less(f"{PRINTED}, scaled", f"{IDENTITY}, scaled", FILTER):
        text += f", and {number(scaled, DIFFERENCE)} with both scaled to the training views"
    return f"{text}."
