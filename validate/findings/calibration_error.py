"""The effect of calibration errors on the ranking, from `calibration_error.csv`."""

from __future__ import annotations

from collections.abc import Sequence

from pss.hints import CsvRow
from validate.runs.numbers import with_range

__all__ = ["LOST", "calibration_error_findings", "calibration_error_sentences"]

# PSS "no longer ranks" where it has lost this much of its ρ.
LOST = 0.1
KINDS = (
    ("pan_tilt_deg", "pan and tilt", lambda value: f"{value:g}°"),
    ("focal_share", "focal length", lambda value: f"{100 * value:g} %"),
    ("position_m", "place", lambda value: f"{1000 * value:g} mm"),
)
EACH_FRAME, FROZEN = ("each frame", "over calibrations"), ("frozen", "within one calibration")
OWN, IN_WEIGHTS = "own", "with term"
# Columns of the table: head, population, weights, prediction.
COLUMNS = (
    ("over calibrations: no term", EACH_FRAME, OWN, "plain"),
    ("term in R", EACH_FRAME, OWN, "with_term"),
    ("C + GΣGᵀ", EACH_FRAME, OWN, "propagated"),
    ("term in R and in the weights", EACH_FRAME, IN_WEIGHTS, "with_term"),
    ("within one frozen calibration: no term", FROZEN, OWN, "plain"),
    ("term in R", FROZEN, OWN, "with_term"),
    ("term in R and in the weights", FROZEN, IN_WEIGHTS, "with_term"),
    ("mean of other calibrations, as measured", FROZEN, OWN, "other_draws"),
)


def calibration_error_findings(rows: Sequence[CsvRow]) -> str:
    """The sentences, then a table with a line for each size."""
    heads = ("pan, tilt", "focal length", "place", "RMS in mm", *(head for head, *_ in COLUMNS))
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for size in dict.fromkeys(_size(row) for row in rows):
        names = (unit(value) if value else "" for value, (_, _, unit) in zip(size, KINDS, strict=True))
        first = _row(rows, size, EACH_FRAME, OWN)
        assert first is not None
        rhos = []
        for _, population, weights, name in COLUMNS:
            row = _row(rows, size, population, weights)
            rhos.append("" if row is None or not row.get(f"spearman_{name}") else _rho(row, name))
        lines.append("| " + " | ".join((*names, f"{1000 * float(first['median_rms_m']):.2f}", *rhos)) + " |")
    return calibration_error_sentences(rows) + "\n\n" + "\n".join(lines)


def calibration_error_sentences(rows: Sequence[CsvRow]) -> str:
    """From which errors on the ranking is lost over calibrations and within one, and what terms for them give back."""
    none = _row(rows, (0.0, 0.0, 0.0), EACH_FRAME, OWN)
    assert none is not None
    largest = max((size for size in map(_size, rows) if all(size)), key=sum)
    parts = [
        (
            f"Without errors, {none['n']} configurations of four cameras in the room are ranked with ρ = "
            f"{_rho(none, 'plain')} (calibrated R, limits of detection, single frame)."
        ),
        (
            f"Unknown errors lower it by more than {LOST:g}, over calibrations, from "
            f"{_lost(rows, EACH_FRAME)} on{_within(rows)}."
        ),
    ]
    if over := _row(rows, largest, EACH_FRAME, OWN):
        parts.append(
            f"With all three of {_words(largest)}, ρ over calibrations is {_rho(over, 'plain')}; a term for the errors "
            f"in the predicted R changes it by {_rho(over, 'gain')} to {_rho(over, 'with_term')}"
            + _in_weights(rows, largest, EACH_FRAME)
        )
    if within := _row(rows, largest, FROZEN, OWN):
        parts.append(
            f"Within one frozen calibration, which is what a user has after a move to presets, it is "
            f"{_rho(within, 'plain')} on average ({_extremes(within, 'plain')} among {within['draws']} draws), and "
            f"{_rho(within, 'with_term')} with the term"
            + _in_weights(rows, largest, FROZEN)
            + f" The mean of what was measured under the other calibrations reaches {_rho(within, 'other_draws')}: "
            "most of the rest is the draw, which only another calibration removes."
        )
        matching = _row(rows, largest, EACH_FRAME, OWN)
        if matching is not None:
            parts.append(
                f"C + GΣGᵀ has the right size over calibrations: measured over predicted RMS is "
                f"{float(matching['rms_over_matching']):.2f} in the median, within one calibration "
                f"{float(within['rms_over_matching']):.2f}; without the term {float(matching['rms_over_plain']):.0f}."
            )
    return " ".join(parts)


def _within(rows: Sequence[CsvRow]) -> str:
    lost = _lost(rows, FROZEN)
    return f"; within one frozen calibration from {lost} on" if lost else ""


def _lost(rows: Sequence[CsvRow], population: tuple[str, str]) -> str:
    """The smallest size of each kind of error, by itself, that costs more than `LOST`."""
    none = _row(rows, (0.0, 0.0, 0.0), population, OWN)
    if none is None:
        return ""
    found = []
    for index, (_, name, unit) in enumerate(KINDS):
        alone = [size for size in dict.fromkeys(map(_size, rows)) if size[index] and sum(map(bool, size)) == 1]
        lost = (
            size
            for size in sorted(alone)
            if (row := _row(rows, size, population, OWN))
            and float(none["spearman_plain"]) - float(row["spearman_plain"]) > LOST
        )
        if (first := next(lost, None)) is not None:
            found.append(f"{name} off by {unit(first[index])}")
    return ", ".join(found) or "no size that was tried"


def _in_weights(rows: Sequence[CsvRow], size: tuple[float, ...], population: tuple[str, str]) -> str:
    row = _row(rows, size, population, IN_WEIGHTS)
    return f", in triangulation's weights too {_rho(row, 'with_term')}." if row else "."


def _words(size: tuple[float, ...]) -> str:
    return ", ".join(unit(value) for value, (_, _, unit) in zip(size, KINDS, strict=True))


def _size(row: CsvRow) -> tuple[float, ...]:
    return tuple(float(row[column]) for column, *_ in KINDS)


def _row(rows: Sequence[CsvRow], size: tuple[float, ...], population: tuple[str, str], weights: str) -> CsvRow | None:
    """The row of a size; tables of an earlier version have errors of each frame alone, without these columns."""
    for row in rows:
        of = (row.get("kind", EACH_FRAME[0]), row.get("judged", EACH_FRAME[1]))
        if _size(row) == size and of == population and row.get("weights", OWN) == weights:
            return row
    return None


def _extremes(row: CsvRow, name: str) -> str:
    return " to ".join(f"{float(row[f'spearman_{name}_{end}']):.2f}" for end in ("min", "max"))


def _rho(row: CsvRow, name: str) -> str:
    return with_range(*(row[f"spearman_{name}{end}"] for end in ("", "_low", "_high")))
