"""The five sentences that a reader takes home, each with its numbers, intervals and population, made from the tables.

What a sentence claims follows from the numbers: a difference counts if its interval has no zero in it, a size is right
if NEES is within `RIGHT_SIZE`. Other tables make other sentences.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from validate.findings.calibration_error import LOST
from validate.findings.contenders import IDENTITY, PRINTED
from validate.findings.places import COUNT, Place
from validate.findings.process import MOTIONS, at_headline, at_the_scenes, level_words
from validate.findings.tables import Row, all_of, bounds, number, percent_with_range, value_of, with_range

__all__ = ["Sentence", "five_sentences", "written"]

CALIBRATED, PHYSICAL, WHOLE = "calibrated", "physical", "physical, whole markers"
# NEES over its degrees of freedom of a prediction that is called right.
RIGHT_SIZE = (0.9, 1.1)
DIFFERENCE = "spearman_difference"
# Values of `kind` in calibration_error.csv, what each is judged over, and in words; earlier tables have no kinds.
BROKEN_BY = {
    "": ("", "by "),
    "each frame": ("over calibrations", "drawn anew each frame, by "),
    "frozen": ("within one calibration", "frozen as after a move to a preset, by "),
}
LEAST = "spearman_plain_least"
# Factors of a calibration that are not the paper's.
OWN_FACTORS = ("brightness-contrast", "floor")
CONDITIONS = "registered markers; dim light unless named; perfect calibration; a closed world"


@dataclass(frozen=True)
class Sentence:
    """One of the five: what it claims in a few words, the numbers for it, and of what population they are."""

    claim: str
    numbers: str
    population: str


def five_sentences(places: Sequence[Place], calibration_errors: Sequence[Row] = ()) -> list[Sentence]:
    """Those of the five for which there are tables.

    Args:
        places: of which the first is the one that the sentences begin with.
        calibration_errors: rows of calibration_error.csv.
    """
    if not places:
        return []
    makers = (_as_printed, _ranking, _process, _size)
    found = [sentence for maker in makers if (sentence := maker(places)) is not None]
    choosing = _choosing(places, calibration_errors)
    return [*found, choosing] if choosing else found


def written(sentences: Sequence[Sentence]) -> str:
    """As a numbered list in Markdown."""
    parts = [
        f"{place}. **{each.claim}** {each.numbers} *Population: {each.population}.*"
        for place, each in enumerate(sentences, 1)
    ]
    return "\n\n".join(parts)


def _as_printed(places: Sequence[Place]) -> Sentence | None:
    there = [place for place in places if place.ranked(PRINTED) and place.ranked(IDENTITY)]
    if not there:
        return None
    better = [place for place in there if _is_better(place)]
    verb = f"ranks better than R = I in {len(better)}" if better else "does not rank better than R = I in any"
    claim = f"As printed, the paper's metric {verb} of {_count(there)}."
    first, less = there[0], there[0].less(PRINTED, IDENTITY)
    numbers = (
        f"In the {first.title} single-frame PSS has ρ = {number(first.ranked(PRINTED), 'spearman')} as printed and "
        f"{number(first.ranked(IDENTITY), 'spearman')} with R = I"
    )
    numbers += f", a paired difference of {number(less, DIFFERENCE)}" if less else ""
    differences = [_difference(place) for place in there]
    numbers += f"; over all of them the difference is {_from_to(differences)}." if len(there) > 1 else "."
    return Sentence(claim, numbers, _population(there))


def _difference(place: Place) -> float:
    printed, identity = (value_of(place.ranked(name), "spearman") for name in (PRINTED, IDENTITY))
    return printed - identity


def _is_better(place: Place) -> bool:
    """By the interval of the paired difference; without one, by the interval of the worse against the better's ρ."""
    printed, identity = place.ranked(PRINTED), place.ranked(IDENTITY)
    if less := place.less(PRINTED, IDENTITY):
        return bounds(less, DIFFERENCE)[1] > 0
    return bounds(printed, "spearman")[1] > bounds(identity, "spearman")[0]


