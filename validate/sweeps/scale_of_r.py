"""The effect of the unit of R on a ranking: the paper's PSS of R, R/10, …, beside the filter's (`scale.csv`).

The paper adds m² to px², so that the unit of R is undefined. A whole R times s multiplies every single-frame C by s and
changes no rank. P∞ weighs R against the process noise: where R is far too large, a point that two cameras see is hardly
worth more than one that moves on, and PSS ranks by other things than where R has the size of the errors.
"""

from __future__ import annotations

import numpy as np

from pss import METRICS
from pss.hints import Row
from pss.noise import SCALED_MODELS
from validate.prediction.predict import predict
from validate.prediction.weights import scaled
from validate.stats.intervals import interval, weighted_spearman
from validate.stats.optimum import optimum
from validate.sweeps.derived import derived
from validate.sweeps.optima import trend
from validate.sweeps.sweep import SweepResult

__all__ = ["SCALES", "scale_rows"]


# From m² that are read as px² down to where the errors of a detector are: R is then of 1e-5 px² and less.
SCALES = (1.0, 0.1, 1e-2, 1e-3, 1e-4, 1e-5)


@derived
def scale_rows(result: SweepResult) -> list[Row]:
    """A row for each of the scene's models whose unit is open, times each of `SCALES`: Spearman of PSS over the steps.

    Of the paper's PSS with the measured one of the filter; the interval is that of `correlation.csv`. None for a sweep
    of one step.
    """
    if len(result.assessments) < 2:
        return []
    rows: list[Row] = []
    measured = trend(result, single_frame=False)
    for model in (model for model in result.plan.scene.noise_models if model.name in SCALED_MODELS):
        weights = result.replicates[model.name].point_weights
        for times in SCALES:
            at_scale = scaled(model, times, model.name)
            # As the step itself was predicted: whole markers are looked for by how they look.
            evaluations = [
                predict(
                    step.scene.replace(noise_models=(at_scale,)),
                    step.cameras,
                    assessment.predicted[model.name].task.appearance,
                )[model.name]
                for step, assessment in zip(result.configurations, result.assessments, strict=True)
            ]
            values = np.array([METRICS["pss"].score(evaluation) for evaluation in evaluations])
            terms = np.array([np.nan_to_num(1 / evaluation.sigma_m) for evaluation in evaluations])
            rho, low, high = np.nan, np.nan, np.nan
            if not measured.flat:
                rho = float(weighted_spearman(values, measured.values))
                low, high = interval(np.asarray(weighted_spearman(weights @ terms.T, measured.samples)))
            best = optimum(values)
            rows.append(
                {
                    "sweep": result.plan.sweep.name,
                    "metric": "pss",
                    "noise_model": model.name,
                    "multiplier": times,
                    "measure": "measured_pss_filter",
                    "n": len(values),
                    "spearman": rho,
                    "spearman_ci_low": float(low),
                    "spearman_ci_high": float(high),
                    "optimum": "" if best is None else result.configurations[best].value,
                }
            )
    return rows
