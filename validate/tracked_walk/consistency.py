"""Consistency of the tracks of a walk: errors against their covariance, by group of markers, with intervals.

Convention: NEES is eᵀP⁻¹e of the position's error e about the truth, over its three degrees of freedom: 1 where P is
right, above it where P is too small. P is the filter's own in that frame and trial, which follows the time-varying
Riccati recursion with the views that were really used. It is not the steady state P∞ of Eq. 4, which no frame of a walk
with moving cameras has to reach; how far the metric's prediction is from the filter's own P is a question of its own
(`predicted`).
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from pss.cameras.camera import as_points
from pss.errors import RangeError, ShapeError
from pss.hints import Bools, Floats, Row
from validate.stats.consistency import Consistency, crossed_mean, of_errors
from validate.stats.ranking import Resamples
from validate.tracked_walk.filter import WalkTracks

__all__ = ["consistency", "group_masks"]


# Frames that stay together in a resample: a second of a walk at ten frames a second, about a stride, in which a
# filter of constant velocity has forgotten and the view of a marker, with its bias, has changed.
BLOCK_FRAMES = 10
# Views that updated a cell's frame: 0 for all cells, and 2 for those in which the depth was measured as well. A track
# that one view alone keeps alive drifts along its ray, and a few of these make up the mean of all squares.
LEAST_VIEWS = (0, 2)


def consistency(
    tracks: WalkTracks,
    truth_m: ArrayLike,
    groups: Mapping[str, ArrayLike],
    rng: np.random.Generator,
    predicted: tuple[Floats, Floats] | None = None,
    block_frames: int = BLOCK_FRAMES,
) -> list[Row]:
    """Two rows for each group, of all cells and of those that two views updated: NEES, coverage and RMS error.

    Each is given before (`prior_…`) and after (`posterior_…`) the updates.

    A cell is a marker in a frame of a trial, with a track that is not lost: lost tracks have no position. (A
    prediction counts as lost if the track was lost after the frame before.) `share_tracked` is how many cells these
    are, so that losing the difficult markers cannot improve a filter's score unseen.

    Intervals (95 %, `…_ci_low`, `…_ci_high`) come from random weights of markers crossed with blocks of frames. The
    trials of a frame share its rendered image, and with it the frozen bias of its detections: they get one weight
    between them, and are never taken for further markers or frames.

    Args:
        truth_m: m, the markers' true places, (K, N, 3).
        groups: masks (N,) by name; a marker may be in several, or in none.
        rng: of the resamples.
        predicted: m², the metric's own covariances before and after the updates, (K, N, 3, 3) each
            (`walk_riccati.riccati_along`); None for none.
        block_frames: frames in a block.

    Returns:
        Rows with `group`, `min_views` (0 or 2), `markers`, `frames`, `trials`, `share_tracked` (these cells, of all
        markers in all frames of all trials), `track_losses` and `reacquired` (sums over trials and markers),
        `share_gated` (detections thrown out, of those that met a gate or a start; these three of the group, whatever
        the views), and for each kind `…_cells`, `…_nees_per_dof`, `…_coverage_50`, `_90` and `_95` (share of errors
        inside the ellipsoid that should hold so many per cent), `…_rms_m` and `…_claimed_rms_m` (√ of the mean tr P of
        the same cells). With `predicted`, also `…_predicted_rms_m` and `…_common_rms_m`, predicted and measured, of the
        cells that have both. What has no cell is nan.

    Raises:
        ShapeError: truth, masks or predictions do not fit the tracks.
        RangeError: `block_frames` < 1.
    """
    frames, trials, markers, _ = tracks.posterior_m.shape
    truth = as_points(truth_m, "truth_m")
    if truth.shape != (frames, markers, 3):
        raise ShapeError(f"truth_m has shape {truth.shape}; allowed beside these tracks is {(frames, markers, 3)}")
    for covariance in predicted or ():
        if np.shape(covariance) != (frames, markers, 3, 3):
            raise ShapeError(f"predicted has shape {np.shape(covariance)}; allowed: {(frames, markers, 3, 3)}, twice")
    if block_frames < 1:
        raise RangeError(f"block_frames = {block_frames!r}; allowed: at least 1")
    masks = group_masks(groups, markers)
    # A frame's trials are rows of their own in what follows, all in the block of their frame.
    block = np.repeat(np.arange(frames) // block_frames, trials)
    resamples = Resamples.of_configurations(block[:, None], markers)

    lost_before = np.concatenate([np.zeros((1, trials, markers), dtype=bool), tracks.lost[:-1]])
    kinds = (
        _Kind("prior", tracks.prior_m, tracks.prior_covariance_m2, lost_before, truth),
        _Kind("posterior", tracks.posterior_m, tracks.posterior_covariance_m2, tracks.lost, truth),
    )
    rows, views = [], tracks.used.sum(axis=1)
    for name, mask in masks.items():
        for min_views in LEAST_VIEWS:
            cells = mask & (views >= min_views)
            row: Row = {"group": name, "min_views": min_views, "markers": int(mask.sum())}
            row |= {"frames": frames, "trials": trials, **_counts(tracks, mask, cells)}
            for kind, expected in zip(kinds, predicted or (None, None), strict=True):
                row |= kind.row(cells.reshape(-1, markers), resamples, expected)
            rows.append(row)
    return rows


def group_masks(groups: Mapping[str, ArrayLike], markers: int) -> dict[str, Bools]:
    """The masks as arrays (N,), N = `markers`.

    Raises:
        ShapeError: one that is not of N truth values.
    """
    masks = {name: np.asarray(mask) for name, mask in groups.items()}
    for name, mask in masks.items():
        if mask.shape != (markers,) or mask.dtype != bool:
            raise ShapeError(f"group {name!r} is {mask.dtype} {mask.shape}; allowed: a mask, bool ({markers},)")
    return masks


def _counts(tracks: WalkTracks, mask: Bools, cells: Bools) -> Row:
    """How much of a group (N,) was tracked, in `cells` (K, T, N), and lost and thrown out."""
    tracked = (np.isfinite(tracks.posterior_m[..., 0]) & ~tracks.lost & cells)[..., mask]
    used, gated = int(tracks.used[..., mask].sum()), int(tracks.gated[..., mask].sum())
    return {
        "share_tracked": float(tracked.mean()) if tracked.size else float("nan"),
        "track_losses": int(tracks.losses[:, mask].sum()),
        "reacquired": int(tracks.reacquired[:, mask].sum()),
        "share_gated": gated / (used + gated) if used + gated else float("nan"),
    }


class _Kind:
    """Errors before or after the updates, with frames and trials as one axis: (K T, N, …)."""

    def __init__(self, name: str, places_m: Floats, covariance_m2: Floats, lost: Bools, truth_m: Floats) -> None:
        self.name, self.trials = name, places_m.shape[1]
        errors = np.where(lost[..., None], np.nan, places_m - truth_m[:, None])
        flat = (-1, errors.shape[2])
        covariance = np.where(lost[..., None, None], np.nan, covariance_m2).reshape(*flat, 3, 3)
        self.squares_m2 = (errors**2).sum(axis=-1).reshape(flat)
        self.claimed_m2 = np.trace(covariance, axis1=-2, axis2=-1)
        self.judged: Consistency = of_errors(errors.reshape(-1, 1, *errors.shape[2:]), covariance)

    def row(self, cells: Bools, resamples: Resamples, predicted_m2: Floats | None) -> Row:
        """The columns of some cells, (K T, N); `predicted_m2` (K, N, 3, 3)."""

        def of_these(values: Floats) -> Floats:
            return np.where(cells, values, np.nan)

        squares = of_these(self.squares_m2)
        found: Row = {"cells": int(np.isfinite(squares).sum())}
        found |= _mean_with_interval("nees_per_dof", of_these(self.judged.nees), resamples)
        for level, inside in self.judged.inside.items():
            found |= _mean_with_interval(f"coverage_{round(100 * level)}", of_these(inside), resamples, most=1.0)
        mean_squares = _mean_with_interval("rms_m", squares, resamples)
        found |= {column: float(np.sqrt(value)) for column, value in mean_squares.items()}
        found["claimed_rms_m"] = _root_mean(of_these(self.claimed_m2))
        if predicted_m2 is not None:
            expected = np.repeat(np.trace(predicted_m2, axis1=-2, axis2=-1), self.trials, axis=0)
            both = np.isfinite(squares) & np.isfinite(expected)
            found["predicted_rms_m"], found["common_rms_m"] = _root_mean(expected[both]), _root_mean(squares[both])
        return {f"{self.name}_{column}": value for column, value in found.items()}


def _mean_with_interval(name: str, values: Floats, resamples: Resamples, most: float = np.inf) -> dict[str, float]:
    """The mean of (K T, N), nan left out, and its interval's ends, which must not leave 0 to `most`.

    To scale the resamples' deviations back to full size may take an end beyond what the mean can be.
    """
    mean = crossed_mean(values, resamples)
    low, high = np.clip(mean.interval, 0.0, most).tolist()
    return {name: mean.estimate, f"{name}_ci_low": low, f"{name}_ci_high": high}


def _root_mean(values: Floats) -> float:
    known = values[np.isfinite(values)]
    return float(np.sqrt(known.mean())) if known.size else float("nan")
