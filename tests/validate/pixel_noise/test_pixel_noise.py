"""The pixel noise table: its statistics on numbers whose truth is known, its laboratory, and the command as a whole."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import numpy as np
import pytest

from render import backend
from render.renderer import Renderer
from render.sensor import expected_electrons
from validate.pixel_noise.design import COMBINATIONS, SAMPLING, SERIES, Shot, draw_factors, make_plan
from validate.pixel_noise.estimates import PoseSpread, bias, detection_rate, percentile_error, spread
from validate.pixel_noise.exponents import joint_exponents, log_variance, series_exponent
from validate.pixel_noise.laboratory import FOCAL_PX, MARKER_M, PRINT, Factors, Setup, draw_poses
from validate.run_sweep import main

ROOT = Path(__file__).parents[3]
POSES, TRIALS = 8, 20
WORLDS = 400
# 95 % intervals over 400 worlds: their coverage is known to ± 1.1 % (one standard deviation) if it is 95 %.
COVERAGE = (0.90, 0.985)
# What the table's numbers may end in, and those that have no unit.
UNITS = ("_px", "_deg", "_e")
WITHOUT_UNIT = {"series", "set", "factor", "paper", "from", "to", "white_snr", "edge_cnr", "marker_id"}
WITHOUT_UNIT |= {"renders", "captures", "found", "unexpected_ids", "render_noise_ratio"}
WITHOUT_UNIT |= {f"detection_rate{end}" for end in ("", "_low", "_high")}
WITHOUT_UNIT |= {"exponent", "exponent_low", "exponent_high", "bound_exponent", "physical_exponent", "paper_exponent"}


def residuals_of(rng, sigma_px, bias_px, worlds=WORLDS, uneven=0.0):
    """(W, P, T, 2): biases of one axis with an RMS of `bias_px` over poses, poses whose σ differs by `uneven`."""
    own = sigma_px * np.exp(uneven * rng.standard_normal((worlds, POSES, 1, 1)) - uneven**2)
    frozen = bias_px * rng.standard_normal((worlds, POSES, 1, 2))
    return frozen + own * rng.standard_normal((worlds, POSES, TRIALS, 2))


def covered(estimates, truth):
    """Share of the intervals that hold the truth."""
    return np.mean([estimate.low <= truth <= estimate.high for estimate in estimates])


# ---- bias, spread, rate ----------------------------------------------------------------------------------------------


def test_spread_and_mean_of_a_pose_by_hand():
    """Two captures at ±0.1 px along x about a mean of (0.3, 0): s² = 0.02/2 over both axes."""
    residuals = np.array([[[0.2, 0.0], [0.4, 0.0], [np.nan, np.nan]]])
    poses = PoseSpread.of(residuals)
    np.testing.assert_array_equal(poses.counts, [2])
    np.testing.assert_allclose(poses.mean_px, [[0.3, 0.0]])
    np.testing.assert_allclose(poses.variance_px2, [0.01])
    assert spread(poses).value == pytest.approx(0.1)
    # One axis of the mean: 0.09/2; noise leaves 0.01/2 in the mean of two.
    assert bias(poses).value == pytest.approx(math.sqrt(0.045 - 0.005))
    assert percentile_error(residuals, 100) == pytest.approx(0.4)


def test_bias_of_noise_alone_is_none():
    """The mean of few captures is not zero; what noise explains of that is taken off."""
    rng = np.random.default_rng(0)
    squares = [bias(PoseSpread.of(each)).value ** 2 for each in residuals_of(rng, 0.01, 0.0)]
    # Cut at zero, about half of the worlds say none at all, and the rest a part of σ²/T.
    assert 0.3 < np.mean(np.array(squares) == 0) < 0.7
    assert np.mean(squares) < 0.01**2 / TRIALS
    intervals = [bias(PoseSpread.of(each)) for each in residuals_of(rng, 0.01, 0.0)]
    assert np.mean([each.low == 0 for each in intervals]) > 0.95


@pytest.mark.parametrize("bias_px", [0.003, 0.02])
def test_intervals_of_the_bias_cover_it(bias_px):
    rng = np.random.default_rng(1)
    found = [bias(PoseSpread.of(each)) for each in residuals_of(rng, 0.01, bias_px)]
    assert COVERAGE[0] < covered(found, bias_px) < COVERAGE[1]
    assert np.mean([each.value**2 for each in found]) == pytest.approx(bias_px**2, rel=0.1)


@pytest.mark.parametrize("uneven", [0.0, 0.3])
def test_intervals_of_the_spread_cover_it_though_poses_differ(uneven):
    """E own² = σ² by construction, so that the pooled variance is σ²."""
    rng = np.random.default_rng(2)
    found = [spread(PoseSpread.of(each)) for each in residuals_of(rng, 0.01, 0.02, uneven=uneven)]
    assert COVERAGE[0] < covered(found, 0.01) < COVERAGE[1]
    assert np.mean([each.value**2 for each in found]) == pytest.approx(1e-4, rel=0.03)


def test_missed_captures_do_not_bias_the_spread():
    rng = np.random.default_rng(3)
    residuals = residuals_of(rng, 0.01, 0.02)
    residuals[rng.random(residuals.shape[:3]) < 0.6] = np.nan
    found = [spread(PoseSpread.of(each)) for each in residuals]
    assert np.mean([each.value**2 for each in found]) == pytest.approx(1e-4, rel=0.03)
    assert COVERAGE[0] < covered(found, 0.01) < COVERAGE[1]


def test_nothing_found_is_nan_and_not_zero():
    nothing = np.full((POSES, TRIALS, 2), np.nan)
    poses = PoseSpread.of(nothing)
    assert math.isnan(spread(poses).value)
    assert math.isnan(bias(poses).value)
    assert math.isnan(percentile_error(nothing))
    rate = detection_rate(nothing)
    assert (rate.value, rate.low) == (0.0, 0.0)
    assert rate.high == pytest.approx(0.324, abs=1e-3)


def test_a_rate_is_as_sure_as_its_poses():
    """Wilson's interval of 8 poses, whatever the captures of each: eight of eight leaves 0.676."""
    rate = detection_rate(np.zeros((POSES, TRIALS, 2)))
    assert (rate.value, rate.high) == (1.0, 1.0)
    assert rate.low == pytest.approx(0.676, abs=1e-3)


