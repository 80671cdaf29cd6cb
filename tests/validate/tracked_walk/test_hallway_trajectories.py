"""Poses from markers against scipy's minimiser and the gait's own frames, and TUM files against numpy and evo."""

from __future__ import annotations

import dataclasses
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import scipy.optimize
from scipy.spatial.transform import Rotation

from pss import RangeError, ShapeError
from render.store.folder import StoreError
from scenes.markers.suit import PLACES, SUIT_KEYS, SUIT_SIZE, ids_on, suit_markers
from scenes.people.avatar import Stance, avatar_frames
from scenes.people.gait import stride_of_speed
from scenes.schema.avatar import SuitSpec
from validate.tracked_walk.trajectories import body_poses, torso_pose, torso_reference_m, write_tum, write_walk

ROOT = Path(__file__).parents[3]
HEIGHT_M = 1.75
STANCE = Stance("H1", HEIGHT_M, stride_of_speed(1.2, HEIGHT_M), 0.0, (-0.6, -4.0), 0.0)
FIRST_ID = 50
SIDE_MODULES = 8.0
MODULES_MM = {key: getattr(SuitSpec(first_id=FIRST_ID), key) for key in SUIT_KEYS}
# A few roundings of metres.
ROUNDING_M = 1e-12
# Two minimisers of one sum of squares; scipy's own stops where a step changes it by less than its rounding.
SAME_MINIMUM = 1e-6
END = {"xtol": 1e-15, "ftol": 1e-15, "gtol": 1e-15}
# What a file must keep of a metre, a second and a quaternion.
KEPT_M = 1e-9
# Relative, of errors of centimetres and degrees: ten decimals of metres and quaternions, and evo's arc cosine.
SAME_ERROR = 1e-7
# Standard errors that a mean of draws may be off: once in 16,000 for a fixed seed.
STANDARD_ERRORS = 4.0
BODY_M = np.array([[0.0, 0.11, 0.38], [0, -0.11, 0.38], [0.01, 0.1, 0.09], [0, -0.12, 0.09], [0.15, 0, 0.18]])


def walk(steps: int = 9) -> list[Stance]:
    """Stances along a walk that also turns."""
    return [
        dataclasses.replace(STANCE, phase=(0.37 * k) % 1, position_m=(-0.6, -4 + 0.4 * k), heading_deg=15.0 * k)
        for k in range(steps)
    ]


def suit(stance: Stance):
    """The markers of the suit that there are."""
    return [marker for marker in suit_markers(stance, FIRST_ID, MODULES_MM, SIDE_MODULES) if marker]


def rows(path: Path) -> np.ndarray:
    """The numbers of a TUM file, (K, 8)."""
    return np.loadtxt(path, ndmin=2)


# ---- the torso -------------------------------------------------------------------------------------------------------


def test_markers_of_a_part_keep_their_distances_over_the_walk_and_others_do_not():
    at = {stance: {marker.id: np.array(marker.centre_m) for marker in suit(stance)} for stance in walk()}

    def spread_m(ids):
        apart = [np.linalg.norm([places[a] - places[b] for a in ids for b in ids], axis=1) for places in at.values()]
        return np.ptp(apart, axis=0).max()

    torso = ids_on("torso", FIRST_ID)
    assert spread_m(torso) < ROUNDING_M
    assert all(spread_m((*torso, other)) > 0.01 for other in ids_on("right thigh", FIRST_ID))


def test_every_marker_is_on_one_part():
    ids = [number for part in {place.part for place in PLACES} for number in ids_on(part, FIRST_ID)]
    assert sorted(ids) == list(range(FIRST_ID, FIRST_ID + SUIT_SIZE))
    for none in ("left foot", "thigh"):
        with pytest.raises(RangeError, match=rf"'{none}' bears no markers; allowed: head, torso"):
            ids_on(none, FIRST_ID)


def test_the_torsos_reference_is_the_same_in_every_stance():
    """Six markers about the middle between the hips: front and back at two heights, and the flanks."""
    first, *others = [torso_reference_m(stance, suit(stance), FIRST_ID) for stance in walk()]
    assert list(first) == list(ids_on("torso", FIRST_ID))
    for other in others:
        np.testing.assert_allclose(list(other.values()), list(first.values()), atol=ROUNDING_M)
    front, right = first[FIRST_ID + 5], first[FIRST_ID + 9]
    assert PLACES[5].facing == (0, 1, 0)
    assert front[1] > 0.05
    assert front[2] == pytest.approx(0.218 * HEIGHT_M, abs=0.02)
    assert PLACES[9].facing == (1, 0, 0)
    assert right[0] > 0.05
    assert abs(right[1]) < 0.02


