"""A sentence of the findings, and the words that all of them share."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from validate.findings.places import Place
from validate.findings.population import cases, titles
from validate.runs.numbers import signed

__all__ = ["DIFFERENCE", "LESS_COUNT", "Sentence", "any_of", "from_to", "own_population", "share_of"]


# Columns of paired differences of ρ.
DIFFERENCE, LESS_COUNT = "spearman_difference", "minus_visibility_count"


@dataclass(frozen=True)
class Sentence:
    """One of the five: what it claims in a few words, the numbers for it, and its population where it is its own."""

    claim: str
    numbers: str
    population: str = ""


def own_population(there: Sequence[Place], places: Sequence[Place]) -> str:
    """The places that a sentence is of, if it is not of all."""
    return "" if len(there) == len(places) else f"Population: {titles(there)} alone"


def share_of(some: Sequence[Place], there: Sequence[Place]) -> str:
    """2 of 5 cases, or the one case by its title."""
    return f"{len(some)} of {len(there)} cases" if len(there) > 1 else cases(there) if some else "no case"


def any_of(places: Sequence[Place]) -> str:
    """Any of several cases, or the one by its title."""
    return f"any of {cases(places)}" if len(places) > 1 else cases(places)


def from_to(values: Iterable[float]) -> str:
    """0.84 to 0.93, or one number if both are the same."""
    known = [value for value in values if math.isfinite(value)]
    if not known:
        return "unknown"
    low, high = (signed(f"{value:.2f}") for value in (min(known), max(known)))
    return low if low == high else f"{low} to {high}"
