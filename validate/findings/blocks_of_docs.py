"""Parts of sentences in docs/bank.md: what the calibrations are, and how strong process noise is beside measurement."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from pathlib import Path

from validate.findings.places import places_of_reference
from validate.findings.process import SCENES_STEP_MM
from validate.findings.tables import NOTHING, Row, all_of, read_tables, value_of

__all__ = ["DOCS_BLOCKS"]

OWN_FACTOR = "brightness-contrast"
# A person's, whose level is in bank.md.
PERSON_M2_S3 = 1.0


def _times_physical(reference: Path) -> str:
    """How many times the physical R the fitted ones are, over rooms and lights."""
    times = [place.weights.get(OWN_FACTOR, math.nan) for place in places_of_reference(reference)]
    known = [each for each in times if not math.isnan(each)]
    if not known:
        return NOTHING
    ends = [f"{end:.2f}" for end in (min(known), max(known))]
    return " to ".join(dict.fromkeys(ends)) + f" by light ({known[0]:.2f} in the room's own)"


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


def _levels(reference: Path) -> list[Row]:
    return list(read_tables(reference / "bank").get("process", ()))


def _two_digits(value: float) -> str:
    return f"{float(f'{value:.2g}'):,.0f}"


DOCS_BLOCKS: Mapping[str, Callable[[Path], str]] = {
    "banks: times physical": _times_physical,
    "process: step of the scenes": _scenes_step,
    "process: acceleration of people": _person,
}
