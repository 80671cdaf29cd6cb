"""A scene measured as it is: a sweep of one step, with tables, words and a page of its own, and without any warning."""

from __future__ import annotations

import csv
import io
import json
import re
import warnings
from types import SimpleNamespace

import matplotlib.pyplot as plt
import numpy as np
import pytest
from rich.console import Console

import scenes
from scenes import SceneError
from scenes.steps.measurement import SEED, TRIALS, measurement_of
from tests.helpers.closet import SCENE, SELECTION, SWEEP
from tests.helpers.made_up_run import PIXEL_NOISE_PX, made_up_run
from tests.helpers.pages import Page
from tests.helpers.predicted_result import predicted_result
from validate.commands import measure
from validate.pages.data import read_sweeps
from validate.pages.figure import combinations, filled
from validate.pages.measured import marker_rows, measured_in_words
from validate.pages.section import KIND_CHOICE, section_of
from validate.pages.steps import steps_of_plan
from validate.plots.single_step import draw_errors, measurement_figure
from validate.results.report import of_results
from validate.results.run_request import RunRequest
from validate.run_sweep import main
from validate.runs.input_files import load_measurement_of
from validate.stats.intervals import interval
from validate.sweeps.single_step import is_measurement, measurement_rows
from validate.sweeps.summary import show

# One value, as the user of a setting writes it.
ONE = SWEEP.replace("values = [1.5, 2.0, 3.0]", "values = [2.0]").replace("trials = 4", "trials = 12")
# Numbers of a table have seven digits.
SAME_DIGITS = 2e-6


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A sweep of one value beside one of three selections."""
    folder = tmp_path_factory.mktemp("measurement")
    text = io.StringIO()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        results, acquired, _ = made_up_run(folder, SCENE, {"one": ONE, "pairs": SELECTION})
        show(results, acquired, Console(file=text, width=300))
    page = (folder / "run" / "report.html").read_text(encoding="utf-8")
    return SimpleNamespace(folder=folder, results=results, acquired=acquired, shown=text.getvalue(), page=page)


def test_a_sweep_of_one_value_prints_no_rank_and_no_claims(made):
    """Of the other sweep there are ranks; of this one errors in mm."""
    assert [is_measurement(result) for result in made.results] == [True, False]
    ranks = made.shown.split("Predicted against measured PSS over the steps")[1].split("└")[0]
    assert "│ one " not in ranks
    assert "│ pairs " in ranks
    assert "one: error of the markers in mm" in made.shown
    assert re.search(r"one: RMS error [\d.]+ mm \[[\d.]+, [\d.]+\] over \d+ of 12 markers", made.shown)
    assert "The paper's claims" not in made.shown
    with (made.folder / "run" / "correlation.csv").open() as file:
        assert {row["level"] for row in csv.DictReader(file) if row["sweep"] == "one"} == {"point"}


def test_ratios_are_those_of_the_tables(made):
    """Ratio and NEES by another way: from configurations and points; measured and predicted of the same resamples."""
    rows = measurement_rows(made.results[0])
    assert [(row["noise_model"], row["kind"]) for row in rows] == [
        (model, kind) for model in ("as-printed", "corrected") for kind in ("single frame", "filter")
    ]
    (assessment,) = made.results[0].assessments
    for row in rows:
        predicted, errors = assessment.predicted[row["noise_model"]], assessment.measured.errors
        if row["kind"] == "single frame":
            assert row["ratio"] == pytest.approx(errors.pss() / predicted.pss_single_frame, rel=1e-12)
            nees, counts = errors.nees(predicted.single_frame_covariance), errors.detections
            known = np.isfinite(nees)
            mean = (nees[known] * counts[known]).sum() / counts[known].sum() / 3
            assert row["nees_over_3"] == pytest.approx(mean, rel=1e-9)
            assert row["nees_over_3_ci_low"] < mean < row["nees_over_3_ci_high"]
        else:
            sigma, found = predicted.sigma_m, assessment.measured.inverse_filter_sigma
            weights = made.results[0].replicates[row["noise_model"]].point_weights
            expected = np.nan_to_num(1 / sigma)
            resampled = [np.average(found, weights=w) / np.average(expected, weights=w) for w in weights]
            assert [row["ratio_ci_low"], row["ratio_ci_high"]] == pytest.approx(interval(np.array(resampled)), rel=1e-9)
        assert row["ratio_ci_low"] < row["ratio"] < row["ratio_ci_high"]
    assert measurement_rows(made.results[1]) == []


def test_nees_of_a_right_covariance_is_one():
    """The made-up pixels with their own covariance, without bias: the interval holds 1 in most of ten worlds."""
    from validate.stats.measured_errors import MeasuredErrors
    from validate.sweeps.replicates import sweep_replicates
    from validate.sweeps.single_step import _nees_share

    rng, holds = np.random.default_rng(2), 0
    for _ in range(10):
        root = np.tril(rng.normal(size=(20, 3, 3))) * PIXEL_NOISE_PX
        errors = MeasuredErrors(np.einsum("nij,tnj->tni", root, rng.normal(size=(20, 20, 3))))
        made = sweep_replicates([errors], np.ones((1, 20)), rng, 200)
        value, low, high = _nees_share(errors, root @ root.mT, made)
        assert value == pytest.approx(1, abs=0.15)
        holds += low <= 1 <= high
    assert holds >= 8


def test_the_page_has_the_error_of_each_marker_and_no_curve_over_steps(made):
    """A section without slider, curves, ranks; the other sweep's has them."""
    table, other = read_sweeps(made.folder / "run")
    one, pairs = made.page.split('<section class="sweep"')[1:]
    assert 'data-figure="plan"' in one
    for gone in ('data-figure="curves"', 'data-figure="leaderboard"', "The steps in numbers", "Where PSS is highest"):
        assert gone not in one
        assert gone in pairs
    assert '<div class="stepper" hidden>' in one
    assert measured_in_words(table) in made.page
    rows = marker_rows(table)
    assert len(rows) == 12
    measured = [float(row["measured"][0]) for row in rows if row["measured"][0] != "–"]
    assert measured == sorted(measured, reverse=True)
    ids = [e.attributes["id"] for e in Page(made.page).elements if "id" in e.attributes]
    assert len(ids) == len(set(ids))
    verdicts = made.page.split('<table id="verdicts">')[1].split("</table>")[0]
    assert '<th scope="row">one</th>' not in verdicts
    ratios = made.page.split('<table id="ratios">')[1].split("</table>")[0]
    assert ratios.count('<th scope="row">one</th>') == 4
    assert other.name not in ratios