def test_a_reference_needs_markers_of_this_avatar():
    with pytest.raises(RangeError, match=r"no marker on the torso of 'H2'"):
        torso_reference_m(dataclasses.replace(STANCE, name="H2"), suit(STANCE), FIRST_ID)


def test_the_torsos_pose_comes_back_from_its_markers():
    """Markers by the suit, poses by the gait's frames."""
    stances = walk()
    reference = torso_reference_m(STANCE, suit(STANCE), FIRST_ID)
    places = [{marker.id: marker.centre_m for marker in suit(stance)} for stance in stances]
    positions, rotations, rms = body_poses([[at[n] for n in reference] for at in places], list(reference.values()))
    truth, turns = torso_pose(stances)
    np.testing.assert_allclose(positions, truth, atol=ROUNDING_M)
    np.testing.assert_allclose(rotations.as_matrix(), turns.as_matrix(), atol=ROUNDING_M)
    np.testing.assert_allclose(rms, 0, atol=ROUNDING_M)
    for stance, position, turn in zip(stances, truth, turns, strict=True):
        np.testing.assert_allclose(position[:2], stance.position_m, atol=ROUNDING_M)
        # Heading as a camera pans: 0 is +y, 90 is +x.
        heading = np.radians(stance.heading_deg)
        np.testing.assert_allclose(turn.apply([0, 1, 0]), [np.sin(heading), np.cos(heading), 0], atol=ROUNDING_M)
        np.testing.assert_allclose(position, avatar_frames(stance)["torso"].origin_m, atol=ROUNDING_M)


# ---- poses -----------------------------------------------------------------------------------------------------------


def noisy(poses: int, sigma_m: float, seed: int = 3) -> tuple[np.ndarray, np.ndarray, Rotation]:
    """Measured points (K, N, 3) of `BODY_M`, and the true positions and rotations."""
    rng = np.random.default_rng(seed)
    positions, rotations = rng.uniform(-4, 4, (poses, 3)), Rotation.random(poses, rng=rng)
    points = np.array([turn.apply(BODY_M) for turn in rotations]) + positions[:, None]
    return points + sigma_m * rng.standard_normal(points.shape), positions, rotations


def test_poses_are_the_weighted_least_squares_ones():
    """scipy.optimize on position and rotation vector, with points missing and weights of three decades."""
    points, *_ = noisy(4, sigma_m=0.02)
    points[1, 2] = np.nan
    weights = 10 ** np.random.default_rng(5).uniform(-3, 0, points.shape[:2])
    weights[2, 0] = 0
    positions, rotations, rms = body_poses(points, BODY_M, weights)
    for k in range(len(points)):
        used = np.isfinite(points[k, :, 0])
        measured, reference, weight = points[k, used], BODY_M[used], weights[k, used]

        def misfit(x, measured=measured, reference=reference, weight=weight):
            placed = Rotation.from_rotvec(x[3:]).apply(reference) + x[:3]
            return (np.sqrt(weight / weight.sum())[:, None] * (measured - placed)).ravel()

        best = min(
            (
                scipy.optimize.least_squares(misfit, [*measured.mean(axis=0), *start], jac="3-point", **END)
                for start in 2 * np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])
            ),
            key=lambda found: found.cost,
        )
        np.testing.assert_allclose(positions[k], best.x[:3], atol=SAME_MINIMUM)
        assert (rotations[k].inv() * Rotation.from_rotvec(best.x[3:])).magnitude() < SAME_MINIMUM
        assert rms[k] == pytest.approx(np.sqrt(2 * best.cost), abs=SAME_MINIMUM)


def test_the_misfit_has_as_many_degrees_of_freedom_as_numbers_less_six():
    """With noise σ in each coordinate of N points the sum of squares is σ²(3N − 6) on average (to first order)."""
    sigma_m, poses = 1e-4, 600
    points, *_ = noisy(poses, sigma_m)
    squares = len(BODY_M) * body_poses(points, BODY_M)[2] ** 2 / sigma_m**2
    degrees = 3 * len(BODY_M) - 6
    assert abs(squares.mean() - degrees) < STANDARD_ERRORS * np.sqrt(2 * degrees / poses)


@pytest.mark.parametrize("case", ["two points", "none", "a line", "one place", "weights"])
def test_poses_that_nothing_determines_are_nan(case):
    points, *_ = noisy(2, sigma_m=0.0)
    reference, weights = BODY_M.copy(), np.ones(points.shape[:2])
    if case == "two points":
        points[0, 2:, 1] = np.nan
    elif case == "none":
        points[0] = np.nan
    elif case == "a line":
        points[0, :, :] = np.outer(np.linspace(0, 1, 5), [1, 2, 3])
    elif case == "one place":
        points[0] = [1, 2, 3]
    else:
        weights[0, :3] = 0
    positions, rotations, rms = body_poses(points, reference, weights)
    assert np.isnan(positions[0]).all()
    assert np.isnan(rms[0])
    assert rotations[0].magnitude() == 0
    assert rms[1] == pytest.approx(0, abs=ROUNDING_M)


