"""A metric of one's own stands where the project's stand: in check, in a sweep's tables and console, in the report."""

from __future__ import annotations

import csv
import importlib.metadata
import io
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.stats

import scenes
from pss.metric.table import Metric, MetricTable
from pss.metrics import OF_THE_PAPER
from tests.helpers.closet import SCENE, SWEEP
from tests.helpers.made_up_run import made_up_run
from validate.commands import check
from validate.commands.subcommands import Check
from validate.pages.data import read_sweeps
from validate.prediction import own_metrics
from validate.prediction.foresight import foresee, model_rows
from validate.prediction.own_metrics import best_step, failures_of
from validate.prediction.warnings import warnings_of
from validate.runs.console import Console
from validate.sweeps.summary import show

ROOT = Path(__file__).parents[3]
# Digits of a table.
SAME_DIGITS = 2e-6


def median_sigma_mm(evaluation):
    """mm, of the observable points."""
    return 1000 * np.nanmedian(evaluation.single_frame_sigma_m)


def broken(evaluation):
    """A score that fails."""
    raise ZeroDivisionError("of mine")


BROUGHT = (Metric("median-mm", median_sigma_mm, False, "own"), Metric("broken", broken, True, "own"))


@pytest.fixture(scope="module")
def installed():
    """A table of metrics beside which another package's entry point is installed."""
    entry = SimpleNamespace(name="theirs", value="theirs:METRICS", load=lambda: BROUGHT)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(importlib.metadata, "entry_points", lambda *, group: (entry,))
        table = MetricTable(OF_THE_PAPER)
        assert table.of_entry_points() == BROUGHT
        patch.setattr(own_metrics, "METRICS", table)
        yield table


@pytest.fixture(scope="module")
def made(installed, tmp_path_factory):
    """A made-up sweep with its tables and its report."""
    folder = tmp_path_factory.mktemp("own")
    results, acquired, _ = made_up_run(folder, SCENE, {"zooming": SWEEP})
    return SimpleNamespace(result=results[0], acquired=acquired, folder=folder / "run")


def rows_of(made, name):
    with (made.folder / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_tables_have_its_number_and_its_rank(made):
    """The score of each step's own evaluation, and SciPy's ρ; less is better, so that the sign turns."""
    for model in made.result.noise_models:
        rows = [row for row in rows_of(made, "configurations") if row["noise_model"] == model]
        expected = [median_sigma_mm(each.predicted[model]) for each in made.result.assessments]
        found = np.array([float(row["metric_median-mm"]) for row in rows])
        np.testing.assert_allclose(found, expected, rtol=SAME_DIGITS)
        assert {row["metric_broken"] for row in rows} == {""}
        [ranked] = [
            row
            for row in rows_of(made, "correlation")
            if (row["metric"], row["noise_model"], row["measure"]) == ("median-mm", model, "measured_pss_single_frame")
        ]
        rho = -scipy.stats.spearmanr(expected, made.result.measured_pss()).statistic
        assert float(ranked["spearman"]) == pytest.approx(rho, abs=SAME_DIGITS)


def test_the_console_has_a_row_for_it(made):
    """With the step that it would choose; a metric without a number has none."""
    text = io.StringIO()
    show([made.result], made.acquired, Console(file=text, width=200))
    lines = [[cell.strip() for cell in line.split("│")] for line in text.getvalue().splitlines()]
    rows = {(cells[2], cells[3]): cells[4:7] for cells in lines if len(cells) > 7}
    model = made.result.noise_models[-1]
    values = np.array([median_sigma_mm(each.predicted[model]) for each in made.result.assessments])
    assert rows[model, "median-mm"][1] == str(made.result.configurations[int(values.argmin())].value)
    assert rows[model, "broken"][:2] == ["undefined", "none"]


def test_the_report_shows_it(made):
    """In the ranking of metrics, whose figure takes every metric of correlation.csv, and at each step."""
    table = read_sweeps(made.folder)[0]
    assert {row["metric"] for row in table.correlation} >= {"median-mm", "broken"}
    page = (made.folder / "report.html").read_text(encoding="utf-8")
    assert f"median-mm, {table.leading_model}</th>" in page
    steps = page.split("The steps in numbers")[1]
    for value in table.own_metrics(table.leading_model)["median-mm"]:
        assert f'<td class="n">{value:.4g}</td>' in steps


def test_check_shows_it(installed, tmp_path, capsys):
    """Beside PSS for each noise model, and a line for the one that fails."""
    seen = foresee(scenes.load(ROOT / "scenes" / "bench.toml"))
    for row in model_rows(seen):
        assert row["metric_median-mm"] == median_sigma_mm(seen.evaluations[row["noise_model"]])
    assert "metric broken has no number (ZeroDivisionError: of mine)" in warnings_of(seen)
    check.execute(Check("bench", tmp_path / "plan.svg"))
    printed = capsys.readouterr().out
    assert "median-mm" in printed
    for evaluation in seen.evaluations.values():
        assert f" {median_sigma_mm(evaluation):.4g} " in printed


def test_the_best_step_by_a_metric_follows_its_direction():
    """nan is never chosen, and ∞ may be."""
    assert best_step(BROUGHT[0], np.array([2.0, np.nan, 1.0, np.inf])) == 2
    assert best_step(BROUGHT[1], np.array([2.0, np.nan, 1.0, np.inf])) == 3
    assert best_step(BROUGHT[0], np.array([np.nan, np.nan])) is None


def test_a_failure_is_named_once(installed, made):
    """However many steps and models it failed at."""
    scores = [each for of_model in made.result.own_scores.values() for each in of_model]
    assert failures_of(scores) == ["metric broken has no number (ZeroDivisionError: of mine)"]
