"""Parts of the README on the banks: the five sentences, and every contender in every room and light."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from validate.findings.calibration_error import calibration_error_sentences
from validate.findings.contenders import contenders_in
from validate.findings.places import COUNT, FILTER, HEADLINE, SINGLE_FRAME, Place, places_of_reference
from validate.findings.sentences import five_sentences, written
from validate.findings.tables import NOTHING, Row, all_of, markdown_table, number, percent, read_tables

__all__ = ["BANK_BLOCKS"]

COUNTED = "(count of visible points)"


def _sentences(reference: Path) -> str:
    """The five sentences that open the findings."""
    errors = read_tables(reference).get("calibration_error", [])
    return written(five_sentences(places_of_reference(reference), errors))


def _ranks(reference: Path) -> str:
    """ρ of single-frame PSS for every contender in every place, and of the count of visible points."""
    places = places_of_reference(reference)
    rows = [[name, *(number(place.ranked(name), "spearman") for place in places)] for name in _models(places)]
    rows.append([COUNTED, *(number(place.ranked("physical", COUNT), "spearman") for place in places)])
    return markdown_table(["R", *(place.title for place in places)], rows)


def _neutral(reference: Path) -> str:
    """ρ of every contender, and of the count, by every yardstick in the first place."""
    room = places_of_reference(reference)[0]
    names = dict.fromkeys(row["yardstick"] for row in _of_four(room))
    yardsticks = sorted((name for name in names if name != FILTER), key=_order)
    rows = []
    for model, metric in [*((model, "") for model in _models([room])), ("physical", COUNT)]:
        found = (room.ranked(model, metric or "pss-single-frame", name) for name in yardsticks)
        rows.append([COUNTED if metric else model, *(number(row, "spearman") for row in found)])
    return markdown_table(["R", *map(_words, yardsticks)], rows)


def _of_four(place: Place, **wanted: str) -> list[Row]:
    """The leaderboard of four cameras."""
    return all_of(place.rows("leaderboard"), cameras=HEADLINE, **wanted)


def _models(places: Sequence[Place]) -> list[str]:
    return [contender.name for contender in contenders_in(model for place in places for model in place.models)]


def _order(yardstick: str) -> tuple[int, float]:
    """Measured PSS first, then shares by their threshold, then the median."""
    return (0, 0.0) if yardstick == SINGLE_FRAME else (1, _millimetres(yardstick)) if "share" in yardstick else (2, 0.0)


def _millimetres(yardstick: str) -> float:
    return float(yardstick.removeprefix("share_under_").removesuffix("mm"))


def _words(yardstick: str) -> str:
    if yardstick.startswith("share_under_"):
        return f"within {_millimetres(yardstick):g} mm"
    return {SINGLE_FRAME: "measured PSS", "median_rms_m": "median RMS"}.get(yardstick, yardstick)


def _under(reference: Path) -> str:
    """How calibrated PSS ranks by the share of points within 5 mm."""
    room = places_of_reference(reference)[0]
    row = room.ranked("calibrated", "pss-single-frame", "share_under_5mm")
    if row is None:
        return f"ρ = {NOTHING}"
    others = sum(bool(other["spearman"]) for other in _of_four(room, yardstick="share_under_5mm"))
    rank = f"{row['rank']} [{row['rank_ci_low']}, {row['rank_ci_high']}]"
    return f"ρ = {number(row, 'spearman')} and the rank {rank} of {others}"


def _tied(reference: Path) -> str:
    """How many pairs of metric and noise model reach into the rank of calibrated PSS."""
    room = places_of_reference(reference)[0]
    own = room.ranked("calibrated")
    if own is None:
        return NOTHING
    low, high = float(own["rank_ci_low"]), float(own["rank_ci_high"])
    rows = [row for row in _of_four(room, yardstick=SINGLE_FRAME) if row is not own and row["rank_ci_low"]]
    return str(sum(float(row["rank_ci_low"]) <= high and low <= float(row["rank_ci_high"]) for row in rows))


def _missed(reference: Path) -> str:
    """Of all pairs of a view and a marker, those predicted visible and missed, by what counts as visible."""
    rows = read_tables(reference / "bank")["detection"]
    return ", ".join(f"{percent(row['visible_missed'])} by {row['visibility']}" for row in rows)


def _calibration_errors(reference: Path) -> str:
    return calibration_error_sentences(read_tables(reference)["calibration_error"])


BANK_BLOCKS: Mapping[str, Callable[[Path], str]] = {
    "banks: sentences": _sentences,
    "banks: ranks": _ranks,
    "banks: neutral": _neutral,
    "banks: within 5 mm": _under,
    "banks: tied": _tied,
    "banks: missed": _missed,
    "calibration errors: sentences": _calibration_errors,
}
