"""The page of a schedule: one section, with choices of strategy and zoom limit, whose steps are the walk."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from validate.pages import budget, points, scene3d, space
from validate.pages import section as page
from validate.pages.data import KINDS
from validate.pages.figure import Choice
from validate.pages.images import Pictures, chosen_crops
from validate.pages.scene3d import Group
from validate.pages.section import Courses, Section
from validate.pages.sentences import claims
from validate.pages.steps import Step
from validate.runs.numbers import written
from validate.runs.palette import BLUE, TINT_BLUE, TINT_VERMILION, VERMILION
from validate.schedule_pages import curves, ranking, sentences
from validate.schedule_pages.steps import Different, label_of
from validate.schedule_pages.tables import ScheduleTable

__all__ = ["html_of_schedule", "schedule_section"]

# Signs of the cameras that follow the first and the second avatar, as of their markers, and tints of their bodies.
FOLLOWING = ((BLUE, "circle"), (VERMILION, "square"))
TINTS = (TINT_BLUE, TINT_VERMILION)
# Of a body in each of the steps: hundreds of them are sent with the page.
MOST_FACES = 700
# A marker of a suit is some centimetres wide, in a hallway of ten metres.
PLATE_SCALE = 1.6
# From the side, in plotly's unit: the walk goes across the page.
EYE = (1.4, -0.34, 0.68)


def schedule_section(
    table: ScheduleTable, found: Different, title: str, avatars: tuple[str, str], steps: Sequence[Step]
) -> Section:
    """All that the page shows of a schedule.

    Args:
        found: the different steps, which `steps` are.
        avatars: names, the first of the walk first.
    """
    of_walk = len(table.y_m)
    states = table.every.at([run * of_walk + step for run, step in found.places])
    appearances = {
        name: Group(colour, symbol, f"follows {name}")
        for name, (colour, symbol) in zip(avatars, FOLLOWING, strict=True)
    }
    bodies = dict(zip(avatars, TINTS, strict=True))
    plates = f"Plates are drawn {PLATE_SCALE:g} times as large as they are. "
    figures = [
        curves.walk_figure(table, *avatars),
        ranking.ranking_figure(table),
        ranking.agreement_figure(table),
        points.points_figure(states),
        budget.budget_figure(states),
        scene3d.scene_figure(states, steps[0].state.room, appearances, bodies, plates, EYE),
    ]
    columns = page.joined_columns(
        points.point_columns(states, steps),
        budget.budget_columns(states),
        [curves.walk_columns(table, step) for _, step in found.places],
        space.scene_columns(states, steps, appearances, tuple(bodies), MOST_FACES, PLATE_SCALE),
    )
    choices = (
        Choice("strategy", "Strategy", tuple((name, name) for name in table.strategy_names)),
        Choice("zoom_limit", "Zoom limit", tuple((limit, limit.replace("x", "×")) for limit in table.limits)),
    )
    courses = Courses(
        choices,
        {"|".join(run): numbers for run, numbers in found.courses.items()},
        tuple(f"{label_of(y)}, {time:.1f} s" for y, time in zip(table.y_m, table.time_s, strict=True)),
        int(table.measured(KINDS[0])[0][0].argmax()),
    )
    crops = chosen_crops(steps)
    named = dataclasses.replace(states, labels=tuple(step.label for step in steps))
    return Section(named, title, steps, figures, columns, crops, courses, appearances, all_cameras=True)


def html_of_schedule(section: Section, table: ScheduleTable, pictures: Pictures, about: Mapping[str, str]) -> str:
    """The whole page.

    Args:
        pictures: of the section.
        about: what the run was made with, for the foot: words by name.
    """
    name = table.every.name
    words = {
        "verdict": "",
        "remarks": sentences.remarks(table),
        "claims": claims(table.claims),
        "steps": _step_rows(table),
        "steering": table.steering,
    }
    return page.page_of(
        "hallway.html.j2",
        f"PSS report: {name}",
        [section],
        [words],
        pictures,
        about,
        cards=sentences.cards(table),
        brief=sentences.claims_in_brief(table),
        leading=table.every.leading_model,
        verdicts=sentences.verdict_rows(table),
        rankings=sentences.ranking_rows(table),
        limit_words="without a zoom limit" if table.first_limit == "none" else f"with the limit {table.first_limit}",
    )


def _step_rows(table: ScheduleTable) -> list[dict[str, Any]]:
    """For each run, the table of its steps, for who would rather read than look; PSS in 1/m."""
    models, measured = table.every.models, [table.measured(kind) for kind in KINDS]
    predicted = {(model, kind.name): table.predicted(model, kind) for model in models for kind in KINDS}
    detected = table.by_run(table.every.steps[models[0]]["markers_found_by_two"])
    found = []
    for number, (strategy, limit) in enumerate(table.runs):
        rows = []
        for step, y in enumerate(table.y_m):
            cells = [written(predicted[model, kind.name][number, step], 4) for kind in KINDS for model in models]
            ranges = []
            for value, low, high in ((part[number, step] for part in parts) for parts in measured):
                interval = f" [{written(low, 4)}, {written(high, 4)}]" if low == low else ""
                ranges.append(written(value, 4) + interval)
            rows.append(
                {
                    "label": f"{label_of(y)}, {table.time_s[step]:.1f} s",
                    "assigned": table.assigned[number * len(table.y_m) + step],
                    "predicted": cells,
                    "measured": ranges,
                    "found": f"{detected[number, step]:.1f}",
                }
            )
        found.append({"strategy": strategy, "limit": limit, "rows": rows})
    return found
