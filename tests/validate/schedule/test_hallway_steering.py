"""The steering filter against a textbook loop, its lag and consistency over seeded runs, and what the cameras reach."""

import dataclasses
import math

import numpy as np
import pytest
import scipy.stats

from pss import ConstantVelocity, PTZCamera, RangeError, ShapeError
from pss.cameras.motors import PTZLimits, follow, quantised
from pss.surrogates import Cylinder, on_cylinder
from validate.schedule.state import Avatar, Plan
from validate.schedule.steering import steer
from validate.schedule.strategies import STRATEGIES
from validate.schedule.tracker import Track, Tracking, noisy_positions
from validate.schedule.walk import passing

# Relative to metres and m/s: the same filter by another route, over some hundred frames.
SAME_FILTER = 1e-9
# Probability outside a band; the seeds are fixed, so that a pass stays a pass.
OUTSIDE_BAND = 1e-3
FRAME_S = 1 / 30
LIMITS = PTZLimits(pan_speed_deg_per_s=90, tilt_speed_deg_per_s=60, zoom_factor_per_s=2, focus_speed_dioptre_per_s=1)
CORNERS = [(-2.9, -4.9, 2.9), (2.9, -4.9, 2.9), (-2.9, 4.9, 2.9), (2.9, 4.9, 2.9)]
CAMERAS = tuple(PTZCamera(place, 0, 0).aimed_at((0, 0, 1)) for place in CORNERS)
BODY = Avatar(on_cylinder(Cylinder("body", (0, 0, 0), 0.25, 1.8), 12, caps=False))
PLAN = Plan({"H1": BODY, "H2": BODY}, LIMITS)
# One step of the walk a frame, over a short way.
SHORT = passing(reach_m=1.0, steps=51)


def textbook(measurements, start, A, Q, sigma, speed_sigma, start_sigma):
    """Kalman's equations as printed, with inverses; one that is None is skipped. Yields (x⁺, P⁺) per frame."""
    H, R = np.hstack([np.eye(3), np.zeros((3, 3))]), sigma**2 * np.eye(3)
    x = np.concatenate([start, np.zeros(3)])
    P = np.diag([start_sigma**2] * 3 + [speed_sigma**2] * 3)
    for number, z in enumerate(measurements):
        if number:
            x, P = A @ x, A @ P @ A.T + Q
        if z is not None:
            K = P @ H.T @ np.linalg.inv(H @ P @ H.T + R)
            x, P = x + K @ (z - H @ x), (np.eye(6) - K @ H) @ P
        yield x, P


@pytest.mark.parametrize("latency_s", [0.0, 0.1, 0.025])
def test_the_filter_is_the_textbooks(latency_s):
    rng = np.random.default_rng(4)
    tracking = Tracking(latency_s=latency_s)
    start, velocity = np.array([0.3, -4, 0.9]), np.array([0.1, 1.2, 0])
    z = [start + velocity * FRAME_S * k + 0.03 * rng.standard_normal(3) for k in range(120)]
    z[20:45] = [None] * 25
    z[0] = None
    process = ConstantVelocity(0.5, FRAME_S)
    track = Track(start, tracking)
    ahead = latency_s + FRAME_S
    longer = ConstantVelocity(0.5, ahead)
    for number, (x, P) in enumerate(textbook(z, start, process.A, process.Q, 0.03, 1.5, 1.0)):
        if number:
            track.advance()
        track.update(z[number])
        np.testing.assert_allclose(track.state, x, atol=SAME_FILTER)
        np.testing.assert_allclose(track.covariance, P, atol=SAME_FILTER)
        place, covariance = track.ahead(ahead)
        np.testing.assert_allclose(place, x[:3] + ahead * x[3:], atol=SAME_FILTER)
        np.testing.assert_allclose(covariance, (longer.A @ P @ longer.A.T + longer.Q)[:3, :3], atol=SAME_FILTER)
    np.testing.assert_array_equal(track.ahead(0)[0], track.state[:3])


