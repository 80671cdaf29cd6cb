"""σ∞ by the level of process noise, where it measures precision and where it counts points; from process.csv."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pss.hints import CsvRow
from validate.findings.contenders import CALIBRATED, PHYSICAL, contenders_in
from validate.findings.places import COUNT, FILTER, SHARE, Place
from validate.runs.csv_file import all_of, bounds, first_of, value_of
from validate.runs.numbers import NOTHING, in_powers, number
from validate.runs.table_text import markdown_table

__all__ = [
    "COUNTED_BY",
    "MOTIONS",
    "at_headline",
    "at_the_scenes",
    "less_counts",
    "level_words",
    "process_table",
    "ratio_words",
]

# The kinds of motion in the column `process`, in words.
MOTIONS = {"random-walk": "random walk", "constant-velocity": "constant velocity"}
# The level of the scenes' own process noise.
SCENES_STEP_MM = 1.0
_LEVEL = ("process", "step_mm", "acceleration_density_m2_s3", "time_step_s")
# The counts, in words, and the contenders whose visibility they are shown by.
_COUNTS = {COUNT: "count of cameras, at most three", SHARE: "share that two cameras see"}
COUNTED_BY = (CALIBRATED, PHYSICAL)
_LESS = {COUNT: "minus_visibility_count", SHARE: "minus_visible_share"}


def at_headline(place: Place, model: str, motion: str, metric: str = "pss") -> CsvRow | None:
    """The row at q ≈ c of a metric under a noise model."""
    return first_of(place.rows("process"), headline="yes", process=motion, metric=metric, noise_model=model)


def at_the_scenes(place: Place, model: str, metric: str = "pss") -> CsvRow | None:
    """The row at the scenes' own process noise, from process.csv or from the leaderboard of the filter."""
    rows = all_of(place.rows("process"), process="random-walk", metric=metric, noise_model=model)
    there = [row for row in rows if math.isclose(value_of(row, "step_mm"), SCENES_STEP_MM)]
    return there[0] if there else place.ranked(model, metric, FILTER)


def less_counts(row: CsvRow) -> list[tuple[float, float, float]]:
    """The paired differences of ρ to each count that the table has, with their 95 % intervals."""
    return [found for column in _LESS.values() if not math.isnan((found := bounds(row, column))[1])]


def ratio_words(row: CsvRow) -> str:
    """The predicted and the measured q/c of a level: "q/c 0.38 predicted, 0.55 measured"."""
    kinds = {"predicted": value_of(row, "q_over_c"), "measured": value_of(row, "q_over_c_measured")}
    known = [f"{in_powers(value)} {kind}" for kind, value in kinds.items() if math.isfinite(value)]
    return f"q/c {', '.join(known)}" if known else "q/c unknown"


def level_words(row: CsvRow) -> str:
    """The kind of motion and how strong it is: "random walk, 0.05 mm a frame"."""
    motion = MOTIONS.get(row.get("process", ""), row.get("process", ""))
    step, density = value_of(row, "step_mm"), value_of(row, "acceleration_density_m2_s3")
    strength = "" if math.isnan(density) else f"{in_powers(density)} m²/s³"
    strength = strength if math.isnan(step) else f"{step:.2g} mm a frame"
    return ", ".join(filter(None, (motion, strength)))


def process_table(places: Sequence[Place]) -> str:
    """ρ of σ∞ by place, process and level under every contender, and of the counts."""
    rows = []
    counts = {f"{words} ({model})": (metric, model) for model in COUNTED_BY for metric, words in _COUNTS.items()}
    models = contenders_in(row["noise_model"] for place in places for row in place.rows("process"))
    for place in places:
        table = place.rows("process")
        for level in dict.fromkeys(tuple(row.get(key, "") for key in _LEVEL) for row in table):
            here = [row for row in table if tuple(row.get(key, "") for key in _LEVEL) == level]
            pss = {row["noise_model"]: row for row in all_of(here, metric="pss")}
            ratios = [value_of(here[0], name) for name in ("q_over_c", "q_over_c_measured")]
            words = level_words(here[0])
            rows.append(
                [
                    place.title,
                    f"**{words}**" if here[0].get("headline") == "yes" else words,
                    *(in_powers(ratio) if math.isfinite(ratio) else NOTHING for ratio in ratios),
                    *(number(pss.get(model.name), "spearman") for model in models),
                    *(
                        number(first_of(here, metric=metric, noise_model=model), "spearman")
                        for metric, model in counts.values()
                    ),
                ]
            )
    heads = ["where", "process noise", "q / c", "measured", *(model.name for model in models), *counts]
    return markdown_table(heads, rows)
