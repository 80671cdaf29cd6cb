"""Parts of sentences in docs/bank.md: calibrations, pixels in bright light, process noise beside measurement."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path

from pss.hints import CsvRow
from validate.findings.places import places_of_reference
from validate.findings.process import SCENES_STEP_MM
from validate.runs.csv_file import all_of, read_tables, value_of
from validate.runs.numbers import NOTHING, number

__all__ = ["DOCS_BLOCKS"]

# What makes up the physical R, and a constant of the calibration's own: neither is a factor of the paper.
OWN_FACTORS = ("brightness-contrast", "floor")
# A person's, whose level is in bank.md.
PERSON_M2_S3 = 1.0


def _times_physical(reference: Path) -> str:
    """What the fitted R are made of, over rooms and lights."""
    fitted = [place for place in places_of_reference(reference) if place.weights]
    plain = [place for place in fitted if set(place.weights) <= set(OWN_FACTORS)]
    if not plain:
        return NOTHING
    own = [place.weights.get(OWN_FACTORS[0], math.nan) for place in plain]
    ends = " to ".join(dict.fromkeys(f"{end:.2f}" for end in (min(own), max(own))))
    text = (
        f"In {len(plain)} of {len(fitted)} cases it is `physical` times {ends} ({own[0]:.2f} in the {plain[0].title})"
    )
    others = [
        f"{place.title}: {' and '.join(name for name in place.weights if name not in OWN_FACTORS)}"
        for place in fitted
        if place not in plain
    ]
    return text + (
        f", and in {len(others)} a factor of the paper has a weight too ({'; '.join(others)})" * bool(others)
    )


def _bright_pixels(reference: Path) -> str:
    """NEES of pixels in the brightest light."""
    rows = all_of(read_tables(reference / "bank-half-full-well").get("consistency", ()), level="pixel")
    by_model = {row["noise_model"]: number(row, "nees_per_dof") for row in rows}
    return f"{by_model.get('physical', NOTHING)} by `physical`, {by_model.get('calibrated', NOTHING)} calibrated"


def _scenes_step(reference: Path) -> str:
    """q/c of the room's own random walk, and the error it is held against."""
    rows = all_of(_levels(reference), process="random-walk")
    row = next((row for row in rows if math.isclose(value_of(row, "step_mm"), SCENES_STEP_MM)), None)
    if row is None:
        return NOTHING
    ratio = value_of(row, "q_over_c")
    error_mm = SCENES_STEP_MM / math.sqrt(ratio)
    return f"{SCENES_STEP_MM:g} mm against errors of {error_mm:.3f} mm is q/c = {_two_digits(ratio)}"


def _person(reference: Path) -> str:
    """q/c of a person's acceleration at the bank's frame rate, and the rate at which it is 1."""
    row = next((row for row in all_of(_levels(reference), process="constant-velocity", headline="yes")), None)
    if row is None:
        return NOTHING
    ratio = value_of(row, "q_over_c") * PERSON_M2_S3 / value_of(row, "acceleration_density_m2_s3")
    rate_hz = 1 / value_of(row, "time_step_s")
    of_one = rate_hz * math.cbrt(ratio)
    return f"{_two_digits(ratio)} at {rate_hz:.0f} frames/s and 1 at {_two_digits(of_one)}"


def _levels(reference: Path) -> list[CsvRow]:
    return list(read_tables(reference / "bank").get("process", ()))


def _two_digits(value: float) -> str:
    return f"{float(f'{value:.2g}'):,.0f}"


DOCS_BLOCKS: Mapping[str, Callable[[Path], str]] = {
    "banks: times physical": _times_physical,
    "banks: pixels in bright light": _bright_pixels,
    "process: step of the scenes": _scenes_step,
    "process: acceleration of people": _person,
}
