"""The paper's claims about Figure 4, tested on a schedule: yes or no, with numbers, predicted and measured.

A claim about an increase holds if the lower end of its interval does. Intervals are of the markers and the trials; the
walk and the steps are as they are.

PSS is a share of markers times the mean of 1/σ of those that count. So beside each figure stands the same figure of the
share alone (`of_counts`), and what is left of it per marker that counts (`per_marker`): a ratio is the product of the
two, and where the second is 1 a claim about PSS is one about counts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pss.hints import Floats, Row
from validate.schedule.own_cameras import OwnCameras
from validate.schedule.results import Curves, ScheduleResult
from validate.schedule.runs import limit_name
from validate.stats.intervals import interval, sample_interval

__all__ = ["claim_rows"]

Figure = Callable[[Floats], Floats]
Estimate = tuple[float, Floats]

FOLLOW, FARTHER, CLOSER = "follow", "swap-to-farther", "swap-to-closer"
# Of PSS: less than this from the other avatar's cameras is no spike; and it must stand out from the other steps.
LEAST_SPIKE, ABOVE_OTHERS = 0.1, 2.0
# Columns of a figure's two factors.
BESIDE = tuple(f"{name}{end}" for name in ("of_counts", "per_marker") for end in ("", "_ci_low", "_ci_high"))


def claim_rows(result: ScheduleResult, own: OwnCameras | None) -> list[Row]:
    """A row for each claim, side and kind; none for a claim whose strategies were not run.

    Args:
        result: of both avatars.
        own: PSS of `follow` from the cameras that are assigned to each avatar alone; None if it was not run.
    """
    sides = [_Side(curves, result.counts[key]) for key, curves in result.curves.items()]
    rows = [row for side in sides for row in _of_curves(result, side)]
    if own is not None:
        alone = [_Side(own.curves(key), own.counts(key)) for key in result.curves]
        rows += [_spike(result, of_own, side) for of_own, side in zip(alone, sides, strict=True)]
        for of_own in alone:
            rows += _hump(result, of_own, 0, ", each avatar's own cameras alone")
    order = {claim: number for number, claim in enumerate(dict.fromkeys(str(row["claim"]) for row in rows))}
    return sorted(rows, key=lambda row: order[str(row["claim"])])


@dataclass(frozen=True, eq=False)
class _Side:
    """PSS as predicted or measured, and the share of markers in it."""

    curves: Curves
    counts: Curves

    def figures(self, figure: Figure) -> tuple[Estimate, Estimate]:
        """A figure of PSS and of the share alone, each with its resamples."""
        return _of(self.curves, figure), _of(self.counts, figure)


def _of(curves: Curves, figure: Figure) -> Estimate:
    with np.errstate(divide="ignore", invalid="ignore"):  # no marker is seen at one end: infinitely better
        return float(figure(curves.values)), np.asarray(figure(curves.samples))


def _of_curves(result: ScheduleResult, side: _Side) -> Iterator[Row]:
    curves = side.curves
    runs = {(run.strategy, run.zoom_limit): number for number, run in enumerate(result.held.design.runs)}
    limits = list(dict.fromkeys(limit for _, limit in runs))
    for limit in limits:
        closer, farther = runs.get((CLOSER, limit)), runs.get((FARTHER, limit))
        if closer is not None and farther is not None:
            yield _row(
                "swapping to the closer avatar (2b) is better on average than to the farther (2a)",
                side,
                "mean PSS over the steps, (2b) / (2a)",
                _ratio_of_means(closer, farther, np.ones(result.shape[1], dtype=bool)),
                f"zoom limit {limit_name(limit)}",
            )
    if (FOLLOW, None) not in runs:
        return
    free = runs[FOLLOW, None]
    zooms = np.array([[camera.zoom for camera in cameras] for cameras in result.held.design.runs[free].steered.cameras])
    for limit in (limit for limit in limits if limit is not None and (FOLLOW, limit) in runs):
        held_back = (zooms > limit).any(axis=1)
        text = "the zoom limit lowers PSS at a distance, strategy (1)"
        if not held_back.any():
            yield _nothing(
                text, curves, f"x{limit:g} is never reached: no target asks for more than x{zooms.max():.2g}"
            )
            continue
        yield _row(
            text,
            side,
            "mean PSS over the steps where it binds, without / with the limit",
            _ratio_of_means(free, runs[FOLLOW, limit], held_back),
            f"x{limit:g}, {held_back.sum()} steps",
        )
    yield from _hump(result, side, free)


def _ratio_of_means(one: int, other: int, steps: NDArray[np.bool_]) -> Figure:
    """Of the means of two runs over some steps."""
    return lambda values: values[..., one, steps].mean(axis=-1) / values[..., other, steps].mean(axis=-1)


def _hump(result: ScheduleResult, side: _Side, run: int, of: str = "") -> Iterator[Row]:
    """With strategy (1) PSS first rises, then falls."""
    best = int(side.curves.values[run].argmax())
    y = result.configurations[best].value  # the same walk in every run
    for text, end in (("PSS first rises, strategy (1)", 0), ("PSS then falls, strategy (1)", -1)):
        yield _row(
            text + of,
            side,
            "PSS at its highest / at that end",
            lambda values, end=end: values[..., run, best] / values[..., run, end],
            f"highest at y = {_place(y)}",
        )


def _spike(result: ScheduleResult, own: _Side, side: _Side) -> Row:
    """Where the other avatar's cameras see an avatar, too, PSS has a spike."""
    runs = [(run.strategy, run.zoom_limit) for run in result.held.design.runs]
    run = runs.index((FOLLOW, None))
    curves = side.curves
    share = 1 - own.curves.values[0] / curves.values[run]
    samples = 1 - own.curves.samples[:, 0] / curves.samples[:, run]
    at = int(share.argmax())
    low, high = interval(samples[:, at])
    low, high = min(low, share[at]), max(high, share[at])
    stands_out = share[at] > ABOVE_OTHERS * np.median(share)
    y = result.configurations[run * len(share) + at].value
    of_counts = 1 - own.counts.values[0, at] / side.counts.values[run, at]
    return {
        **_head("a spike where an avatar enters the view of cameras that are not assigned to it, strategy (1)", curves),
        "holds": "yes" if low > LEAST_SPIKE and stands_out else "no",
        "statistic": f"largest share of PSS from those cameras (median over the steps: {np.median(share):.2g})",
        "value": float(share[at]),
        "ci_low": float(low),
        "ci_high": float(high),
        "where": f"y = {_place(y)}",
        **dict.fromkeys(BESIDE, np.nan),
        "of_counts": float(of_counts),
        "per_marker": float(1 - (1 - share[at]) / (1 - of_counts)) if of_counts < 1 else np.nan,
    }


