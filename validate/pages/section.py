"""The page itself: sweeps with their figures, tables and pictures, as one HTML file that refers to no other."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import jinja2
import plotly.offline

from validate.pages import budget, causes, curves, measured, plan, points, quality, scene3d, sentences, space
from validate.pages.data import KINDS, MM, SweepTable
from validate.pages.figure import Choice, Columns, Figure, only_changes
from validate.pages.html import json_in_page
from validate.pages.images import LAYERS, MOST_BLUR_PX, Crop, Pictures, chosen_crops, overlay
from validate.pages.scene3d import GROUPS, Group
from validate.pages.steps import Step
from validate.runs.numbers import written

__all__ = ["KIND_CHOICE", "Courses", "Section", "html_of", "joined_columns", "page_of", "section_of", "words_of"]

KIND_CHOICE = Choice("kind", "Kind of PSS", tuple((kind.name, kind.words) for kind in KINDS))


# What plays may do in a second.
SPEEDS_PER_S = (1, 2, 4, 8)


@dataclass(frozen=True)
class Courses:
    """What the slider goes through: for each setting of some choices, the numbers of the section's steps in order.

    Attributes:
        choices: the reader's, such as of a strategy; a sweep has none.
        steps: by the choices' values, joined by "|".
        labels: of the slider's places.
        first: the place that is shown at first.
    """

    choices: tuple[Choice, ...]
    steps: Mapping[str, Sequence[int]]
    labels: tuple[str, ...]
    first: int


@dataclass(frozen=True)
class Section:
    """A sweep, or another run in steps, on the page.

    Attributes:
        columns: of its steps.
        crops: requested of its pictures.
        groups: of its cameras.
        all_cameras: whether the pictures of all cameras are shown at first.
    """

    table: SweepTable
    title: str
    steps: Sequence[Step]
    figures: Sequence[Figure]
    columns: Sequence[Columns]
    crops: Sequence[Crop]
    courses: Courses
    groups: Mapping[str, Group]
    all_cameras: bool = False

    @property
    def model_choice(self) -> Choice:
        """Of the noise model, the leading one first."""
        models = self.table.models
        return Choice("model", "Noise model", tuple((m, m) for m in models), self.table.leading_model)


def section_of(table: SweepTable, title: str, steps: Sequence[Step]) -> Section:
    """The figures of a sweep and all that they show at each step."""
    if measured.is_measurement(table):
        of_steps = [points.points_figure(table), plan.plan_figure(table, steps)]
    else:
        of_steps = [
            curves.curves_figure(table),
            points.points_figure(table),
            quality.leaderboard_figure(table),
            quality.nees_figure(table),
        ]
    figures = [
        *of_steps,
        budget.budget_figure(table),
        budget.visibility_figure(table),
        scene3d.scene_figure(table, steps[0].state.room),
    ]
    if measured.is_measurement(table):
        figures = measured.of_one_step(figures)
    parts = (
        points.point_columns(table, steps),
        budget.budget_columns(table),
        budget.visibility_columns(steps),
        space.scene_columns(table, steps),
    )
    courses = Courses((), {"": range(len(steps))}, table.labels, table.measured_pss(KINDS[0]).best or 0)
    return Section(table, title, steps, figures, joined_columns(*parts), chosen_crops(steps), courses, GROUPS)


def joined_columns(*parts: Sequence[Columns]) -> list[Columns]:
    """The columns of each step, from several figures."""
    return [{name: value for part in at_step for name, value in part.items()} for at_step in zip(*parts, strict=True)]


def html_of(sections: Sequence[Section], pictures: Pictures, about: Mapping[str, str]) -> str:
    """The whole page of a run of sweeps; arguments as for `page_of`."""
    title = "PSS report: " + ", ".join(section.table.name for section in sections)
    return page_of("report.html.j2", title, sections, [_words_of_sweep(s) for s in sections], pictures, about)


def page_of(
    template: str,
    title: str,
    sections: Sequence[Section],
    words: Sequence[Mapping[str, Any]],
    pictures: Pictures,
    about: Mapping[str, str],
    **more: Any,
) -> str:
    """The whole page of a run.

    Args:
        words: of each section, values for the template beside those of `words_of`.
        pictures: of all sections, the crops one section after the other.
        about: what the run was made with, for the foot: words by name.
        more: further values for the template.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("validate.pages"), autoescape=True, undefined=jinja2.StrictUndefined
    )
    style, shared, own_script = (
        environment.loader.get_source(environment, file)[0]  # type: ignore[union-attr]
        for file in ("report.css", "figures.js", "report.js")
    )
    uris = iter(pictures.crops)
    crops = [[(crop, next(uris)) for crop in section.crops] for section in sections]
    return environment.get_template(template).render(
        title=title,
        sections=[
            {"id": f"sweep-{number}", **words_of(section, cut), **own}
            for number, (section, cut, own) in enumerate(zip(sections, crops, words, strict=True), start=1)
        ],
        speeds=SPEEDS_PER_S,
        layers=LAYERS,
        farthest_m=pictures.farthest_m,
        most_blur_px=MOST_BLUR_PX,
        picture_width_px=pictures.width_px,
        about=about,
        css=style,
        script=shared + own_script,
        plotly=plotly.offline.get_plotlyjs(),
        data=json_in_page({"sweeps": [_data(section) for section in sections], "views": _views(sections, pictures)}),
        **more,
    )


