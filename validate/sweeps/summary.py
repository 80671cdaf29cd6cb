"""Console output of a run: correlation, optima and regret of each sweep, the paper's claims, and failures."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from validate.acquire.acquire import Acquired
from validate.prediction.own_metrics import own_metrics, own_table
from validate.runs.console import Console
from validate.stats.intervals import FEWEST_RESAMPLED, oracle_regret
from validate.stats.measured_errors import FEWEST_TRIALS
from validate.sweeps.claims import claim_rows
from validate.sweeps.correlation import Correlation, headline, own_rows
from validate.sweeps.optima import kind_words, trend, trends
from validate.sweeps.rows import detection_rows
from validate.sweeps.single_step import is_measurement, measurement_rows
from validate.sweeps.single_step_summary import error_line, error_table, ratio_table
from validate.sweeps.slopes import slope_rows
from validate.sweeps.sweep import SweepResult

__all__ = ["show"]


def show(results: Sequence[SweepResult], acquired: Acquired, console: Console) -> None:
    """Print a run's tables."""
    whole = [result for result in results if result.assessments]
    for result in filter(is_measurement, whole):
        console.print(error_table(result))
        console.print(ratio_table(result.plan.sweep.name, measurement_rows(result)))
    in_steps = [result for result in whole if not is_measurement(result)]
    if in_steps:
        console.print(_correlation_table(in_steps))
        if own_metrics():
            console.print(own_table([row for result in in_steps for row in own_rows(result)]))
        of_factors = [result for result in in_steps if result.plan.sweep.varies_scene]
        of_paper = [result for result in in_steps if result.plan.sweep.paper_figure(result.plan.scene)]
        if of_paper:
            console.print(_claims_table(of_paper))
        if len(of_paper) < len(in_steps):
            console.print(_optima_table([result for result in in_steps if result not in of_paper]))
        if of_factors:
            console.print(_slopes_table(of_factors))
    if whole:
        console.print(_detection_table(whole))
    for result in filter(is_measurement, whole):
        console.print(error_line(result), markup=False, soft_wrap=True)
    for result in results:
        _remarks(result, acquired, console)


def _correlation_table(results: Sequence[SweepResult]) -> Table:
    table = Table(title="Predicted against measured PSS over the steps of each sweep")
    for name in ("sweep", "noise model", "kind"):
        table.add_column(name)
    for name in ("Spearman ρ [95 %]", "optimum predicted", "measured", "regret (oracle)"):
        table.add_column(name, justify="right")
    for result in results:
        halves = result.measured_halves()
        for model in result.noise_models:
            for single_frame in (True, False):
                found, lost = headline(result, model, single_frame)
                regret = "" if np.isnan(lost) else f"{lost:.1%} ({oracle_regret(*halves):.1%})"
                table.add_row(
                    result.plan.sweep.name,
                    model,
                    kind_words(single_frame),
                    _rho(found),
                    trend(result, single_frame, model).optimum,
                    trend(result, single_frame).optimum,
                    regret,
                )
        table.add_section()
    return table


def _rho(found: Correlation) -> str:
    if np.isnan(found.rho):
        return "undefined"
    return f"{found.rho:+.2f}{_limits(found.low, found.high, '+.2f')}"


def _limits(low: float, high: float, digits: str) -> str:
    """The ends of an interval after its value; nothing where it has none."""
    return "" if np.isnan(low) else f" [{low:{digits}}, {high:{digits}}]"


def _claims_table(results: Sequence[SweepResult]) -> Table:
    table = Table(title="The paper's claims on its Figures 1 to 3")
    for name in ("sweep", "claim", "side", "holds", "statistic", "value [95 %]"):
        table.add_column(name)
    for result in results:
        for row in claim_rows(result):
            side = " ".join(filter(None, (str(row["side"]), str(row["noise_model"]))))
            value = f"{row['value']:.3g}{_limits(row['ci_low'], row['ci_high'], '.3g')}"
            table.add_row(row["sweep"], row["claim"], side, row["holds"], row["statistic"], value)
        table.add_section()
    return table