def _ranking(places: Sequence[Place]) -> Sentence | None:
    there = [place for place in places if place.ranked(CALIBRATED)]
    if not there:
        return None
    over = {
        name: [value_of(place.ranked(name), "spearman") for place in there] for name in (CALIBRATED, PHYSICAL, WHOLE)
    }
    claim = (
        f"Calibrated on other views, single-frame PSS ranks with ρ of {min(over[CALIBRATED]):.2f} or more in "
        f"{_count(there)}; with the physical R, which is fitted to nothing, {_from_to(over[PHYSICAL])}."
    )
    first = there[0]
    numbers = (
        f"In the {first.title} ρ = {number(first.ranked(CALIBRATED), 'spearman')} calibrated, "
        f"{number(first.ranked(PHYSICAL), 'spearman')} physical, {number(first.ranked(WHOLE), 'spearman')} with whole "
        "markers."
    )
    for place in there:
        if place.commits:
            steps = " and ".join(f"{what} in commit `{commit}`" for what, commit in place.commits.items())
            rho = number(place.ranked(CALIBRATED), "spearman")
            numbers += f" The {place.title} is prospective, {steps}: ρ = {rho} calibrated."
    return Sentence(claim, f"{numbers} {_weights(there)}".strip(), _population(there))


def _weights(places: Sequence[Place]) -> str:
    """What the calibrations make of the paper's factors."""
    fitted = [place.weights for place in places if place.weights]
    if not fitted:
        return ""
    scales = [weights.get(OWN_FACTORS[0], math.nan) for weights in fitted]
    others = sorted({name for weights in fitted for name in weights if name not in OWN_FACTORS})
    times = _from_to(scales)
    if others:
        return f"The calibrations give weight to {', '.join(others)} beside the physical factor's {times}."
    return f"Every calibration gives the paper's factors no weight: the fitted R is the physical one times {times}."


def _process(places: Sequence[Place]) -> Sentence | None:
    there, judged = [], []
    for place in places:
        rows = [row for motion in MOTIONS if (row := at_headline(place, CALIBRATED, motion))]
        judged += [bounds(row, "minus_visibility_count") for row in rows]
        there += [place] * bool(rows)
    at_scenes = _at_the_scenes(places)
    if not judged:
        claim = "σ∞ has been judged only at the scenes' own process noise, where it is nearly a count of points."
        judged_there = [place for place in places if at_the_scenes(place, CALIBRATED)]
        return Sentence(claim, at_scenes, _population(judged_there)) if at_scenes else None
    better = [low for _, low, _ in judged if low > 0]
    where = f" in {len(better)} of {len(judged)} comparisons" * (0 < len(better) < len(judged))
    verb = "ranks better than" if better else "does not rank better than"
    claim = f"Where process and measurement weigh alike (q ≈ c), calibrated σ∞ {verb} counting what is visible{where}."
    said = []
    for motion in MOTIONS:
        if row := at_headline(there[0], CALIBRATED, motion):
            count = at_headline(there[0], CALIBRATED, motion, COUNT)
            said.append(
                f"{level_words(row)}: ρ = {number(row, 'spearman')} against {number(count, 'spearman')} of the "
                f"expected count, a paired difference of {number(row, 'minus_visibility_count')}"
            )
    over = _from_to([value for value, *_ in judged])
    numbers = f"In the {there[0].title}, {'; '.join(said)}; over all comparisons the difference is {over}. {at_scenes}"
    return Sentence(claim, numbers.strip(), _population(there))


def _at_the_scenes(places: Sequence[Place]) -> str:
    place = next((place for place in places if at_the_scenes(place, CALIBRATED)), None)
    if place is None:
        return ""
    count = at_the_scenes(place, CALIBRATED, COUNT) or at_the_scenes(place, PHYSICAL, COUNT)
    return (
        f"At the scenes' own process noise, 1 mm a frame, it is {number(at_the_scenes(place, CALIBRATED), 'spearman')} "
        f"against {number(count, 'spearman')} in the {place.title}: nearly a count."
    )


def _size(places: Sequence[Place]) -> Sentence | None:
    there = [place for place in places if place.sized(CALIBRATED)]
    if not there:
        return None
    name = "nees_per_dof"
    right = [place for place in there if RIGHT_SIZE[0] <= value_of(place.sized(CALIBRATED), name) <= RIGHT_SIZE[1]]
    claim = f"Calibrated, the predicted variance of errors is right within 10 % in {len(right)} of {_count(there)}."
    first = there[0]
    numbers = (
        f"NEES/3 (above 1 errors are larger than predicted) is {number(first.sized(CALIBRATED), name)} in the "
        f"{first.title}, {number(first.sized(PHYSICAL), name)} by the physical R and "
        f"{number(first.sized(WHOLE), name)} with whole markers"
    )
    wrong = [f"{each.title} {number(each.sized(CALIBRATED), name)}" for each in there if each not in right]
    numbers += f"; calibrated it is not within {RIGHT_SIZE[0]:g} to {RIGHT_SIZE[1]:g} in {', '.join(wrong)}" * bool(
        wrong
    )
    known = [times for place in there if math.isfinite(times := _times(place.sized(PRINTED)))]
    if known:
        times = " to ".join(dict.fromkeys((_few(min(known)), _few(max(known)))))
        numbers += f". As printed, errors are predicted {times} times too large"
    return Sentence(claim, numbers + ".", _population(there))


