"""All tables of the held steps of a schedule, in the order in which they are written."""

from __future__ import annotations

from collections.abc import Sequence

from pss.hints import Row
from validate.acquire.request import Acquired, Acquisition
from validate.schedule.agreement import agreement_rows
from validate.schedule.claims import claim_rows
from validate.schedule.own_cameras import OwnCameras
from validate.schedule.process_rows import process_rows
from validate.schedule.results import ScheduleResult
from validate.schedule.rows import held_configuration_rows, held_point_rows, run_rows
from validate.schedule.strategy_ranking import ranking_rows, strategy_rows
from validate.sweeps.correlation import correlation_rows
from validate.sweeps.rows import detection_rows, timing_rows, view_rows

__all__ = ["tables_of"]


def tables_of(
    results: Sequence[ScheduleResult],
    requested: Sequence[Acquisition],
    acquired: Acquired,
    aside: OwnCameras | None,
) -> dict[str, list[Row]]:
    """The rows of each table, by name.

    Args:
        results: of each avatar, the last of both together.
        aside: the comparison of each avatar's own cameras with all, if it was made.
    """
    both = results[-1]
    return {
        "configurations": [row for result in results for row in held_configuration_rows(result)],
        "points": held_point_rows(both),
        "views": view_rows([both], acquired),
        "timings": timing_rows(requested, acquired),
        "detection": detection_rows([both]),
        "correlation": [{"avatar": both.avatar, **row} for row in correlation_rows(both)],
        "agreement": [row for result in results for row in agreement_rows(result)],
        "strategies": [row for result in results for row in strategy_rows(result)],
        "ranking": [row for result in results for row in ranking_rows(result)],
        "claims": claim_rows(both, aside),
        "process": process_rows(both),
        "runs": run_rows(both),
    }
