"""Where nothing was measured no step is best: no value, no claim, no star, no sentence names one."""

from __future__ import annotations

import io
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pytest

from tests.helpers import made_up_run as made_up
from tests.helpers.closet import SCENE, SWEEP
from validate.pages.curves import curves_figure
from validate.pages.data import KINDS, read_sweeps
from validate.pages.sentences import in_words, verdicts
from validate.plots.sweep import draw_curves
from validate.runs.console import Console
from validate.stats.optimum import optimum
from validate.sweeps.claims import claim_rows
from validate.sweeps.summary import show


def test_the_optimum_is_the_first_of_the_largest_above_zero():
    """nan does not count, and zeros have no best."""
    assert optimum([1.0, 3.0, 3.0, np.nan]) == 1
    assert optimum([0.0, np.nan, 0.0]) is None
    assert optimum([]) is None


@pytest.fixture(scope="module")
def lost(tmp_path_factory):
    """A made-up run in whose views no marker was ever found."""
    folder = tmp_path_factory.mktemp("lost")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(made_up, "FOUND", 0.0)
        results, acquired, _ = made_up.made_up_run(folder, SCENE, {"zooming": SWEEP})
    return SimpleNamespace(folder=folder / "run", result=results[0], acquired=acquired)


def test_tables_and_claims_name_no_measured_optimum(lost):
    """The predictions keep theirs."""
    text = io.StringIO()
    show([lost.result], lost.acquired, Console(file=text, width=200))
    line = next(line for line in text.getvalue().splitlines() if "single frame" in line)
    cells = [cell.strip() for cell in line.split("│")]
    assert cells[6] == "none"
    assert float(cells[5]) in (1.5, 2.0, 3.0)
    assert not [row for row in claim_rows(lost.result) if row["side"] == "measured"]


def test_figures_have_no_star_of_it(lost):
    """One star for each noise model alone, in the picture and on the page."""
    axes = plt.figure().add_subplot()
    draw_curves(axes, lost.result, single_frame=True)
    models = lost.result.noise_models
    assert sum(line.get_marker() == "*" for line in axes.lines) == len(models)
    plt.close("all")
    table = read_sweeps(lost.folder)[0]
    stars = curves_figure(table).columns[f"optima|{KINDS[0].name}"]
    assert stars[0] is None
    assert None not in stars[1:]


def test_the_report_names_none(lost):
    """In its table and in its sentence."""
    table = read_sweeps(lost.folder)[0]
    assert {verdict.measured_optimum for verdict in verdicts(table)} == {"none"}
    assert "nothing to compare" in in_words(table)
