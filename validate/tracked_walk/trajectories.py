"""The paths of a run of the hallway as TUM files, and the pose of a body's rigid part from its markers.

A TUM file has a line `timestamp tx ty tz qx qy qz qw` for each moment: seconds, metres in the world, and the unit
quaternion that turns the body's axes into the world's. It is the format of the TUM RGB-D benchmark, and what `evo`
and most programs that compare trajectories read.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from pss import RangeError, ShapeError
from pss.cameras.camera import as_points
from pss.hints import Floats
from render.store.folder import write_text
from render.world.state import Marker
from scenes.markers.suit import ids_on
from scenes.people.avatar import Stance, avatar_frames

__all__ = ["Poses", "body_poses", "torso_pose", "torso_reference_m", "write_tum", "write_walk"]

Poses = tuple[Floats, Rotation]
"""Metres, the positions of a body's reference origin, (K, 3), and the K rotations from its axes to the world's."""

# Trunk from the hips to the shoulders: one part in `scenes.people.body`, so chest and pelvis don't turn against each
# other.
TORSO = "torso"
POSE_MARKERS = 3
# Markers that are off a line by less than a thousandth of its length (half a millimetre on a torso, a plate's own
# thickness) do not determine a rotation about it. The ratio is of the squares of the two.
ON_A_LINE = 1e-6
# Rounding to ten decimals moves a position by 0.05 nm and an angle by as little at a metre's distance.
DECIMALS = 10
HEADER = "# timestamp tx ty tz qx qy qz qw"
# Names become parts of file names.
FILE_NAME = re.compile(r"[\w-][\w.-]*")


# ---- poses -----------------------------------------------------------------------------------------------------------


def torso_reference_m(stance: Stance, markers: Sequence[Marker], first_id: int) -> dict[int, Floats]:
    """Metres, where an avatar's markers sit on its torso, by id in rising order, (3,) each.

    The origin is the middle between the hips, and the axes point right, forwards and up, as in `torso_pose`. The torso
    is rigid over the walk, so any stance of this avatar gives the same places.

    Args:
        stance: of the avatar when its markers were at `markers`.
        markers: the scene's, those of others among them.
        first_id: of the avatar's suit.

    Raises:
        RangeError: none of the markers is on this avatar's torso.
    """
    frame, ids = avatar_frames(stance)[TORSO], ids_on(TORSO, first_id)
    own = {marker.id: np.array(marker.centre_m) for marker in markers if marker.object_name == stance.name}
    if not own.keys() & set(ids):
        raise RangeError(f"no marker on the torso of {stance.name!r}; allowed: some of the ids {ids[0]} to {ids[-1]}")
    return {number: (own[number] - frame.origin_m) @ frame.axes for number in ids if number in own}


def torso_pose(stances: Sequence[Stance]) -> Poses:
    """The true pose of an avatar's torso in each of K `stances`: the middle between its hips, m, and its axes."""
    frames = [avatar_frames(stance)[TORSO] for stance in stances]
    positions_m = np.array([frame.origin_m for frame in frames]).reshape(-1, 3)
    return positions_m, Rotation.from_matrix(np.array([frame.axes for frame in frames]).reshape(-1, 3, 3))


def body_poses(
    points_m: ArrayLike, reference_m: ArrayLike, weights: ArrayLike | None = None
) -> tuple[Floats, Rotation, Floats]:
    """The poses of a rigid body from measured places of its points: least squares over turns and shifts.

    Args:
        points_m: m in the world, (K, N, 3), nan where a point was not measured.
        reference_m: m, the same points in the body's own axes, about the origin whose position is requested, (N, 3).
        weights: of the points, such as one over their variances, (K, N), 0 to leave one out; None for equal ones.

    Returns:
        Metres, the positions of the reference's origin, (K, 3); the K rotations from the body's axes to the world's;
        m, the weighted root mean square distance of the measured points from where the pose puts them, (K,).
        Where fewer than three points are known or they lie on a line, position and distance are nan and the rotation
        is the identity.

    Raises:
        ShapeError: the arrays do not fit each other.
        RangeError: the reference is not finite, or a weight is negative or not finite.
    """
    points, reference = np.asarray(points_m, dtype=float), as_points(reference_m, "reference_m")
    if points.ndim != 3 or points.shape[1:] != reference.shape or reference.ndim != 2:
        raise ShapeError(
            f"points_m has shape {points.shape} and reference_m {reference.shape}; allowed: (K, N, 3) and (N, 3)"
        )
    weight = np.ones(points.shape[:2]) if weights is None else np.asarray(weights, dtype=float)
    if weight.shape != points.shape[:2]:
        raise ShapeError(f"weights has shape {weight.shape}; allowed beside points_m is {points.shape[:2]}")
    if not ((weight >= 0) & np.isfinite(weight)).all():
        raise RangeError(f"weights holds {weight[~((weight >= 0) & np.isfinite(weight))][0]}; allowed: 0 or more")
    known = np.isfinite(points).all(axis=2) & (weight > 0)
    positions, rms = np.full((len(points), 3), np.nan), np.full(len(points), np.nan)
    turns = np.tile(np.eye(3), (len(points), 1, 1))
    for row in np.flatnonzero(known.sum(axis=1) >= POSE_MARKERS):
        chosen = known[row]
        fitted = _fitted(points[row, chosen], reference[chosen], weight[row, chosen])
        if fitted is not None:
            positions[row], turns[row], rms[row] = fitted
    return positions, Rotation.from_matrix(turns), rms