def _place(y_m: float | str) -> str:
    """Metres along the hallway; a step that is meant to be the middle may come out a rounding beside it."""
    return f"{round(float(y_m), 6) + 0.0:.2g} m"


def _head(claim: str, curves: Curves) -> Row:
    return {"claim": claim, "side": curves.side, "noise_model": curves.noise_model, "kind": curves.kind}


def _row(claim: str, side: _Side, figure: str, of: Figure, at: str) -> Row:
    (ratio, ratios), (count, counts) = side.figures(of)
    low, high = _ends(ratio, ratios)
    with np.errstate(divide="ignore", invalid="ignore"):
        left, lefts = float(np.divide(ratio, count)), ratios / counts
    return {
        **_head(claim, side.curves),
        "holds": "yes" if low > 1 else "no",
        "statistic": figure,
        "value": ratio,
        "ci_low": low,
        "ci_high": high,
        "where": at,
        **_beside("of_counts", count, counts),
        **_beside("per_marker", left, lefts),
    }


def _beside(name: str, value: float, samples: Floats) -> Row:
    low, high = _ends(value, samples)
    return {name: value, f"{name}_ci_low": low, f"{name}_ci_high": high}


def _ends(value: float, samples: Floats) -> tuple[float, float]:
    """The percentile interval, which is made to hold its estimate: nan if that is, or most of the resamples are."""
    known = samples[~np.isnan(samples)]
    if np.isnan(value) or 2 * len(known) < len(samples):
        return np.nan, np.nan
    low, high = sample_interval(known)
    return min(float(low), value), max(float(high), value)


def _nothing(claim: str, curves: Curves, why: str) -> Row:
    return {**_head(claim, curves), "holds": "not asked", "statistic": why, "value": np.nan, "ci_low": np.nan,
            "ci_high": np.nan, "where": "", **dict.fromkeys(BESIDE, np.nan)}  # fmt: skip
