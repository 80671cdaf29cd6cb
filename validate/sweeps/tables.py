"""All tables of a run of sweeps, in the order in which they are written."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from pss.hints import Row
from validate.acquire.request import Acquired, Acquisition
from validate.sweeps import claims, correlation, optima, rows, scale_of_r, single_step, slopes
from validate.sweeps.sweep import SweepResult

__all__ = ["TABLES", "tables_of"]

TABLES = (
    "configurations",
    "points",
    "views",
    "timings",
    "detection",
    "correlation",
    "claims",
    "scale",
    "optima",
    "measurement",
    "slopes",
)
"""Names of the tables of each run."""


def tables_of(
    results: Sequence[SweepResult], requested: Sequence[Acquisition], acquired: Acquired
) -> dict[str, list[Row]]:
    """The rows of each table, by name; of sweeps that have a configuration whose views exist."""
    whole = [result for result in results if result.assessments]

    def of_each(rows_of: Callable[[SweepResult], list[Row]]) -> list[Row]:
        return [row for result in whole for row in rows_of(result)]

    found = (
        of_each(rows.configuration_rows),
        of_each(rows.point_rows),
        rows.view_rows(whole, acquired),
        rows.timing_rows(requested, acquired),
        rows.detection_rows(whole),
        of_each(correlation.correlation_rows),
        of_each(claims.claim_rows),
        of_each(scale_of_r.scale_rows),
        of_each(optima.optimum_rows),
        of_each(single_step.measurement_rows),
        of_each(slopes.slope_rows),
    )
    return dict(zip(TABLES, found, strict=True))
