"""The real walk on detections that were drawn, not rendered: design, tracking, tables and trajectories."""

from __future__ import annotations

import csv

import numpy as np
import pytest

import scenes
from pss import ConstantVelocity, RangeError
from pss.noise import Calibration
from render.keys import state_key
from render.random_streams import random_stream
from render.store.folder import Store
from scenes.steps.schedule_file import load_schedule
from tests.helpers.drawn_pixels import LIMITS, acquired_of
from validate.schedule.stage import stage_of, stance_in
from validate.tracked_walk import files
from validate.tracked_walk.files import torso_trajectories, write_real_walk
from validate.tracked_walk.frames import body_parts, gait_densities, real_walk_of, track_real_walk
from validate.tracked_walk.process_misfit import motion_misfit

pytestmark = pytest.mark.slow

# Of a walk of 4 s.
FRAMES = 25
CALIBRATION = Calibration("calibrated", {"brightness-contrast": 1.0}, {}, LIMITS)
# NEES/3 of drawn detections, over a thousand cells of tens of markers; that of the predictions hangs on the gait.
POSTERIOR_NEES = (0.8, 1.25)
# Of the median over forty frames: who is counted as seen differs between the drawn detections and the fitted limits.
FORESEEN = 0.25
# Of a marker's density by this walk itself and by the gait of slower and faster ones.
SAME_GAIT = 2.0


@pytest.fixture(scope="module")
def schedule():
    return load_schedule(
        "hallway", ["sweep.real_walk.frames_per_s=6", "sweep.real_walk.trials=3", "sweep.walk.reach_m=2.4"]
    )


@pytest.fixture(scope="module")
def stage(schedule):
    return stage_of(schedule, scenes.load(schedule.scene_path))


@pytest.fixture(scope="module")
def real(schedule, stage):
    return real_walk_of(schedule, stage, {}, "no renderer")


@pytest.fixture(scope="module")
def tracked(real):
    places = [(scene, views) for scene, views in zip(real.scenes, real.views, strict=True)]
    found = acquired_of(places)
    for measurement in found.measured.values():
        measurement.pixels.flags.writeable = False
    found = type(found)({item: _few(value, 3) for item, value in found.measured.items()}, appearances=found.appearances)
    return track_real_walk(real, found, CALIBRATION)


def _few(measurement, trials):
    return type(measurement)(measurement.pixels[:trials], measurement.covariance[:trials], 0, 0.0)


def test_frames_are_of_people_who_walk(real, schedule):
    assert len(real.scenes) == len(real.steered.cameras) == FRAMES
    assert np.diff(real.walk.times_s) == pytest.approx(1 / 6)
    for item in real.scenes[7].state.objects:
        assert np.linalg.norm(item.motion.velocity_m_per_s) == pytest.approx(1.2)
    assert len({state_key(scene.state) for scene in real.scenes}) == FRAMES
    # A marker on the trunk keeps up with its person.
    head = np.flatnonzero(body_parts(real.stage)["head"] & real.stage.groups["H1"])
    assert np.diff(real.truth_m[:, head, 1], axis=0).mean() == pytest.approx(1.2 / 6, rel=0.05)


def test_the_posterior_is_as_good_as_it_says(tracked):
    rows = tracked.consistency_rows(random_stream(0, "test", "walk"))
    (both,) = (row for row in rows if row["group"] == "both" and row["min_views"] == 2)
    assert POSTERIOR_NEES[0] < both["posterior_nees_per_dof"] < POSTERIOR_NEES[1]
    assert both["share_tracked"] > 0.05
    parts = {row["group"] for row in rows}
    assert parts == {"H1", "H2", "both", "torso", "head", "arms", "legs"}


def test_the_metrics_own_recursion_foresees_the_filters_error(tracked):
    """In the median of frame and marker; means belong to what coasts, unseen."""
    rows = [row for row in tracked.frame_rows() if row["avatar"] == "both"]
    ratio = np.array([row["predicted_median_m"] / row["measured_median_m"] for row in rows])
    assert np.nanmedian(ratio) == pytest.approx(1, rel=FORESEEN)
    assert np.isfinite(ratio).mean() > 0.9


def test_the_process_is_of_other_walks_and_fits_this_one(real):
    reported = gait_densities(real.stage, real.walk)
    own = motion_misfit(real.truth_m, ConstantVelocity(1.0, real.walk.step_s))
    parts = body_parts(real.stage)
    for part in ("torso", "legs"):
        assert 1 / SAME_GAIT < reported[parts[part]].mean() / own[parts[part]].mean() < SAME_GAIT
    # Limbs swing; alike places on the two suits have one density.
    assert reported[parts["legs"]].mean() > 2 * reported[parts["torso"]].mean()
    np.testing.assert_array_equal(reported[real.stage.groups["H1"]], reported[real.stage.groups["H2"]])


def test_frames_rows_count_what_is_tracked(tracked):
    rows = tracked.frame_rows()
    assert len(rows) == 3 * FRAMES
    for row in rows:
        assert 0 <= row["found_by_two"] <= row["markers"]
        assert row["tracked"] <= row["markers"]
    middle = next(row for row in rows if row["step"] == FRAMES // 2 and row["avatar"] == "both")
    assert middle["found_by_two"] > 5
    in_views = np.isfinite(tracked.pixels[FRAMES // 2, :, :, :, 0]).sum(axis=0)
    assert middle["found_by_two"] == np.mean([(trial > 1).sum() for trial in in_views])
    assert middle["found_by_one"] == np.mean([(trial == 1).sum() for trial in in_views])
    assert middle["measured_median_m"] < 0.02


def test_the_torso_is_where_it_is(tracked):
    """Its pose from tracked markers against the true one: millimetres and a degree or two."""
    (positions, turns), (true_positions, true_turns) = torso_trajectories(tracked, "H1")
    known = np.isfinite(positions[:, 0])
    assert known.sum() > 5
    assert np.median(np.linalg.norm(positions - true_positions, axis=1)[known]) < 0.02
    assert np.median((turns[known].inv() * true_turns[known]).magnitude()) < np.radians(5)
    # The true one is the stance's own, whatever its markers do.
    stance = stance_in(tracked.real.scenes[3], "H1")
    assert true_positions[3, :2] == pytest.approx(stance.position_m, abs=1e-9)


def test_what_a_real_walk_leaves(tracked, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(files, "write_film", lambda path, frames, *rest: asked.append((path, rest[1:])))
    write_real_walk(tmp_path, tracked, Store(tmp_path), 0, 0.1)
    assert asked == [(tmp_path / "figures" / "walk.webp", ("swap-to-closer", pytest.approx(6)))]
    for name in ("walk", "walk_consistency", "walk_misfit"):
        with (tmp_path / f"{name}.csv").open(encoding="utf-8") as file:
            assert len(list(csv.DictReader(file))) > 5
    for avatar in ("H1", "H2"):
        estimates = sorted((tmp_path / "trajectories" / avatar).glob("*-estimate.tum"))
        assert len(estimates) > 10
        for path in estimates:
            rows = np.loadtxt(path)
            truth = np.loadtxt(path.with_name(path.name.replace("estimate", "truth")))
            assert set(rows[:, 0]) <= set(truth[:, 0])


def test_a_rate_that_does_not_fit_is_refused(schedule, stage):
    wrong = load_schedule("hallway", ["sweep.real_walk.frames_per_s=6.1"])
    with pytest.raises(RangeError, match=r"24\.4 frames of a walk .* whole number of frames"):
        real_walk_of(wrong, stage, {}, "no renderer")