def test_a_reference_on_a_line_gives_no_pose():
    points = np.random.default_rng(0).uniform(-1, 1, (2, 4, 3))
    assert np.isnan(body_poses(points, np.outer(range(4), [0.1, 0.2, 0.0]))[0]).all()


@pytest.mark.parametrize(
    ("arguments", "error", "says"),
    [
        ((np.zeros((2, 5)), BODY_M), ShapeError, r"\(K, N, 3\)"),
        ((np.zeros((2, 4, 3)), BODY_M), ShapeError, r"\(2, 4, 3\)"),
        ((np.zeros((2, 5, 3)), BODY_M * np.nan), RangeError, "reference_m"),
        ((np.zeros((2, 5, 3)), BODY_M, np.ones(5)), ShapeError, r"\(2, 5\)"),
        ((np.zeros((2, 5, 3)), BODY_M, -np.ones((2, 5))), RangeError, "-1"),
        ((np.zeros((2, 5, 3)), BODY_M, np.full((2, 5), np.nan)), RangeError, "nan"),
    ],
)
def test_bodies_that_do_not_fit_are_refused(arguments, error, says):
    with pytest.raises(error, match=says):
        body_poses(*arguments)


# ---- files -----------------------------------------------------------------------------------------------------------


def test_a_file_holds_what_is_known_to_a_nanometre(tmp_path):
    rng = np.random.default_rng(8)
    times, positions = np.cumsum(rng.uniform(0.01, 1, 30)), rng.uniform(-5, 5, (30, 3))
    turns = Rotation.random(30, rng=rng)
    positions[4, 1] = np.nan
    write_tum(tmp_path / "a.tum", times, positions, turns)
    read, kept = rows(tmp_path / "a.tum"), np.delete(np.arange(30), 4)
    assert read.shape == (29, 8)
    np.testing.assert_allclose(read[:, 0], times[kept], atol=KEPT_M, rtol=0)
    np.testing.assert_allclose(read[:, 1:4], positions[kept], atol=KEPT_M, rtol=0)
    assert (Rotation.from_quat(read[:, 4:]).inv() * turns[kept]).magnitude().max() < KEPT_M


def test_the_quaternions_real_part_comes_last(tmp_path):
    """A quarter turn about z is (0, 0, √½, √½), and a point's identity (0, 0, 0, 1)."""
    write_tum(tmp_path / "a.tum", [0.5], [[1, 2, 3]], Rotation.from_rotvec([[0, 0, np.pi / 2]]))
    np.testing.assert_allclose(rows(tmp_path / "a.tum"), [[0.5, 1, 2, 3, 0, 0, 0.5**0.5, 0.5**0.5]], atol=KEPT_M)
    write_tum(tmp_path / "b.tum", [0.5], [[1, 2, 3]])
    np.testing.assert_array_equal(rows(tmp_path / "b.tum"), [[0.5, 1, 2, 3, 0, 0, 0, 1]])
    assert (tmp_path / "b.tum").read_text().splitlines()[0] == "# timestamp tx ty tz qx qy qz qw"


@pytest.mark.parametrize(
    ("arguments", "error", "says"),
    [
        (([0, 1], np.zeros((3, 3))), ShapeError, r"\(2,\) and positions_m \(3, 3\)"),
        (([0, 1], np.zeros((2, 3)), Rotation.identity(3)), ShapeError, r"\(3,\); allowed is \(2,\)"),
        (([0, 1], np.zeros((2, 3)), Rotation.identity()), ShapeError, r"\(\); allowed is \(2,\)"),
        (([0, 2, 1], np.zeros((3, 3))), RangeError, "1.0 out of order"),
        (([0, 1, 1], np.zeros((3, 3))), RangeError, "1.0 out of order"),
        (([np.nan], np.zeros((1, 3))), RangeError, "nan out of order"),
        (([0], [[0, np.inf, 0]]), RangeError, "inf"),
    ],
)
def test_trajectories_that_are_none_are_refused_and_leave_no_file(tmp_path, arguments, error, says):
    with pytest.raises(error, match=says):
        write_tum(tmp_path / "a.tum", *arguments)
    assert not list(tmp_path.iterdir())


