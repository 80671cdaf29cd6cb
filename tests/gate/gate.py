"""The gate: does the prediction rank configurations as the measurement does? Pure functions from numbers to claims.

A claim holds if the whole interval lies above its bound, and the figure itself is at least what is required. Ranks are
judged within an equal camera count: over different counts, any number that grows with the cameras correlates. The gate
stands or falls with all its claims, so that each is judged at a level that holds for the family (Bonferroni).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from pss.errors import RangeError, ShapeError
from validate.stats.crossed import Resamples
from validate.stats.intervals import interval
from validate.stats.ranking import judge_against

__all__ = ["FAMILY_LEVEL", "FEWEST_CONFIGURATIONS", "Claim", "family_level", "format_claims", "judge", "turn_shows"]

# Chance that all intervals of a gate cover what they are for.
FAMILY_LEVEL = 0.95
# A turn of the camera that the measuring side is not told of has to show in its detections within this share of itself.
TURN_TOLERANCE = 0.05
BOOTSTRAPS = 1000

# Fewer ranks than this say nothing: by pure chance one order in 120 of five configurations is the right one.
FEWEST_CONFIGURATIONS = 8


@dataclass(frozen=True)
class Claim:
    """A statement that a run confirms or not.

    Attributes:
        name: what is claimed, in words.
        figure: the measured figure, nan if it is not defined.
        low, high: its interval.
        bound: what `low` has to reach.
        holds: both are reached. An unknown figure holds nothing.
        least: what `figure` has to reach; None if only the interval counts.
    """

    name: str
    figure: float
    low: float
    high: float
    bound: float
    holds: bool
    least: float | None = None


def judge(
    metric_points: ArrayLike,
    measured_points: ArrayLike,
    views: Sequence[Sequence[int]],
    *,
    bound: float,
    least: float | None = None,
    cameras: int | None = None,
    camera_names: Sequence[str] | None = None,
    label: str = "predicted PSS",
    level: float = FAMILY_LEVEL,
) -> list[Claim]:
    """Judge the rank correlation of predicted with measured single-frame PSS within each camera count.

    Args:
        metric_points: 1/m, (K, N), predicted single-frame 1/σ, 0 where unobservable.
        measured_points: 1/m, (K, N), `MeasuredErrors.inverse_sigma` of each configuration.
        views: the K configurations' views; their lengths are the camera counts.
        bound: Spearman's ρ that the interval's lower end has to reach.
        least: Spearman's ρ that the estimate has to reach; None if only the interval counts.
        cameras: judge this count only; every count if None.
        camera_names: the camera of each view, (V,), whose views share chance; None: a view shares none with another.
        label: what predicts, for the claims' names.
        level: of the interval; `family_level` of the number of claims that are judged together.

    Returns:
        One claim for each camera count, in ascending order. With fewer than `FEWEST_CONFIGURATIONS` of a count, the
        figure is unknown and the claim does not hold.
    """
    metric, measured = np.asarray(metric_points, dtype=np.float64), np.asarray(measured_points, dtype=np.float64)
    if metric.ndim != 2 or metric.shape != measured.shape or len(views) != len(metric):
        raise ShapeError(
            f"metric_points {metric.shape}, measured_points {measured.shape} and {len(views)} configurations' views; "
            "allowed: (K, N), (K, N) and K"
        )
    for name, value in (("bound", bound), ("least", least)):
        if value is not None and not -1 <= value <= 1:
            raise RangeError(f"{name} = {value!r}; allowed: −1 to 1")
    counts = np.array([len(configuration) for configuration in views])
    claims = []
    for count in sorted(set(counts.tolist())) if cameras is None else [cameras]:
        chosen = np.flatnonzero(counts == count)
        figures = (np.nan, np.nan, np.nan)
        if len(chosen) >= FEWEST_CONFIGURATIONS:
            table = np.array([list(views[k]) for k in chosen])
            resamples = Resamples.of_configurations(table, metric.shape[1], camera_names)
            rho = judge_against(metric[chosen], measured[chosen], resamples)
            figures = (rho.estimate, *rho.ends(level))
        name = f"Spearman of {label} with measured PSS, {count} cameras, {len(chosen)} configurations"
        holds = bool(figures[1] >= bound and (least is None or figures[0] >= least))
        claims.append(Claim(name, *figures, bound, holds, least))
    return claims


def family_level(claims: int) -> float:
    """Level of each interval so that all of so many hold together with `FAMILY_LEVEL`, whatever they share."""
    return 1 - (1 - FAMILY_LEVEL) / claims


def turn_shows(
    residuals_px: ArrayLike, shift_px: ArrayLike, rng: np.random.Generator, level: float = FAMILY_LEVEL
) -> Claim:
    """Judge whether a turn of the rendered camera, of which the measuring side knows nothing, shows in full.

    A detection that is fed with true projections, and noise of whatever size, shows nothing of it.

    Args:
        residuals_px: detections less projections by the camera as it is said to be, (T, N, 2); nan if not detected.
        shift_px: what the turn does to the projections, (N, 2).
    """
    residuals, shift = np.asarray(residuals_px, dtype=np.float64), np.asarray(shift_px, dtype=np.float64)
    if residuals.ndim != 3 or residuals.shape[1:] != shift.shape:
        raise ShapeError(f"residuals_px {residuals.shape}, shift_px {shift.shape}; allowed: (T, N, 2) and (N, 2)")
    seen = np.isfinite(residuals[..., 0]).any(axis=0)
    mean = np.nanmean(residuals[:, seen], axis=0)
    shown, turned = (mean * shift[seen]).sum(axis=1), (shift[seen] ** 2).sum(axis=1)
    figures = (np.nan, np.nan, np.nan)
    if seen.sum() >= FEWEST_CONFIGURATIONS and turned.sum() > 0:
        weights = rng.dirichlet(np.ones(len(shown)), size=BOOTSTRAPS)
        low, high = interval((weights @ shown) / (weights @ turned), level)
        figures = (float(shown.sum() / turned.sum()), float(low), float(high))
    holds = bool(figures[1] >= 1 - TURN_TOLERANCE and figures[2] <= 1 + TURN_TOLERANCE)
    return Claim("share of an untold turn of the camera that shows", *figures, 1 - TURN_TOLERANCE, holds)


def format_claims(claims: Iterable[Claim]) -> str:
    """One line for each claim: verdict, name, figure, interval and bound."""
    claims = list(claims)
    width = max((len(claim.name) for claim in claims), default=0)
    return "\n".join(
        f"{'PASS' if claim.holds else 'FAIL'}  {claim.name:<{width}}  {claim.figure:+.3f}  "
        f"[{claim.low:+.3f}, {claim.high:+.3f}]  bound {claim.bound:+.3f}"
        + ("" if claim.least is None else f", of the figure {claim.least:+.3f}")
        for claim in claims
    )
