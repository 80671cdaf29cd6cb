"""Files of a real walk: tables of its frames and of its consistency, trajectories, and a film."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from pss.hints import Floats
from render.random_streams import random_stream
from render.store.folder import Store
from render.store.views import stored_view
from validate.plots.film import write_film
from validate.plots.film_frame import FilmFrame
from validate.runs.tables import write_csv
from validate.schedule.stage import stance_in
from validate.tracked_walk.frames import TrackedWalk
from validate.tracked_walk.trajectories import Poses, body_poses, torso_pose, torso_reference_m, write_walk

__all__ = ["film_frames", "torso_trajectories", "write_real_walk"]


# Of all that is tracked and written, this trial's.
SHOWN_TRIAL = 0
# Of a capture's pixels, darker than white on the film: paper is brighter than nearly all else in a view.
WHITE_PERCENTILE = 99.8


def write_real_walk(folder: Path, tracked: TrackedWalk, store: Store, seed: int, assumed_density_m2_s3: float) -> None:
    """Write `walk.csv`, `walk_consistency.csv`, `walk_misfit.csv`, `trajectories/` and `figures/walk.webp`.

    Args:
        assumed_density_m2_s3: m²/s³, the acceleration density that the schedule passes to the metric.

    Raises:
        DamagedViewError: a view of the film is not in the store, or was found damaged and set aside.
    """
    write_csv(folder / "walk.csv", tracked.frame_rows())
    rng = random_stream(seed, tracked.real.strategy, "walk consistency")
    write_csv(folder / "walk_consistency.csv", tracked.consistency_rows(rng))
    write_csv(folder / "walk_misfit.csv", tracked.misfit_rows(assumed_density_m2_s3))
    _write_trajectories(folder, tracked)
    real = tracked.real
    rate = 1 / real.walk.step_s
    write_film(folder / "figures" / "walk.webp", film_frames(tracked, store), real.stage.scene.state.room,
               real.strategy, rate)  # fmt: skip


def _write_trajectories(folder: Path, tracked: TrackedWalk) -> None:
    """The markers and the torso of each avatar in one trial, estimated and true."""
    real = tracked.real
    markers = real.stage.scene.state.markers
    estimate = tracked.tracks.posterior_m[:, SHOWN_TRIAL]
    kept = np.where(tracked.tracks.lost[:, SHOWN_TRIAL, :, None], np.nan, estimate)
    for avatar in real.stage.names:
        worn = np.flatnonzero(real.stage.groups[avatar])
        named = {str(markers[n].id): n for n in worn.tolist()}
        estimates: dict[str, Floats | Poses] = {name: kept[:, n] for name, n in named.items()}
        truths: dict[str, Floats | Poses] = {name: real.truth_m[:, n] for name, n in named.items()}
        # evo refuses a file without a moment.
        seen = {name for name, n in named.items() if np.isfinite(kept[:, n, 0]).sum() > 1}
        estimates = {name: value for name, value in estimates.items() if name in seen}
        truths = {name: value for name, value in truths.items() if name in seen}
        torso = torso_trajectories(tracked, avatar)
        if np.isfinite(torso[0][0][:, 0]).sum() > 1:
            estimates["torso"], truths["torso"] = torso
        write_walk(folder, avatar, real.walk.times_s, estimates, truths)


def torso_trajectories(tracked: TrackedWalk, avatar: str) -> tuple[Poses, Poses]:
    """The poses of an avatar's torso, estimated from its tracked markers and true; nan where fewer than three are."""
    real = tracked.real
    stances = [stance_in(scene, avatar) for scene in real.scenes]
    first_id = dict(zip(real.stage.names, real.stage.first_ids, strict=True))[avatar]
    places = torso_reference_m(stances[0], real.scenes[0].state.markers, first_id)
    ids = [marker.id for marker in real.stage.scene.state.markers]
    columns = [ids.index(marker) for marker in places]
    points = np.where(
        tracked.tracks.lost[:, SHOWN_TRIAL, columns, None], np.nan, tracked.tracks.posterior_m[:, SHOWN_TRIAL, columns]
    )
    variance = np.trace(tracked.tracks.posterior_covariance_m2[:, SHOWN_TRIAL, columns], axis1=-2, axis2=-1)
    weights = np.where(np.isfinite(variance), 1 / np.where(np.isfinite(variance), variance, 1.0), 0.0)
    positions, turns, _ = body_poses(points, np.array(list(places.values())), weights)
    return (positions, turns), torso_pose(stances)


def film_frames(tracked: TrackedWalk, store: Store) -> Iterator[FilmFrame]:
    """The pictures of the film, one at a time: captures from the store, with what was found in one trial."""
    real = tracked.real
    headings = {
        walk.name: math.degrees(math.atan2(*walk.velocity_m_per_s[:2].tolist())) for walk in real.stage.walk.walks
    }
    white = 0.0
    for frame, (cameras, views) in enumerate(zip(real.steered.cameras, real.views, strict=True)):
        images, found = [], []
        for number, item in enumerate(views):
            view = stored_view(store, item.request.key)
            images.append(np.maximum(view.capture_dn.astype(float) - view.sensor.black_level_dn, 0.0))
            pixels = tracked.pixels[frame, number, SHOWN_TRIAL]
            found.append(pixels[np.isfinite(pixels[:, 0])])
        # One exposure for the whole film, so that light and shade are the hallway's.
        white = white or max(float(np.percentile(image, WHITE_PERCENTILE)) for image in images)
        yield FilmFrame(
            frame,
            float(real.walk.times_s[frame] - real.walk.times_s[0]),
            cameras,
            real.steered.assignments[frame],
            tuple(np.minimum(image / white, 1.0) for image in images),
            tuple(found),
            {name: places[frame] for name, places in real.walk.positions_m.items()},
            headings,
            dict(zip(real.stage.names, real.steered.predicted_m[frame], strict=True)),
        )