def known_walk(folder: Path) -> tuple[np.ndarray, np.ndarray, Rotation, Rotation]:
    """Write a marker and a torso with known errors: true and estimated places (K, 3), nan in two rows, and turns."""
    rng, steps = np.random.default_rng(12), 21
    times = np.arange(steps) / 3
    truth, turns = torso_pose([dataclasses.replace(STANCE, position_m=(-0.6, -4 + 0.4 * k)) for k in range(steps)])
    estimate = truth + 0.02 * rng.standard_normal(truth.shape) + [0.01, 0, 0]
    estimate[[3, 17]] = np.nan
    turned = turns * Rotation.from_rotvec(0.05 * rng.standard_normal(truth.shape))
    estimates = {"3": estimate, "torso": (estimate, turned)}
    written = write_walk(folder, "H1", times, estimates, {"3": truth, "torso": (truth, turns)})
    assert [path.relative_to(folder).as_posix() for path in written] == [
        f"trajectories/H1/{name}-{kind}.tum" for kind in ("truth", "estimate") for name in ("3", "torso")
    ]
    return truth, estimate, turns, turned


def test_a_walk_is_written_beside_its_truth(tmp_path):
    truth, estimate, _, turned = known_walk(tmp_path)
    folder, found = tmp_path / "trajectories" / "H1", np.isfinite(estimate[:, 0])
    np.testing.assert_allclose(rows(folder / "3-truth.tum")[:, 1:4], truth, atol=KEPT_M)
    np.testing.assert_allclose(rows(folder / "3-estimate.tum")[:, 1:4], estimate[found], atol=KEPT_M)
    np.testing.assert_array_equal(rows(folder / "3-estimate.tum")[:, 4:], [[0, 0, 0, 1]] * found.sum())
    read = rows(folder / "torso-estimate.tum")
    assert (Rotation.from_quat(read[:, 4:]).inv() * turned[found]).magnitude().max() < KEPT_M


def test_walks_that_do_not_fit_are_refused(tmp_path):
    place = np.zeros((1, 3))
    with pytest.raises(RangeError, match=r"estimates are of \['1'\]; allowed: \['2'\]"):
        write_walk(tmp_path, "H1", [0], {"1": place}, {"2": place})
    for avatar, name in (("H1", "../3"), ("a/b", "3"), ("..", "3"), ("H1", "")):
        with pytest.raises(RangeError, match="becomes a file's name"):
            write_walk(tmp_path, avatar, [0], {name: place}, {name: place})
    assert not list(tmp_path.iterdir())
    (tmp_path / "trajectories").write_text("in the way")
    with pytest.raises(StoreError, match="allowed is a folder"):
        write_walk(tmp_path, "H1", [0], {"3": place}, {"3": place})


# ---- evo -------------------------------------------------------------------------------------------------------------


@pytest.mark.acceptance
@pytest.mark.parametrize(
    ("name", "relation"), [("3", "trans_part"), ("torso", "trans_part"), ("torso", "angle_deg"), ("torso", "full")]
)
def test_evo_finds_the_error_that_was_made(tmp_path, name, relation):
    """The command line of the docstring, and numpy's own root mean square over the moments that both files have."""
    truth, estimate, turns, turned = known_walk(tmp_path)
    files = [f"trajectories/H1/{name}-{kind}.tum" for kind in ("truth", "estimate")]
    command = [Path(sys.executable).with_name("evo_ape"), "tum", *files, "--pose_relation", relation]
    # evo keeps its settings in the home folder.
    environment = os.environ | {"HOME": str(tmp_path), "USERPROFILE": str(tmp_path)}
    done = subprocess.run(
        [*command, "--save_results", "result.zip"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=environment,
        timeout=300,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    with zipfile.ZipFile(tmp_path / "result.zip") as archive:
        stats = json.loads(archive.read("stats.json"))
    found = np.isfinite(estimate[:, 0])
    apart = turns[found].inv() * turned[found]
    # evo's whole error is the Frobenius norm of the pose that is left between the two, less the identity.
    left = turns[found].inv().apply(estimate[found] - truth[found])
    squares = {
        "trans_part": (left**2).sum(axis=1),
        "angle_deg": np.degrees(apart.magnitude()) ** 2,
        "full": (left**2).sum(axis=1) + ((apart.as_matrix() - np.eye(3)) ** 2).sum(axis=(1, 2)),
    }[relation]
    print(f"{name} {relation}: evo {stats['rmse']:.9f}, numpy {np.sqrt(squares.mean()):.9f}")
    assert stats["rmse"] == pytest.approx(np.sqrt(squares.mean()), rel=SAME_ERROR)
    assert stats["max"] == pytest.approx(np.sqrt(squares.max()), rel=SAME_ERROR)