# ---- exponents -------------------------------------------------------------------------------------------------------


def estimated_log_variance(rng, true_sigma):
    """log σ² as estimated from the captures of a pose."""
    freedom = 2 * (TRIALS - 1)
    variance = true_sigma**2 * rng.chisquare(freedom, size=true_sigma.shape) / freedom
    return log_variance(variance, np.full(true_sigma.shape, freedom))


def test_the_logarithm_of_a_variance_is_unbiased():
    rng = np.random.default_rng(4)
    for freedom in (2, 10):
        estimates = rng.chisquare(freedom, size=200_000) / freedom
        assert log_variance(estimates, np.full(200_000, freedom)).mean() == pytest.approx(0, abs=0.01)


@pytest.mark.parametrize("exponent", [-1.0, 0.5])
def test_the_exponent_of_a_series_is_recovered(exponent):
    """Poses with constants of their own, and trends of their own about the common one; the worst level is missed."""
    rng = np.random.default_rng(5)
    level = np.repeat(np.linspace(0, 2, 6), POSES)
    pose = np.tile(np.arange(POSES), 6)
    found = []
    for _ in range(WORLDS):
        own, trend = 0.3 * rng.standard_normal(POSES), exponent + 0.1 * rng.standard_normal(POSES)
        logs = estimated_log_variance(rng, np.exp(own[pose] + trend[pose] * level))
        logs[:2] = np.nan
        found.append(series_exponent(logs, level, pose))
    assert np.mean([each.value for each in found]) == pytest.approx(exponent, abs=0.01)
    assert COVERAGE[0] < covered(found, exponent) < COVERAGE[1]