def _optima_table(results: Sequence[SweepResult]) -> Table:
    table = Table(title="PSS over the steps of each sweep: where it is highest, times with their 95 % intervals")
    for name in ("sweep", "kind", "side", "finding"):
        table.add_column(name)
    for result in results:
        for each in trends(result):
            side = " ".join(filter(None, (each.side, each.noise_model)))
            table.add_row(result.plan.sweep.name, kind_words(each.single_frame), side, each.finding)
        table.add_section()
    return table


def _slopes_table(results: Sequence[SweepResult]) -> Table:
    """Of sweeps of one factor: those of cameras' settings have an optimum, and no slope worth printing."""
    table = Table(title="Log-log slopes of the single-frame RMS over the steps, on the points common to all")
    for name in ("sweep", "over", "points", "noise model"):
        table.add_column(name)
    for name in ("predicted", "measured [95 %]"):
        table.add_column(name, justify="right")
    for result in results:
        for row in slope_rows(result):
            limits = (row["measured_slope_ci_low"], row["measured_slope_ci_high"])
            measured = f"{row['measured_slope']:+.2f}{_limits(*limits, '+.2f')}"
            words = (row["sweep"], row["parameter"], row["points"], row["noise_model"])
            table.add_row(*(str(word) for word in words), f"{row['predicted_slope']:+.2f}", measured)
        table.add_section()
    return table


def _detection_table(results: Sequence[SweepResult]) -> Table:
    table = Table(title="Predicted visible against detected (views × markers)")
    for name in ("sweep", "views", "visible, detected", "visible, missed", "hidden, detected", "hidden, missed"):
        table.add_column(name, justify="right")
    for row in detection_rows(results):
        counts = (row[f"{side}_{what}"] for side in ("visible", "hidden") for what in ("detected", "missed"))
        table.add_row(str(row["sweep"]), str(row["views"]), *(str(count) for count in counts))
    return table


def _remarks(result: SweepResult, acquired: Acquired, console: Console) -> None:
    """Results that are no errors, but that a reader must know of."""
    name = result.plan.sweep.name
    for configuration, assessment, requested in zip(
        result.configurations, result.assessments, result.views, strict=True
    ):
        where = name if is_measurement(result) else f"{name} {configuration.label}"
        if len(configuration.cameras) < 2:
            console.print(f"{where}: one camera observes no point (PSS 0)", markup=False)
        for camera, item in zip(configuration.cameras, requested, strict=True):
            if not acquired.measured[item].detected.any():
                console.print(f"{where}: no marker found in the view of camera {camera.name}", markup=False)
        if not assessment.measured.errors.detected.any() and len(configuration.cameras) > 1:
            console.print(f"{where}: no point triangulated (measured PSS 0)", markup=False)
        elif assessment.measured.errors.detected.any() and assessment.measured.errors.pss() == 0:
            console.print(f"{where}: no point triangulated in {FEWEST_TRIALS} trials (measured PSS 0)", markup=False)
    trials = result.plan.sweep.trials
    if trials < 2 * FEWEST_TRIALS:
        lost = "intervals of what is measured, and regret" if trials < FEWEST_RESAMPLED else "regret"
        console.print(f"{name}: {trials} trials are too few for {lost}; {2 * FEWEST_TRIALS} allow both", markup=False)
    if result.assessments:
        shares = np.array([assessment.measured.errors.noise_share for assessment in result.assessments])
        known = shares[np.isfinite(shares)]
        if len(known):
            spread = f" in the median configuration ({known.min():.0%} to {known.max():.0%})" if len(known) > 1 else ""
            console.print(
                f"{name}: noise makes {np.median(known):.0%} of the mean squared error{spread}; the rest is bias",
                markup=False,
            )
