"""The rows of a schedule's files: those of sweeps, with step, time, strategy, zoom limit and avatar beside them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from pss.hints import Row
from validate.schedule.results import HEADLINE_KIND, ScheduleResult
from validate.schedule.runs import limit_name
from validate.stats.intervals import sample_interval
from validate.sweeps.rows import configuration_rows, point_rows

__all__ = ["held_configuration_rows", "held_point_rows", "run_rows"]


def held_configuration_rows(result: ScheduleResult) -> list[Row]:
    """A row for each run, step and noise model, of one avatar or both."""
    rows = []
    filter_low, filter_high = sample_interval(result.curves["", "filter"].samples)
    for row, (run, step) in _with_places(result, configuration_rows(result), per=1):
        model = str(row["noise_model"])
        held = result.held.steps[run][step]
        assessment = held.assessments[result.avatar]
        seen = assessment.predicted[model].visible.sum(axis=0) >= 2
        rates = assessment.view_detection_rate
        rows.append(
            {
                **_place(result, run, step),
                "avatar": result.avatar,
                **row,
                "pss_q_near_c": float(result.curves[model, HEADLINE_KIND].values[run, step]),
                "measured_pss_filter_q_near_c": float(result.curves["", HEADLINE_KIND].values[run, step]),
                "measured_pss_filter_ci_low": float(filter_low[run, step]),
                "measured_pss_filter_ci_high": float(filter_high[run, step]),
                "pss_surrogate": held.surrogate[result.avatar][model].pss,
                "sigma_inf_surrogate_rms_m": held.surrogate[result.avatar][model].sigma_inf_rms_m,
                "markers_seen_by_two": int(seen.sum()),
                "markers_found_by_two": float(assessment.measured.errors.detection_rate.sum()),
                "markers_found_by_any": float((rates.max(axis=0) > 0).sum()),
                "track_lost": int(_lost(result, run, step)),
            }
        )
    return rows


def held_point_rows(result: ScheduleResult) -> list[Row]:
    """A row for each run, step, marker and noise model."""
    markers = len(result.assessments[0].measured.errors.rms_m)
    return [
        {**_place(result, run, step), "avatar": row["object"], **row}
        for row, (run, step) in _with_places(result, point_rows(result), per=markers)
    ]


def run_rows(result: ScheduleResult) -> list[Row]:
    """A row for each run: what its steering came to."""
    rows = []
    for run in result.held.design.runs:
        steered = run.steered
        truth = np.array([result.held.design.stage.walk.positions_m[name] for name in result.held.design.stage.names])
        error = np.linalg.norm(steered.predicted_m - truth.swapaxes(0, 1), axis=-1)
        zooms = [camera.zoom for cameras in steered.cameras for camera in cameras]
        rows.append(
            {
                "strategy": run.strategy,
                "zoom_limit": limit_name(run.zoom_limit),
                "swaps": steered.swaps,
                "lost_tracks": sum(steered.losses.values()),
                "aim_error_rms_m": float(np.sqrt((error**2).mean())),
                "smallest_zoom": min(zooms),
                "largest_zoom": max(zooms),
            }
        )
    return rows


def _lost(result: ScheduleResult, run: int, step: int) -> bool:
    """Whether the steering had lost the avatar, or one of both."""
    lost = dict(
        zip(result.held.design.stage.names, result.held.design.runs[run].steered.lost[step].tolist(), strict=True)
    )
    return bool(lost.get(result.avatar, any(lost.values())))


def _with_places(result: ScheduleResult, rows: Sequence[Row], per: int) -> Iterator[tuple[Row, tuple[int, int]]]:
    """Each row with its run and step; `per` rows in a row are of one."""
    runs, steps = result.shape
    for number, row in enumerate(rows):
        yield row, divmod(number // per % (runs * steps), steps)


def _place(result: ScheduleResult, run: int, step: int) -> Row:
    which = result.held.design.runs[run]
    return {
        "step": step,
        "time_s": float(which.steered.times_s[step]),
        "strategy": which.strategy,
        "zoom_limit": limit_name(which.zoom_limit),
        "assigned": " ".join(which.steered.assignments[step]),
    }
