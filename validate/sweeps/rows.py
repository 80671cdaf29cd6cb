"""The rows of a run's CSV files: one function a file, and the writer."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import asdict

import numpy as np
from numpy.typing import NDArray

from pss.hints import Floats, Row
from render.certificate import Certificate
from scenes import Configuration
from validate.acquire.acquire import Acquired, Acquisition
from validate.markers.darkness import markers_too_dark
from validate.stats.intervals import interval
from validate.sweeps.assessment import Assessment
from validate.sweeps.departures import error_budgets, nees
from validate.sweeps.derived import derived
from validate.sweeps.sweep import SweepResult

__all__ = [
    "THRESHOLDS_MM",
    "configuration_rows",
    "detection_rows",
    "point_rows",
    "pooled",
    "timing_rows",
    "view_rows",
]


THIS_RUN, ANOTHER_RUN = "this run", "another run"
THRESHOLDS_MM = (1, 2, 5, 10)


def pooled(rms: Floats, points: NDArray[np.bool_]) -> float:
    """Root mean square of (N,) RMS over some of the points; nan over none."""
    chosen = rms[points & np.isfinite(rms)]
    return float(np.sqrt((chosen**2).mean())) if len(chosen) else math.nan


def common_points(result: SweepResult) -> NDArray[np.bool_]:
    """(N,), the points that every configuration measured: RMS values are comparable between steps on these only."""
    measured = [assessment.measured.errors.detections > 0 for assessment in result.assessments]
    return np.all(measured, axis=0)


@derived
def configuration_rows(result: SweepResult) -> list[Row]:
    """A row for each configuration and noise model."""
    common = common_points(result)
    everywhere = np.ones_like(common)
    rows: list[Row] = []
    for model in result.noise_models:
        replicates, budgets = result.replicates[model], error_budgets(result, model)
        pss_low, pss_high = interval(replicates.measured_pss)
        rms_low, rms_high = interval(replicates.rms_m)
        for step, (configuration, assessment) in enumerate(zip(result.configurations, result.assessments, strict=True)):
            predicted, measured = assessment.predicted[model], assessment.measured
            errors = measured.errors
            rows.append(
                {
                    "sweep": result.plan.sweep.name,
                    "configuration": configuration.label,
                    "parameter": configuration.parameter,
                    "value": configuration.value,
                    "cameras": len(configuration.cameras),
                    "camera_names": " ".join(camera.name for camera in configuration.cameras),
                    "noise_model": model,
                    "points": len(errors.rms_m),
                    "observable": int(predicted.observable.sum()),
                    "detected": int((errors.detections > 0).sum()),
                    "pss": predicted.pss,
                    "measured_pss_filter": measured.pss_filter,
                    "pss_single_frame": predicted.pss_single_frame,
                    "measured_pss_single_frame": errors.pss(),
                    "measured_pss_ci_low": pss_low[step],
                    "measured_pss_ci_high": pss_high[step],
                    "sigma_inf_rms_m": pooled(predicted.sigma_m, everywhere),
                    "predicted_rms_m": pooled(predicted.single_frame_rms_m, everywhere),
                    "measured_rms_m": errors.pooled_rms_m,
                    "measured_rms_ci_low_m": rms_low[step],
                    "measured_rms_ci_high_m": rms_high[step],
                    "measured_rms_opencv_m": measured.linear.pooled_rms_m,
                    "measured_bias_rms_m": pooled(errors.bias_m, everywhere),
                    "measured_std_rms_m": pooled(errors.std_m, everywhere),
                    "predicted_prior_rms_m": pooled(predicted.rms_m, everywhere),
                    "predicted_posterior_rms_m": pooled(predicted.posterior_rms_m, everywhere),
                    "measured_prior_rms_m": pooled(measured.prior_rms_m, everywhere),
                    "measured_posterior_rms_m": pooled(measured.posterior_rms_m, everywhere),
                    "common_points": int(common.sum()),
                    "predicted_rms_common_m": pooled(predicted.single_frame_rms_m, common),
                    "measured_rms_common_m": pooled(errors.rms_m, common),
                    "median_rms_m": errors.median_rms_m,
                    **{f"share_under_{mm}mm": errors.share_under(mm / 1000) for mm in THRESHOLDS_MM},
                    "noise_share": errors.noise_share,
                    **{f"budget_{name}": factor for name, factor in asdict(budgets[step]).items()},
                    "rejected_detections": int(measured.triangulated.rejected.sum()),
                    **(result.own_scores[model][step].columns if result.own_scores else {}),
                }
            )
    return rows


@derived
def point_rows(result: SweepResult) -> list[Row]:
    """A row for each point of each configuration and noise model."""
    rows: list[Row] = []
    for model in result.noise_models:
        steps = zip(result.configurations, result.assessments, nees(result, model), strict=True)
        for configuration, assessment, of_points in steps:
            for point in _points(configuration, assessment, model, of_points):
                rows.append({"sweep": result.plan.sweep.name, "configuration": configuration.label, **point})
    return rows


def _points(configuration: Configuration, assessment: Assessment, model: str, of_points: Floats) -> Iterable[Row]:
    predicted, measured = assessment.predicted[model], assessment.measured
    errors = measured.errors
    columns = {
        "views": predicted.visible.sum(axis=0),
        "detection_rate": errors.detection_rate,
        "sigma_inf_m": predicted.sigma_m,
        "single_frame_sigma_m": predicted.single_frame_sigma_m,
        "single_frame_rms_m": predicted.single_frame_rms_m,
        "measured_sigma_m": errors.sigma_m,
        "measured_rms_m": errors.rms_m,
        "measured_bias_m": errors.bias_m,
        "measured_std_m": errors.std_m,
        "measured_filter_sigma_m": measured.filter_sigma_m,
        "measured_prior_rms_m": measured.prior_rms_m,
        "measured_posterior_rms_m": measured.posterior_rms_m,
        "nees": of_points,
        "nees_detections": measured.own_nees,
    }
    for number, marker in enumerate(configuration.scene.state.markers):
        x, y, z = marker.centre_m
        yield {
            "noise_model": model,
            "point": marker.id,
            "object": marker.object_name,
            "x_m": x,
            "y_m": y,
            "z_m": z,
            **{name: column[number] for name, column in columns.items()},
        }


def view_rows(results: Sequence[SweepResult], acquired: Acquired) -> list[Row]:
    """A row for each view that any configuration used."""
    rows: dict[str, Row] = {}
    for result in results:
        for configuration, assessment, requested in zip(
            result.configurations, result.assessments, result.views, strict=True
        ):
            visible = next(iter(assessment.predicted.values())).visible
            for camera, seen, item in zip(configuration.cameras, visible, requested, strict=True):
                key = item.request.key
                if key not in rows:
                    rows[key] = {
                        "view": key,
                        "camera": camera.name,
                        "pan_deg": camera.pan_deg,
                        "tilt_deg": camera.tilt_deg,
                        "zoom": camera.zoom,
                        "focus_distance_m": camera.focus_distance_m,
                        "f_number": camera.f_number,
                        "markers_visible": int(seen.sum()),
                        "markers_detected": float(acquired.measured[item].detected.sum(axis=1).mean()),
                        "unexpected_ids": acquired.measured[item].unexpected_ids,
                        **_certificate(acquired.certificates[key]),
                        "exr": f"views/{key}.exr",
                    }
    return list(rows.values())


def _certificate(certificate: Certificate) -> Row:
    return {
        "render_noise_ratio": certificate.edge_rms,
        "render_noise_ratio_median": certificate.edge_median,
        "render_noise_ratio_p999": certificate.edge_p999,
        "render_noise_ratio_image": certificate.image_rms,
        "samples": certificate.samples,
        "saturated_share": certificate.saturated_share,
    }


def timing_rows(requested: Iterable[Acquisition], acquired: Acquired) -> list[Row]:
    """Seconds that each view took, whichever run made it; nan where the store does not have that of another run's."""
    rows: dict[str, Row] = {}
    for item in requested:
        if item in acquired.measured:
            key = item.request.key
            seconds = acquired.render_seconds.get(key, acquired.stored_seconds.get(key, math.nan))
            rows[key] = {
                "view": key,
                "render_seconds": seconds,
                "detect_seconds": acquired.measured[item].seconds,
                "rendered_in": THIS_RUN if key in acquired.render_seconds else ANOTHER_RUN,
                "measured_in": THIS_RUN if item in acquired.measured_items else ANOTHER_RUN,
            }
    return list(rows.values())


