"""The contenders in one order, colour and sign, for every table and figure of the findings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

__all__ = [
    "CALIBRATED",
    "CONTENDERS",
    "IDENTITY",
    "PHYSICAL",
    "PRINTED",
    "WHOLE_MARKERS",
    "Contender",
    "contenders_in",
]


@dataclass(frozen=True)
class Contender:
    """A noise model with what it takes as visible.

    Attributes:
        name: in the tables' column `noise_model`.
        colour: of its family, colour-blind safe (Okabe and Ito).
        sign: Matplotlib's marker, which tells the members of a family apart.
        filled: the marker.
    """

    name: str
    colour: str
    sign: str
    filled: bool


PRINTED, IDENTITY = "as-printed", "identity"
PHYSICAL, WHOLE_MARKERS, CALIBRATED = "physical", "physical, whole markers", "calibrated"
_PRINTED, _CORRECTED, _IDENTITY, _PHYSICAL, _CALIBRATED = "#D55E00", "#B07A00", "#777777", "#0072B2", "#00795A"

CONTENDERS = (
    Contender(PRINTED, _PRINTED, "o", True),
    Contender("as-printed, scaled", _PRINTED, "o", False),
    Contender("corrected", _CORRECTED, "D", True),
    Contender("corrected, scaled", _CORRECTED, "D", False),
    Contender(IDENTITY, _IDENTITY, "s", True),
    Contender("identity, scaled", _IDENTITY, "s", False),
    Contender(PHYSICAL, _PHYSICAL, "^", True),
    Contender(WHOLE_MARKERS, _PHYSICAL, "v", True),
    Contender("calibrated R", _CALIBRATED, "o", False),
    Contender("calibrated, limits", _CALIBRATED, "s", False),
    Contender(CALIBRATED, _CALIBRATED, "o", True),
)
_OTHER = "#CC79A7"


def contenders_in(names: Iterable[str]) -> list[Contender]:
    """Those of these names, in the one order; names that are not of the list come last."""
    there = list(dict.fromkeys(names))
    known = [contender for contender in CONTENDERS if contender.name in there]
    new = [name for name in there if name not in {contender.name for contender in CONTENDERS}]
    return known + [Contender(name, _OTHER, "P", True) for name in new]
