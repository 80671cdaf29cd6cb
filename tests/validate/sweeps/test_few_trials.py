"""Sweeps of two or three trials: what they can estimate has a number, and what they cannot has none."""

from __future__ import annotations

import io
import re
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pytest

from pss import RangeError
from tests.helpers.closet import SCENE, SWEEP
from tests.helpers.made_up_run import made_up_run
from validate.acquire.messages import RunMessages
from validate.bank.design import BankDesign
from validate.commands.run_and_save import execute
from validate.pages.data import read_sweeps
from validate.pages.sentences import in_words
from validate.plots.sweep import draw_curves
from validate.results.run_request import RunRequest
from validate.runs.console import Console
from validate.sweeps.correlation import correlation_rows
from validate.sweeps.rows import configuration_rows
from validate.sweeps.summary import show

# Measured PSS of two trials over that of many: they fall short by the points' own spread and by what the docstring of
# `inverse_sigma_bias` states. Without its factor of √π for two trials they would exceed it.
FEW_OVER_MANY = (0.5, 1.0)


def made(folder, trials):
    folder.mkdir()
    results, acquired, _ = made_up_run(folder, SCENE, {"zooming": SWEEP.replace("trials = 4", f"trials = {trials}")})
    return SimpleNamespace(result=results[0], acquired=acquired, folder=folder / "run")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The same made-up sweep with few trials and with many."""
    folder = tmp_path_factory.mktemp("trials")
    return {trials: made(folder / str(trials), trials) for trials in (2, 40)}


def test_two_trials_measure_what_many_do(runs):
    """PSS of both kinds and the RMS; there was a 0, and 'no point was triangulated'."""
    few, many = (configuration_rows(runs[trials].result) for trials in (2, 40))
    for one, other in zip(few, many, strict=True):
        ratio = one["measured_pss_single_frame"] / other["measured_pss_single_frame"]
        assert FEW_OVER_MANY[0] < ratio < FEW_OVER_MANY[1]
    sentence = in_words(read_sweeps(runs[2].folder)[0])
    assert "triangulated" not in sentence
    assert "nothing to compare" not in sentence


def test_what_two_trials_cannot_give_is_empty(runs):
    """No interval of what is measured, no regret; and nowhere a nan to read."""
    for row in configuration_rows(runs[2].result):
        assert np.isnan([row["measured_pss_ci_low"], row["measured_rms_ci_high_m"]]).all()
    rows = [row for row in correlation_rows(runs[2].result) if row["level"] == "configuration"]
    assert all(np.isnan(row["regret"]) for row in rows if row["measure"] == "measured_pss_single_frame")
    text = io.StringIO()
    show([runs[2].result], runs[2].acquired, Console(file=text, width=200))
    assert "2 trials are too few for intervals of what is measured, and regret; 4 allow both" in text.getvalue()
    assert "nan" not in text.getvalue()
    page = (runs[2].folder / "report.html").read_text(encoding="utf-8")
    assert not re.search(r"\bnan\b", re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL))
    axes = plt.figure().add_subplot()
    draw_curves(axes, runs[2].result, single_frame=True)
    assert "95 % interval" not in axes.get_legend_handles_labels()[1]
    plt.close("all")


def test_one_trial_is_refused_with_the_reason(tmp_path):
    """By sweeps and by banks, before anything is rendered."""
    with pytest.raises(RangeError, match=r"--trials 1; allowed: 2 or more \(one has no spread\)"):
        execute(RunRequest(("zoom",), trials=1, out=tmp_path), RunMessages(quiet=True))
    with pytest.raises(RangeError, match=r"--trials 1; allowed: 2 or more"):
        BankDesign(trials=1)
