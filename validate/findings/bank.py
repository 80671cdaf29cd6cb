"""The findings of one bank alone, from its tables: the sentences that it has tables for, then the tables."""

from __future__ import annotations

from collections.abc import Sequence

from validate.findings.places import Place, places_of_bank
from validate.findings.process import process_table
from validate.findings.ranking_tables import (
    ceiling_table,
    count_table,
    difference_table,
    neutral_table,
    ranking_table,
    regret_table,
)
from validate.findings.sentences import five_sentences, written
from validate.findings.size_tables import (
    axes_table,
    detection_table,
    nees_table,
    parts_table,
    ratio_table,
    reliability_table,
    scale_table,
    sensitivity_table,
)
from validate.findings.tables import Tables, folded

__all__ = ["bank_findings", "bank_tables"]


CEILING = (
    '"Ceiling" is what a perfect prediction reaches; "oracle" has the pixel errors of one half of the trials, and '
    'is judged on the other; "split halves" are the measured PSS of one half by the other\'s.'
)


def bank_findings(tables: Tables) -> str:
    """The text of a bank's own findings.md, in Markdown."""
    places = places_of_bank(tables)
    sentences = written(five_sentences(places))
    return "\n\n".join(part for part in ("# Findings", sentences, bank_tables(places)) if part) + "\n"


def bank_tables(places: Sequence[Place]) -> str:
    """The tables of all places, those that most readers skip folded; a table without rows has no heading."""
    ranking = (
        "ρ of the configurations of four cameras with measured PSS, by R and what counts as visible. A scalar times R "
        "changes no rank of single-frame PSS; it does change those of σ∞."
    )
    parts = [
        _titled("How well does it rank?", ranking, ranking_table(places)),
        folded("By the number of cameras", count_table(places)),
        _titled("Against R = I and against counting", "Paired differences of ρ.", difference_table(places)),
        _titled("What does choosing by it cost?", "Mean regret of single-frame PSS.", regret_table(places)),
        _titled(
            "Is the error as large as predicted?",
            "NEES over its degrees of freedom: 1 is right, above it errors are larger than predicted.",
            nees_table(places),
        ),
        folded("Ratios, coverage, and ranks of points", ratio_table(places)),
        folded("Axes of the error ellipsoids", axes_table(places)),
        _titled("What is the ceiling?", CEILING, ceiling_table(places)),
        _titled("σ∞ by process noise", "ρ of σ∞ with the filter's measured PSS.", process_table(places)),
        _neutral(places),
        _by_place("What holds it back?", "Each R with each kind of visibility.", places),
        _titled("How much depends on the open constants?", "", folded("ρ by constant", sensitivity_table(places))),
        folded("ρ of σ∞ by the unit of R", scale_table(places)),
        _titled("What is seen and found", "Of all pairs of a view and a marker.", detection_table(places)),
        folded("Predicted probability of detection and share found", reliability_table(places)),
    ]
    return "\n\n".join(part for part in parts if part)


def _neutral(places: Sequence[Place]) -> str:
    body = "\n\n".join(folded(f"All metrics: {place.title}", neutral_table(place)) for place in places)
    words = "ρ and rank [interval] of each metric by each yardstick; shares and median favour no metric's form."
    return _titled("Against the rivals", words, body)


def _by_place(title: str, words: str, places: Sequence[Place]) -> str:
    body = "\n\n".join(folded(f"Parts: {place.title}", text) for place in places if (text := parts_table(place)))
    return _titled(title, words, body)


def _titled(title: str, words: str, body: str) -> str:
    return "\n\n".join(part for part in (f"### {title}", words, body) if part) if body else ""
