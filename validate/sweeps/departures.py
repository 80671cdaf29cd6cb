"""How measured errors depart from predictions: the error budget of each step of a sweep, and NEES of each point."""

from __future__ import annotations

import numpy as np

from pss.hints import Floats
from validate.points.error_budget import ErrorBudget, error_budget
from validate.sweeps.derived import derived
from validate.sweeps.sweep import SweepResult

__all__ = ["error_budgets", "nees"]


@derived
def error_budgets(result: SweepResult, model: str) -> tuple[ErrorBudget, ...]:
    """The factors from a noise model's single-frame PSS to the measured one, at each of the S steps."""
    return tuple(
        error_budget(a.predicted[model], a.measured.triangulated, a.measured.propagated, a.measured.errors.pss())
        for a in result.assessments
    )


@derived
def nees(result: SweepResult, model: str) -> Floats:
    """NEES of each point under a noise model's C, (S, N): 3 where C is right; nan without C or errors."""
    covariances = [assessment.predicted[model].single_frame_covariance for assessment in result.assessments]
    errors = [assessment.measured.errors for assessment in result.assessments]
    return np.array([e.nees(c) for e, c in zip(errors, covariances, strict=True)])
