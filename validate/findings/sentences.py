"""The five main findings in a sentence each, with numbers and intervals from the tables.

What a sentence claims follows from the numbers: a difference counts if its interval has no zero in it, a size is right
if NEES is within `sentence_size.RIGHT_SIZE`. Other tables make other sentences.
"""

from __future__ import annotations

from collections.abc import Sequence

from pss.hints import CsvRow
from validate.findings.places import Place
from validate.findings.population import common_population
from validate.findings.sentence import Sentence
from validate.findings.sentence_choosing import choosing_sentence
from validate.findings.sentence_printed import printed_sentence
from validate.findings.sentence_process import process_sentence
from validate.findings.sentence_ranking import ranking_sentence
from validate.findings.sentence_size import size_sentence

__all__ = ["five_sentences", "with_population"]


def five_sentences(places: Sequence[Place], calibration_errors: Sequence[CsvRow] = ()) -> list[Sentence]:
    """Those of the five for which there are tables.

    Args:
        places: of which the first is the one that the sentences begin with.
        calibration_errors: rows of calibration_error.csv.
    """
    if not places:
        return []
    makers = (printed_sentence, ranking_sentence, process_sentence, size_sentence)
    found = [sentence for maker in makers if (sentence := maker(places)) is not None]
    choosing = choosing_sentence(places, calibration_errors)
    return [*found, choosing] if choosing else found


def with_population(places: Sequence[Place], calibration_errors: Sequence[CsvRow] = ()) -> str:
    """The sentences as a numbered list in Markdown, and below it the population that they share."""
    parts = [
        f"{place}. **{each.claim}** {each.numbers}" + f" *{each.population}.*" * bool(each.population)
        for place, each in enumerate(five_sentences(places, calibration_errors), 1)
    ]
    return "\n\n".join([*parts, common_population(places)] if parts else [])
