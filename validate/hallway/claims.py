"""What the paper says of Figure 4, asked of a schedule: yes or no, with numbers, predicted and measured.

A claim about an increase holds if the lower end of its interval does. Intervals are of the markers and the trials; the
walk and the steps are as they are.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from validate.hallway.own_cameras import OwnCameras
from validate.hallway.results import Curves, ScheduleResult
from validate.hallway.runs import limit_name
from validate.intervals import interval, sample_interval

__all__ = ["claim_rows"]

Floats = NDArray[np.float64]
Row = dict[str, object]

FOLLOW, FARTHER, CLOSER = "follow", "swap-to-farther", "swap-to-closer"
# Of PSS: less than this from the other avatar's cameras is no spike; and it must stand out from the other steps.
LEAST_SPIKE, ABOVE_OTHERS = 0.1, 2.0


def claim_rows(result: ScheduleResult, own: OwnCameras | None) -> list[Row]:
    """A row for each claim, side and kind; none for a claim whose strategies were not run.

    Args:
        result: of both avatars.
        own: PSS of `follow` from the cameras that are assigned to each avatar alone; None if it was not run.
    """
    rows = [row for curves in result.curves.values() for row in _of_curves(result, curves)]
    if own is not None:
        rows += [_spike(result, own.curves(key), curves) for key, curves in result.curves.items()]
        for key in result.curves:
            rows += _hump(result, own.curves(key), 0, ", each avatar's own cameras alone")
    order = {claim: number for number, claim in enumerate(dict.fromkeys(str(row["claim"]) for row in rows))}
    return sorted(rows, key=lambda row: order[str(row["claim"])])


def _of_curves(result: ScheduleResult, curves: Curves) -> Iterator[Row]:
    runs = {(run.strategy, run.zoom_limit): number for number, run in enumerate(result.held.design.runs)}
    limits = list(dict.fromkeys(limit for _, limit in runs))
    for limit in limits:
        closer, farther = runs.get((CLOSER, limit)), runs.get((FARTHER, limit))
        if closer is not None and farther is not None:
            yield _row(
                "swapping to the closer avatar (2b) is better on average than to the farther (2a)",
                curves,
                "mean PSS over the steps, (2b) / (2a)",
                curves.values[closer].mean() / curves.values[farther].mean(),
                curves.samples[:, closer].mean(axis=-1) / curves.samples[:, farther].mean(axis=-1),
                f"zoom limit {limit_name(limit)}",
            )
    if (FOLLOW, None) not in runs:
        return
    free = runs[FOLLOW, None]
    zooms = np.array([[camera.zoom for camera in cameras] for cameras in result.held.design.runs[free].steered.cameras])
    for limit in (limit for limit in limits if limit is not None and (FOLLOW, limit) in runs):
        held_back = (zooms > limit).any(axis=1)
        number = runs[FOLLOW, limit]
        text = "the zoom limit lowers PSS at a distance, strategy (1)"
        if not held_back.any():
            yield _nothing(
                text, curves, f"x{limit:g} is never reached: no target asks for more than x{zooms.max():.2g}"
            )
            continue
        yield _row(
            text,
            curves,
            "mean PSS over the steps where it binds, without / with the limit",
            curves.values[free, held_back].mean() / curves.values[number, held_back].mean(),
            curves.samples[:, free, held_back].mean(axis=-1) / curves.samples[:, number, held_back].mean(axis=-1),
            f"x{limit:g}, {held_back.sum()} steps",
        )
    yield from _hump(result, curves, free)


def _hump(result: ScheduleResult, curves: Curves, run: int, of: str = "") -> Iterator[Row]:
    """With strategy (1) PSS first rises, then falls."""
    values, samples = curves.values[run], curves.samples[:, run]
    best = int(values.argmax())
    y = result.configurations[best].value  # the same walk in every run
    for text, end in (("PSS first rises, strategy (1)", 0), ("PSS then falls, strategy (1)", -1)):
        with np.errstate(divide="ignore", invalid="ignore"):  # nobody is seen at that end: infinitely better
            ratio, ratios = values[best] / values[end], samples[:, best] / samples[:, end]
        yield _row(text + of, curves, "PSS at its highest / at that end", ratio, ratios, f"highest at y = {_place(y)}")


def _spike(result: ScheduleResult, own: Curves, curves: Curves) -> Row:
    """Where the other avatar's cameras see an avatar, too, PSS has a spike."""
    runs = [(run.strategy, run.zoom_limit) for run in result.held.design.runs]
    run = runs.index((FOLLOW, None))
    share = 1 - own.values[0] / curves.values[run]
    samples = 1 - own.samples[:, 0] / curves.samples[:, run]
    at = int(share.argmax())
    low, high = interval(samples[:, at])
    stands_out = share[at] > ABOVE_OTHERS * np.median(share)
    y = result.configurations[run * len(share) + at].value
    return {
        **_head("a spike where an avatar enters the view of cameras that are not assigned to it, strategy (1)", curves),
        "holds": "yes" if low > LEAST_SPIKE and stands_out else "no",
        "figure": f"largest share of PSS from those cameras (median over the steps: {np.median(share):.2g})",
        "value": float(share[at]),
        "ci_low": float(low),
        "ci_high": float(high),
        "at": f"y = {_place(y)}",
    }


def _place(y_m: float | str) -> str:
    """Metres along the hallway; a step that is meant to be the middle may come out a rounding beside it."""
    return f"{round(float(y_m), 6) + 0.0:.2g} m"


def _head(claim: str, curves: Curves) -> Row:
    return {"claim": claim, "side": curves.side, "noise_model": curves.noise_model, "kind": curves.kind}


def _row(claim: str, curves: Curves, figure: str, ratio: float, samples: Floats, at: str) -> Row:
    low, high = sample_interval(samples)
    return {
        **_head(claim, curves),
        "holds": "yes" if low > 1 else "no",
        "figure": figure,
        "value": float(ratio),
        "ci_low": float(low),
        "ci_high": float(high),
        "at": at,
    }


def _nothing(claim: str, curves: Curves, why: str) -> Row:
    return {**_head(claim, curves), "holds": "not asked", "figure": why, "value": np.nan, "ci_low": np.nan,
            "ci_high": np.nan, "at": ""}  # fmt: skip