def _words_of_sweep(section: Section) -> dict[str, Any]:
    """Values for the template's part on a sweep."""
    table = section.table
    alone = measured.is_measurement(table)
    return {
        "verdict": measured.measured_in_words(table) if alone else sentences.in_words(table),
        "remarks": sentences.remarks(table),
        "verdicts": [] if alone else sentences.verdicts(table),
        "ratios": measured.ratio_rows(table),
        "markers": measured.marker_rows(table) if alone else [],
        "leading": table.leading_model,
        "claims": sentences.claims(table.claims),
        "findings": sentences.findings(table),
        "steps": [] if alone else _step_rows(table),
        "own": [f"{name}, {table.leading_model}" for name in table.own_metrics(table.leading_model)],
    }


def words_of(section: Section, crops: Sequence[tuple[Crop, str]]) -> dict[str, Any]:
    """Values for the template's part on any section."""
    table = section.table
    return {
        "name": table.name,
        "title": section.title,
        "labels": section.courses.labels,
        "figures": section.figures,
        "shared": (*section.courses.choices, section.model_choice, KIND_CHOICE),
        "models": table.models,
        "all_cameras": section.all_cameras,
        "crops": [
            (words, [(crop, uri) for crop, uri in crops if crop.kind == kind])
            for kind, words in (
                ("best", "Best localised"),
                ("worst", "Worst localised, of those found"),
                ("missed", "Should be seen, and never found"),
            )
        ],
        "missed_words": causes.in_words(crop.causes for crop, _ in crops if crop.kind == "missed"),
        "points": [f"{point} on {name}" for point, name in zip(table.point_ids, table.objects, strict=True)],
    }


def _step_rows(table: SweepTable) -> list[dict[str, Any]]:
    """The table of steps, for who would rather read than look; PSS in 1/m."""
    single = KINDS[0]
    found = table.measured_pss(single)
    columns = table.steps[table.models[0]]
    return [
        {
            "label": label,
            "cameras": " ".join(table.camera_names[n]),
            "predicted": [written(table.predicted_pss(model, single).values[n], 4) for model in table.models],
            "measured": _with_limits(found.values[n], found.low[n], found.high[n]),
            "own": [_own_text(values[n]) for values in table.own_metrics(table.leading_model).values()],
            "filter": written(table.measured_pss(KINDS[1]).values[n], 4),
            "points": f"{columns['detected'][n]:.0f} of {columns['points'][n]:.0f}",
            "rms": f"{columns['measured_rms_m'][n] * MM:.3g}",
        }
        for n, label in enumerate(table.labels)
    ]


def _own_text(value: float) -> str:
    """A number of a metric of any kind; a dash where it has none."""
    return written(value, 4) if math.isfinite(value) else ("–" if math.isnan(value) else f"{value:g}")


def _with_limits(value: float, low: float, high: float) -> str:
    """A number with its interval's ends, if it has one."""
    return written(value, 4) + ("" if math.isnan(low) else f" [{written(low, 4)}, {written(high, 4)}]")


def _data(section: Section) -> dict[str, Any]:
    """What the page's script draws from."""
    return {
        "name": section.table.name,
        "labels": list(section.courses.labels),
        "first": section.courses.first,
        "courses": {key: list(steps) for key, steps in section.courses.steps.items()},
        "course_of": [choice.name for choice in section.courses.choices],
        "steps": only_changes(section.columns),
        "figures": [
            {
                "id": f.id,
                "traces": f.traces,
                "layout": f.layout,
                "columns": f.columns,
                "height": f.height_px,
                "alt": f.alt,
            }
            for f in section.figures
        ],
        "views": [
            [
                [camera.name, sight.view_key, *([section.groups[group].words] if section.courses.choices else [])]
                for camera, sight, group in zip(step.cameras, step.sights, step.groups, strict=True)
            ]
            for step in section.steps
        ],
    }


def _views(sections: Sequence[Section], pictures: Pictures) -> dict[str, Any]:
    """Each view once: its size, pictures, and what is drawn over them."""
    found: dict[str, Any] = {}
    for section in sections:
        for step in section.steps:
            for number, sight in enumerate(step.sights):
                if sight.view_key not in found:
                    found[sight.view_key] = {
                        "size": list(step.cameras[number].resolution),
                        "pictures": pictures.views.get(sight.view_key, {}),
                        "markers": overlay(step, number),
                    }
    return found