def test_predictions_are_consistent_where_the_avatar_moves_by_the_filters_process():
    """NEES of the prediction a latency and a frame ahead: the sum over runs is χ² with three degrees a run."""
    runs, settle, ahead_frames, q, sigma = 150, 60, 4, 0.5, 0.03
    tracking = Tracking(latency_s=(ahead_frames - 1) * FRAME_S)
    process = ConstantVelocity(q, FRAME_S)
    root = np.linalg.cholesky(process.Q)
    sums = np.zeros(settle)
    for run in range(runs):
        rng = np.random.default_rng([7, run])
        entry = np.array([0.0, -4, 0.9])
        # The truth is drawn from what the filter believes at first.
        x = np.concatenate([entry + rng.standard_normal(3), 1.5 * rng.standard_normal(3)])
        path = [x]
        for _ in range(settle + ahead_frames):
            path.append(process.A @ path[-1] + root @ rng.standard_normal(6))
        track = Track(entry, tracking)
        for k in range(settle):
            if k:
                track.advance()
            track.update(path[k][:3] + sigma * rng.standard_normal(3))
            place, covariance = track.ahead(tracking.latency_s + FRAME_S)
            error = place - path[k + ahead_frames][:3]
            sums[k] += error @ np.linalg.solve(covariance, error)
    low, high = scipy.stats.chi2.interval(1 - OUTSIDE_BAND / 3, 3 * runs)
    for k in (0, settle // 2, settle - 1):  # a frame far apart from the others; near ones share their errors
        assert low < sums[k] < high, (k, sums[k] / (3 * runs))


def test_latency_is_made_up_for_and_does_not_become_a_lag():
    """Mean error along a walk at constant velocity over seeded runs: none, where 0.12 m would be the latency's lag."""
    runs, frames, walk, errors = 40, 60, SHORT.first, []
    for seed in range(runs):
        tracking = Tracking(latency_s=0.1, seed=seed)
        measure = noisy_positions(tracking.sigma_m, seed)
        track = Track(walk.position_m(-0.1), tracking)
        for frame in range(frames):
            if frame:
                track.advance()
            track.update(measure("H1", frame, walk.position_m(frame * FRAME_S - 0.1)))
        errors.append(track.ahead(0.1 + FRAME_S)[0][1] - walk.position_m(frames * FRAME_S)[1])
    band = scipy.stats.norm.isf(OUTSIDE_BAND / 2) * np.std(errors, ddof=1) / math.sqrt(runs)
    assert abs(np.mean(errors)) < band < 0.25 * 0.12


# ---- the run ---------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def steered():
    return steer(SHORT, CAMERAS, STRATEGIES["swap-to-closer"], PLAN, Tracking(seed=3))


def test_a_runs_predictions_are_the_textbooks_from_the_same_measurements(steered):
    warm_up, measure = 30, noisy_positions(0.03, 3)
    clock = SHORT.times_s[0] + FRAME_S * (np.arange(warm_up + 50) - warm_up)
    process, ahead = ConstantVelocity(0.5, FRAME_S), 0.1 + FRAME_S
    for index, walk in enumerate(SHORT.walks):
        z = [measure(walk.name, frame, walk.position_m(t - 0.1)) for frame, t in enumerate(clock)]
        states = list(textbook(z, walk.position_m(clock[0] - 0.1), process.A, process.Q, 0.03, 1.5, 1.0))
        expected = [x[:3] + ahead * x[3:] for x, _ in states[warm_up - 1 :]]
        np.testing.assert_allclose(steered.predicted_m[:, index], expected, atol=SAME_FILTER)
    assert steered.predicted_m.shape == (51, 2, 3)
    assert steered.covariance_m2.shape == (51, 2, 3, 3)
    np.testing.assert_array_equal(steered.times_s, SHORT.times_s)
    # It is the prediction that is near the truth, not its copy.
    error = steered.predicted_m[:, 0] - SHORT.positions_m["H1"]
    assert 0.005 < np.sqrt((error**2).mean()) < 0.05


def test_the_cameras_swap_once_and_keep_to_their_speeds(steered):
    assert steered.swaps == 4
    assert steered.assignments[0] == ("H1", "H1", "H2", "H2")
    assert steered.assignments[-1] == ("H2", "H2", "H1", "H1")
    assert len(steered.cameras) == len(steered.assignments) == 51
    settings = np.array([[(c.pan_deg, c.tilt_deg, math.log(c.zoom)) for c in row] for row in steered.cameras])
    moves = np.diff(settings, axis=0)
    moves[..., 0] = (moves[..., 0] + 180) % 360 - 180
    fastest = np.array([90, 60, math.log(2)]) * FRAME_S
    assert (np.abs(moves) <= fastest * (1 + 1e-6)).all()
    assert (np.abs(moves) > 0.99 * fastest)[..., 0].any()  # they do hurry at the swap
    assert all(camera == quantised(camera, LIMITS) for row in steered.cameras for camera in row)


def test_motors_without_speed_limits_are_where_the_predictions_say():
    plan = dataclasses.replace(PLAN, limits=PTZLimits())
    run = steer(SHORT, CAMERAS, STRATEGIES["follow"], plan, Tracking(warm_up_s=0.2))
    for row, predicted in zip(run.cameras, run.predicted_m, strict=True):
        targets = (predicted[0], predicted[0], predicted[1], predicted[1])
        expected = tuple(follow(c, target, 0.95, PTZLimits()) for c, target in zip(CAMERAS, targets, strict=True))
        assert row == expected


def test_a_run_is_the_same_again_and_another_with_another_seed(steered):
    again = steer(SHORT, CAMERAS, STRATEGIES["swap-to-closer"], PLAN, Tracking(seed=3))
    np.testing.assert_array_equal(again.predicted_m, steered.predicted_m)
    assert repr(again.cameras) == repr(steered.cameras)
    other = steer(SHORT, CAMERAS, STRATEGIES["swap-to-closer"], PLAN, Tracking(seed=4))
    assert (other.predicted_m != steered.predicted_m).all()


def test_a_strategy_is_told_predictions_and_the_last_assignment():
    reported = []

    def spy(state):
        reported.append(state)
        return ("H1", "H2") * 2 if state.step % 2 else ("H2", "H1") * 2

    run = steer(SHORT, CAMERAS, spy, PLAN, Tracking(warm_up_s=0.5))
    # At the start, then every ten frames such that the first step of the walk is a decision.
    np.testing.assert_allclose([s.time_s for s in reported], [-0.5, *np.arange(-1, 5) / 3], atol=1e-12)
    assert [state.step for state in reported] == list(range(len(reported)))
    assert reported[0].previous is None
    assert [state.previous for state in reported[1:]] == [("H2", "H1") * 2, ("H1", "H2") * 2] * 3
    assert run.swaps == 4 * (len(reported) - 1)
    last = reported[-1]
    due = SHORT.first.position_m(last.time_s + PLAN.step_s)
    assert 0 < np.linalg.norm(last.predicted_m["H1"] - due) < 0.1


def without(gaps):
    """Measures without noise, but for the frames in `gaps`, by name."""
    return lambda name, frame, place: None if any(frame in gap for gap in gaps.get(name, ())) else place


def test_lost_avatars_are_counted_and_found_again():
    gaps = {"H1": [range(40, 55), range(60, 69), range(70, 80)], "H2": [range(31, 40)]}
    run = steer(SHORT, CAMERAS, STRATEGIES["follow"], PLAN, Tracking(lost_after_frames=10), without(gaps))
    assert run.losses == {"H1": 2, "H2": 0}
    # Step k was told in frame k + 29; lost from the tenth frame of a gap to the next measurement.
    lost = np.flatnonzero(run.lost[:, 0]) + 29
    assert lost.tolist() == [49, 50, 51, 52, 53, 54, 79]
    assert not run.lost[:, 1].any()
    # It coasts at its last velocity, which without noise is nearly its own, and is less sure of it.
    np.testing.assert_allclose(run.predicted_m[:, 0], SHORT.positions_m["H1"], atol=0.02)
    spread = np.sqrt(run.covariance_m2[:, 0, 1, 1])
    assert spread[54 - 29] > 2 * spread[39 - 29]
    assert spread[55 - 29] < spread[54 - 29] / 2


def test_mistakes_are_refused_in_one_line():
    follow_on = STRATEGIES["follow"]
    with pytest.raises(RangeError, match=r"the plan's avatars are \['A'\]; allowed: the walks' \['H1', 'H2'\]"):
        steer(SHORT, CAMERAS, follow_on, Plan({"A": BODY}))
    with pytest.raises(RangeError, match=r"a step of the walk, 0.3508.* is 10.526.* frames"):
        steer(passing(steps=20), CAMERAS, follow_on, PLAN)
    with pytest.raises(RangeError, match=r"plan.step_s, 0.01 s, is 0.3 frames"):
        steer(SHORT, CAMERAS, follow_on, dataclasses.replace(PLAN, step_s=0.01))
    with pytest.raises(RangeError, match="'H3'"):
        steer(SHORT, CAMERAS, lambda state: ("H3",) * 4, PLAN)
    with pytest.raises(ShapeError, match=r"shape \(2,\); allowed is \(3,\), or None"):
        steer(SHORT, CAMERAS, follow_on, PLAN, measure=lambda name, frame, place: place[:2])
    with pytest.raises(RangeError, match="finite metres, or None"):
        steer(SHORT, CAMERAS, follow_on, PLAN, measure=lambda name, frame, place: place * math.nan)
    for key, value in (("sigma_m", 0), ("latency_s", -0.1), ("lost_after_frames", 0), ("warm_up_s", math.inf)):
        with pytest.raises(RangeError, match=f"{key} = "):
            Tracking(**{key: value})
