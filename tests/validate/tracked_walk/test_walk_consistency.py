"""What is said of tracks by group, on tracks made by hand, and the motion's misfit on simulated and walking markers."""

from pathlib import Path

import numpy as np
import pytest
import scipy.stats

import scenes
from pss import ConstantVelocity, RangeError, ShapeError
from scenes.markers.suit import SUIT_KEYS, SUIT_SIZE
from validate.tracked_walk.consistency import consistency
from validate.tracked_walk.filter import WalkTracks
from validate.tracked_walk.process_misfit import misfit_rows, motion_misfit

# Probability outside the band of a test; the seeds are fixed, so that a pass stays a pass.
OUTSIDE_BAND = 1e-3
# One number by another sum.
SAME = 1e-9
# Rounding of a straight walk of some metres, in second differences over 2/3 Δt³: (1e-15 m)² times 1e3 s⁻³ or so.
NO_DENSITY_M2_S3 = 1e-20
HALLWAY = Path(__file__).parents[3] / "scenes" / "hallway.toml"
STEP_S = 0.1
TOLD = ConstantVelocity(0.5, STEP_S)


def made(errors, covariance, prior_factor=2.0, lost=None):
    """Tracks about 0 with these errors (K, T, N, 3) and covariances (K, T, N, 3, 3); the prior's are scaled alike."""
    shape = errors.shape[:3]
    lost = np.zeros(shape, dtype=bool) if lost is None else lost
    used = np.ones((shape[0], 2, *shape[1:]), dtype=bool)
    return WalkTracks(
        prior_m=prior_factor * errors,
        posterior_m=errors,
        prior_covariance_m2=prior_factor**2 * covariance,
        posterior_covariance_m2=covariance,
        used=used,
        gated=np.zeros_like(used),
        lost=lost,
        losses=np.zeros(shape[1:], dtype=int),
        reacquired=np.zeros(shape[1:], dtype=int),
    )


def drawn(rng, shape):
    """Errors (…, 3) of covariances (…, 3, 3) that differ from cell to cell, m and m²."""
    root = 1e-3 * (rng.uniform(-1, 1, (*shape, 3, 3)) + 2 * np.eye(3))
    return (root @ rng.standard_normal((*shape, 3, 1)))[..., 0], root @ root.mT


def rows_of(tracks, groups=None, seed=0, min_views=0, **keys):
    frames, _, markers, _ = tracks.posterior_m.shape
    groups = {"all": np.ones(markers, dtype=bool)} if groups is None else groups
    rows = consistency(tracks, np.zeros((frames, markers, 3)), groups, np.random.default_rng(seed), **keys)
    assert [row["group"] for row in rows] == [name for name in groups for _ in range(2)]
    return [row for row in rows if row["min_views"] == min_views]


# ---- consistency -----------------------------------------------------------------------------------------------------


def test_errors_of_the_stated_covariance_have_nees_and_coverage_as_they_should():
    """And with P a quarter too small, both say so."""
    cells = 30 * 4 * 50
    errors, covariance = drawn(np.random.default_rng(1), (30, 4, 50))
    (row,) = rows_of(made(errors, covariance))
    band = scipy.stats.norm.isf(OUTSIDE_BAND / 2) / np.sqrt(cells)
    for kind in ("prior", "posterior"):
        assert row[f"{kind}_cells"] == cells
        assert row[f"{kind}_nees_per_dof"] == pytest.approx(1, abs=band * np.sqrt(2 / 3))
        for percent in (50, 90, 95):
            share = percent / 100
            assert row[f"{kind}_coverage_{percent}"] == pytest.approx(share, abs=band * np.sqrt(share * (1 - share)))
        assert row[f"{kind}_nees_per_dof_ci_low"] < 1 < row[f"{kind}_nees_per_dof_ci_high"]
        assert row[f"{kind}_rms_m"] == pytest.approx(row[f"{kind}_claimed_rms_m"], rel=band)
    (small,) = rows_of(made(errors, 0.75 * covariance))
    assert small["posterior_nees_per_dof"] == pytest.approx(row["posterior_nees_per_dof"] / 0.75, rel=SAME)
    assert small["posterior_nees_per_dof_ci_low"] > 1
    assert small["posterior_coverage_90_ci_high"] < 0.9


