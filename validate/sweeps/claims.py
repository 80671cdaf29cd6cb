"""The paper's claims about its Figures 1 to 3, tested on a sweep: yes or no, with numbers, predicted and measured.

A claim about an increase holds if the lower end of its interval does; an "of a sweep" claim that a sweep cannot answer
is left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pss.hints import Floats, Row
from validate.stats.intervals import interval, weighted_spearman
from validate.stats.optimum import optimum
from validate.sweeps.derived import derived
from validate.sweeps.sweep import SweepResult

__all__ = ["claim_rows"]


# A worst case that moves less than this from one step to the next, while PSS moves more, is flat there.
FLAT = 0.01


@dataclass(frozen=True, eq=False)
class Curve:
    """PSS or a worst case over the steps, with resamples (B, S)."""

    side: str
    noise_model: str
    values: Floats
    samples: Floats


@derived
def claim_rows(result: SweepResult) -> list[Row]:
    """A row for each claim and each side: the prediction by each noise model, and the measurement.

    None for a sweep that is of none of the paper's figures, or of one step.
    """
    if len(result.assessments) < 2 or result.plan.sweep.paper_figure(result.plan.scene) is None:
        return []
    return [
        {"sweep": result.plan.sweep.name, **row}
        for row in (_angle_rows(result) if _is_pairs(result) else _hump_rows(result))
    ] + [{"sweep": result.plan.sweep.name, **row} for row in _flat_rows(result)]


def _is_pairs(result: SweepResult) -> bool:
    return all(c.parameter == "selection" and len(c.cameras) == 2 for c in result.configurations)


def _curves(result: SweepResult) -> Iterator[Curve]:
    for model in result.noise_models:
        yield Curve("predicted", model, result.predicted_pss(model), result.replicates[model].predicted_pss)
    first = result.replicates[result.noise_models[0]]
    yield Curve("measured", "", result.measured_pss(), first.measured_pss)


def _hump_rows(result: SweepResult) -> Iterator[Row]:
    """Figures 1 and 2: PSS first rises, then falls."""
    if result.configurations[0].parameter == "selection" or len(result.configurations) < 3:
        return
    for curve in _curves(result):
        best = optimum(curve.values)
        if best is None:  # PSS of 0 everywhere neither rises nor falls
            continue
        inside = 0 < best < len(curve.values) - 1
        for text, end in (("PSS rises from the first value", 0), ("PSS falls to the last value", -1)):
            with np.errstate(divide="ignore", invalid="ignore"):
                ratio = curve.values[best] / curve.values[end]
                low, high = interval(curve.samples[:, best] / curve.samples[:, end])
            yield _row(text, curve, inside and bool(low > 1), "PSS at optimum / at that end", ratio, low, high) | {
                "where": result.configurations[best].value
            }


def _angle_rows(result: SweepResult) -> Iterator[Row]:
    """Figure 3: PSS rises with the angle between the viewing directions of the two cameras."""
    forward = [[camera.rotation[2] for camera in c.cameras] for c in result.configurations]
    angle = np.degrees([np.arccos(np.clip(a @ b, -1, 1)) for a, b in forward])
    for curve in _curves(result):
        best = optimum(curve.values)
        if best is None:
            continue
        rho = float(weighted_spearman(angle, curve.values))
        low, high = interval(np.asarray(weighted_spearman(np.broadcast_to(angle, curve.samples.shape), curve.samples)))
        yield _row(
            "PSS rises with the angle between the cameras", curve, bool(low > 0), "Spearman's ρ", rho, low, high
        ) | {"where": f"{angle[best]:.0f} deg"}


def _flat_rows(result: SweepResult) -> Iterator[Row]:
    """Section 3.3: the ∞-norm has flat regions. Over observable (measured: detected) points.

    No interval: the measured worst point scatters by more than a flat step, so resamples would only break its ties.
    """
    pss = {curve.noise_model or curve.side: curve for curve in _curves(result)}
    for model in result.noise_models:
        sigma = [assessment.predicted[model].single_frame_sigma_m for assessment in result.assessments]
        worst = np.array([np.nanmax(s) if np.isfinite(s).any() else np.nan for s in sigma])
        yield from _flat_row(Curve("predicted", model, worst, worst[None]), pss[model])
    rms = [assessment.measured.errors.rms_m for assessment in result.assessments]
    worst = np.array([np.nanmax(r) if np.isfinite(r).any() else np.nan for r in rms])
    yield from _flat_row(Curve("measured", "", worst, worst[None]), pss["measured"])


def _flat_row(worst: Curve, pss: Curve) -> Iterator[Row]:
    if len(worst.values) < 2 or not np.isfinite(worst.values).all():
        return
    with np.errstate(divide="ignore", invalid="ignore"):
        moves = np.abs(np.diff(np.log(pss.values))) > FLAT
        flat = np.abs(np.diff(np.log(worst.values))) < FLAT
    share = float((flat & moves).mean())
    yield _row(
        "the ∞-norm has flat regions where PSS has none",
        worst,
        share > 0,
        f"share of steps that move the worst point < {FLAT:.0%}, PSS more",
        share,
        np.nan,
        np.nan,
    ) | {"where": ""}


def _row(text: str, curve: Curve, holds: bool, what: str, figure: float, low: object, high: object) -> Row:
    return {
        "claim": text,
        "side": curve.side,
        "noise_model": curve.noise_model,
        "holds": "yes" if holds else "no",
        "statistic": what,
        "value": float(figure),
        "ci_low": float(np.asarray(low)),
        "ci_high": float(np.asarray(high)),
    }