def test_the_script_finds_every_column_of_every_figure(made):
    """At its one step, whatever is chosen."""
    table = read_sweeps(made.folder / "run")[0]
    (sweep, _) = of_results(made.results, made.acquired.measured)
    steps = steps_of_plan(sweep.plan, sweep.labels, sweep.predictions, sweep.measured)
    section = section_of(table, "title", steps)
    for figure in section.figures:
        assert "slider" not in figure.caption
        assert "all steps" not in [trace.get("name") for trace in figure.traces]
        for chosen in combinations((section.model_choice, KIND_CHOICE, *figure.choices)):
            assert filled(figure, section.columns[0], chosen)["data"]


def test_the_figure_has_every_marker(made):
    """Measured and predicted errors, as the assessment has them."""
    figure = measurement_figure(made.results[0])
    axes = (
        figure.axes[-1]
        if figure.axes[-1].get_xlabel() == "marker"
        else next(a for a in figure.axes if a.get_xlabel() == "marker")
    )
    drawn = next(line for line in axes.lines if line.get_label() == "measured RMS").get_ydata()
    expected = made.results[0].assessments[0].measured.errors.rms_m * 1000
    np.testing.assert_allclose(np.sort(drawn), np.sort(expected))


def test_each_error_stands_at_its_own_marker():
    """In a room of several objects, by which the markers are ordered and not as in the scene's file."""
    result = predicted_result("zoom", measured=(2.0,), every=8)
    (step,), (assessment,) = result.configurations, result.assessments
    markers = step.scene.state.markers
    rms_m = {marker.id: (1 + number) / 1000 for number, marker in enumerate(markers)}
    assessment.measured.errors.rms_m = np.array(list(rms_m.values()))
    predicted = assessment.predicted[result.noise_models[0]].single_frame_rms_m
    of_ids = {marker.id: 1000 * value for marker, value in zip(markers, predicted, strict=True)}
    axes = plt.figure().add_subplot()
    draw_errors(axes, result)
    ids = [int(label.get_text()) for label in axes.get_xticklabels()]
    plt.close("all")
    assert sorted(ids) == sorted(rms_m)
    assert ids != list(rms_m)
    lines = {line.get_label(): line.get_ydata() for line in axes.lines}
    np.testing.assert_allclose(lines["measured RMS"], [1000 * rms_m[each] for each in ids])
    drawn = lines[f"predicted √tr C, {result.noise_models[0]}"]
    np.testing.assert_allclose(drawn, [of_ids[each] for each in ids])


