"""Slopes of errors over a sweep's parameter: what is fitted, on which points, and how sure it is."""

from __future__ import annotations

import numpy as np
import pytest

from pss import ShapeError
from validate.stats.measured_errors import MeasuredErrors
from validate.sweeps.slopes import common_points, log_slope, slopes

PARAMETER = np.array([1.0, 1.5, 2.5, 4.0])
TRIALS, POINTS = 20, 40


def errors_of(rms_m, rng):
    """Trials of points whose RMS is (S,), with nothing in common but that."""
    return [MeasuredErrors(rms / 3**0.5 * rng.standard_normal((TRIALS, POINTS, 3))) for rms in rms_m]


def test_the_slope_of_a_power_is_its_exponent():
    """Of several curves at once, whatever their scale."""
    curves = np.array([[3.0], [0.2]]) * PARAMETER ** np.array([[2.0], [-0.5]])
    np.testing.assert_allclose(log_slope(PARAMETER, curves), [2.0, -0.5], rtol=1e-12)
    with pytest.raises(ShapeError, match=r"allowed: \(S,\) and \(\.\.\., S\)"):
        log_slope(PARAMETER, np.ones(3))


def test_the_measured_slope_is_found_within_its_interval():
    """Of 40 sweeps with errors in proportion to the square, at least 33 intervals hold 2 (38 would on average)."""
    rng = np.random.default_rng(8)
    held = 0
    for _ in range(40):
        found = slopes(
            PARAMETER,
            {"right": np.tile(1e-3 * PARAMETER[:, None] ** 2, POINTS), "flat": np.ones((4, POINTS))},
            errors_of(1e-3 * PARAMETER**2, rng),
            rng,
            replicates=100,
        )
        held += found.low <= 2 <= found.high
        assert found.measured == pytest.approx(2, abs=0.15)
    assert held >= 33
    assert found.predicted == pytest.approx({"right": 2, "flat": 0})
    assert found.points == POINTS
    assert found.departure < 0.1


def test_only_points_of_all_steps_count():
    """A step that loses its worst points must not look better, and points that no model predicts don't count."""
    rng = np.random.default_rng(9)
    rms = np.full((4, POINTS), 1e-3)
    rms[:, 0] = 1.0
    errors = [e.errors_m.copy() for e in errors_of([1e-3] * 4, rng)]
    for e in errors:
        e[:, 0] *= 1000
    errors[2][:15, 0] = np.nan  # found in a quarter of the trials of one step
    errors[1][:8, 1] = np.nan  # in more than half: stays
    rms[3, 2] = np.nan
    errors = [MeasuredErrors(e) for e in errors]
    common = common_points({"any": rms}, errors)
    assert not common[0]
    assert common[1]
    assert not common[2]
    found = slopes(PARAMETER, {"any": rms}, errors, rng)
    assert found.points == POINTS - 2
    assert found.measured == pytest.approx(0, abs=0.1)
    assert found.low < 0 < found.high


def test_without_a_common_point_there_is_no_slope():
    """nan on every side, not an error."""
    errors = [MeasuredErrors(np.full((4, 3, 3), np.nan)) for _ in PARAMETER]
    found = slopes(PARAMETER, {"any": np.ones((4, 3))}, errors, np.random.default_rng(1))
    assert found.points == 0
    assert np.isnan([found.measured, found.low, found.high, found.predicted["any"], found.departure]).all()


def test_a_curve_that_is_no_power_departs_from_its_line():
    """A hump has a slope of about zero, and says that it is none."""
    hump = np.array([3e-3, 1e-3, 1e-3, 3e-3])
    rng = np.random.default_rng(10)
    found = slopes(PARAMETER, {"any": np.ones((4, POINTS))}, errors_of(hump, rng), rng)
    assert abs(found.measured) < 0.2
    assert found.departure > 0.4
