"""Levels of process noise: the rule of the headline, σ∞ at each level, and where measured filter PSS is but a count."""

from __future__ import annotations

import numpy as np
import pytest

import scenes
from pss import ConstantVelocity, NoiseModel, RandomWalk, evaluate
from pss.errors import RangeError
from tests.conftest import ROOM_FILE
from validate.bank.design import BankDesign, draw_configurations, held_out_views
from validate.bank.filtered import filter_all
from validate.bank.leaderboard import CountVerdict
from validate.bank.measured import BankData, measure_all
from validate.bank.predicted import GivenCovariance, PredictionTask, predict_all
from validate.bank.process_noise import filter_terms, information_of, process_rows, steady_covariances
from validate.prediction.contenders import Contender
from validate.prediction.process_levels import STEPS_M, headline_of, levels_about, nearest
from validate.stats.intervals import weighted_spearman

# Both ways solve Eq. 4, one by the smallest eigenvalue and one by the whole matrix.
SAME_SIGMA = 1e-6
# σ∞ over a step that is 20 times the error is √(1 + c/q) = 1.001; where rays meet flatly c is ten times as large.
SAME_TERMS, SPREAD_OF_TERMS = 0.002, 0.02
TYPICAL_M = 5e-5


@pytest.fixture(scope="module")
def world():
    """Views of the room whose detections err by a size of their own, so that four of them fix points to about 0.05 mm.

    Points that are seen are found in 96 % of the trials; nothing is rendered.
    """
    scene = scenes.load(ROOM_FILE)
    bank = held_out_views(scene, BankDesign(settings=3, turns=1), "r")
    rng = np.random.default_rng(1)
    points = scene.state.points_m
    seen = evaluate(bank.cameras, points, scene.state.normals, occluder=scene.state.occluders).visible
    sigma = rng.uniform(0.003, 0.036, size=len(bank.cameras))
    projected = np.array([camera.project(points)[0] for camera in bank.cameras])
    pixels = projected[:, None] + rng.standard_normal((len(sigma), 20, len(points), 2)) * sigma[:, None, None, None]
    pixels[~(seen[:, None] & (rng.uniform(size=pixels.shape[:3]) < 0.96))] = np.nan
    covariance = np.broadcast_to((sigma**2)[:, None, None, None, None] * np.eye(2), (*pixels.shape, 2))
    data = BankData(bank.cameras, points, pixels, covariance, RandomWalk(step_std_m=1e-3), 1)
    table = np.broadcast_to((sigma**2)[:, None, None, None] * np.eye(2), (len(sigma), len(points), 2, 2))
    contenders = (
        Contender("physical", NoiseModel("physical", (GivenCovariance(bank.cameras, table),))),
        Contender("ten times too large", NoiseModel("large", (GivenCovariance(bank.cameras, 100 * table),))),
    )
    state = scene.state
    task = PredictionTask(
        bank.cameras, points, state.normals, state.occluders, None, data.process, contenders,
        {"physical": ("visibility-count", "visible-share"), "ten times too large": ()},
    )  # fmt: skip
    names = [camera.name for camera in bank.cameras]
    chosen = draw_configurations(names, 4, 40, np.random.default_rng(2))
    measured = measure_all(data, chosen.tolist(), processes=1)
    verdict = CountVerdict(4, chosen, measured, predict_all(task, chosen.tolist(), 1), names)
    levels = levels_about(TYPICAL_M)
    return bank, data, contenders, verdict, levels, filter_all(data, chosen, measured, levels, processes=1)


# ---- the rule --------------------------------------------------------------------------------------------------------


def test_the_headline_is_where_process_and_measurement_are_equal():
    """Nearest on a logarithmic scale, by the predicted error of views that are not judged, and by nothing else."""
    for sigma_m, step_m in ((4.9e-5, 3e-5), (5.6e-5, 1e-4), (1e-4, 1e-4), (1e-9, 3e-6), (1.0, 1e-3)):
        levels = levels_about(sigma_m)
        assert levels[headline_of(levels)].process == RandomWalk(step_m)
        assert [level.headline for level in levels if level.walks].count(True) == 1
        (velocity,) = (level for level in levels if level.headline and not level.walks)
        assert velocity.q_over_c == 1
        assert velocity.process.acceleration_density_m2_s3 == pytest.approx(sigma_m**2 * 30**3)
    assert [level.process.step_std_m for level in levels if level.walks] == list(STEPS_M)
    assert [levels_about(1e-4)[k].q_over_c for k in (3, 5)] == pytest.approx([1, 100])
    with pytest.raises(RangeError, match="a typical error of nan m; allowed: finite and above 0"):
        nearest(STEPS_M, float("nan"))


@pytest.mark.slow
def test_a_grid_of_accelerations_is_a_grid_of_frame_rates(world):
    """σ∞ of a constant velocity depends on density × Δt³ alone: eight times the density at half of the time step."""
    _, _, _, verdict, _, _ = world
    information, found = information_of([of_all["physical"] for of_all in verdict.predicted])
    slow, fast = ConstantVelocity(1e-3, 1 / 30), ConstantVelocity(8e-3, 1 / 60)
    terms = [filter_terms(information, found, process) for process in (slow, fast, ConstantVelocity(1e-3, 1 / 60))]
    np.testing.assert_allclose(terms[0], terms[1], rtol=SAME_SIGMA)
    assert np.abs(terms[2][found > 0] / terms[0][found > 0] - 1).min() > 0.1