def detection_rows(results: Sequence[SweepResult]) -> list[Row]:
    """Predicted visible against detected (in half the trials or more), counted over views × markers of each sweep.

    Of those missed, `visible_missed_too_dark` have less contrast than the noise of a capture leaves legible.
    """
    rows = []
    for result in results:
        seen, found, dark = set(), {True: [0, 0], False: [0, 0]}, 0
        for assessment, requested in zip(result.assessments, result.views, strict=True):
            evaluation = next(iter(assessment.predicted.values()))
            visible, too_dark = evaluation.visible, markers_too_dark(evaluation, requested[0].request.sensor)
            rate = assessment.view_detection_rate
            for row, item in enumerate(requested):
                if item.request.key in seen:
                    continue
                seen.add(item.request.key)
                detected = rate[row] >= 0.5
                dark += int((visible[row] & ~detected & too_dark[row]).sum())
                for predicted in (True, False):
                    chosen = detected[visible[row] == predicted]
                    found[predicted][0] += int(chosen.sum())
                    found[predicted][1] += int((~chosen).sum())
        rows.append(
            {
                "sweep": result.plan.sweep.name,
                "views": len(seen),
                "visible_detected": found[True][0],
                "visible_missed": found[True][1],
                "visible_missed_too_dark": dark,
                "hidden_detected": found[False][0],
                "hidden_missed": found[False][1],
            }
        )
    return rows