def _fitted(measured: Floats, reference: Floats, weight: Floats) -> tuple[Floats, Floats, float] | None:
    """Metres, position (3,), turn (3, 3) and m, root mean square, from M points; None if they lie on a line."""
    share = weight / weight.sum()
    middle, reference_middle = share @ measured, share @ reference
    out, reference_out = measured - middle, reference - reference_middle
    # Its singular values are products of both sets' extents: the second is nothing as soon as one of them is a line.
    first, second, _ = np.linalg.svd((share[:, None] * out).T @ reference_out, compute_uv=False)
    if second <= ON_A_LINE * first:
        return None
    turn = Rotation.align_vectors(out, reference_out, weights=share)[0]
    left = out - turn.apply(reference_out)
    rms = float(np.sqrt(share @ (left**2).sum(axis=1)))
    return middle - turn.apply(reference_middle), turn.as_matrix(), rms


# ---- files -----------------------------------------------------------------------------------------------------------


def write_tum(path: Path, times_s: ArrayLike, positions_m: ArrayLike, rotations: Rotation | None = None) -> None:
    """Write a trajectory as a TUM file, whole or not at all. Rows whose position has a nan are left out.

    Args:
        times_s: s, (K,), each later than the one before.
        positions_m: m in the world, (K, 3).
        rotations: K, from the body's axes to the world's; None for a point, which gets the identity.

    Raises:
        ShapeError: not as many times, positions and rotations.
        RangeError: times that do not rise, by ten decimals, or a position that is infinite.
        StoreError: the folder cannot be written.
    """
    times, positions = np.asarray(times_s, dtype=float), np.asarray(positions_m, dtype=float)
    if times.ndim != 1 or positions.shape != (len(times), 3):
        raise ShapeError(f"times_s has shape {times.shape} and positions_m {positions.shape}; allowed: (K,) and (K, 3)")
    if rotations is not None and np.shape(rotations.as_quat()) != (len(times), 4):
        raise ShapeError(f"rotations has shape {rotations.as_quat().shape[:-1]}; allowed is ({len(times)},)")
    steps = np.diff(np.round(times, DECIMALS))
    if not np.isfinite(times).all() or not (steps > 0).all():
        late = times[1:][~(steps > 0)].tolist() or times[~np.isfinite(times)].tolist()
        raise RangeError(f"times_s holds {late[0]} out of order; allowed: finite seconds, each later than the last")
    if np.isinf(positions).any():
        raise RangeError(f"positions_m holds {positions[np.isinf(positions)][0]}; allowed: metres, or nan for none")
    turns = Rotation.identity(len(times)) if rotations is None else rotations
    # Of the two quaternions of a rotation the one with the positive real part.
    rows = np.column_stack([times, positions, turns.as_quat(canonical=True)])[np.isfinite(positions).all(axis=1)]
    lines = [" ".join(f"{number:.{DECIMALS}f}" for number in row) for row in rows.tolist()]
    write_text(path, "\n".join([HEADER, *lines]) + "\n")


def write_walk(
    folder: Path,
    avatar: str,
    times_s: ArrayLike,
    estimates: Mapping[str, ArrayLike | Poses],
    truths: Mapping[str, ArrayLike | Poses],
) -> list[Path]:
    """Write what was found of an avatar's walk beside what was true, as TUM files, and return their paths.

    They are `trajectories/<avatar>/<name>-truth.tum` and `…-estimate.tum` in `folder`. evo's error of a marker and of
    the torso's position, then of the torso's turn, in one world, so without aligning anything:

        evo_ape tum trajectories/H1/3-truth.tum trajectories/H1/3-estimate.tum
        evo_ape tum trajectories/H1/torso-truth.tum trajectories/H1/torso-estimate.tum
        evo_ape tum trajectories/H1/torso-truth.tum trajectories/H1/torso-estimate.tum --pose_relation angle_deg

    evo compares the moments that both files have. A marker that was never found has a file without moments, which
    evo refuses.

    Args:
        avatar: its name.
        times_s: s, (K,), each later than the one before.
        estimates: by the name of a marker or a body, such as "torso": m, its positions, (K, 3), nan where it was not
            found, or its `Poses`.
        truths: likewise, of the same names.

    Raises:
        RangeError: estimates and truths of different names, or names that no file can have; times as in `write_tum`.
        ShapeError, StoreError: as `write_tum`.
    """
    if set(estimates) != set(truths):
        raise RangeError(f"estimates are of {sorted(estimates)}; allowed: {sorted(truths)}, as the truths")
    for name in (avatar, *truths):
        if not FILE_NAME.fullmatch(name):
            raise RangeError(f"{name!r} becomes a file's name; allowed: letters, digits, hyphens, underscores and dots")
    written = []
    for kind, trajectories in (("truth", truths), ("estimate", estimates)):
        for name, trajectory in trajectories.items():
            posed = isinstance(trajectory, tuple) and len(trajectory) == 2 and isinstance(trajectory[1], Rotation)
            positions, rotations = trajectory if posed else (trajectory, None)
            path = folder / "trajectories" / avatar / f"{name}-{kind}.tum"
            write_tum(path, times_s, positions, rotations)
            written.append(path)
    return written