# ---- what is predicted -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("process", [RandomWalk(3e-5), ConstantVelocity(1e-4)], ids=["walk", "velocity"])
def test_predictions_at_other_process_noise_are_those_of_the_metric(world, process):
    """From the information of one evaluation, against another evaluation with that process."""
    bank, data, contenders, verdict, _, _ = world
    state = bank.scene.state
    information, found = information_of([of_all["physical"] for of_all in verdict.predicted[:5]])
    terms = filter_terms(information, found, process)
    prior, posterior = steady_covariances(information, found, process)
    for k, views in enumerate(verdict.configurations[:5]):
        evaluation = evaluate(
            [bank.cameras[view] for view in views], data.points_m, state.normals, noise=contenders[0].noise,
            process=process, occluder=state.occluders,
        )  # fmt: skip
        np.testing.assert_allclose(terms[k], np.nan_to_num(1 / evaluation.sigma_m), rtol=SAME_SIGMA)
        for own, other in ((prior[k], evaluation.covariance), (posterior[k], evaluation.posterior)):
            np.testing.assert_allclose(own, other[:, :3, :3], rtol=0, atol=SAME_SIGMA * np.nanmax(other[:, :3, :3]))
    np.testing.assert_allclose(filter_terms(information, found / 2, process), terms / 2)


# ---- what is measured ------------------------------------------------------------------------------------------------


def test_measured_filter_pss_is_a_count_at_a_millimetre_and_none_where_process_and_measurement_are_equal(world):
    """With errors of 0.05 mm: the terms of all points are the inverse step, or spread as their errors do."""
    _, _, _, verdict, levels, filtered = world
    found = [configuration.errors for configuration in verdict.measured]
    rate = np.array([errors.detection_rate for errors in found])
    typical_m = np.nanmedian([errors.sigma_m for errors in found])
    assert 0.5 * TYPICAL_M < typical_m < 2 * TYPICAL_M
    often = rate > 0.5
    coarse = next(k for k, level in enumerate(levels) if level.process == RandomWalk(1e-3))
    fine = headline_of(levels)
    assert 0.1 < levels[fine].q_over_c < 10
    steps = {k: levels[k].process.step_std_m * filtered.inverse_sigma[k][often] / rate[often] for k in (coarse, fine)}
    assert np.median(steps[coarse]) == pytest.approx(1, abs=SAME_TERMS)
    assert np.std(steps[coarse]) < SPREAD_OF_TERMS
    assert np.std(steps[fine]) > 5 * SPREAD_OF_TERMS
    share = rate.mean(axis=1)
    assert weighted_spearman(share, filtered.inverse_sigma[coarse].mean(axis=1)) > 0.995
    assert weighted_spearman(share, filtered.inverse_sigma[fine].mean(axis=1)) < 0.95


def test_rows_say_at_each_level_what_pss_adds_to_a_count(world):
    """The right R ranks where the count does not; at a millimetre both do; a scale of R costs where q ≈ c."""
    _, _, _, verdict, levels, filtered = world
    rows = process_rows(verdict, ["physical", "ten times too large"], levels, filtered)
    assert len(rows) == len(levels) * 2 * 3
    of = {(row["process"], row["q_over_c"], row["noise_model"], row["metric"]): row for row in rows}
    (level,) = (level for level in levels if level.walks and level.headline)
    best = of["random-walk", level.q_over_c, "physical", "pss"]
    assert best["headline"] == "yes"
    assert best["spearman"] > 0.97
    assert best["spearman_ci_low"] <= best["spearman"] <= best["spearman_ci_high"]
    count = of["random-walk", level.q_over_c, "physical", "visibility-count"]
    assert best["minus_visibility_count"] == pytest.approx(best["spearman"] - count["spearman"])
    assert best["minus_visibility_count"] > 0.05
    assert count["minus_visibility_count"] == 0
    coarse = of["random-walk", levels[5].q_over_c, "physical", "pss"]
    assert abs(coarse["minus_visible_share"]) < 0.01
    assert 0.2 < best["q_over_c_measured"] / best["q_over_c"] < 5
    assert {row["headline"] for row in rows if row["step_mm"] == 1.0} == {"no"}
    other = of["random-walk", level.q_over_c, "ten times too large", "visibility-count"]
    assert other["spearman"] == count["spearman"]  # looked up for one, and counted here for the other


def test_nees_of_the_filter_has_content_at_the_headline(world):
    """A right R is found right and one of ten times the size is found out, before and after; at 1 mm P⁻ is the same."""
    _, _, contenders, verdict, levels, filtered = world
    right, wrong = (contender.name for contender in contenders)
    information = {name: information_of([found[name] for found in verdict.predicted]) for name in (right, wrong)}
    known = np.isfinite(filtered.prior_moment_m2).all(axis=(-2, -1)) & (information[right][1] > 0)

    def nees(name, process, moment, kind):
        covariance = steady_covariances(*information[name], process)[kind][known]
        return np.trace(np.linalg.solve(covariance, moment[known]), axis1=1, axis2=2).mean() / 3

    for kind, moment in enumerate((filtered.prior_moment_m2, filtered.posterior_moment_m2)):
        assert nees(right, levels[headline_of(levels)].process, moment, kind) == pytest.approx(1, abs=0.15)
        assert nees(wrong, levels[headline_of(levels)].process, moment, kind) < 0.5
    walk = RandomWalk(1e-3)
    ratio = [np.trace(steady_covariances(*information[name], walk)[0][known], axis1=1, axis2=2) for name in information]
    assert np.median(ratio[1] / ratio[0]) < 1.15
