"""Each noise model against the errors at three levels, pixel, single frame and filter, and what was seen and found."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pss import NoiseModel
from pss.cameras.views import Views
from pss.hints import Floats, Row
from validate.acquire.acquire import Acquired
from validate.bank.design import ViewBank
from validate.bank.filtered import Filtered
from validate.bank.judge import appearance_of
from validate.bank.leaderboard import CountVerdict
from validate.bank.measured import BankData, residual_moments
from validate.bank.process_noise import information_of, steady_covariances
from validate.prediction.contenders import Contender
from validate.stats.consistency import anisotropy, of_errors, of_moments, pooled_spearman, root_trace_of, sandwich
from validate.stats.ranking import Resamples, with_interval

__all__ = ["blunder_row", "consistency_rows", "pixel_rows"]


def pixel_rows(bank: ViewBank, data: BankData, acquired: Acquired, models: Sequence[NoiseModel]) -> list[Row]:
    """Each model's R, and each detection's own covariance, against the pixel errors of all views."""
    state = bank.scene.state
    residuals = data.residuals()
    views = Views(list(bank.cameras), state.points_m, state.normals, appearance_of(bank.scene, acquired))
    names = [camera.name for camera in bank.cameras]
    chance = Resamples.of_configurations(np.arange(len(names))[:, None], len(state.points_m), names)
    trials = np.isfinite(residuals[..., 0]).sum(axis=1)
    rows = []
    for model in models:
        covariance = np.broadcast_to(
            model.of_views(views).matrix(len(bank.cameras), len(state.points_m)), (*trials.shape, 2, 2)
        )
        rows.append(_pixel_row(model.name, residuals, covariance, trials, chance))
    seen = np.isfinite(residuals[..., :1, None])
    total = np.where(seen, data.covariance, 0.0).sum(axis=1)
    own = np.where(trials[..., None, None] > 0, total / np.maximum(trials, 1)[..., None, None], np.nan)
    rows.append(_pixel_row("detection's own", residuals, own, trials, chance))
    return rows


def _pixel_row(name: str, residuals: Floats, covariance: Floats, trials: NDArray[np.int64], chance: Resamples) -> Row:
    covariance = np.where(np.isfinite(covariance), covariance, np.nan)
    found = of_errors(residuals, covariance)
    enough = np.isfinite(found.log_ratio) & (trials >= 10)
    # The logarithm of a variance over n trials of two axes has the variance 2/(2n): that of its root a quarter of it.
    sampling = float(np.mean(1 / (4 * trials[enough]))) if enough.any() else float("nan")
    scatter = float(np.var(found.log_ratio[enough])) if enough.any() else float("nan")
    return {
        "level": "pixel",
        "cameras": 1,
        "noise_model": name,
        **found.row(chance),
        "log_scatter": float(np.sqrt(max(scatter - sampling, 0.0))),
    }


def consistency_rows(
    verdict: CountVerdict,
    bank: ViewBank,
    data: BankData,
    contenders: Sequence[Contender],
    acquired: Acquired,
    filtered: Filtered | None = None,
) -> list[Row]:
    """Single frame, and the filter where it was run, of each contender over the configurations of one camera count.

    The filter is a linearised simulation driven by rendered residuals, at the headline's process noise: with much more
    of it P⁻ is the step, and NEES is 1 whatever R is.
    """
    q = None if filtered is None else float(filtered.process.Q[0, 0])
    chance = verdict.chance
    errors = np.array([found.errors.errors_m for found in verdict.measured])
    moment = np.array([found.errors.second_moment_m2 for found in verdict.measured])
    trials = np.array([found.errors.detections for found in verdict.measured])
    rms = np.array([found.errors.rms_m for found in verdict.measured])
    rows = []
    for contender in contenders:
        of_model = [found[contender.name] for found in verdict.predicted]
        covariance = np.array([found.covariance_m2 for found in of_model])
        ratio = _sandwich_medians(verdict, bank, data, contender, acquired, q)
        rows.append(
            {
                "level": "single frame",
                "cameras": verdict.cameras,
                "noise_model": contender.name,
                **of_errors(errors, covariance).row(chance),
                **with_interval("point_spearman", pooled_spearman(root_trace_of(covariance), rms, chance)),
                **anisotropy(moment, covariance, trials),
                "sandwich_over_claimed_median": ratio[0],
            }
        )
        if filtered is not None:
            rows += _filter_rows(verdict, contender.name, filtered, ratio[1], chance)
    return rows


def _filter_rows(verdict: CountVerdict, name: str, filtered: Filtered, ratio: float, chance: Resamples) -> list[Row]:
    """P⁻ and P⁺ against the filter's second moments, which are solved for, and against simulated errors."""
    rows = []
    information = information_of([found[name] for found in verdict.predicted])
    for kind, covariance in zip(
        ("prior", "posterior"), steady_covariances(*information, filtered.process), strict=True
    ):
        moments, errors = (getattr(filtered, f"{kind}_{what}") for what in ("moment_m2", "errors_m"))
        found = of_moments(moments, covariance)
        known = found[np.isfinite(found)]
        rows.append(
            {
                "level": f"filter, {kind}",
                "cameras": verdict.cameras,
                "noise_model": name,
                **of_errors(errors, covariance).row(chance),
                "predicted_over_measured_rms_median": float(np.median(known)),
                "median_abs_log_ratio": float(np.median(np.abs(np.log(known)))),
                "median_log_ratio": float(np.median(np.log(known))),
                "sandwich_over_claimed_median": ratio,
            }
        )
    return rows


def _sandwich_medians(
    verdict: CountVerdict, bank: ViewBank, data: BankData, contender: Contender, acquired: Acquired, q: float | None
) -> tuple[float, float]:
    """Median over configurations and points of actual over claimed √tr, weighted by the claimed R: frame and filter.

    The filter is that of a random walk of variance `q` m² a frame; without one it is of the scene's own process.
    """
    state = bank.scene.state
    true = residual_moments(data.residuals())
    views = Views(list(bank.cameras), state.points_m, state.normals, appearance_of(bank.scene, acquired))
    with np.errstate(divide="ignore", invalid="ignore"):
        claimed = np.broadcast_to(contender.noise.of_views(views).matrix(*true.shape[:2]), true.shape)
    jacobians = np.array([camera.jacobian(state.points_m) for camera in bank.cameras])
    found = []
    q = float(data.process.Q[0, 0]) if q is None else q
    for chosen, predicted in zip(verdict.configurations, verdict.predicted, strict=True):
        seen = predicted[contender.name].visible & np.isfinite(true[chosen]).all(axis=(-2, -1))
        seen &= np.isfinite(claimed[chosen]).all(axis=(-2, -1))
        cell = seen[..., None, None]
        found.append(
            sandwich(
                np.where(cell, jacobians[chosen], 0.0),
                np.where(cell, claimed[chosen], np.eye(2)),
                np.where(cell, true[chosen], np.eye(2)),
                q,
            )
        )
    ratio = np.array(found)
    return float(np.nanmedian(ratio[:, 0])), float(np.nanmedian(ratio[:, 1]))


def blunder_row(verdict: CountVerdict) -> Row:
    """Detections that triangulation threw out by their reprojection χ², which needs no truth, and those it kept."""
    rejected = sum(found.rejected for found in verdict.measured)
    kept = sum(found.kept for found in verdict.measured)
    return {
        "cameras": verdict.cameras,
        "detections_kept": kept,
        "detections_rejected": rejected,
        "rejected_share": rejected / max(kept + rejected, 1),
    }
