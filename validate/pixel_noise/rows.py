"""The rows of the pixel noise table, of its renders, and of the exponents."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pss.hints import Floats, Row
from validate.pixel_noise.design import COMBINATIONS, SERIES, Series
from validate.pixel_noise.estimates import Estimate, PoseSpread, bias, detection_rate, percentile_error, spread
from validate.pixel_noise.exponents import PowerLaw, joint_exponents, log_variance, series_exponent
from validate.pixel_noise.laboratory import Factors
from validate.pixel_noise.measure import Measured

__all__ = ["JOINT", "exponent_rows", "joint_law", "level_rows", "levels_of", "render_rows"]


# A render detected in fewer captures gives the scatter of a selected subset, not of all captures.
LEAST_FOUND = 0.5
JOINT = ("module_px", "blur_px", "cos_incidence", "edge_cnr")


@dataclass(frozen=True)
class Fit:
    """An exponent to be taken from a series, and the paper's R alone for it (nan: none)."""

    series: str
    factor: str
    paper: float = math.nan
    equation: str = ""
    smallest: float = 0.0


FITS = (
    Fit("module", "module_px", -1.0, "Eq. 11: D"),
    Fit("cc-10px", "cc_px", 1.0, "Eq. 15", smallest=1.0),
    Fit("cc-10px", "blur_px"),
    Fit("cc-25px", "cc_px", 1.0, "Eq. 15", smallest=1.0),
    Fit("cc-25px", "blur_px"),
    Fit("incidence", "cos_incidence", -0.5, "Eq. 11, corrected"),
    Fit("white", "white_e", 0.0, "not in R"),
    Fit("white", "edge_cnr", 0.0, "not in R"),
)


def levels_of(measured: Sequence[Measured], series: Series) -> list[tuple[Factors, list[Measured]]]:
    """What was measured at each level of a series, in its order."""
    mine = [item for item in measured if item.shot.series == series.name]
    found: dict[Factors, list[Measured]] = {}
    for item in mine:
        found.setdefault(item.shot.setup.factors, []).append(item)
    return list(found.items())


def _factor_columns(factors: Factors) -> Row:
    names = ("module_px", "cc_px", "blur_px", "incidence_deg", "white_e", "black_e", "white_snr", "edge_cnr")
    return {name: getattr(factors, name) for name in names}


def _rms_sigma(covariances: Floats) -> float:
    """px, one axis, from covariances (..., 2, 2); those that are nan do not count."""
    traces = np.trace(covariances, axis1=-2, axis2=-1) / 2
    known = traces[np.isfinite(traces)]
    return float(np.sqrt(known.mean())) if known.size else math.nan


def _interval(name: str, unit: str, estimate: Estimate) -> Row:
    return {
        f"{name}{unit}": estimate.value,
        f"{name}_low{unit}": estimate.low,
        f"{name}_high{unit}": estimate.high,
    }


def level_rows(measured: Sequence[Measured]) -> list[Row]:
    """A row for each level of each series: the table."""
    rows = []
    for series in SERIES:
        for factors, items in levels_of(measured, series):
            residuals = np.array([item.residuals_px for item in items])
            poses = PoseSpread.of(residuals)
            rows.append(
                {
                    "series": series.name,
                    **_factor_columns(factors),
                    "renders": len(items),
                    "captures": residuals.shape[0] * residuals.shape[1],
                    "found": int(poses.counts.sum()),
                    **_interval("detection_rate", "", detection_rate(residuals)),
                    **_interval("sigma", "_px", spread(poses)),
                    **_interval("bias", "_px", bias(poses)),
                    "error_p95_px": percentile_error(residuals),
                    "bound_sigma_px": _rms_sigma(np.array([item.bound_px2 for item in items])),
                    "physical_sigma_px": _rms_sigma(np.array([item.physical_px2 for item in items])),
                    "claimed_sigma_px": _rms_sigma(np.array([item.claimed_px2 for item in items])),
                    "render_noise_ratio": float(np.sqrt(np.mean([item.render_noise_ratio**2 for item in items]))),
                }
            )
    return rows


