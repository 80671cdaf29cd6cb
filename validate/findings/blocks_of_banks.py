"""Parts of pages on the banks: the README's six rows, and every contender in every room and light."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from pss.hints import CsvRow
from validate.findings.calibration_error import calibration_error_sentences
from validate.findings.contenders import CALIBRATED, contenders_in
from validate.findings.places import COUNT, FILTER, HEADLINE, SHARE, SINGLE_FRAME, Place, places_of_reference
from validate.findings.six_rows import six_rows
from validate.runs.csv_file import all_of, read_tables
from validate.runs.numbers import NOTHING, number, percent, with_range
from validate.runs.table_text import markdown_table

__all__ = ["BANK_BLOCKS"]

# Counts as the smooth probability of detection expects them.
SCALED = ", scaled"
COUNTED = {COUNT: "(expected count of cameras, at most three)", SHARE: "(expected share that two cameras see)"}


def _ranks(reference: Path) -> str:
    """ρ of single-frame PSS for every contender in every place, and of the expected counts.

    Scaled models have the ranks of the unscaled, and no rows of their own.
    """
    places = places_of_reference(reference)
    names = [name for name in _models(places) if not name.endswith(SCALED)]
    rows = [[name, *(number(place.ranked(name), "spearman") for place in places)] for name in names]
    for metric, words in COUNTED.items():
        rows.append([words, *(number(place.ranked(CALIBRATED, metric), "spearman") for place in places)])
    return markdown_table(["R", *(place.title for place in places)], rows)


def _neutral(reference: Path) -> str:
    """By every measure in every place: ρ of calibrated single-frame PSS (ρ less that of its count)."""
    places = places_of_reference(reference)
    names = dict.fromkeys(row["measure"] for place in places for row in _of_four(place))
    rows = []
    for name in sorted((name for name in names if name != FILTER), key=_order):
        found = [place.ranked(CALIBRATED, "pss-single-frame", name) for place in places]
        rows.append([_words(name), *map(_beside_the_count, found)])
    return markdown_table(["measure", *(place.title for place in places)], rows)


def _beside_the_count(row: CsvRow | None) -> str:
    rho = with_range((row or {}).get("spearman", ""), "", "")
    return rho if rho == NOTHING else f"{rho} ({number(row, 'minus_visibility_count')})"


def _of_four(place: Place, **values: str) -> list[CsvRow]:
    """The leaderboard of four cameras."""
    return all_of(place.rows("leaderboard"), cameras=HEADLINE, **values)


def _models(places: Sequence[Place]) -> list[str]:
    return [contender.name for contender in contenders_in(model for place in places for model in place.models)]


def _order(measure: str) -> tuple[int, float]:
    """Measured PSS first, then shares by their threshold, then the median."""
    return (0, 0.0) if measure == SINGLE_FRAME else (1, _millimetres(measure)) if "share" in measure else (2, 0.0)


def _millimetres(measure: str) -> float:
    return float(measure.removeprefix("share_under_").removesuffix("mm"))


def _words(measure: str) -> str:
    if measure.startswith("share_under_"):
        return f"within {_millimetres(measure):g} mm"
    return {SINGLE_FRAME: "measured PSS", "median_rms_m": "median RMS"}.get(measure, measure)


def _under(reference: Path) -> str:
    """How calibrated PSS ranks by the share of points within 5 mm."""
    room = places_of_reference(reference)[0]
    row = room.ranked("calibrated", "pss-single-frame", "share_under_5mm")
    if row is None:
        return f"ρ = {NOTHING}"
    orders = [each for each in _of_four(room, measure="share_under_5mm") if each["spearman"] and not _is_twin(each)]
    rank = f"{row['rank']} [{row['rank_ci_low']}, {row['rank_ci_high']}]"
    return f"ρ = {number(row, 'spearman')} and the rank {rank} of {len(orders)}"


def _tied(reference: Path) -> str:
    """How many other orders, of pairs of metric and noise model, reach into the rank of calibrated PSS."""
    room = places_of_reference(reference)[0]
    own = room.ranked("calibrated")
    if own is None:
        return NOTHING
    low, high = float(own["rank_ci_low"]), float(own["rank_ci_high"])
    board = _of_four(room, measure=SINGLE_FRAME)
    rows = [row for row in board if row is not own and row["rank_ci_low"] and row["spearman"] and not _is_twin(row)]
    return str(sum(float(row["rank_ci_low"]) <= high and low <= float(row["rank_ci_high"]) for row in rows))


def _is_twin(row: CsvRow) -> bool:
    """Whether another pair orders the configurations the same way."""
    return bool(row.get("equivalent_to"))


def _missed(reference: Path) -> str:
    """Of all pairs of a view and a marker, those predicted visible and missed, by what counts as visible."""
    rows = read_tables(reference / "bank")["detection"]
    return ", ".join(f"{percent(row['visible_missed'])} by {row['visibility']}" for row in rows)


def _calibration_errors(reference: Path) -> str:
    return calibration_error_sentences(read_tables(reference)["calibration_error"])


BANK_BLOCKS: Mapping[str, Callable[[Path], str]] = {
    "findings: six rows": six_rows,
    "banks: ranks": _ranks,
    "banks: neutral": _neutral,
    "banks: within 5 mm": _under,
    "banks: tied": _tied,
    "banks: missed": _missed,
    "calibration errors: sentences": _calibration_errors,
}