# ---- the command -----------------------------------------------------------------------------------------------------


@pytest.fixture
def closet(tmp_path):
    """A scene of one's own."""
    path = tmp_path / "closet.toml"
    path.write_text(SCENE)
    return path


def test_a_scene_as_it_is_is_a_sweep_of_one_step_of_all_cameras(closet):
    """With the project's own number of trials and seed; overrides and cameras count."""
    scene = scenes.load(closet)
    sweep = measurement_of(scene)
    (step,) = sweep.configurations(scene)
    assert step.cameras == scene.cameras
    assert (sweep.name, sweep.trials, sweep.seed) == ("closet", TRIALS, SEED)
    sweep = measurement_of(scene, ["east", "west"], ["sweep.trials=5", "sensor.exposure_ms=3"])
    (step,) = sweep.configurations(scene)
    assert [camera.name for camera in step.cameras] == ["west", "east"]
    assert sweep.trials == 5


@pytest.mark.parametrize(
    ("cameras", "overrides", "words"),
    [
        (["wets"], [], 'did you mean "west"'),
        (["west", "west"], [], "nothing twice"),
        ([], ["sweep.trial=5"], "has no key"),
        ([], ["sweep.trials=1"], "allowed"),
    ],
)
def test_mistakes_are_one_line(closet, cameras, overrides, words):
    """With what is allowed."""
    with pytest.raises(SceneError, match=words) as caught:
        load_measurement_of(closet, cameras, overrides, allow_outside=False)
    assert len(caught.value.problems) == 1


def test_results_of_a_scene_and_of_a_sweep_of_its_name_are_apart(closet):
    """By themselves, results/measure/closet."""
    assert RunRequest((), closet, cameras=()).folder.parts == ("results", "measure", "closet")
    assert RunRequest(("closet.toml",)).folder.parts == ("results", "closet")


def test_a_dry_run_of_the_command(closet, tmp_path, capsys):
    """Of one configuration, by name as well; nothing is left."""
    arguments = ["--store", str(tmp_path / "store"), "--out", str(tmp_path / "out"), "--dry-run"]
    assert main(["measure", str(closet), "--cameras", "west", "east", *arguments]) == 0
    printed = capsys.readouterr().out
    assert "closet: 1 configurations" in printed
    assert "2 views" in printed
    assert not (tmp_path / "out").exists()
    assert main(["measure", "room", *arguments, "--trials", "3"]) == 0
    assert "7 views" in capsys.readouterr().out
    assert main(["measure", "rom", *arguments]) == 2
    assert 'did you mean "room"' in capsys.readouterr().err
    assert measure.SCENES.name == "scenes"


@pytest.mark.render
@pytest.mark.acceptance
def test_a_whole_run_and_its_report_again(closet, tmp_path):
    """Rendered, measured, and its report made again the same."""
    arguments = ["measure", str(closet), "--store", str(tmp_path / "store"), "--out", str(tmp_path / "out")]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert main([*arguments, "--trials", "4"]) == 0
    record = json.loads((tmp_path / "out" / "run.json").read_text())
    assert record["options"]["cameras"] == "()"
    for name in ("closet", "closet_points", "closet_captures"):
        assert (tmp_path / "out" / "figures" / f"{name}.png").exists()
    before = (tmp_path / "out" / "report.html").read_bytes()
    again = ["report", str(tmp_path / "out"), "--scene", str(closet), "--store", str(tmp_path / "store")]
    assert main(again) == 0
    assert (tmp_path / "out" / "report.html").read_bytes() == before
