"""Rivals that are a number of a covariance, against closed cases, numeric derivatives and the region itself."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull, HalfspaceIntersection

from pss import PositionFix, PTZCamera, RandomWalk, evaluate
from pss.rivals.covariance import PRIOR_SIGMA_M, quantisation_volume_m3, worst_diagonal_m2
from pss.rivals.entropy import DETECTION_PROBABILITY, expected_log_determinant
from pss.rivals.planar import planar_variance_m2
from tests.helpers.rivals import CAMERAS, TARGET, look, random_cameras, ring, scene, score, single, towards

# Relative; the same sums in another order.
SAME_TO_ROUNDING = 1e-9
# Relative; a central difference of 10 µm against metres keeps about nine digits, and an inverse loses some.
AGREES_WITH_DIFFERENCES = 1e-6
# Relative; over ±½ px at 4 m the pyramids differ from prisms by a few mm over 4 m.
PYRAMIDS_ARE_NEARLY_PRISMS = 3e-3
# The ±½ px region's volume over the Gaussian's √det: a box of three sides has 12^1.5 = 41.6; of two cameras that know
# the height alike both, 58.8. Each further camera takes more of the Gaussian than of the region.
REGION_OVER_GAUSSIAN = {2: (41.0, 59.0), 3: (41.0, 110.0), 5: (41.0, 200.0)}
# ln det, of m⁶: what it costs to take the ninth camera's information for sure.
NINTH_CAMERA = 0.02
# With R = I and s = d/f, two cameras at right angles have J = diag(1, 1, 2)/s².
RIGHT_ANGLES = ring(0, 90)
S = 4 / RIGHT_ANGLES[0].focal_px


@pytest.mark.parametrize(
    ("name", "expected", "sigma"),
    [
        ("a-optimality", 2.5 * S**2, math.sqrt(2.5) * S),
        ("d-optimality", math.log(S**6 / 2), (S**6 / 2) ** (1 / 6)),
        ("e-optimality", S**2, S),
        ("worst-diagonal", S**2, S),
        ("quantisation-volume", S**3 / math.sqrt(2) / 12**1.5, S * (1 / math.sqrt(2)) ** (1 / 3) / math.sqrt(12)),
        ("gdop", 4 * math.sqrt(2.5), 4 * math.sqrt(2.5)),
        ("planar-estimator", 2 * S**2, math.sqrt(2) * S),
        ("pairwise-bearing", 16, 4),
    ],
)
def test_two_cameras_at_right_angles(name, expected, sigma):
    result = look(RIGHT_ANGLES, noise="identity")
    assert score(name, result) == pytest.approx(expected)
    assert score(f"{name}-count-zero", result) == pytest.approx(1 / sigma)


def test_t_optimality_of_two_cameras():
    result = look(RIGHT_ANGLES, noise="identity")
    assert score("t-optimality", result) == pytest.approx(4 / S**2)
    assert score("t-optimality-count-zero", result) == pytest.approx(2 / S)
    alone = look(RIGHT_ANGLES[:1], noise="identity")
    assert score("t-optimality", alone) == pytest.approx(2 / S**2)
    assert score("t-optimality-count-zero", alone) == 0


def test_optimality_is_of_the_inverse_of_the_summed_information():
    """Camera by camera from H and R; means over the points, the largest for the worst diagonal."""
    rng = np.random.default_rng(1)
    points = TARGET + 0.2 * rng.standard_normal((5, 3))
    result = look(random_cameras(rng), points)
    C, J = [], []
    for i in range(len(points)):
        J.append(
            sum(
                result.jacobian[k, i].T @ np.linalg.inv(result.noise_px2[k, i]) @ result.jacobian[k, i]
                for k in np.flatnonzero(result.visible[:, i])
            )
        )
        C.append(np.linalg.inv(J[-1]))
    expected = {
        "a-optimality": np.mean([np.trace(c) for c in C]),
        "d-optimality": np.mean([math.log(np.linalg.det(c)) for c in C]),
        "e-optimality": np.mean([np.linalg.eigvalsh(c)[-1] for c in C]),
        "t-optimality": np.mean([np.trace(j) for j in J]),
        "worst-diagonal": max(max(np.diag(c)) for c in C),
        "worst-diagonal-count-zero": np.mean([1 / math.sqrt(max(np.diag(c))) for c in C]),
    }
    for name, value in expected.items():
        assert score(name, result) == pytest.approx(value, rel=SAME_TO_ROUNDING), name
    assert worst_diagonal_m2(result).max() > worst_diagonal_m2(result).min()


def test_e_optimality_counted_as_eq_10_does_is_single_frame_pss():
    result = scene(CAMERAS)
    assert 0 < result.observable.mean() < 1
    assert score("e-optimality-count-zero", result) == pytest.approx(result.pss_single_frame, rel=SAME_TO_ROUNDING)


def test_gdop_is_that_of_measured_bearings():
    """√tr (HᵀH)⁻¹ with H by central differences of the unit vectors."""
    rng, step = np.random.default_rng(2), 1e-5
    for count in (2, 3, 6):
        cameras = random_cameras(rng, count)
        H = np.vstack(
            [
                np.column_stack(
                    [(towards(c, TARGET + e) - towards(c, TARGET - e)) / (2 * step) for e in step * np.eye(3)]
                )
                for c in cameras
            ]
        )
        expected = math.sqrt(np.trace(np.linalg.inv(H.T @ H)))
        assert score("gdop", look(cameras)) == pytest.approx(expected, rel=AGREES_WITH_DIFFERENCES)


# ---- quantisation ----------------------------------------------------------------------------------------------------


def region_m3(cameras):
    """m³, volume of what the pyramids of ±½ px about the target's pixels have in common, by their half-spaces."""
    scale, half_spaces = 1e3, []  # about the target and in mm, for the library's sake
    for camera in cameras:
        P = camera.projection_matrix
        u, v = camera.project(TARGET)[0]
        for row, pixel in ((0, u), (1, v)):
            for sign in (1, -1):
                # sign·(P_row·x − (pixel + sign/2)·P_depth·x) ≤ 0
                a = sign * (P[row] - (pixel + sign / 2) * P[2])
                offset = a[:3] @ TARGET + a[3]
                half_spaces.append(np.append(a[:3], offset * scale) / np.linalg.norm(a[:3]))
    corners = HalfspaceIntersection(np.array(half_spaces), np.zeros(3)).intersections
    return ConvexHull(corners).volume / scale**3