def render_rows(measured: Sequence[Measured]) -> list[Row]:
    """A row for each render, the random combinations with them."""
    rows = []
    for item in measured:
        setup, pose = item.shot.setup, item.shot.setup.pose
        poses = PoseSpread.of(item.residuals_px[None])
        x, y = poses.mean_px[0]
        rows.append(
            {
                "series": item.shot.series,
                **_factor_columns(setup.factors),
                "marker_id": pose.marker_id,
                "roll_deg": pose.roll_deg,
                "azimuth_deg": pose.azimuth_deg,
                "centre_x_px": setup.truth_px[0],
                "centre_y_px": setup.truth_px[1],
                "captures": len(item.residuals_px),
                "found": int(poses.counts[0]),
                "unexpected_ids": item.unexpected_ids,
                "mean_residual_x_px": x,
                "mean_residual_y_px": y,
                "sigma_px": math.sqrt(poses.variance_px2[0]),
                "bound_sigma_px": _rms_sigma(item.bound_px2),
                "physical_sigma_px": _rms_sigma(item.physical_px2),
                "claimed_sigma_px": _rms_sigma(item.claimed_px2),
            }
        )
    return rows


def _log_variances(items: Sequence[Measured]) -> Floats:
    """log σ² of each render, (N,); nan where too few captures show the marker."""
    logs = []
    for item in items:
        poses = PoseSpread.of(item.residuals_px[None])
        enough = poses.counts[0] >= max(2.0, LEAST_FOUND * len(item.residuals_px))
        logs.append(float(log_variance(poses.variance_px2, poses.freedom)[0]) if enough else math.nan)
    return np.array(logs)


def _predicted_logs(items: Sequence[Measured], which: str, known: NDArray[np.bool_]) -> Floats:
    """log σ² of a prediction for the same renders, (N,); nan where the measurement is."""
    with np.errstate(divide="ignore"):
        logs = np.array([2 * math.log(_rms_sigma(getattr(item, which))) for item in items])
    return np.where(known, logs, np.nan)


def _logs(items: Sequence[Measured], factor: str) -> Floats:
    with np.errstate(divide="ignore"):
        return np.log(np.array([getattr(item.shot.setup.factors, factor) for item in items], dtype=float))


def exponent_rows(measured: Sequence[Measured], law: PowerLaw) -> list[Row]:
    """A row for each exponent of σ: of the series one by one, and of the combinations together."""
    rows = []
    for fit in FITS:
        items = [
            item
            for item in measured
            if item.shot.series == fit.series and getattr(item.shot.setup.factors, fit.factor) >= fit.smallest
        ]
        poses = np.array([item.shot.setup.pose.marker_id for item in items])
        logs, found = _logs(items, fit.factor), _log_variances(items)
        known = np.isfinite(found)
        predicted = [
            series_exponent(_predicted_logs(items, which, known), logs, poses).value
            for which in ("bound_px2", "physical_px2")
        ]
        rows.append(_exponent(fit, items, known, series_exponent(found, logs, poses), predicted))
    items = [item for item in measured if item.shot.series == COMBINATIONS]
    known = np.isfinite(_log_variances(items))
    laws = [joint_law(items, which) for which in ("bound_px2", "physical_px2")]
    for number, factor in enumerate(JOINT):
        predicted = [other.exponents[number].value for other in laws]
        rows.append(_exponent(Fit(COMBINATIONS, factor), items, known, law.exponents[number], predicted))
    return rows


def _exponent(
    fit: Fit, items: Sequence[Measured], known: NDArray[np.bool_], found: Estimate, predicted: Sequence[float]
) -> Row:
    values = np.array([getattr(item.shot.setup.factors, fit.factor) for item in items], dtype=float)
    used = values[known]
    return {
        "set": fit.series,
        "factor": fit.factor,
        "from": float(used.min()) if used.size else math.nan,
        "to": float(used.max()) if used.size else math.nan,
        "renders": len(used),
        **_interval("exponent", "", found),
        "bound_exponent": predicted[0],
        "physical_exponent": predicted[1],
        "paper_exponent": fit.paper,
        "paper": fit.equation,
    }


def joint_law(measured: Sequence[Measured], which: str = "measured", seed: int = 0) -> PowerLaw:
    """σ against all factors of `JOINT` over the random combinations; or a prediction for the same renders."""
    items = [item for item in measured if item.shot.series == COMBINATIONS]
    found = _log_variances(items)
    if which != "measured":
        found = _predicted_logs(items, which, np.isfinite(found))
    logs = np.array([_logs(items, factor) for factor in JOINT]).T
    return joint_exponents(found, logs, np.random.default_rng(seed))
