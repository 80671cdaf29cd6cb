"""The table of process noise: how well PSS of the filter follows the measurement at each level, beside a count."""

from __future__ import annotations

from pss.hints import Floats, Row
from validate.schedule.agreement import with_ends
from validate.schedule.claims import CLOSER, FARTHER
from validate.schedule.process_noise import equivalent_frame_rate_hz
from validate.schedule.results import ScheduleResult
from validate.stats.intervals import weighted_spearman
from validate.stats.series import spearman_difference_interval, spearman_interval

__all__ = ["process_rows"]


def process_rows(result: ScheduleResult) -> list[Row]:
    """A row for each level and noise model, over all strategies and steps without a zoom limit (or with the first one).

    `equivalent_frame_rate_hz` is the number of frames at which the schedule's own acceleration has the level's q/c. The
    columns `…_closer_over_farther` have the claim of the paper, mean PSS of (2b) over that of (2a), predicted and
    measured; `…_of_counts` the same ratio of the shares of markers, and the rest is per marker.
    """
    runs = result.held.design.runs
    limits = [run.zoom_limit for run in runs]
    limit = None if None in limits else limits[0]
    members = [number for number, run in enumerate(runs) if run.zoom_limit == limit]
    names = [runs[number].strategy for number in members]
    triangulated = result.counts["", "filter"].values[members]
    rows: list[Row] = []
    for number, level in enumerate(result.held.levels):
        measured = _means(result, "", number)[members]
        by_share = float(weighted_spearman(triangulated.ravel(), measured.ravel()))
        for model in result.noise_models:
            predicted, seen = _means(result, model, number)[members], result.counts[model, "filter"].values[members]
            rows.append(
                {
                    **level.row,
                    "is_schedule_process": "yes" if number == 0 else "no",
                    "equivalent_frame_rate_hz": equivalent_frame_rate_hz(level, result.held.levels[0]),
                    "avatar": result.avatar,
                    "noise_model": model,
                    "n": measured.size,
                    **with_ends("spearman", spearman_interval(predicted, measured)),
                    **with_ends("visible_share_spearman", spearman_interval(seen, measured)),
                    **with_ends("minus_visible_share", spearman_difference_interval(predicted, seen, measured)),
                    "triangulated_share_spearman": by_share,
                    "predicted_closer_over_farther": _ratio(names, predicted),
                    "predicted_closer_over_farther_of_counts": _ratio(names, seen),
                    "measured_closer_over_farther": _ratio(names, measured),
                    "measured_closer_over_farther_of_counts": _ratio(names, triangulated),
                }
            )
    return rows


def _means(result: ScheduleResult, model: str, level: int) -> Floats:
    """1/m, PSS of the filter at a level, (R, K)."""
    return result.level_terms(model, level).mean(axis=1).reshape(result.shape)


def _ratio(names: list[str], values: Floats) -> float:
    """Mean over the steps of (2b) over that of (2a); nan where one of them was not run, or is 0."""
    if CLOSER not in names or FARTHER not in names:
        return float("nan")
    closer, farther = values[names.index(CLOSER)].mean(), values[names.index(FARTHER)].mean()
    return float(closer / farther) if farther > 0 else float("nan")
