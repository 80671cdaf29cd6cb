"""The report of a run of sweeps, from its tables and what the tables do not have: predictions and detections."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from pss import Evaluation
from render.code_digest import code_of
from render.store.folder import Store, StoreError, write_text
from validate.acquire.acquire import Acquisition
from validate.markers.view_measurement import ViewMeasurement
from validate.pages.data import SweepTable
from validate.pages.gltf import write_models
from validate.pages.images import pictures_of
from validate.pages.section import Section, html_of, section_of
from validate.pages.steps import steps_of_plan
from validate.pages.stored import REPORT
from validate.plots.sweep import EXCLUDED
from validate.sweeps.sweep import Plan, SweepResult

__all__ = ["SweepForReport", "of_results", "source_of_report", "write_report"]


@dataclass(frozen=True, eq=False)
class SweepForReport:
    """A sweep with what the tables do not have: predictions by step and noise model, and detections by view."""

    plan: Plan
    labels: tuple[str, ...]
    predictions: tuple[Mapping[str, Evaluation], ...]
    measured: Mapping[Acquisition, ViewMeasurement]


def of_results(results: Sequence[SweepResult], measured: Mapping[Acquisition, ViewMeasurement]) -> list[SweepForReport]:
    """Those sweeps of a run that have a configuration to show."""
    return [
        SweepForReport(
            result.plan,
            tuple(configuration.label for configuration in result.configurations),
            tuple(assessment.predicted for assessment in result.assessments),
            measured,
        )
        for result in results
        if result.assessments
    ]


def write_report(folder: Path, found: Sequence[SweepTable], sweeps: Sequence[SweepForReport], store: Store) -> Path:
    """Write `report.html` and the scene as glTF into a run's folder; the report's path.

    Args:
        found: the run's tables, a part for each sweep.

    Raises:
        StoreError: the tables are of other sweeps, or the folder cannot be written.
        DamagedViewError: a view is not in the store, or was found damaged and set aside.
    """
    tables = {table.name: table for table in found}
    sections: list[Section] = []
    for sweep in sweeps:
        name = sweep.plan.sweep.name
        if name not in tables or tables[name].labels != sweep.labels:
            raise StoreError(f"{folder}/configurations.csv has other steps than the sweep {name}; run the sweep again")
        steps = steps_of_plan(sweep.plan, sweep.labels, sweep.predictions, sweep.measured)
        sections.append(section_of(tables[name], sweep.plan.sweep.title, steps))
    every_step = [step for section in sections for step in section.steps]
    pictures = pictures_of(every_step, [crop for section in sections for crop in section.crops], store)
    path = folder / REPORT
    write_text(path, html_of(sections, pictures, _about(sweeps)))
    write_models(folder, sections)
    return path


def _about(sweeps: Sequence[SweepForReport]) -> dict[str, str]:
    first = sweeps[0].plan
    return {
        "sweeps": ", ".join(sweep.plan.sweep.name for sweep in sweeps),
        "scene": first.scene.path.name,
        "trials of each view": str(first.sweep.trials),
        "seed": str(first.sweep.seed),
        "renderer": next((item.request.renderer for views in first.views for item in views), "none"),
    }


def source_of_report(figures_drawn_from: str) -> str:
    """Hash of all that a report shows, beside what a run's figures show: the code that makes it."""
    code = code_of("validate.pages.section", "validate.pages.images", "validate.pages.gltf", excluded=EXCLUDED)
    digest = hashlib.sha256(f"{figures_drawn_from} {code.digest}".encode())
    for path in sorted((Path(__file__).parents[1] / "pages" / "templates").iterdir()):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:24]
