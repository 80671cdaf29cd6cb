"""The five main findings in a sentence each, with numbers and intervals from the tables.

What a sentence claims follows from the numbers: a difference counts if its interval has no zero in it, a size is right
if NEES is within `RIGHT_SIZE`. Other tables make other sentences.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from pss.hints import CsvRow
from validate.findings.calibration_error import LOST
from validate.findings.contenders import CALIBRATED, IDENTITY, PHYSICAL, PRINTED, WHOLE_MARKERS
from validate.findings.places import COUNT, FILTER, SHARE, Place
from validate.findings.population import cases, common_population, titles
from validate.findings.process import (
    MOTIONS,
    at_headline,
    at_the_scenes,
    less_counts,
    level_words,
    ratio_words,
)
from validate.runs.csv_file import all_of, bounds, value_of
from validate.runs.numbers import in_powers, number, percent_with_range, signed, with_range

__all__ = [
    "DIFFERENCE",
    "LESS_COUNT",
    "NEUTRAL",
    "RIGHT_SIZE",
    "Sentence",
    "decided",
    "five_sentences",
    "is_better",
    "lost_rankings",
    "neutral_row",
    "with_ends",
    "with_population",
]

# NEES over its degrees of freedom of a prediction that is called right.
RIGHT_SIZE = (0.9, 1.1)
DIFFERENCE, LESS_COUNT = "spearman_difference", "minus_visibility_count"
# Measures that have no metric's form: the first decides what a sentence claims, in the room twice the median error.
NEUTRAL, MEDIAN = "share_under_0.1mm", "median_rms_m"
# Two ρ that differ by less rank alike.
ALIKE = 0.005
# Values of `kind` in calibration_error.csv, what each is judged over, and in words; earlier tables have no kinds.
BROKEN_BY = {
    "": ("", ""),
    "each frame": ("over calibrations", "drawn anew each frame, "),
    "frozen": ("within one calibration", "frozen as after a move to a preset, "),
}
LEAST = "spearman_plain_min"
# Factors of a calibration that are not the paper's.
OWN_FACTORS = ("brightness-contrast", "floor")


@dataclass(frozen=True)
class Sentence:
    """One of the five: what it claims in a few words, the numbers for it, and its population where it is its own."""

    claim: str
    numbers: str
    population: str = ""


def five_sentences(places: Sequence[Place], calibration_errors: Sequence[CsvRow] = ()) -> list[Sentence]:
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


def with_population(places: Sequence[Place], calibration_errors: Sequence[CsvRow] = ()) -> str:
    """The sentences as a numbered list in Markdown, and below it the population that they share."""
    parts = [
        f"{place}. **{each.claim}** {each.numbers}" + f" *{each.population}.*" * bool(each.population)
        for place, each in enumerate(five_sentences(places, calibration_errors), 1)
    ]
    return "\n\n".join([*parts, common_population(places)] if parts else [])


# ---- 1: the paper's R ------------------------------------------------------------------------------------------------


def _as_printed(places: Sequence[Place]) -> Sentence | None:
    there = [place for place in places if place.ranked(PRINTED) and place.ranked(IDENTITY)]
    if not there:
        return None
    better = [place for place in there if is_better(place)]
    if better:
        claim = f"The paper's R, as printed, ranks better than R = I in {_share(better, there)}."
    else:
        claim = f"The paper's R, as printed, is not shown to rank better than R = I in {_any(there)}."
    first, less = there[0], there[0].less(PRINTED, IDENTITY)
    numbers = (
        f"In the {first.title} single-frame PSS has ρ = {number(first.ranked(PRINTED), 'spearman')} as printed and "
        f"{number(first.ranked(IDENTITY), 'spearman')} with R = I"
    )
    numbers += f", a paired difference of {number(less, DIFFERENCE)}" if less else ""
    numbers += f"; over all of them {_from_to(map(_difference, there))}." if len(there) > 1 else "."
    return Sentence(claim, " ".join(filter(None, (numbers, _power(there), _at_one_mm(there)))), _own(there, places))


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


# ---- 2: ranking ------------------------------------------------------------------------------------------------------


def _ranking(places: Sequence[Place]) -> Sentence | None:
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
    return Sentence(claim, " ".join(filter(None, numbers)), _own(there, places))


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
    times = _from_to(scales)
    others = [
        f"{name} {in_powers(weight)} in the {place.title}"
        for place in places
        for name, weight in sorted(place.weights.items())
        if name not in OWN_FACTORS
    ]
    if others:
        return f"Of the paper's factors some have a weight: {', '.join(others)}. The physical factor's is {times}."
    return f"Every calibration gives the paper's factors no weight: the fitted R is the physical one times {times}."


# ---- 3: σ∞ against counts --------------------------------------------------------------------------------------------


def _process(places: Sequence[Place]) -> Sentence | None:
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
        return Sentence(claim, at_scenes, _own(judged_there, places)) if at_scenes else None
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
    least = _from_to(min(value for value, *_ in found) for found in judged)
    numbers = (
        f"In the {first.title}, {level_words(row)} ({ratio_words(row)}): ρ = {number(row, 'spearman')}, "
        f"{', '.join(parts)}; less that of the stronger count {least} over all comparisons. {at_scenes}"
    )
    return Sentence(claim, numbers.strip(), _own(there, places))


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


# ---- 4: size ---------------------------------------------------------------------------------------------------------


def _size(places: Sequence[Place]) -> Sentence | None:
    there = [place for place in places if place.sized(CALIBRATED)]
    if not there:
        return None
    name = "nees_per_dof"
    low, high = RIGHT_SIZE
    right = [place for place in there if low <= value_of(place.sized(CALIBRATED), name) <= high]
    ends = [bounds(place.sized(CALIBRATED), name)[1:] for place in there]
    whole = sum(low <= lower and upper <= high for lower, upper in ends)
    claim = f"Calibrated, NEES/3 lies within {low:g} to {high:g} in {_share(right, there)}"
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
    return Sentence(claim, numbers + ".", _own(there, places))


def _times(row: CsvRow | None) -> float:
    """Predicted over measured RMS, in the median of the points."""
    return math.exp(value_of(row, "median_log_ratio"))


def _few(value: float) -> str:
    return f"{float(f'{value:.2g}'):,.0f}" if value >= 10 else f"{value:.1f}"


# ---- 5: choosing -----------------------------------------------------------------------------------------------------


def _choosing(places: Sequence[Place], calibration_errors: Sequence[CsvRow]) -> Sentence | None:
    name = "regret_of_20_mean"
    there = [place for place in places if not math.isnan(value_of(place.ranked(CALIBRATED), name))]
    if not there:
        return None
    most = max(there, key=lambda place: value_of(place.ranked(CALIBRATED), name))
    broken, count = _broken(calibration_errors)
    claim = (
        f"Choosing the best of 20 by calibrated PSS costs at most {percent_with_range(most.ranked(CALIBRATED), name)} "
        f"of the best measured PSS on average ({most.title})"
    )
    claim += "; small unknown errors of calibration break the ranking." if broken else "."
    first = there[0]
    row = first.ranked(CALIBRATED)
    costs = [f"{percent_with_range(row, name)} calibrated"]
    costs += [f"{percent_with_range(first.ranked(model), name)} {model}" for model in (PHYSICAL, PRINTED, IDENTITY)]
    if not math.isnan(value_of(row, f"oracle_{name}")):
        costs.insert(0, f"{percent_with_range(row, f'oracle_{name}')} by the oracle")
    numbers = f"In the {first.title} the mean regret is {', '.join(costs)}."
    half = (
        f"Population of the second half: {count} configurations of four cameras in the room, by `calibrated, limits`, "
        "whose regret was not measured"
    )
    population = [_own(there, places), half * bool(broken)]
    return Sentence(claim, f"{numbers} {broken}".strip(), "; ".join(filter(None, population)))


def _broken(rows: Sequence[CsvRow]) -> tuple[str, str]:
    """From which unknown error of pan and tilt on the ranking is lost, by kind, and over how many configurations."""
    none, lost = lost_rankings(rows)
    if none is None or not lost:
        return "", ""
    parts = []
    for kind, row in lost.items():
        drawn = row.get("draws") and row.get(LEAST)
        least = f", in one of {row['draws']} draws to {with_range(row[LEAST], '', '')}" if drawn else ""
        parts.append(f"{BROKEN_BY[kind][1]}by {value_of(row, 'pan_tilt_deg'):g}°, to {with_ends(row)}{least}")
    text = f"An unknown error of pan and tilt takes ρ from {with_ends(none)} in the room: {'; '.join(parts)}."
    return text, none.get("n", "")


def lost_rankings(rows: Sequence[CsvRow]) -> tuple[CsvRow | None, dict[str, CsvRow]]:
    """The row of calibration_error.csv without errors, and by kind that of the smallest error of pan and tilt alone
    that costs more than `LOST` of ρ."""
    alone = [row for row in rows if not (value_of(row, "focal_share") or value_of(row, "position_m"))]
    none = next((row for row in alone if value_of(row, "pan_tilt_deg") == 0), None)
    lost: dict[str, CsvRow] = {}
    if none is not None:
        for kind, (judged, _) in BROKEN_BY.items():
            of_kind = all_of(alone, kind=kind, judged=judged, weights="own" if kind else "")
            first = next((row for row in of_kind if _plain(none) - _plain(row) > LOST), None)
            if first is not None:
                lost[kind] = first
    return none, lost


def _plain(row: CsvRow) -> float:
    return value_of(row, "spearman_plain")


def with_ends(row: CsvRow) -> str:
    """ρ by the prediction without an error of calibration, with its interval."""
    return with_range(*(row[f"spearman_plain{end}"] for end in ("", "_low", "_high")))


# ---- words -----------------------------------------------------------------------------------------------------------


def _own(there: Sequence[Place], places: Sequence[Place]) -> str:
    """The places that a sentence is of, if it is not of all."""
    return "" if len(there) == len(places) else f"Population: {titles(there)} alone"


def _share(some: Sequence[Place], there: Sequence[Place]) -> str:
    return f"{len(some)} of {len(there)} cases" if len(there) > 1 else cases(there) if some else "no case"


def _any(places: Sequence[Place]) -> str:
    return f"any of {cases(places)}" if len(places) > 1 else cases(places)


def _from_to(values: Iterable[float]) -> str:
    """0.84 to 0.93, or one number if both are the same."""
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return "unknown"
    low, high = (signed(f"{value:.2f}") for value in (min(known), max(known)))
    return low if low == high else f"{low} to {high}"