def test_groups_lost_tracks_and_counts_by_hand():
    rng = np.random.default_rng(2)
    errors, covariance = drawn(rng, (6, 2, 5))
    lost = np.zeros((6, 2, 5), dtype=bool)
    lost[2:4, 0, 1] = True
    errors[2:4, 0, 1] = 100.0  # coasting
    errors[:, :, 4] = np.nan  # never tracked
    covariance[:, :, 4] = np.nan
    tracks = made(errors, covariance, lost=lost)
    tracks.losses[0, 1] = tracks.reacquired[0, 1] = 1
    tracks.used[0, 0, :, 0], tracks.gated[0, 0, :, 0] = False, True
    tracks.prior_m[3:5, 0, 1] = 100.0
    tracks.prior_m[2, 0, 1] = 0.001  # the track was lost only after this prediction
    first, others = rows_of(tracks, {"one": np.arange(5) == 1, "others": np.arange(5) != 1})

    kept = ~lost[:, :, 1]
    e, P = errors[:, :, 1][kept], covariance[:, :, 1][kept]
    assert (first["group"], first["markers"], first["frames"], first["trials"]) == ("one", 1, 6, 2)
    assert first["posterior_cells"] == first["prior_cells"] == 10
    assert first["share_tracked"] == pytest.approx(10 / 12)
    assert first["posterior_nees_per_dof"] == pytest.approx(
        np.mean([x @ np.linalg.inv(c) @ x / 3 for x, c in zip(e, P, strict=True)]), rel=SAME
    )
    assert first["posterior_rms_m"] == pytest.approx(np.sqrt((e**2).sum() / len(e)), rel=SAME)
    assert first["posterior_claimed_rms_m"] == pytest.approx(np.sqrt(np.trace(P.mean(axis=0))), rel=SAME)
    assert first["prior_rms_m"] < 0.1
    assert (first["track_losses"], first["reacquired"], first["share_gated"]) == (1, 1, 0)
    assert (others["track_losses"], others["reacquired"]) == (0, 0)
    assert others["share_tracked"] == pytest.approx(3 / 4)
    assert others["share_gated"] == pytest.approx(2 / (6 * 2 * 2 * 4))


def test_cells_of_two_views_are_told_apart_from_those_of_one():
    errors, covariance = drawn(np.random.default_rng(10), (6, 2, 3))
    tracks = made(errors, covariance)
    tracks.used[:4, 0, 1, 2] = False
    tracks.posterior_m[:4, 1, 2] = 5.0
    (every,), (two,) = (rows_of(tracks, min_views=least) for least in (0, 2))
    kept = tracks.used.all(axis=1)
    assert (every["posterior_cells"], two["posterior_cells"]) == (36, 32)
    assert two["share_tracked"] == pytest.approx(32 / 36)
    assert two["posterior_rms_m"] == pytest.approx(np.sqrt((errors[kept] ** 2).sum(axis=-1).mean()), rel=SAME)
    assert every["posterior_rms_m"] > 1


def test_the_metrics_prediction_stands_beside_the_cells_it_has():
    errors, covariance = drawn(np.random.default_rng(3), (4, 3, 2))
    errors[0, 1, 0] = np.nan
    predicted = np.tile(1e-6 * np.eye(3), (4, 2, 1, 1)) * np.arange(1, 9).reshape(4, 2, 1, 1)
    predicted[3, 1] = np.nan
    (row,) = rows_of(made(errors, covariance), predicted=(predicted, predicted))
    both = np.isfinite(errors[..., 0]) & np.isfinite(predicted[:, None, :, 0, 0])
    measured_m = np.sqrt((errors[both] ** 2).sum(axis=-1).mean())
    variances = np.broadcast_to(3e-6 * np.arange(1, 9).reshape(4, 1, 2), (4, 3, 2))
    assert row["posterior_common_rms_m"] == pytest.approx(measured_m, rel=SAME)
    assert row["prior_common_rms_m"] == pytest.approx(2 * measured_m, rel=SAME)
    assert row["posterior_predicted_rms_m"] == pytest.approx(np.sqrt(variances[both].mean()), rel=SAME)


