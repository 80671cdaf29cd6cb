"""The findings of one bank alone, from its tables: the sentences that it has tables for, then the tables."""

from __future__ import annotations

from collections.abc import Sequence

from validate.findings.places import Place, places_of_bank
from validate.findings.process import level_words, process_table
from validate.findings.ranking_tables import (
    ceiling_table,
    count_table,
    difference_table,
    neutral_table,
    ranking_table,
    regret_table,
)
from validate.findings.sentences import with_population
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
from validate.runs.csv_file import Tables, first_of
from validate.runs.table_text import folded

__all__ = ["bank_findings", "bank_tables"]


CEILING = (
    '"Ceiling" is what a perfect prediction reaches; "oracle" has the pixel errors of one half of the trials, and '
    'is judged on the other; "split halves" are the measured PSS of one half by the other\'s.'
)


def bank_findings(tables: Tables) -> str:
    """The text of a bank's own findings.md, in Markdown."""
    places = places_of_bank(tables)
    sentences = with_population(places)
    return "\n\n".join(part for part in ("# Findings", sentences, bank_tables(places)) if part) + "\n"


def bank_tables(places: Sequence[Place]) -> str:
    """The tables of all places, those that most readers skip folded; a table without rows has no heading."""
    ranking = (
        "ρ of the configurations of four cameras with measured PSS, by R and what counts as visible. A scalar times R "
        "changes no rank of single-frame PSS; it does change those of σ∞."
    )
    parts = [
        _titled("How well does it rank?", ranking, folded("ρ by R", ranking_table(places))),
        folded("By the number of cameras", _of_counts(places)),
        _titled(
            "Against R = I and against counting",
            "Paired differences of ρ, to other R and to the counts of what the same contender takes as visible.",
            folded("Differences", difference_table(places)),
        ),
        _titled(
            "What does choosing by it cost?",
            "Mean regret of single-frame PSS.",
            folded("Regret of choosing one of 5 and of 20", regret_table(places)),
        ),
        _titled(
            "Is the error as large as predicted?",
            "NEES over its degrees of freedom: 1 is right, above it errors are larger than predicted. The filter is at "
            f"the random walk's q ≈ c{_levels(places)}, before an update (prior) and after it (posterior).",
            folded("NEES by level", nees_table(places)),
        ),
        folded("Ratios, coverage, and ranks of points", ratio_table(places)),
        folded("Axes of the error ellipsoids", axes_table(places)),
        _titled("What is the ceiling?", CEILING, ceiling_table(places)),
        _titled(
            "σ∞ by process noise",
            "ρ of σ∞ with the filter's measured PSS; in bold q ≈ c.",
            folded("ρ by level of process noise", process_table(places)),
        ),
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
    words = (
        "ρ and rank [interval] of each metric by each measure; shares and median favour no metric's form. Pairs that "
        "order the configurations the same way are one row. Most rivals were judged with the visibility of "
        "`calibrated, limits` only."
    )
    return _titled("Against the rivals", words, body)


def _levels(places: Sequence[Place]) -> str:
    """The step of the headline's random walk in each place."""
    found = [
        (place.title, level_words(row).removeprefix("random walk, "))
        for place in places
        if (row := first_of(place.rows("process"), headline="yes", process="random-walk"))
    ]
    words = dict.fromkeys(level for _, level in found)
    return f" ({'; '.join(_of_level(level, found) for level in words)})" if found else ""


def _of_level(level: str, found: Sequence[tuple[str, str]]) -> str:
    return f"{level} in {', '.join(title for title, own in found if own == level)}"


def _of_counts(places: Sequence[Place]) -> str:
    """The table by the number of cameras, and who has one number of cameras alone."""
    table = count_table(places)
    single = [place.title for place in places if len({row["cameras"] for row in place.rows("leaderboard")}) == 1]
    words = f"Judged with four cameras alone: {', '.join(single)}." if single else ""
    return "\n\n".join(filter(None, (table, words))) if table else ""


def _by_place(title: str, words: str, places: Sequence[Place]) -> str:
    body = "\n\n".join(folded(f"Parts: {place.title}", text) for place in places if (text := parts_table(place)))
    return _titled(title, words, body)


def _titled(title: str, words: str, body: str) -> str:
    return "\n\n".join(part for part in (f"### {title}", words, body) if part) if body else ""
