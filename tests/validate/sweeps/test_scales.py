"""The unit of R: what it cannot change, what it does, and that it is the unit of the process noise alone."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import scipy.stats

from pss import Appearance, RandomWalk, evaluate, noise_model
from pss.visibility.targets import TARGET_VISIBILITY
from tests.helpers.closet import SCENE, SWEEP
from tests.helpers.made_up_run import made_up_run
from validate.prediction.predict import predict
from validate.prediction.weights import scaled
from validate.sweeps.correlation import correlation_rows
from validate.sweeps.scale_of_r import SCALES, scale_rows

# Two solutions of one equation in other units, and sums in another order.
ROUNDING = 1e-9
MODELS = ("as-printed", "corrected")
# The closet's.
STEP_M = 1e-3


@pytest.fixture(scope="module")
def zooming(tmp_path_factory):
    """A made-up sweep of zoom whose markers leave the picture one after the other."""
    sweep = SWEEP.replace("values = [1.5, 2.0, 3.0]", "values = [1.0, 1.4, 1.8, 2.2, 2.6, 3.0, 3.4, 3.8]")
    results, _, _ = made_up_run(tmp_path_factory.mktemp("scales"), SCENE, {"zooming": sweep})
    assert len(results[0].assessments) == 8
    return results[0]


def test_at_its_own_scale_a_row_is_that_of_the_correlations(zooming):
    """The same ρ and the same interval."""
    expected = {
        row["noise_model"]: row
        for row in correlation_rows(zooming)
        if (row["level"], row["metric"], row["measure"]) == ("configuration", "pss", "measured_pss_filter")
    }
    rows = [row for row in scale_rows(zooming) if row["multiplier"] == 1]
    assert {row["noise_model"] for row in rows} == set(expected) == set(MODELS)
    for row in rows:
        for column in ("spearman", "spearman_ci_low", "spearman_ci_high", "n"):
            assert row[column] == pytest.approx(expected[row["noise_model"]][column], abs=ROUNDING)


def test_a_scale_of_r_is_one_of_the_process(zooming):
    """sR with q is R with q/s, σ∞ times √s: the order of the steps by a second way, which leaves R as it is."""
    measured = zooming.measured_pss(single_frame=False)
    rows = scale_rows(zooming)
    assert len(rows) == len(MODELS) * len(SCALES)
    for row in rows:
        step_m = STEP_M / np.sqrt(row["multiplier"])
        values = [
            evaluate(
                each.cameras,
                each.scene.state.points_m,
                each.scene.state.normals,
                noise=each.scene.noise_model(row["noise_model"]),
                process=RandomWalk(step_std_m=step_m),
                occluder=each.scene.state.occluders,
            ).pss
            for each in zooming.configurations
        ]
        assert row["spearman"] == pytest.approx(scipy.stats.spearmanr(values, measured).statistic, abs=ROUNDING)
        assert row["optimum"] == zooming.configurations[int(np.argmax(values))].value
    assert len({row["spearman"] for row in rows}) > 1


def test_a_scale_is_of_all_of_r_and_of_no_single_frame_rank(zooming):
    """Every entry of R times s, every C times s."""
    each = zooming.configurations[0]
    state = each.scene.state
    model = noise_model("as-printed")
    small = scaled(model, 1e-4, "small")
    assert small.name == "small"
    where = (each.cameras[0], state.points_m, state.normals)
    np.testing.assert_allclose(small.covariance(*where), 1e-4 * model.covariance(*where), rtol=ROUNDING)
    one, other = (
        evaluate(each.cameras, state.points_m, state.normals, noise=noise).single_frame_sigma_m
        for noise in (model, small)
    )
    np.testing.assert_allclose(other, 1e-2 * one, rtol=ROUNDING)


def test_one_step_has_no_order(zooming):
    """No rows, and nothing to divide by."""
    alone = dataclasses.replace(zooming, configurations=zooming.configurations[:1], assessments=zooming.assessments[:1])
    assert scale_rows(alone) == []


def test_whole_markers_are_looked_for_by_how_they_look(zooming):
    """The appearance of each step's own prediction, which a scene with `metric.visibility = "target"` needs."""
    markers = len(zooming.configurations[0].scene.state.points_m)
    appearance = Appearance(np.full(markers, 0.035), np.full(markers, 0.02), np.full(markers, 0.001))
    whole = [
        dataclasses.replace(each, scene=each.scene.replace(visibility=TARGET_VISIBILITY))
        for each in zooming.configurations
    ]
    assessed = [
        dataclasses.replace(each, predicted=predict(step.scene, step.cameras, appearance))
        for step, each in zip(whole, zooming.assessments, strict=True)
    ]
    result = dataclasses.replace(zooming, configurations=tuple(whole), assessments=tuple(assessed))
    rows = [row for row in scale_rows(result) if row["multiplier"] == 1]
    expected = [
        row["spearman"]
        for row in correlation_rows(result)
        if (row["level"], row["metric"], row["measure"]) == ("configuration", "pss", "measured_pss_filter")
    ]
    assert [row["spearman"] for row in rows] == pytest.approx(expected, abs=ROUNDING)
