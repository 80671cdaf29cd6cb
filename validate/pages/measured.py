"""The report of a scene that is measured as it is: errors in mm, ratios to predictions, and each marker."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from validate.pages.data import MM, SweepTable
from validate.pages.figure import Figure
from validate.runs.csv_file import all_of, number_in
from validate.runs.numbers import in_mm, written

__all__ = ["is_measurement", "marker_rows", "measured_in_words", "of_one_step", "ratio_rows"]

ENDS = ("", "_ci_low", "_ci_high")
# mm, of the tables' shares of errors.
THRESHOLDS_MM = (1, 2, 5, 10)


# Columns of measurement.csv.
NUMBERS = ("predicted_pss", "measured_pss", *(f"{name}{end}" for name in ("ratio", "nees_over_3") for end in ENDS))
# The name of what a figure draws of all steps together.
ALL_STEPS = "all steps"
# Captions of figures that are made for a sweep of several steps.
CAPTIONS = {
    "points": (
        "Each sign is a marker. On the solid line the error is as large as predicted; the dashed one is the median "
        "ratio. A scatter along a line shows that the metric predicts which points are hard; a line away from the "
        "solid one, that it is wrong by a factor. Points that are not observable, or were never triangulated, have no "
        "place here: see the error budget."
    ),
    "budget": (
        "Four factors multiply to measured over predicted single-frame PSS; 1: no departure. “Visibility”: points and "
        "views that should see them, and did not find them in every trial. “Noise model”: the predicted R against the "
        "covariance that each detection gets from its own image. “Detector”: that covariance against how far "
        "detections really are off, with the bias that every trial repeats. “Geometry”: what triangulation makes of "
        "them against what H predicts. With the paper’s R the second factor has no meaning, since that R mixes units."
    ),
    "visibility": (
        "Markers whose centre each camera should see: found in half of the trials or more, or missed. Missed markers "
        "are the part of the departure that no noise model explains: the metric requires a centre in view, the "
        "detector needs the whole marker, large and sharp enough."
    ),
}


def of_one_step(figures: Sequence[Figure]) -> list[Figure]:
    """The figures with captions that speak of no other steps, and without what is drawn of those."""
    return [
        replace(
            figure,
            caption=CAPTIONS.get(figure.id, figure.caption),
            traces=[trace for trace in figure.traces if trace.get("name") != ALL_STEPS],
        )
        for figure in figures
    ]


def is_measurement(table: SweepTable) -> bool:
    """Whether a sweep has one step alone."""
    return len(table.labels) == 1


def measured_in_words(table: SweepTable) -> str:
    """The sentences that the report begins with."""
    columns = {name: values[0] for name, values in table.steps[table.models[0]].items()}
    found, count = int(columns["detected"]), int(columns["points"])
    if not found:
        return f"None of {count} markers was triangulated: there is no error to state."
    measured = table.points[table.models[0]]["measured_rms_m"][0]
    worst = int(np.nanargmax(measured))
    limits = _limits(*(columns[f"measured_rms_ci_{end}_m"] * MM for end in ("low", "high")))
    words = (
        f"The RMS error is {columns['measured_rms_m'] * MM:.3g} mm{limits} over the {found} of {count} markers that "
        f"were triangulated, single frame; the worst is {measured[worst] * MM:.3g} mm, marker {table.point_ids[worst]} "
        f"on {table.objects[worst]}. Of all captures of all markers "
        + ", ".join(f"{columns[f'share_under_{mm}mm']:.0%} are off by less than {mm} mm" for mm in THRESHOLDS_MM[:2])
        + ". "
    )
    model = table.leading_model
    words += f"Predicted (noise model {model}): {table.steps[model]['predicted_rms_m'][0] * MM:.3g} mm"
    rows = all_of(table.measurement, noise_model=model, kind="single frame")
    if rows and rows[0]["ratio"]:
        ratio, *ends = (number_in(rows[0], f"ratio{end}") for end in ENDS)
        words += f"; measured PSS is {ratio:.3g}{_limits(*ends)} times the predicted one"
    return f"{words}.".replace("%", " %")


def _limits(low: float, high: float) -> str:
    return "" if math.isnan(low) else f" [{low:.3g}, {high:.3g}]"


def ratio_rows(table: SweepTable) -> list[dict[str, str]]:
    """Rows of measurement.csv in words."""
    found = []
    for row in table.measurement:
        numbers = {key: number_in(row, key) for key in NUMBERS}
        words = {
            key: "–"
            if not math.isfinite(numbers[key])
            else f"{numbers[key]:.3g}{_limits(numbers[f'{key}_ci_low'], numbers[f'{key}_ci_high'])}"
            for key in ("ratio", "nees_over_3")
        }
        pss = {key: written(numbers[key], 4) for key in ("predicted_pss", "measured_pss")}
        found.append({"model": row["noise_model"], "kind": row["kind"], **pss, **words})
    return found


def marker_rows(table: SweepTable) -> list[dict[str, Any]]:
    """A row for each marker, the worst first, those without an error last."""
    first = {name: values[0] for name, values in table.points[table.models[0]].items()}
    of_models = {model: table.points[model]["single_frame_rms_m"][0] for model in table.models}
    nees = table.points[table.leading_model]["nees"][0]
    order = np.argsort(-np.nan_to_num(first["measured_rms_m"], nan=-1.0), kind="stable")
    return [_marker_row(table, int(n), first, of_models, nees) for n in order]


def _marker_row(
    table: SweepTable, n: int, first: Mapping[str, Any], of_models: Mapping[str, Any], nees: Any
) -> dict[str, Any]:
    columns = ("measured_rms_m", "measured_bias_m", "measured_std_m")
    return {
        "marker": table.point_ids[n],
        "object": table.objects[n],
        "place": ", ".join(f"{first[f'{axis}_m'][n]:.2f}" for axis in "xyz").replace("-", "−"),
        "views": int(first["views"][n]),
        "rate": f"{first['detection_rate'][n]:.0%}".replace("%", " %"),
        "measured": [in_mm(first[name][n]) for name in columns],
        "predicted": [in_mm(values[n]) for values in of_models.values()],
        "nees": f"{nees[n] / 3:.3g}" if math.isfinite(nees[n]) else "–",
    }