def _times(row: Row | None) -> float:
    """Predicted over measured RMS, in the median of the points."""
    return math.exp(value_of(row, "median_log_ratio"))


def _few(value: float) -> str:
    return f"{float(f'{value:.2g}'):,.0f}" if value >= 10 else f"{value:.1f}"


def _choosing(places: Sequence[Place], calibration_errors: Sequence[Row]) -> Sentence | None:
    name = "regret_of_20_mean"
    there = [place for place in places if _has(place.ranked(CALIBRATED), name)]
    if not there:
        return None
    most = max(100 * value_of(place.ranked(CALIBRATED), name) for place in there)
    claim = f"Choosing the best of 20 by calibrated PSS costs {most:.1f} % of the best measured PSS or less on average"
    broken = _broken(calibration_errors)
    claim += "; small unknown errors of calibration break it." if broken else "."
    first = there[0]
    row = first.ranked(CALIBRATED)
    costs = [f"{percent_with_range(row, name)} calibrated"]
    costs += [f"{percent_with_range(first.ranked(model), name)} {model}" for model in (PHYSICAL, PRINTED, IDENTITY)]
    if _has(row, f"oracle_{name}"):
        costs.insert(0, f"{percent_with_range(row, f'oracle_{name}')} by the oracle")
    numbers = f"In the {first.title} the mean regret is {', '.join(costs)}."
    return Sentence(claim, f"{numbers} {broken}".strip(), _population(there))


def _broken(rows: Sequence[Row]) -> str:
    """From which unknown error of pan and tilt on the ranking is lost, drawn anew each frame and frozen."""
    alone = [row for row in rows if not (value_of(row, "focal_share") or value_of(row, "position_m"))]
    none = next((row for row in alone if value_of(row, "pan_tilt_deg") == 0), None)
    if none is None:
        return ""
    said = []
    for kind, (judged, words) in BROKEN_BY.items():
        of_kind = all_of(alone, kind=kind, judged=judged, weights="own" if kind else "")
        lost = next((row for row in of_kind if _rho(none) - _rho(row) > LOST), None)
        if lost is not None:
            drawn = lost.get("draws") and lost.get(LEAST)
            least = f", in one of {lost['draws']} draws to {with_range(lost[LEAST], '', '')}" if drawn else ""
            said.append(f"{words}{value_of(lost, 'pan_tilt_deg'):g}°, to {_with_ends(lost)}{least}")
    if not said:
        return ""
    return f"An unknown error of pan and tilt takes ρ from {_with_ends(none)} in the room: {'; '.join(said)}."


def _rho(row: Row) -> float:
    return value_of(row, "spearman_plain")


def _with_ends(row: Row) -> str:
    return with_range(*(row[f"spearman_plain{end}"] for end in ("", "_low", "_high")))


def _population(places: Sequence[Place]) -> str:
    """Of which configurations the numbers are, and under which conditions."""
    counts = dict.fromkeys(row["n"] for place in places if (row := _any_row(place)) and row.get("n"))
    each = f"{' or '.join(counts)} configurations of four cameras" + f" in each of {_count(places)}" * (len(places) > 1)
    of_what = ", ".join(dict.fromkeys(place.population for place in places))
    return f"{each}; settings of {of_what} camera places; {CONDITIONS}"


def _any_row(place: Place) -> Row | None:
    return next((row for model in place.models if (row := place.ranked(model))), None)


def _from_to(values: Sequence[float], digits: int = 2) -> str:
    """0.84 to 0.93, or one number if both are the same."""
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return "unknown"
    low, high = (f"{value:.{digits}f}".replace("-", "−") for value in (min(known), max(known)))
    return low if low == high else f"{low} to {high}"


def _has(row: Row | None, name: str) -> bool:
    return not math.isnan(value_of(row, name))


def _count(places: Sequence[Place]) -> str:
    return "one room and light" if len(places) == 1 else f"{len(places)} rooms and lights"
