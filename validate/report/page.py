"""The page itself: sweeps with their figures, tables and pictures, as one HTML file that refers to no other."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import jinja2
import plotly.offline

from validate.report import budget, curves, points, quality, scene3d, verdict
from validate.report.data import KINDS, MM, SweepTable
from validate.report.frame import json_in_page
from validate.report.images import LAYERS, MOST_BLUR_PX, Crop, Pictures, chosen_crops, overlay
from validate.report.steps import Step
from validate.report.traces import Choice, Columns, Figure, only_changes

__all__ = ["Section", "html_of", "section_of"]

KIND_CHOICE = Choice("kind", "Kind of PSS", tuple((kind.name, kind.words) for kind in KINDS))


@dataclass(frozen=True)
class Section:
    """A sweep on the page. `columns` are those of its steps; `crops` are asked of its pictures."""

    table: SweepTable
    title: str
    steps: Sequence[Step]
    figures: Sequence[Figure]
    columns: Sequence[Columns]
    crops: Sequence[Crop]

    @property
    def model_choice(self) -> Choice:
        """Of the noise model, the leading one first."""
        models = self.table.models
        return Choice("model", "Noise model", tuple((m, m) for m in models), self.table.leading_model)


def section_of(table: SweepTable, title: str, steps: Sequence[Step]) -> Section:
    """The figures of a sweep and all that they show at each step."""
    figures = [
        curves.curves_figure(table),
        points.points_figure(table),
        quality.leaderboard_figure(table),
        quality.nees_figure(table),
        budget.budget_figure(table),
        budget.visibility_figure(table),
        scene3d.scene_figure(table),
    ]
    parts = (
        points.point_columns(table, steps),
        budget.budget_columns(table),
        budget.visibility_columns(steps),
        scene3d.scene_columns(table, steps),
    )
    columns = [
        {name: value for part in at_step for name, value in part.items()} for at_step in zip(*parts, strict=True)
    ]
    return Section(table, title, steps, figures, columns, chosen_crops(steps))


def html_of(sections: Sequence[Section], pictures: Pictures, about: Mapping[str, str]) -> str:
    """The whole page.

    Args:
        pictures: of all sections, the crops one section after the other.
        about: what the run was made with, for the foot: words by name.
    """
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("validate.report"), autoescape=True, undefined=jinja2.StrictUndefined
    )
    source, _, _ = environment.loader.get_source(environment, "report.css")  # type: ignore[union-attr]
    script, _, _ = environment.loader.get_source(environment, "report.js")  # type: ignore[union-attr]
    uris = iter(pictures.crops)
    return environment.get_template("report.html.j2").render(
        title="PSS report: " + ", ".join(section.table.name for section in sections),
        sections=[_words(section, [(crop, next(uris)) for crop in section.crops]) for section in sections],
        layers=LAYERS,
        farthest_m=pictures.farthest_m,
        most_blur_px=MOST_BLUR_PX,
        picture_width_px=pictures.width_px,
        about=about,
        css=source,
        script=script,
        plotly=plotly.offline.get_plotlyjs(),
        data=json_in_page({"sweeps": [_data(section) for section in sections], "views": _views(sections, pictures)}),
    )


def _words(section: Section, crops: Sequence[tuple[Crop, str]]) -> dict[str, Any]:
    """What the template says of a section."""
    table = section.table
    return {
        "id": table.name,
        "title": section.title,
        "verdict": verdict.in_words(table),
        "remarks": verdict.remarks(table),
        "verdicts": verdict.verdicts(table),
        "claims": verdict.claims(table),
        "labels": table.labels,
        "figures": section.figures,
        "shared": (section.model_choice, KIND_CHOICE),
        "steps": _step_rows(table),
        "crops": [
            (words, [(crop, uri) for crop, uri in crops if crop.kind == kind])
            for kind, words in (
                ("best", "Best localised"),
                ("worst", "Worst localised, of those found"),
                ("missed", "Should be seen, and never found"),
            )
        ],
        "points": [f"{point} on {name}" for point, name in zip(table.point_ids, table.objects, strict=True)],
    }


def _step_rows(table: SweepTable) -> list[dict[str, Any]]:
    """The table of steps, for who would rather read than look; PSS in 1/m."""
    single = KINDS[0]
    measured = table.measured_pss(single)
    columns = table.steps[table.models[0]]
    return [
        {
            "label": label,
            "cameras": " ".join(table.camera_names[n]),
            "predicted": [f"{table.predicted_pss(model, single).values[n]:.4g}" for model in table.models],
            "measured": f"{measured.values[n]:.4g} [{measured.low[n]:.4g}, {measured.high[n]:.4g}]",
            "filter": f"{table.measured_pss(KINDS[1]).values[n]:.4g}",
            "points": f"{columns['detected'][n]:.0f} of {columns['points'][n]:.0f}",
            "rms": f"{columns['measured_rms_m'][n] * MM:.3g}",
        }
        for n, label in enumerate(table.labels)
    ]


def _data(section: Section) -> dict[str, Any]:
    """What the page's script draws from."""
    return {
        "name": section.table.name,
        "labels": list(section.table.labels),
        "first": section.table.measured_pss(KINDS[0]).best,
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
            [[camera.name, sight.view_key] for camera, sight in zip(step.cameras, step.sights, strict=True)]
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
