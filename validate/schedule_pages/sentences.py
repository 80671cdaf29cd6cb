"""A schedule's verdict in words: how well PSS follows along the walk, which strategy it would choose, the claims."""

from __future__ import annotations

from typing import Any

import numpy as np

from pss.hints import CsvRow
from validate.pages.columns import whole_number
from validate.pages.data import KINDS
from validate.pages.sentences import claims, standing_of
from validate.runs.csv_file import all_of
from validate.runs.numbers import number_of, percent, plain_range, rho_words
from validate.schedule.agreement import ALL_RUNS
from validate.schedule_pages.tables import KIND_NAMES, ScheduleTable

__all__ = ["cards", "claims_in_brief", "ranking_rows", "remarks", "verdict_rows"]

# R of these mixes m² with px²: their PSS has an order, but no size.
WITHOUT_SIZE = ("as-printed", "corrected")
STEADY = "People are held still at each step: prediction and measurement are those of a local steady state."
INTERVALS = (
    "Intervals of the verdict are over steps, which are few and alike from one to the next; those of PSS and ranks "
    "come from resampled trials and markers. They do not cover other hallways, walks or cameras."
)


def verdict_rows(table: ScheduleTable) -> list[dict[str, Any]]:
    """For each noise model and kind, over all runs without a zoom limit: ρ and the log ratio, with intervals."""
    found = []
    for model in table.every.models:
        for kind in KINDS:
            row = _agreement(table, model, kind.name)
            found.append(
                {
                    "model": model,
                    "kind": kind.words,
                    "n": row["n"],
                    "rho": rho_words(*_three(row, "spearman")),
                    "standing": standing_of(*_three(row, "spearman")),
                    "ratio": plain_range(*_three(row, "median_abs_log_ratio")),
                    "factor": _factor(model, row),
                }
            )
    return found


def ranking_rows(table: ScheduleTable) -> list[dict[str, Any]]:
    """For each noise model and kind: the order of the strategies beside that of measured PSS of the same kind."""
    return [
        {
            "model": model,
            "kind": kind.words,
            "rho": rho_words(*_three(row, "spearman")),
            "chosen": row["chosen"],
            "best": row["best"],
            "share": percent(row["chosen_is_best_share"]),
            "regret": percent(row["regret"]),
        }
        for model in table.every.models
        for kind in KINDS
        if (row := _ranking(table, model, kind.name)) is not None
    ]


def cards(table: ScheduleTable) -> list[dict[str, str]]:
    """The verdict in sentences: `title` and `text` of each card."""
    model, steps = table.every.leading_model, len(table.y_m)
    count = len(table.strategy_names)
    single, filtered = (_agreement(table, model, kind.name) for kind in KINDS)
    follows = (
        f"Over {single['n']} pairs of strategy and step ({count} strategies, {steps} steps, {_limit_words(table)}), "
        f"predicted single-frame PSS (noise model {model}) {standing_of(*_three(single, 'spearman'))} the measured "
        f"one: Spearman’s ρ = {rho_words(*_three(single, 'spearman'))}. In size it is off by {_factor(model, single)} "
        f"in the median. The paper’s own PSS, of σ∞, {standing_of(*_three(filtered, 'spearman'))} the filter’s: "
        f"ρ = {rho_words(*_three(filtered, 'spearman'))}, off by {_factor(model, filtered)}."
    )
    found = [{"title": "Does PSS follow the measurement along the walk?", "text": follows}]
    ranks = [(kind, _ranking(table, model, kind.name)) for kind in KINDS]
    words = " ".join(_choice_words(kind.words, row) for kind, row in ranks if row is not None)
    if words:
        words += f" Only {count} strategies are ranked: read the intervals."
        found.append({"title": "Does it choose the right strategy?", "text": words})
    return found


def claims_in_brief(table: ScheduleTable) -> list[dict[str, Any]]:
    """The paper's claims, each with the results of the leading noise model and of the measurement, by kind.

    Of a claim that is tested under several zoom limits, the first that can be tested.
    """
    found = []
    for claim in dict.fromkeys(row["claim"] for row in table.claims):
        cells = []
        for side, model in (("predicted", table.every.leading_model), ("measured", "")):
            for kind in KINDS:
                rows = all_of(table.claims, claim=claim, side=side, noise_model=model, kind=KIND_NAMES[kind.name])
                cells.append(next((cell for row, cell in zip(rows, claims(rows), strict=True) if row["value"]), None))
        if any(cells):
            figure = next(cell["figure"] for cell in cells if cell)
            found.append({"claim": claim, "figure": figure.partition(" (median")[0], "cells": cells})
    return found


def remarks(table: ScheduleTable) -> list[str]:
    """Caveats of the verdict; each sentence only where the tables support it."""
    found = [
        f"{STEADY} The walk that is rendered frame by frame is in walk.csv and the film, not here.",
        INTERVALS,
    ]
    never = [row for row in table.claims if row["holds"] == "not asked"]
    found += list(
        dict.fromkeys(f"Zoom limit {row['statistic']}. Its steps are those without a limit." for row in never)
    )
    columns = table.every.steps[table.every.models[0]]
    seen, by_two = columns["markers_seen_by_two"].mean(), columns["markers_found_by_two"].mean()
    points = int(columns["points"][0])
    found.append(
        f"Of the {points} markers on both suits, {seen:.0f} should be seen by two cameras in the mean over runs and "
        f"steps, and {by_two:.1f} are found by two: most face away, or are too small to be read. A marker that is not "
        "found counts 0 in measured PSS."
    )
    lost = sum(whole_number(row, "lost_tracks") for row in table.steering)
    found.append(f"The steering lost an avatar {lost} times. Cameras aim where a tracker expects the avatars.")
    return found


def _agreement(table: ScheduleTable, model: str, kind: str) -> CsvRow:
    [row] = all_of(
        table.agreement,
        zoom_limit=table.first_limit,
        strategy=ALL_RUNS,
        kind=KIND_NAMES[kind],
        noise_model=model,
    )
    return row


def _ranking(table: ScheduleTable, model: str, kind: str) -> CsvRow | None:
    rows = all_of(
        table.ranking,
        zoom_limit=table.first_limit,
        noise_model=model,
        kind=KIND_NAMES[kind],
        measure=f"measured PSS, {KIND_NAMES[kind]}",
    )
    return rows[0] if rows else None


def _three(row: CsvRow, name: str) -> tuple[float, float, float]:
    return number_of(row[name]), number_of(row[f"{name}_ci_low"]), number_of(row[f"{name}_ci_high"])


def _factor(model: str, row: CsvRow) -> str:
    """The median ratio's size as a factor."""
    if model in WITHOUT_SIZE:
        return "no meaning"
    values = np.exp(_three(row, "median_abs_log_ratio"))
    return "undefined" if np.isnan(values[0]) else "a factor of {:.2f} [{:.2f}, {:.2f}]".format(*values)


def _limit_words(table: ScheduleTable) -> str:
    return "no zoom limit" if table.first_limit == "none" else f"zoom limit {table.first_limit}"


def _choice_words(kind: str, row: CsvRow) -> str:
    rho = rho_words(*_three(row, "spearman"))
    opening = f"{kind.capitalize()}: it would choose {row['chosen']}"
    if row["chosen"] == row["best"]:
        words = f"{opening}, which is measured best, too"
    else:
        words = (
            f"{opening}; the best measured is {row['best']}, and the choice loses {percent(row['regret'])} of its PSS"
        )
    return f"{words} (the same strategy in {percent(row['chosen_is_best_share'])} of the resamples; ρ = {rho})."