def test_exponents_of_combinations_are_recovered():
    """All four together, with renders that scatter by 20 % besides their noise."""
    rng = np.random.default_rng(6)
    truth = np.array([-0.5, 0.5, -0.3, -1.0])
    found = []
    for _ in range(WORLDS // 10):
        logs = rng.uniform(-1, 1, size=(120, 4)) * (1.0, 1.0, 0.6, 2.0)
        sigma = np.exp(-2 + logs @ truth + 0.2 * rng.standard_normal(120))
        found.append(joint_exponents(estimated_log_variance(rng, sigma), logs, rng))
    for number, exponent in enumerate(truth):
        estimates = [law.exponents[number] for law in found]
        assert np.mean([each.value for each in estimates]) == pytest.approx(exponent, abs=0.02)
        assert covered(estimates, exponent) > 0.85
    assert np.mean([law.constant_px for law in found]) == pytest.approx(math.exp(-2), rel=0.02)
    assert np.mean([law.scatter for law in found]) == pytest.approx(math.exp(math.hypot(0.2, 0.115)), rel=0.02)


def test_a_factor_that_does_not_vary_has_no_exponent():
    assert math.isnan(series_exponent(np.zeros(6), np.ones(6), np.arange(6) % 2).value)
    law = joint_exponents(np.zeros(6), np.ones((6, 2)), np.random.default_rng(0))
    assert math.isnan(law.exponents[0].value)


# ---- the laboratory --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "factors", [Factors(), Factors(cc_px=6.0), Factors(module_px=25.0, cc_px=12.0), Factors(4.0, 0.5, 75.0, 4000.0)]
)
def test_a_setup_has_the_factors_that_were_asked(factors):
    """Circle of confusion, incidence, size and phase of the projected centre, by the project's own camera."""
    for pose in draw_poses(4, np.random.default_rng(0)):
        setup = Setup(factors, pose)
        camera, marker = setup.camera, setup.marker
        assert float(camera.circle_of_confusion_px(MARKER_M)) == pytest.approx(factors.cc_px, abs=1e-6)
        assert float(camera.cos_incidence(MARKER_M, marker.normal)) == pytest.approx(factors.cos_incidence)
        middle = np.array(camera.principal_point_px)
        np.testing.assert_allclose(setup.truth_px - middle, pose.phase_px, atol=1e-3)
        assert camera.focal_px == pytest.approx(FOCAL_PX)
        assert np.dot(marker.up, marker.normal) == pytest.approx(0, abs=1e-12)
        # The homography of the bound has the same centre, and its modules are where the camera puts them.
        offset = 2 * np.array(marker.right) - 1.5 * np.array(marker.up)
        corner, _ = camera.project(MARKER_M + marker.module_m * offset)
        x, y, w = setup.homography @ (2.0, 1.5, 1.0)
        np.testing.assert_allclose((x / w, y / w), corner, atol=1e-6)
        # A module that faces the camera, at the marker's place.
        right = np.array(camera.rotation[0]) * marker.module_m
        ends, _ = camera.project(np.array([MARKER_M, MARKER_M + right]))
        assert np.linalg.norm(ends[1] - ends[0]) == pytest.approx(factors.module_px, rel=1e-3)


def test_series_vary_one_factor_and_share_their_poses():
    plan = make_plan(0)
    for series in SERIES:
        shots = [shot for shot in plan.shots if shot.series == series.name]
        assert {getattr(shot.setup.factors, series.factor) for shot in shots} == set(series.values)
        poses = {shot.setup.pose for shot in shots}
        assert len(shots) == len(poses) * len(series.values)
    assert len({shot.setup.pose for shot in plan.shots if shot.series != COMBINATIONS}) == POSES
    assert make_plan(0) == plan != make_plan(1)


def test_combinations_keep_their_bounds_and_fill_them():
    found = draw_factors(200, np.random.default_rng(0))
    modules = np.array([factors.module_px for factors in found])
    assert all(factors.cc_px <= min(12.0, 0.4 * factors.module_px) for factors in found)
    assert 3.5 <= modules.min() < 3.7 < 23.0 < modules.max() <= 25.0
    logs = np.log([[f.module_px, f.cos_incidence, f.white_e] for f in found]).T
    assert np.abs(np.corrcoef(logs) - np.eye(3)).max() < 0.25


@pytest.mark.render
def test_white_makes_the_electrons_that_were_asked(mi):
    """By the rendered image, in which the laboratory's own formula of the light has no part."""
    chosen = backend.choose()
    for factors in (Factors(white_e=300.0), Factors(cc_px=3.0, incidence_deg=60.0, white_e=2000.0)):
        setup = Setup(factors, draw_poses(1, np.random.default_rng(1))[0])
        shot = Shot("module", setup, factors.white_e)
        view = Renderer(setup.state, setup.baked(), chosen).render(shot.request(chosen.identity))
        electrons = expected_electrons(view.radiance, setup.camera, setup.sensor)
        on_plate = electrons[view.marker_id >= 0]
        # The ring light falls off a little across the plate.
        assert np.percentile(on_plate, 90) == pytest.approx(factors.white_e, rel=0.03)
        assert np.percentile(on_plate, 5) == pytest.approx(factors.black_e, rel=0.3)
        assert view.marker_id.max() == setup.pose.marker_id
        assert PRINT.black_albedo < PRINT.white_albedo
        assert SAMPLING.noise_ratio < 0.5