def test_the_quantisation_regions_volume_is_a_known_multiple_for_two_cameras():
    """At right angles a cube of (d/f)³ against the Gaussian's √det C: √2·12^1.5 = 58.8."""
    volume = quantisation_volume_m3(look(RIGHT_ANGLES))[0]
    assert region_m3(RIGHT_ANGLES) == pytest.approx(S**3, rel=PYRAMIDS_ARE_NEARLY_PRISMS)
    assert region_m3(RIGHT_ANGLES) / volume == pytest.approx(math.sqrt(2) * 12**1.5, rel=PYRAMIDS_ARE_NEARLY_PRISMS)


def test_the_quantisation_regions_volume_stays_within_a_band_of_the_gaussians():
    """What stands in for the volume: a ratio that grows with the cameras, since boxes don't add up as Gaussians do."""
    rng, middle = np.random.default_rng(8), []
    for count, (low, high) in REGION_OVER_GAUSSIAN.items():
        several = [random_cameras(rng, count) for _ in range(12)]
        ratios = [region_m3(cameras) / quantisation_volume_m3(look(cameras))[0] for cameras in several]
        assert low < min(ratios) < max(ratios) < high, count
        middle.append(np.median(ratios))
    assert middle == sorted(middle)


# ---- the plane -------------------------------------------------------------------------------------------------------


def test_the_planar_estimator_is_the_printed_formula_and_the_numeric_inverse():
    """Cameras level with the point: the x and y of Σ HᵀR⁻¹H are the planar problem."""
    rng = np.random.default_rng(3)
    for count in (2, 3, 5):
        azimuths, distances = rng.uniform(0, 360, count), rng.uniform(2, 6, count)
        cameras = [c for a, d in zip(azimuths, distances, strict=True) for c in ring(a, distance_m=d, zoom=1.5)]
        result = look(cameras)
        J = sum(
            H[:, :2].T @ np.linalg.inv(R) @ H[:, :2]
            for H, R in zip(result.jacobian[:, 0], result.noise_px2[:, 0], strict=True)
        )
        variances = result.noise_px2[:, 0, 0, 0] * (distances / cameras[0].focal_px) ** 2
        w, twice = 1 / variances, 2 * np.radians(azimuths)
        W, c, s = w.sum(), (w * np.cos(twice)).sum(), (w * np.sin(twice)).sum()
        assert planar_variance_m2(result)[0] == pytest.approx(np.trace(np.linalg.inv(J)), rel=1e-6)
        assert planar_variance_m2(result)[0] == pytest.approx(4 * W / (W**2 - c**2 - s**2), rel=1e-6)


def test_rays_in_line_fix_nothing_in_the_plane_and_a_camera_above_says_nothing():
    assert planar_variance_m2(look([*ring(30), *ring(30, distance_m=6)]))[0] == math.inf
    assert planar_variance_m2(look(ring(30, 210)))[0] == math.inf
    for beside_m in (0, 1e-12):
        above = PTZCamera((beside_m, 0, 4), 0, -89.9)
        assert planar_variance_m2(look([above, *ring(30)]))[0] == math.inf


# ---- filters ---------------------------------------------------------------------------------------------------------


