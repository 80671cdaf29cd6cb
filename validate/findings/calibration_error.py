"""What errors of calibration do to the ranking, from `calibration_error.csv`."""

from __future__ import annotations

from collections.abc import Callable

from validate.findings.tables import Row, with_range

__all__ = ["calibration_error_findings"]

# PSS "no longer ranks" where it has lost this much of its ρ.
LOST = 0.1
KINDS = (
    ("pan_tilt_deg", "pan and tilt", lambda value: f"{value:g}°"),
    ("focal_share", "focal length", lambda value: f"{100 * value:g} %"),
    ("position_m", "place", lambda value: f"{1000 * value:g} mm"),
)


def calibration_error_findings(rows: list[Row]) -> str:
    """A sentence for each kind of error, and the table."""
    none = next(row for row in rows if not any(float(row[kind]) for kind, *_ in KINDS))
    first = float(none["spearman_plain"])
    said = [
        f"Without errors, {none['n']} configurations of four cameras are ranked with ρ = {_rho(none, 'plain')}.",
        *(_of_kind(rows, column, name, unit, first) for column, name, unit in KINDS),
    ]
    worst = rows[-1]
    said.append(
        f"With all three of {', '.join(unit(float(worst[column])) for column, _, unit in KINDS)}, ρ = "
        f"{_rho(worst, 'plain')}, and with a term for them in R {_rho(worst, 'with_term')}: it gains "
        f"{_rho(worst, 'gain')}."
    )
    heads = ("pan, tilt", "focal length", "place", "RMS in mm", "ρ of PSS", "with a term in R", "gain")
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for row in rows:
        sizes = (unit(float(row[column])) if float(row[column]) else "" for column, _, unit in KINDS)
        rms = f"{1000 * float(row['median_rms_m']):.2f}"
        lines.append("| " + " | ".join((*sizes, rms, *(_rho(row, n) for n in ("plain", "with_term", "gain")))) + " |")
    return "\n".join(f"- {line}" for line in said) + "\n\n" + "\n".join(lines)


def _of_kind(rows: list[Row], column: str, name: str, unit: Callable[[float], str], first: float) -> str:
    others = [other for other, *_ in KINDS if other != column]
    alone = [row for row in rows if float(row[column]) and not any(float(row[other]) for other in others)]
    lost = next((row for row in alone if first - float(row["spearman_plain"]) > LOST), None)
    if lost is None:
        row = alone[-1]
        most = unit(float(row[column]))
        return f"{name.capitalize()}: up to {most}, ρ loses no more than {LOST:g} ({_rho(row, 'plain')})."
    return (
        f"{name.capitalize()}: from {unit(float(lost[column]))} on, ρ has lost more than {LOST:g} "
        f"({_rho(lost, 'plain')}); with a term for it in R it is {_rho(lost, 'with_term')}."
    )


def _rho(row: Row, name: str) -> str:
    return with_range(*(row[f"spearman_{name}{end}"] for end in ("", "_low", "_high")))