# ---- the command -----------------------------------------------------------------------------------------------------


def test_mistakes_end_in_one_line(tmp_path, capsys):
    assert main(["pixel-noise", "--trials", "1", "--out", str(tmp_path / "out")]) == 2
    assert "--trials 1; allowed: 2 or more" in capsys.readouterr().err
    (tmp_path / "file").write_text("mine")
    assert main(["pixel-noise", "--out", str(tmp_path / "file")]) == 2
    assert "is a file" in capsys.readouterr().err


def rows_of(path):
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.mark.render
def test_the_command_leaves_its_table_and_repeats_from_the_store(tmp_path, capsys, monkeypatch):
    """Few levels, end to end; a second run renders nothing and writes the same bytes."""
    arguments = ["pixel-noise", "--quick", "--store", str(tmp_path / "store")]
    assert main([*arguments, "--out", str(tmp_path / "first")]) == 0
    printed = capsys.readouterr().out
    assert "combinations: σ ≈" in printed
    assert "cc_px" in printed
    levels, renders, exponents = (
        rows_of(tmp_path / "first" / name) for name in ("pixel_noise.csv", "renders.csv", "exponents.csv")
    )
    for table in (levels, renders, exponents):
        assert not [name for name in table[0] if not name.endswith(UNITS) and name not in WITHOUT_UNIT]
    assert {row["series"] for row in levels} == {series.name for series in SERIES}
    assert {row["series"] for row in renders} == {series.name for series in SERIES} | {COMBINATIONS}
    found = [row for row in levels if float(row["detection_rate"]) == 1]
    assert len(found) >= 6
    for row in found:
        assert 0.5 < float(row["sigma_px"]) / float(row["bound_sigma_px"]) < 4
        assert 0.7 < float(row["physical_sigma_px"]) / float(row["bound_sigma_px"]) < 1.6
        assert float(row["sigma_low_px"]) < float(row["sigma_px"]) < float(row["sigma_high_px"])
        assert float(row["error_p95_px"]) < 0.2
    assert (tmp_path / "first" / "figures" / "pixel-noise.png").stat().st_size > 20_000
    monkeypatch.setattr("validate.pixel_noise.measure.Renderer", None)
    assert main([*arguments, "--out", str(tmp_path / "second")]) == 0
    for name in ("pixel_noise.csv", "renders.csv", "exponents.csv"):
        assert (tmp_path / "second" / name).read_bytes() == (tmp_path / "first" / name).read_bytes()


# ---- the page --------------------------------------------------------------------------------------------------------


def test_the_page_shows_the_reference_table_and_its_exponents():
    """Every level and every exponent of results/reference, as rounded there."""
    page = (ROOT / "docs" / "pixel-noise.md").read_text(encoding="utf-8").replace("−", "-")
    levels = rows_of(ROOT / "results" / "reference" / "pixel_noise.csv")
    for series in SERIES:
        assert [float(row[series.factor]) for row in levels if row["series"] == series.name] == list(series.values)
    for row in levels:
        cells = [row["series"], *(row[name] for name in ("module_px", "cc_px", "incidence_deg", "white_e"))]
        sigma, low, high = (f"{1000 * float(row[f'sigma{end}_px']):.2f}" for end in ("", "_low", "_high"))
        assert f"| {' | '.join(cells)} | {float(row['detection_rate']):.2f} | {sigma} [{low}, {high}] |" in page
    for row in rows_of(ROOT / "results" / "reference" / "pixel_noise_exponents.csv"):
        value, low, high = (f"{float(row[f'exponent{end}']):+.2f}" for end in ("", "_low", "_high"))
        assert f"| {row['renders']} | {value} [{low}, {high}] |" in page
    for name in (*levels[0], "renders.csv"):
        if not name.endswith(("_low", "_high", "_low_px", "_high_px")):
            assert f"`{name}`" in page, name
