"""Console output for a scene measured as it is: the error in mm by object, and predicted against measured PSS."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from pss.hints import Row
from validate.runs.numbers import in_mm, written
from validate.stats.intervals import interval
from validate.sweeps.rows import THRESHOLDS_MM, pooled
from validate.sweeps.sweep import SweepResult

__all__ = ["error_line", "error_table", "ratio_table"]


MM = 1000.0


def error_line(result: SweepResult) -> str:
    """How large the errors are, in one sentence."""
    errors = result.assessments[0].measured.errors
    found, points = int((errors.detections > 0).sum()), len(errors.rms_m)
    name = result.plan.sweep.name
    if not found:
        return f"{name}: none of {points} markers was triangulated; there is no error to state"
    low, high = (float(end[0]) * MM for end in interval(next(iter(result.replicates.values())).rms_m))
    limits = "" if np.isnan(low) else f" [{low:.3g}, {high:.3g}]"
    shares = ", ".join(f"{errors.share_under(mm / MM):.0%} under {mm} mm" for mm in THRESHOLDS_MM)
    return (
        f"{name}: RMS error {errors.pooled_rms_m * MM:.3g} mm{limits} over {found} of {points} markers that were "
        f"triangulated; of all captures of all markers {shares}"
    )


def error_table(result: SweepResult) -> Table:
    """The markers of each object: how many were found, and their errors, measured and predicted."""
    (assessment,), errors = result.assessments, result.assessments[0].measured.errors
    table = Table(title=f"{result.plan.sweep.name}: error of the markers in mm, single frame")
    table.add_column("object")
    for head in ("markers", "triangulated", "measured RMS", "worst marker", "NEES/3 of detections' own"):
        table.add_column(head, justify="right")
    for model in result.noise_models:
        table.add_column(f"predicted, {model}", justify="right")
    own = assessment.measured.own_nees / 3
    markers = result.configurations[0].scene.state.markers
    names = np.array([marker.object_name for marker in markers])
    for name in dict.fromkeys(names.tolist()):
        of = names == name
        known = of & (errors.detections > 0)
        cells = ["–", "–", "–"]
        if known.any():
            worst = int(np.flatnonzero(known)[np.argmax(errors.rms_m[known])])
            cells = [in_mm(pooled(errors.rms_m, of)), f"{in_mm(errors.rms_m[worst])} ({markers[worst].id})"]
            cells.append(f"{np.nanmedian(own[known]):.2f}" if np.isfinite(own[known]).any() else "–")
        predicted = [in_mm(pooled(assessment.predicted[model].single_frame_rms_m, of)) for model in result.noise_models]
        table.add_row(name, str(int(of.sum())), str(int(known.sum())), *cells, *predicted)
    return table


def ratio_table(name: str, rows: Sequence[Row]) -> Table:
    """Predicted against measured PSS, by noise model and kind: rows as of `measurement_rows`."""
    table = Table(title=f"{name}: PSS in 1/m, predicted against measured, with 95 % intervals")
    for head in ("noise model", "kind"):
        table.add_column(head)
    for head in ("predicted", "measured", "measured / predicted", "NEES/3"):
        table.add_column(head, justify="right")
    for row in rows:
        cells = [written(float(str(row[key])), 4) for key in ("predicted_pss", "measured_pss")]
        limited = [_limited(row, key) for key in ("ratio", "nees_over_3")]
        table.add_row(str(row["noise_model"]), str(row["kind"]), *cells, *limited)
    return table


def _limited(row: dict[str, object], key: str) -> str:
    value, low, high = (float(str(row[name])) for name in (key, f"{key}_ci_low", f"{key}_ci_high"))
    if not np.isfinite(value):
        return "–"
    return f"{value:.3g}" + ("" if np.isnan(low) else f" [{low:.3g}, {high:.3g}]")