def test_the_uncertainty_reward_is_stone_soups_loop():
    """Camera by camera a Kalman update of the covariance; the rewards of the steps add up."""
    result = scene(CAMERAS)
    total = 0.0
    for i in range(len(result.points_m)):
        P = PRIOR_SIGMA_M**2 * np.eye(3)
        for k in np.flatnonzero(result.visible[:, i]):
            H, R = result.jacobian[k, i], result.noise_px2[k, i]
            after = P - P @ H.T @ np.linalg.solve(H @ P @ H.T + R, H @ P)
            total, P = total + np.linalg.norm(P) - np.linalg.norm(after), after
    assert score("uncertainty-reward", result) == pytest.approx(total, rel=SAME_TO_ROUNDING)
    assert total > 0


def test_the_uncertainty_reward_of_a_sharp_view_counts_what_is_seen():
    """√3 m² for a point that is fixed, √3 − 1 for one whose distance is open, 0 for one not seen, to a few mm²."""
    for cameras, expected in ((RIGHT_ANGLES, math.sqrt(3)), (RIGHT_ANGLES[:1], math.sqrt(3) - 1), ([], 0)):
        assert score("uncertainty-reward", look(cameras, noise="identity")) == pytest.approx(expected, abs=1e-4)
    twice = look(RIGHT_ANGLES, [TARGET, TARGET], noise="identity")
    assert score("uncertainty-reward", twice) == pytest.approx(2 * math.sqrt(3), abs=2e-4)


def test_at_the_steady_state_the_reward_is_what_the_walk_adds():
    """Three cameras along three right angles: P∞ − P⁺ = qI is all of it, at whatever distance."""
    axes = np.linalg.qr(np.random.default_rng(5).standard_normal((3, 3)))[0]
    for distance_m in (2, 4):
        cameras = [PTZCamera(tuple(TARGET + distance_m * a), 0, 0).aimed_at(TARGET) for a in axes]
        result = look(cameras, noise="identity", process=RandomWalk(2e-3))
        assert score("uncertainty-reward-steady-state", result) == pytest.approx(4e-6 * math.sqrt(3), rel=1e-6)
    uneven = look(ring(0, 10), noise="identity", process=RandomWalk(2e-3))
    P = uneven.covariance[0]
    expected = np.linalg.norm(P) - np.linalg.norm(P - 4e-6 * np.eye(3))
    assert score("uncertainty-reward-steady-state", uneven) == pytest.approx(expected, rel=1e-6)


def test_the_worst_diagonal_sees_other_sensors():
    """A position fix of 1 mm observes alone what no camera sees."""
    fix = PositionFix(1e-3)
    result = evaluate([], [TARGET], [[0, -1, 0]], sensors=[fix])
    assert score("worst-diagonal", result) == pytest.approx(1e-6)
    assert score("gdop", result) == math.inf


# ---- entropy ---------------------------------------------------------------------------------------------------------


def by_enumeration(result, i, probability=DETECTION_PROBABILITY):
    """Over the subsets of the cameras that see the point, from the definition."""
    prior = np.eye(3) / PRIOR_SIGMA_M**2
    if result.observable[i]:
        prior = prior + np.linalg.inv(result.covariance[i, :3, :3])
    seen, total = np.flatnonzero(result.visible[:, i]), 0.0
    for chosen in itertools.product((False, True), repeat=len(seen)):
        weight = math.prod(probability if c else 1 - probability for c in chosen)
        information = prior + result.camera_information[seen[list(chosen)], i].sum(axis=0)
        total -= weight * np.linalg.slogdet(information)[1]
    return total


def test_entropy_is_the_mean_over_which_cameras_deliver():
    result = scene(CAMERAS)
    expected = [by_enumeration(result, i) for i in range(len(result.points_m))]
    np.testing.assert_allclose(expected_log_determinant(result), expected, rtol=SAME_TO_ROUNDING)
    assert score("entropy", result) == pytest.approx(np.mean(expected))
    sure = expected_log_determinant(result, 1.0)
    assert (sure <= np.array(expected) + SAME_TO_ROUNDING).all()


def test_entropy_of_nothing_is_the_priors():
    nothing = evaluate([], [TARGET], [[0, -1, 0]])
    assert score("entropy", nothing) == pytest.approx(6 * math.log(PRIOR_SIGMA_M))


def test_entropy_of_more_than_eight_cameras_is_a_bit_too_good():
    cameras = [single(x, -4 + 0.1 * k) for k, x in enumerate(np.linspace(-2, 2, 9))]
    result = evaluate(cameras, [TARGET], [[0, -1, 0]])
    assert result.visible.all()
    exact, found = by_enumeration(result, 0), expected_log_determinant(result)[0]
    assert exact - NINTH_CAMERA < found < exact
    # A ninth that does not see the point changes nothing.
    hidden = dataclasses.replace(result, visible=np.arange(9)[:, None] < 8)
    assert expected_log_determinant(hidden)[0] == pytest.approx(by_enumeration(hidden, 0), rel=SAME_TO_ROUNDING)
