"""The contenders in one order, colour and sign, for every table and figure of the findings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from validate.runs.palette import BLUE, DARK_GREEN, MIDDLE_GREY, OCHRE, PURPLE, VERMILION

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
        sign: Matplotlib's marker, different within a family.
        filled: the marker.
    """

    name: str
    colour: str
    sign: str
    filled: bool


PRINTED, IDENTITY = "as-printed", "identity"
PHYSICAL, WHOLE_MARKERS, CALIBRATED = "physical", "physical, whole markers", "calibrated"

CONTENDERS = (
    Contender(PRINTED, VERMILION, "o", True),
    Contender("as-printed, scaled", VERMILION, "o", False),
    Contender("corrected", OCHRE, "D", True),
    Contender("corrected, scaled", OCHRE, "D", False),
    Contender(IDENTITY, MIDDLE_GREY, "s", True),
    Contender("identity, scaled", MIDDLE_GREY, "s", False),
    Contender(PHYSICAL, BLUE, "^", True),
    Contender(WHOLE_MARKERS, BLUE, "v", True),
    Contender("calibrated R", DARK_GREEN, "o", False),
    Contender("calibrated, limits", DARK_GREEN, "s", False),
    Contender(CALIBRATED, DARK_GREEN, "o", True),
)


def contenders_in(names: Iterable[str]) -> list[Contender]:
    """Those of these names, in the one order; names that are not of the list come last."""
    there = list(dict.fromkeys(names))
    known = [contender for contender in CONTENDERS if contender.name in there]
    new = [name for name in there if name not in {contender.name for contender in CONTENDERS}]
    return known + [Contender(name, PURPLE, "P", True) for name in new]
