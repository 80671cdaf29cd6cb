"""The numbers of the five sentences in each room and light, as one table."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from validate.findings.contenders import CALIBRATED, IDENTITY, PHYSICAL, PRINTED, WHOLE_MARKERS
from validate.findings.places import COUNT, FILTER, SHARE, Place
from validate.findings.process import at_headline, at_the_scenes, ratio_words
from validate.runs.numbers import NOTHING, number, percent_with_range
from validate.runs.table_text import markdown_table

__all__ = ["summary_table"]

WALK, REGRET, NEES = "random-walk", "regret_of_20_mean", "nees_per_dof"
WITHIN, MEDIAN, FRAME = "share_under_0.1mm", "median_rms_m", "pss-single-frame"


def _less_identity(model: str) -> tuple[str, Callable[[Place], str]]:
    return f"1 · {model} less R = I", lambda place: number(place.less(model, IDENTITY), "spearman_difference")


def _ratio(place: Place) -> str:
    row = at_headline(place, CALIBRATED, WALK)
    return ratio_words(row).removeprefix("q/c ") if row else NOTHING


# Each row: what it is, and its number in a place.
ROWS: tuple[tuple[str, Callable[[Place], str]], ...] = (
    ("1 · ρ as printed", lambda place: number(place.ranked(PRINTED), "spearman")),
    ("1 · ρ of R = I", lambda place: number(place.ranked(IDENTITY), "spearman")),
    *map(_less_identity, (PRINTED, "corrected", PHYSICAL, CALIBRATED)),
    (
        "1 · σ∞, 1 mm a frame: as-printed less R = I",
        lambda place: number(place.less(PRINTED, IDENTITY, FILTER), "spearman_difference"),
    ),
    ("2 · ρ calibrated", lambda place: number(place.ranked(CALIBRATED), "spearman")),
    ("2 · ρ physical", lambda place: number(place.ranked(PHYSICAL), "spearman")),
    ("2 · ρ physical, whole markers", lambda place: number(place.ranked(WHOLE_MARKERS), "spearman")),
    ("2 · ρ calibrated R", lambda place: number(place.ranked("calibrated R"), "spearman")),
    ("2 · ρ calibrated, limits", lambda place: number(place.ranked("calibrated, limits"), "spearman")),
    ("2 · ρ within 0.1 mm, calibrated", lambda place: number(place.ranked(CALIBRATED, FRAME, WITHIN), "spearman")),
    ("2 · ρ within 0.1 mm, count", lambda place: number(place.ranked(CALIBRATED, COUNT, WITHIN), "spearman")),
    ("2 · ρ median RMS, calibrated", lambda place: number(place.ranked(CALIBRATED, FRAME, MEDIAN), "spearman")),
    ("2 · ρ median RMS, count", lambda place: number(place.ranked(CALIBRATED, COUNT, MEDIAN), "spearman")),
    ("3 · q/c of the random walk", _ratio),
    ("3 · ρ of σ∞ at q ≈ c", lambda place: number(at_headline(place, CALIBRATED, WALK), "spearman")),
    ("3 · ρ of the count of cameras", lambda place: number(at_headline(place, CALIBRATED, WALK, COUNT), "spearman")),
    ("3 · ρ of the share that two see", lambda place: number(at_headline(place, CALIBRATED, WALK, SHARE), "spearman")),
    ("3 · σ∞ less the count", lambda place: number(at_headline(place, CALIBRATED, WALK), "minus_visibility_count")),
    ("3 · σ∞ less the share", lambda place: number(at_headline(place, CALIBRATED, WALK), "minus_visible_share")),
    ("3 · ρ of σ∞, 1 mm a frame", lambda place: number(at_the_scenes(place, CALIBRATED), "spearman")),
    ("3 · ρ of the share, 1 mm a frame", lambda place: number(at_the_scenes(place, CALIBRATED, SHARE), "spearman")),
    ("4 · NEES/3 calibrated", lambda place: number(place.sized(CALIBRATED), NEES)),
    ("4 · NEES/3 physical", lambda place: number(place.sized(PHYSICAL), NEES)),
    ("4 · NEES/3 physical, whole markers", lambda place: number(place.sized(WHOLE_MARKERS), NEES)),
    ("5 · regret calibrated", lambda place: percent_with_range(place.ranked(CALIBRATED), REGRET)),
    ("5 · regret of the oracle", lambda place: percent_with_range(place.ranked(CALIBRATED), f"oracle_{REGRET}")),
    ("5 · regret physical", lambda place: percent_with_range(place.ranked(PHYSICAL), REGRET)),
    ("5 · regret as printed", lambda place: percent_with_range(place.ranked(PRINTED), REGRET)),
    ("5 · regret of R = I", lambda place: percent_with_range(place.ranked(IDENTITY), REGRET)),
)


def summary_table(places: Sequence[Place]) -> str:
    """A column for each place; rows without any number are left out."""
    rows = [[words, *(find(place) for place in places)] for words, find in ROWS]
    there = [row for row in rows if any(cell != NOTHING for cell in row[1:])]
    return markdown_table(["sentence", *(place.title for place in places)], there)