def test_what_trials_or_frames_of_a_block_share_makes_no_interval_shorter():
    """Ten captures of one image, or five frames, with nothing but the frozen bias say no more than one."""
    errors, covariance = drawn(np.random.default_rng(4), (12, 1, 8))
    once, ten_trials, five_frames = (
        rows_of(made(errors.repeat(times, axis), covariance.repeat(times, axis)), block_frames=frames)[0]
        for times, axis, frames in ((1, 1, 1), (10, 1, 1), (5, 0, 5))
    )
    for row in (ten_trials, five_frames):
        for column in ("posterior_nees_per_dof", "posterior_rms_m", "prior_coverage_50"):
            for end in ("", "_ci_low", "_ci_high"):
                assert row[column + end] == pytest.approx(once[column + end], rel=SAME)


def test_an_interval_holds_the_truth_as_often_as_it_says():
    """Errors that last through a block, of each marker its own; at least as often as chance allows of 95 % in 60."""
    rng, runs, held = np.random.default_rng(5), 60, 0
    for run in range(runs):
        of_block = 1e-3 * rng.standard_normal((6, 1, 20, 3))
        errors = np.repeat(np.repeat(of_block, 5, axis=0), 2, axis=1)
        covariance = np.broadcast_to(1e-6 * np.eye(3), (*errors.shape, 3))
        (row,) = rows_of(made(errors, covariance), seed=run, block_frames=5)
        held += row["posterior_nees_per_dof_ci_low"] < 1 < row["posterior_nees_per_dof_ci_high"]
    assert held >= scipy.stats.binom.ppf(OUTSIDE_BAND, runs, 0.95)


def test_what_has_no_cell_is_nan_and_no_end_of_an_interval_is_out_of_range():
    errors, covariance = drawn(np.random.default_rng(6), (3, 1, 2))
    errors[0, 0, 0] *= 100  # one cell that makes up the mean
    some, none = rows_of(
        made(errors, covariance), {"one": np.array([True, False]), "none": np.zeros(2, dtype=bool)}, block_frames=1
    )
    assert none["markers"] == none["posterior_cells"] == 0
    for column in ("posterior_nees_per_dof", "prior_rms_m_ci_low", "share_tracked", "share_gated"):
        assert np.isnan(none[column])
    assert 0 <= some["posterior_nees_per_dof_ci_low"] <= some["posterior_nees_per_dof"]
    assert some["posterior_coverage_50_ci_high"] <= 1


@pytest.mark.parametrize(
    ("truth", "mask", "keys", "error", "says"),
    [
        ((4, 2, 3), np.ones(3, bool), {}, ShapeError, r"\(4, 3, 3\)"),
        ((4, 3, 3), np.ones(2, bool), {}, ShapeError, "'g' is bool"),
        ((4, 3, 3), np.arange(3), {}, ShapeError, "a mask"),
        ((4, 3, 3), np.ones(3, bool), {"block_frames": 0}, RangeError, "block_frames = 0"),
        ((4, 3, 3), np.ones(3, bool), {"predicted": (np.zeros((4, 3)),) * 2}, ShapeError, r"\(4, 3, 3, 3\)"),
    ],
)
def test_what_does_not_fit_is_named(truth, mask, keys, error, says):
    tracks = made(*drawn(np.random.default_rng(7), (4, 1, 3)))
    with pytest.raises(error, match=says):
        consistency(tracks, np.zeros(truth), {"g": mask}, np.random.default_rng(8), **keys)


# ---- the motion's misfit ---------------------------------------------------------------------------------------------


