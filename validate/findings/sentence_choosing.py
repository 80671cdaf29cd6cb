"""The fifth sentence: what choosing by PSS costs, and what errors of calibration do to the ranking."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pss.hints import CsvRow
from validate.findings.calibration_error import LOST
from validate.findings.contenders import CALIBRATED, IDENTITY, PHYSICAL, PRINTED
from validate.findings.places import Place
from validate.findings.sentence import Sentence, own_population
from validate.runs.csv_file import all_of, value_of
from validate.runs.numbers import percent_with_range, with_range

__all__ = ["choosing_sentence", "lost_rankings", "with_ends"]


# Values of `kind` in calibration_error.csv, what each is judged over, and in words; earlier tables have no kinds.
BROKEN_BY = {
    "": ("", ""),
    "each frame": ("over calibrations", "drawn anew each frame, "),
    "frozen": ("within one calibration", "frozen as after a move to a preset, "),
}
LEAST = "spearman_plain_min"


def choosing_sentence(places: Sequence[Place], calibration_errors: Sequence[CsvRow]) -> Sentence | None:
    """The fifth sentence; None where regret has not been measured."""
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
    population = [own_population(there, places), half * bool(broken)]
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
