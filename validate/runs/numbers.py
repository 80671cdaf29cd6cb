"""Numbers as a reader sees them: digits, intervals, units and signs, the same on consoles, pages and in findings."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from pss.hints import CsvRow
from validate.runs.csv_file import bounds

__all__ = [
    "NOTHING",
    "in_mm",
    "in_powers",
    "number",
    "number_of",
    "percent",
    "percent_with_range",
    "plain_range",
    "rho_words",
    "signed",
    "signed_range",
    "two_digits",
    "value_text",
    "with_range",
    "written",
]

# Shown where there is no number.
NOTHING = "–"
# What two decimals round up to 1, and what they round to 0 but three do not.
ALMOST_ONE, ALMOST_ZERO = 0.995, (0.0005, 0.005)
MM = 1000.0


def number_of(text: str | None) -> float:
    """The number in a field of a table; nan where it is empty or there is none."""
    return float(text) if text else math.nan


# ---- digits ----------------------------------------------------------------------------------------------------------


def written(value: float, digits: int) -> str:
    """A number to so many digits for a reader: 0.0397, 39,700, and powers of ten from a million on."""
    rounded = float(f"{value:.{digits}g}")
    return f"{rounded:,.0f}" if 1000 <= abs(rounded) < 1e6 else f"{value:.{digits}g}"


def two_digits(value: float) -> str:
    """0.15, 100, 68,000, and powers of ten from a million on."""
    rounded = float(f"{value:.2g}")
    return f"{rounded:,.0f}" if 10 <= rounded < 1e6 else f"{rounded:g}"


def in_mm(value_m: float) -> str:
    """Metres as millimetres, to three digits."""
    return f"{value_m * MM:.3g}" if math.isfinite(value_m) else NOTHING


def in_powers(value: float, digits: int = 2) -> str:
    """0.0064 as 6.4·10⁻³ and 10,000 as 10⁴ where decimals would be many; 0.35, 420 and 1,170 as they are."""
    if not value or not math.isfinite(value):
        return f"{value:g}"
    rounded = float(f"{value:.{digits}g}")
    exponent = math.floor(math.log10(abs(rounded)))
    if -2 <= exponent < 4:
        return signed(f"{rounded:,.{max(digits - 1 - exponent, 0)}f}")
    factor = f"{rounded / 10**exponent:.{digits - 1}f}".rstrip("0").rstrip(".")
    power = "10" + str(exponent).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
    return power if factor == "1" else f"{signed(factor)}·{power}"


def signed(text: str) -> str:
    """Numbers with the sign for minus, and none before what is rounded to 0."""
    return re.sub(r"-(?=0\.?0*(?![\d.]))", "", text).replace("-", "−")


def percent(value: str) -> str:
    """12.3 %."""
    return f"{100 * float(value):.1f} %" if value else NOTHING


# ---- with an interval ------------------------------------------------------------------------------------------------


def with_range(value: str, low: str, high: str) -> str:
    """0.93 [0.85, 0.98]; the number alone where it has no interval.

    A correlation just below 1 has three decimals: two would call it 1. So has an interval with an end so near to 0 that
    two would hide on which side it is.
    """
    numbers = [float(each or "nan") for each in (value, low, high)]
    if math.isnan(numbers[0]):
        return NOTHING
    known = [number for number in numbers if not math.isnan(number)]
    near_one = ALMOST_ONE <= numbers[0] < 1 and max(known) <= 1
    near_zero = any(ALMOST_ZERO[0] <= abs(end) < ALMOST_ZERO[1] for end in known[1:])
    decimals = 3 if near_one or near_zero else 2
    text = f"{numbers[0]:.{decimals}f}"
    if len(known) == len(numbers):
        text += f" [{numbers[1]:.{decimals}f}, {numbers[2]:.{decimals}f}]"
    return signed(text)


def number(row: CsvRow | None, name: str) -> str:
    """A number with its 95 % interval, in columns `name`, `name`_ci_low and `name`_ci_high."""
    return with_range(*((row or {}).get(key, "") for key in (name, f"{name}_ci_low", f"{name}_ci_high")))


def percent_with_range(row: CsvRow | None, name: str) -> str:
    """0.7 % [0.4, 1.1]; without what is not there."""
    value, low, high = (100 * number for number in bounds(row, name))
    if math.isnan(value):
        return NOTHING
    text = f"{value:.1f} %"
    if not (math.isnan(low) or math.isnan(high)):
        text += f" [{low:.1f}, {high:.1f}]"
    return signed(text)


def value_text(values: Sequence[float]) -> str:
    """A value, or a value with the limits of its interval, to three digits; "" for nan."""
    if math.isnan(values[0]):
        return ""
    interval = (
        "" if len(values) < 3 or math.isnan(values[1]) else f" [{written(values[1], 3)}, {written(values[2], 3)}]"
    )
    return written(values[0], 3) + interval


def plain_range(value: float, low: float, high: float) -> str:
    """0.93 [0.85, 0.98], or "undefined"."""
    return "undefined" if math.isnan(value) else f"{value:.2f} [{low:.2f}, {high:.2f}]"


def rho_words(rho: float, low: float, high: float) -> str:
    """+0.98 [+0.90, +0.99]."""
    if math.isnan(rho):
        return "undefined"
    # A rounding beside 0 has no sign of its own.
    rho, low, high = (round(value, 2) + 0.0 for value in (rho, low, high))
    if math.isnan(low):
        return f"{rho:+.2f}".replace("-", "−")
    return f"{rho:+.2f} [{low:+.2f}, {high:+.2f}]".replace("-", "−")


def signed_range(values: tuple[float, float, float]) -> str:
    """+0.02 [−0.01, +0.05]; the number alone where the interval is nan."""
    interval = "" if math.isnan(values[1]) else f" [{values[1]:+.2f}, {values[2]:+.2f}]"
    return f"{values[0]:+.2f}{interval}".replace("-", "−")