def test_the_misfit_of_a_simulated_motion_is_its_own_density():
    """Whatever the filter is told. Second differences of neighbouring frames correlate by 1/4: a wider band."""
    rng, frames, markers = np.random.default_rng(9), 300, 50
    for density in (0.02, 3.0):
        process, state, truth = ConstantVelocity(density, STEP_S), np.zeros((markers, 6)), []
        root = np.linalg.cholesky(process.Q)
        for _ in range(frames):
            truth.append(state[:, :3])
            state = state @ process.A.T + rng.standard_normal((markers, 6)) @ root.T
        found = motion_misfit(truth, TOLD)
        assert found.shape == (markers,)
        spread = np.sqrt(2 * (1 + 2 / 4**2) / (3 * frames * markers))
        assert found.mean() == pytest.approx(density, rel=scipy.stats.norm.isf(OUTSIDE_BAND / 2) * spread)


def test_a_straight_walk_needs_no_density_and_a_swing_that_of_its_closed_form():
    """Second differences of a sin(2πft) are −4 sin²(πfΔt) of itself, whose mean square is a²/2."""
    frames, amplitude_m, frequency_hz = 200, 0.3, 0.95
    times_s = STEP_S * np.arange(frames + 2)  # 200 differences: 19 whole swings
    truth = times_s[:, None, None] * np.array([[0.1, 1.2, 0.0]]) + np.zeros((1, 2, 1))
    truth[:, 1, 1] += amplitude_m * np.sin(2 * np.pi * frequency_hz * times_s)
    mean_square_m2 = (4 * np.sin(np.pi * frequency_hz * STEP_S) ** 2 * amplitude_m) ** 2 / 2
    density = mean_square_m2 / 3 / (2 / 3 * STEP_S**3)
    found = motion_misfit(truth, TOLD)
    assert found[0] < NO_DENSITY_M2_S3
    assert found[1] == pytest.approx(density, rel=SAME)
    both, swings, none = misfit_rows(
        truth, TOLD, {"both": np.ones(2, bool), "swings": np.array([False, True]), "none": np.zeros(2, bool)}
    )
    assert both["density_m2_s3"] == pytest.approx(density / 2, rel=SAME)
    assert both["largest_density_m2_s3"] == swings["density_m2_s3"] == swings["largest_density_m2_s3"]
    assert swings["density_over_assumed"] == pytest.approx(density / 0.5, rel=SAME)
    assert swings["prediction_rms_m"] == pytest.approx(np.sqrt(mean_square_m2), rel=SAME)
    largest_m = np.abs(np.diff(truth[:, 1, 1], n=2)).max()
    assert swings["largest_sigmas"] == pytest.approx(largest_m / np.sqrt(0.5 * 2 / 3 * STEP_S**3), rel=SAME)
    assert (
        misfit_rows(truth[:, :1], TOLD, {"straight": np.ones(1, bool)})[0]["largest_density_m2_s3"] < NO_DENSITY_M2_S3
    )
    assert none["markers"] == 0
    assert np.isnan(none["density_m2_s3"])


def test_the_limbs_of_a_walking_avatar_swing_more_than_its_trunk():
    scene = scenes.load(HALLWAY)
    places = [-0.6 + 0.12 * k for k in range(6)]  # 1.2 m/s at ten frames a second
    states = [scene.with_settings({"objects.H1.position_m": [-0.8, y]}).state for y in places]
    names = np.array([marker.object_name for marker in states[0].markers])
    keys = np.where(names == "H1", np.resize(SUIT_KEYS, len(names)), "")
    assert (names[:SUIT_SIZE] == "H1").all()
    groups = {part: keys == f"{part}_module_mm" for part in ("torso", "thigh", "shin")} | {"still": names == "H2"}
    torso, thigh, shin, still = misfit_rows([state.points_m for state in states], TOLD, groups)
    assert 0 < 2 * torso["density_m2_s3"] < thigh["density_m2_s3"] < shin["density_m2_s3"] / 2
    # The other one stands while the first is moved.
    assert still["largest_density_m2_s3"] < NO_DENSITY_M2_S3


def test_too_few_frames_are_named():
    with pytest.raises(ShapeError, match="at least 3 frames"):
        motion_misfit(np.zeros((2, 4, 3)), TOLD)
    with pytest.raises(ShapeError, match="'g'"):
        misfit_rows(np.zeros((3, 4, 3)), TOLD, {"g": np.ones(3, bool)})
