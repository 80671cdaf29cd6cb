"""A bank of views: its design, turned renders, and statistics over configurations drawn from it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import scipy.stats

import scenes
from pss import NoiseModel, PTZCamera, RandomWalk, evaluate, noise_model
from pss.riccati.solve import steady_state_covariance_from_information
from pss.visibility.points import VISIBILITY_TESTS
from tests.conftest import ROOM_FILE
from validate import run_sweep
from validate.bank.design import BankDesign, detection_views, draw_configurations, held_out_views, training_views
from validate.bank.differences import METRICS_OF_R, difference_rows
from validate.bank.leaderboard import CountVerdict, leaderboard, measures
from validate.bank.measured import BankData, measure_all
from validate.bank.predicted import GivenCovariance, PredictionTask, predict_all
from validate.bank.sensitivity import variants
from validate.bank.size_bins import BINS, size_rows
from validate.bank.subpixel_shifts import LARGEST_TURN_PX, carried_back, joined, turned
from validate.markers.view_measurement import ViewMeasurement
from validate.prediction.contenders import Contender
from validate.stats.consistency import anisotropy, crossed_mean, of_errors, sandwich
from validate.stats.ranking import Resamples, judge_against, partial, top_hits
from validate.stats.regret import Choices, Picked, Regrets, numbers_of

ROUNDING = 1e-9
# Means over 4e5 draws of a χ² variable: five of their standard errors.
NEES, COVERAGE = 0.015, 0.006
CAMERA = PTZCamera((2.0, -1.0, 2.5), 200, -25, zoom=3, focus_distance_m=3, radial_distortion=(-0.1, 0.02))


@pytest.fixture(scope="module")
def room():
    return scenes.load(ROOM_FILE)


# ---- turned renders --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("distortion", [(0.0, 0.0), (-0.1, 0.02)])
def test_a_turn_is_undone_exactly(distortion):
    """What any turned setting sees of a point, carried back, is where the view's own setting sees it."""
    camera = dataclasses.replace(CAMERA, radial_distortion=distortion)
    rng = np.random.default_rng(1)
    rays = rng.uniform(-0.15, 0.15, size=(50, 2))
    points = np.array(camera.position_m) + (np.column_stack([rays, np.ones(50)]) @ camera.rotation) * 4
    own = camera.project(points)[0]
    for other in turned(camera, 8, rng):
        seen = other.project(points)[0]
        moved = np.linalg.norm(seen - own, axis=1)
        assert moved.min() > 0
        assert moved.max() < 2 * LARGEST_TURN_PX
        np.testing.assert_allclose(carried_back(seen, other, camera), own, atol=1e-6)


def test_what_was_not_detected_stays_so():
    """nan is carried back as nan, with whatever shape."""
    pixels = np.full((3, 2, 2), np.nan)
    pixels[1, 1] = (600.0, 400.0)
    (other,) = turned(CAMERA, 1, np.random.default_rng(2))
    back = carried_back(pixels, other, CAMERA)
    assert np.isfinite(back).sum() == 2
    assert np.isfinite(back[1, 1]).all()


@pytest.mark.parametrize("settings", [1, 2, 3, 4])
def test_halves_of_the_trials_share_the_settings(settings):
    """Even and odd trials both have every setting (but for one trial), and no trial is lost."""
    trials = 8
    parts = [
        ViewMeasurement(np.full((trials, 1, 2), 100.0 + 10 * k), np.ones((trials, 1, 2, 2)), 0, 0.0)
        for k in range(settings)
    ]
    whole = joined(CAMERA, [CAMERA] * settings, parts)
    which = np.rint((whole.pixels[:, 0, 0] - 100) / 10).astype(int)
    assert len(which) == settings * trials
    for half in (which[::2], which[1::2]):
        assert np.ptp(np.bincount(half, minlength=settings)) <= 1


# ---- design ----------------------------------------------------------------------------------------------------------


def test_training_and_held_out_views_share_nothing(room):
    """Other places, other settings; the same design gives the same views."""
    design = BankDesign(settings=3, training_cameras=4)
    training, held_out = training_views(room, design, "r"), held_out_views(room, design, "r")
    assert len(training.views) == 12
    assert len(held_out.views) == 21
    assert not {c.position_m for c in training.cameras} & {c.position_m for c in held_out.cameras}
    assert not {i.request.key for i in training.requested} & {i.request.key for i in held_out.requested}
    assert [c.pan_deg for c in held_out_views(room, design, "r").cameras] == [c.pan_deg for c in held_out.cameras]
    for camera in (*training.cameras, *held_out.cameras):
        x, y, z = camera.position_m
        assert abs(x) < 3
        assert abs(y) < 3
        assert 0 < z < 3
        assert design.zoom[0] <= camera.zoom <= design.zoom[1]
    assert len(held_out.requested) == 21 * design.turns


def test_detection_views_are_of_the_training_cameras_at_any_zoom_and_focus(room):
    """At the same places, with no render in common; in each part of the ranges of zoom and focus as many views."""
    design = BankDesign()
    training, views = training_views(room, design, "r"), detection_views(room, design, "r")
    assert {c.position_m for c in training.cameras} == {c.position_m for c in views.cameras}
    assert len(views.views) == len(views.requested) == design.training_cameras * design.detection_settings
    assert not {i.request.key for i in training.requested} & {i.request.key for i in views.requested}
    assert [i.request.camera for i in views.requested] == list(views.cameras)
    middle = room.state.points_m.mean(axis=0)
    for number, (low, high) in enumerate((design.detection_zoom, design.detection_focus)):
        values = [(c.zoom, c.focus_distance_m / np.linalg.norm(middle - c.position_m))[number] for c in views.cameras]
        edges = np.geomspace(low, high, design.detection_settings + 1)
        assert np.histogram(values, edges)[0].tolist() == [design.training_cameras] * design.detection_settings
    short = scenes.load(ROOM_FILE, ("lens.max_zoom=2.0", *(f"cameras.{number}.zoom=1" for number in range(1, 8))))
    assert max(camera.zoom for camera in detection_views(short, design, "r").cameras) == 2


def test_a_bank_of_cameras_that_cannot_zoom_has_one_zoom():
    """lens.max_zoom = 1 leaves no range to draw from, and 2 a part of the design's."""
    for max_zoom, low, high in ((1.0, 1.0, 1.0), (1.5, 1.5, 1.5), (2.0, 1.5, 2.0)):
        still = tuple(f"cameras.{number}.zoom=1" for number in range(1, 8))
        scene = scenes.load(ROOM_FILE, (f"lens.max_zoom={max_zoom}", *still))
        for bank in (held_out_views, training_views):
            zooms = [camera.zoom for camera in bank(scene, BankDesign(settings=5), "r").cameras]
            assert low <= min(zooms) <= max(zooms) <= high
    assert len(set(zooms)) > 1


def test_a_bank_looks_where_cameras_can_and_focuses_where_lenses_can(room):
    """Cameras under the ceiling that look straight down, and a focus that scatters over any distance."""
    above = dataclasses.replace(room.cameras[0], position_m=(*room.state.points_m.mean(axis=0)[:2], 2.95), name="above")
    scene = room.replace(cameras=(above,))
    views = held_out_views(scene, BankDesign(settings=40, focus_spread=5.0), "r")
    assert len(views.requested) == 80
    assert min(camera.tilt_deg for camera in views.cameras) < -80


def test_too_little_for_a_bank_is_refused_before_anything_is_rendered(tmp_path, capsys):
    text = ROOM_FILE.read_text().replace("[[cameras]]", "[[skipped]]").replace("[[skipped]]", "[[cameras]]", 3)
    head, *cameras = text.split("[[skipped]]")
    rest = cameras[-1].partition("\n[")[2]
    (tmp_path / "three.toml").write_text(head + "[" + rest)
    out = ("--out", str(tmp_path / "out"), "--store", str(tmp_path / "store"))
    for arguments, message in (
        (("--scene", str(tmp_path / "three.toml")), "three.toml: 3 cameras; allowed: 4 or more, as configurations"),
        (("--configurations", "2"), "--configurations 2; allowed: 3 or more, to be ranked"),
        (("--settings", "0"), "--settings 0; allowed: 1 or more"),
        (("--turns", "0"), "--turns 0; allowed: 1 or more"),
    ):
        assert run_sweep.main(["bank", *arguments, *out]) == 2
        assert message in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("size", [2, 4, 6])
def test_a_configuration_takes_one_view_of_a_camera(size):
    """Different configurations, of different cameras each; no more than there are."""
    names = [name for name in "abcdefg" for _ in range(4)]
    drawn = draw_configurations(names, size, 80, np.random.default_rng(3))
    assert drawn.shape == (80, size)
    assert len({tuple(row) for row in drawn.tolist()}) == 80
    assert all(len({names[view] for view in row}) == size for row in drawn)
    few = draw_configurations(["a", "a", "b"], 2, 50, np.random.default_rng(4))
    assert few.tolist() == [[0, 2], [1, 2]]
    assert draw_configurations(["a", "a"], 2, 5, np.random.default_rng(5)).shape == (0, 2)


# ---- prediction and measurement of one bank --------------------------------------------------------------------------


@pytest.fixture(scope="module")
def small(room):
    """Twelve views of the room with made-up detections: the projection plus noise of a known covariance a view."""
    design = BankDesign(settings=2, turns=1)
    bank = held_out_views(room, design, "r")
    rng = np.random.default_rng(6)
    points, normals = room.state.points_m, room.state.normals
    sigma = rng.uniform(0.02, 0.4, size=len(bank.cameras))
    seen = evaluate(bank.cameras, points, normals, occluder=room.state.occluders).visible
    projected = np.array([camera.project(points)[0] for camera in bank.cameras])
    noise = rng.standard_normal((len(sigma), 24, len(points), 2)) * sigma[:, None, None, None]
    pixels = np.where(seen[:, None, :, None], projected[:, None] + noise, np.nan)
    covariance = np.broadcast_to((sigma**2)[:, None, None, None, None] * np.eye(2), (*pixels.shape, 2))
    data = BankData(bank.cameras, points, pixels, covariance, RandomWalk(step_std_m=1e-3), 1)
    return bank, data, sigma


def test_the_right_covariance_ranks_and_is_consistent(room, small):
    """With the true R as a table: ρ near 1, NEES 1, coverage as asked; with R = I neither."""
    bank, data, sigma = small
    table = np.broadcast_to((sigma**2)[:, None, None, None] * np.eye(2), (len(sigma), len(data.points_m), 2, 2))
    true = Contender("true", NoiseModel("true", (GivenCovariance(bank.cameras, table),)))
    contenders = (true, Contender("identity", noise_model("identity")))
    state = room.state
    task = PredictionTask(
        bank.cameras, state.points_m, state.normals, state.occluders, None, data.process, contenders,
        {"true": ("pss", "pss-single-frame", "visible-share", "visibility-count", "e-optimality-count-zero"),
         "identity": ("pss", "pss-single-frame")},
    )  # fmt: skip
    chosen = draw_configurations([c.name for c in bank.cameras], 4, 60, np.random.default_rng(7))
    names = [c.name for c in bank.cameras]
    measured = measure_all(data, chosen.tolist(), processes=1)
    verdict = CountVerdict(4, chosen, measured, predict_all(task, chosen, 1), names)
    pairs = [(model, name) for model in ("true", "identity") for name in ("pss", "pss-single-frame")]
    pairs += [("true", "visible-share"), ("true", "visibility-count"), ("true", "e-optimality-count-zero")]
    rows = leaderboard(verdict, pairs)
    rho = {(row["noise_model"], row["metric"]): row for row in rows if row["measure"] == "measured_pss_single_frame"}
    best = rho["true", "pss-single-frame"]
    assert best["spearman"] > 0.97
    assert best["rank"] == 1
    assert best["spearman_ci_low"] <= best["spearman"] <= best["spearman_ci_high"]
    assert best["spearman"] > rho["identity", "pss-single-frame"]["spearman"] + 0.1
    assert best["minus_pss_single_frame"] == 0
    # The same number by another name: the same interval and rank, which counts it once, and no difference.
    twin = rho["true", "e-optimality-count-zero"]
    assert twin["equivalent_to"] == "pss-single-frame (true)"
    assert twin["minus_pss_single_frame"] == twin["minus_pss_single_frame_ci_low"] == 0
    same = ("spearman", "spearman_ci_low", "spearman_ci_high", "rank", "regret_of_20_mean_ci_low", "regret_of_20_mean")
    assert [twin[column] for column in same] == [best[column] for column in same]
    distinct = [row for row in rho.values() if not row["equivalent_to"]]
    assert sorted(row["rank"] for row in distinct) == list(range(1, len(distinct) + 1))
    assert best["regret_over_oracle_of_20"] == pytest.approx(
        best["regret_of_20_mean"] - best["oracle_regret_of_20_mean"], abs=ROUNDING
    )
    assert best["regret_of_20_median"] <= rho["identity", "pss-single-frame"]["regret_of_20_median"]
    errors = np.array([found.errors.errors_m for found in verdict.measured])
    covariance = np.array([found["true"].covariance_m2 for found in verdict.predicted])
    chance = Resamples.of_configurations(chosen, len(data.points_m), names)
    row = of_errors(errors, covariance).row(chance)
    assert row["nees_per_dof"] == pytest.approx(1, abs=0.05)
    assert row["coverage_90"] == pytest.approx(0.9, abs=0.02)
    assert row["median_abs_log_ratio"] < 0.15
    bins = size_rows(verdict, ["true", "identity"])
    ratios = {name: [row["measured_rms_m"] / row["predicted_rms_m"] for row in bins if row["noise_model"] == name]
              for name in ("true", "identity")}  # fmt: skip
    # RMS over 24 trials scatter by 1/√(6 · 24) = 8 %, and cells of a bin share points and views, so that their median
    # does nearly as much. R = I takes errors for 1 px where they are 0.02 to 0.4 px.
    assert len(ratios["true"]) == BINS
    assert max(abs(ratio - 1) for ratio in ratios["true"]) < 0.17, ratios["true"]
    assert max(ratios["identity"]) < 0.5


def test_results_do_not_depend_on_the_number_of_processes(small):
    """Measured and tracked in one process or in two: the same bits."""
    _, data, _ = small
    chosen = [(0, 2, 4), (1, 3, 8)]
    one, two = (measure_all(data, chosen, filtered=True, processes=n) for n in (1, 2))
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a.errors.errors_m, b.errors.errors_m)
        np.testing.assert_array_equal(a.prior_moment_m2, b.prior_moment_m2)
    assert {y.name for y in measures(one)} == {
        "measured_pss_single_frame", "share_under_5mm", "share_under_0.02mm", "share_under_0.05mm", "share_under_0.1mm",
        "share_under_0.2mm", "median_rms_m", "measured_pss_filter",
    }  # fmt: skip


# ---- statistics ------------------------------------------------------------------------------------------------------


def test_spearman_and_its_partial():
    """The estimates against SciPy's, and the partial against residuals of ranks."""
    rng = np.random.default_rng(10)
    z = rng.standard_normal(400)
    x, y = z + rng.standard_normal(400), z + rng.standard_normal(400)
    chance = Resamples.of_configurations(rng.integers(30, size=(400, 3)), 5)
    xy, xz, yz = (judge_against(a, b, chance) for a, b in ((x, y), (x, z), (y, z)))
    assert xy.estimate == pytest.approx(scipy.stats.spearmanr(x, y).statistic)
    ranks = [scipy.stats.rankdata(v) for v in (x, y, z)]
    residual = [r - np.polyval(np.polyfit(ranks[2], r, 1), ranks[2]) for r in ranks[:2]]
    found = partial(xy, xz, yz)
    assert found.estimate == pytest.approx(np.corrcoef(*residual)[0, 1], abs=ROUNDING)
    low, high = found.interval
    assert low < found.estimate < high
    assert judge_against(-x, y, chance, sign=-1).estimate == pytest.approx(xy.estimate)
    assert xy.minus(xy).interval == (0.0, 0.0)


def test_means_over_points_are_resampled_with_their_points():
    """A metric given by its terms follows the points' weights; the measure does so too, and they agree."""
    rng = np.random.default_rng(11)
    terms = rng.uniform(size=(50, 8))
    chance = Resamples.of_configurations(rng.integers(20, size=(50, 2)), 8)
    judged = judge_against(terms, terms, chance)
    assert judged.estimate == pytest.approx(1)
    np.testing.assert_allclose(judged.samples, 1)


def test_undefined_statistics_have_no_interval():
    """A constant metric has no ρ and no interval."""
    chance = Resamples.of_configurations(np.arange(20)[:, None], 4)
    judged = judge_against(np.ones(20), np.arange(20.0), chance)
    assert np.isnan(judged.estimate)
    assert np.isnan(judged.interval).all()


def regrets(score, halves, size):
    """Regret of a score and of the oracle, and the resamples: configurations of one view, of twenty cameras."""
    cameras = [f"{view % 20}" for view in range(len(score))]
    chance = Resamples.of_configurations(np.arange(len(score))[:, None], 4, cameras)
    costs = Regrets.of_values(halves, {size: Choices.of(chance, size)})
    (lost, median), (oracle, _) = (
        costs.of(Picked.by(numbers_of(score, chance), costs.choices), size),
        costs.oracle(size),
    )
    return lost, oracle, median


def test_regret_of_a_perfect_and_of_a_blind_choice():
    """The truth itself loses nothing; a constant score loses what a random choice does; a nan is never chosen."""
    truth = np.arange(1.0, 101.0)
    perfect, oracle, median = regrets(truth, (truth, truth), 20)
    assert perfect.estimate == oracle.estimate == median == 0
    assert perfect.interval == perfect.minus(oracle).interval == (0.0, 0.0)
    blind, _, _ = regrets(np.zeros(100), (truth, truth), 20)
    assert blind.estimate == pytest.approx(1 - truth.mean() / 96, abs=0.05)  # the best of 20 is about 96 of 100
    low, high = blind.interval
    assert low < blind.estimate < high
    unknown = np.where(truth > 99, np.nan, truth)
    lost, _, _ = regrets(unknown, (truth, truth), 100)
    assert lost.estimate == pytest.approx(0.01)


def test_a_choice_without_a_camera_is_as_large():
    """Left out cameras are never chosen, and where too few configurations are left nothing is."""
    views = np.array([[v, w] for v in range(3) for w in range(3, 6)])
    chance = Resamples.of_configurations(views, 2, ["a", "a", "b", "c", "c", "d"])
    cameras = chance.units[0]
    assert cameras == 4
    choices = Choices.of(chance, 4)
    for row in range(cameras):
        left = np.flatnonzero(chance.views[row])
        if len(left) < 4:
            assert (choices.left[row] == -1).all()
        else:
            assert np.isin(choices.left[row], left).all()
            assert all(len(set(one.tolist())) == 4 for one in choices.left[row])


def test_top_hits_share_ties():
    """All of the best tenth, none, or the share that a constant score finds by chance."""
    truth = np.arange(100.0)
    assert top_hits(truth, truth, 0.1) == 1
    assert top_hits(-truth, truth, 0.1) == 0
    assert top_hits(np.zeros(100), truth, 0.1) == pytest.approx(0.1)


def test_nees_and_coverage_of_gaussian_errors():
    """Errors drawn from C: NEES/3 = 1, and ellipsoids that hold what they should; with C/4 they hold less."""
    rng = np.random.default_rng(14)
    root = rng.standard_normal((4, 25, 3, 3)) * [[[1.0], [0.3], [0.1]]]
    covariance = root @ root.mT + 1e-3 * np.eye(3)
    draws = rng.standard_normal((4, 4000, 25, 3, 1))
    errors = (np.linalg.cholesky(covariance)[:, None] @ draws)[..., 0]
    errors[:, :5, 3] = np.nan
    covariance[2, 7] = np.nan
    found = of_errors(errors, covariance)
    assert np.isnan(found.nees[2, 7])
    assert np.isfinite(found.nees).sum() == 99
    chance = Resamples.of_configurations(np.arange(4)[:, None], 25)
    assert crossed_mean(found.nees, chance).estimate == pytest.approx(1, abs=NEES)
    for level, inside in found.inside.items():
        assert crossed_mean(inside, chance).estimate == pytest.approx(level, abs=COVERAGE)
    too_small = of_errors(errors, covariance / 4)
    assert crossed_mean(too_small.nees, chance).estimate == pytest.approx(4, abs=4 * NEES)
    np.testing.assert_allclose(np.delete((too_small.log_ratio - found.log_ratio).ravel(), 2 * 25 + 7), np.log(0.5))
    moment = np.einsum("ktni,ktnj->knij", np.nan_to_num(errors), np.nan_to_num(errors)) / 4000
    shape = anisotropy(moment, covariance, np.full((4, 25), 4000))
    assert shape["axis_ratio_spearman"] > 0.98
    assert shape["measured_axis_ratio_median"] == pytest.approx(shape["predicted_axis_ratio_median"], rel=0.03)
    assert shape["axis_angle_median_deg"] < 2


def test_sandwich_against_simulation():
    """R ≠ S: the actual covariance of the fit and of the filter, from 20,000 filters; 1 where R = S."""
    rng = np.random.default_rng(15)
    views = 3
    jacobians = [rng.standard_normal((1, 2, 3)) * 300 for _ in range(views)]
    claimed = [np.eye(2)[None] * v for v in (0.04, 0.04, 0.04)]
    true = [np.eye(2)[None] * v for v in (0.004, 0.09, 0.3)]
    q = 1e-6
    np.testing.assert_allclose(sandwich(jacobians, true, true, q), 1, rtol=1e-6)
    frame, filtered = sandwich(jacobians, claimed, true, q)[:, 0]

    h = np.concatenate([j[0] for j in jacobians])
    r = np.diag(np.repeat([c[0, 0, 0] for c in claimed], 2))
    s = np.repeat([t[0, 0, 0] for t in true], 2)
    information = h.T @ np.linalg.solve(r, h)
    prior = steady_state_covariance_from_information(np.eye(3), q * np.eye(3), information[None])[0]
    posterior = np.linalg.inv(np.linalg.inv(prior) + information)
    noise = rng.standard_normal((20_000, 6)) * np.sqrt(s)
    pull = noise @ np.linalg.solve(r, h)
    fit = pull @ np.linalg.inv(information)
    stated = np.trace(np.linalg.inv(information))
    assert frame == pytest.approx(np.sqrt((fit**2).sum(axis=1).mean() / stated), rel=0.02)
    error = rng.standard_normal((20_000, 3)) @ np.linalg.cholesky(prior).T
    for _ in range(200):
        pull = rng.standard_normal((20_000, 6)) * np.sqrt(s) @ np.linalg.solve(r, h)
        updated = error + (pull - error @ information) @ posterior
        error = updated - np.sqrt(q) * rng.standard_normal((20_000, 3))
    assert filtered == pytest.approx(np.sqrt((error**2).sum(axis=1).mean() / np.trace(prior)), rel=0.02)


def test_differences_are_those_of_the_leaderboard(small):
    """ρ of one contender less that of another, and its interval from resamples that both share."""
    bank, data, sigma = small
    table = np.broadcast_to((sigma**2)[:, None, None, None] * np.eye(2), (len(sigma), len(data.points_m), 2, 2))
    true = NoiseModel("true", (GivenCovariance(bank.cameras, table),))
    contenders = [Contender("true", true), Contender("identity", noise_model("identity")), Contender("twin", true)]
    state = bank.scene.state
    asked = {c.name: ("visible-share", "visibility-count") for c in contenders}
    task = PredictionTask(
        bank.cameras, state.points_m, state.normals, state.occluders, None, data.process, tuple(contenders), asked
    )
    chosen = draw_configurations([c.name for c in bank.cameras], 4, 40, np.random.default_rng(7))
    names = [camera.name for camera in bank.cameras]
    measured = measure_all(data, chosen.tolist(), processes=1)
    verdict = CountVerdict(4, chosen, measured, predict_all(task, chosen, 1), names)
    pairs = [(c.name, metric) for c in contenders for metric in (*METRICS_OF_R, "visible-share", "visibility-count")]
    board = leaderboard(verdict, pairs)
    rows = difference_rows(verdict, [c.name for c in contenders], ["identity"])
    assert len(rows) == len({row["measure"] for row in board}) * len(METRICS_OF_R) * 2
    for row in rows:
        one, other = (
            next(
                r["spearman"]
                for r in board
                if (r["noise_model"], r["metric"], r["measure"]) == (name, row["metric"], row["measure"])
            )
            for name in (row["noise_model"], row["baseline"])
        )
        assert row["spearman_difference"] == pytest.approx(one - other, abs=ROUNDING)
    single = {
        (row["noise_model"], row["baseline"]): row
        for row in difference_rows(verdict, [c.name for c in contenders], ["true", "identity"])
        if (row["metric"], row["measure"]) == ("pss-single-frame", "measured_pss_single_frame")
    }
    better = single["true", "identity"]
    assert better["spearman_difference_ci_low"] < better["spearman_difference"] < better["spearman_difference_ci_high"]
    assert better["spearman_difference"] > 0.1
    twin = single["twin", "true"]
    for column in ("spearman_difference", "spearman_difference_ci_low", "spearman_difference_ci_high"):
        assert twin[column] == pytest.approx(0, abs=ROUNDING)


# ---- the open constants ----------------------------------------------------------------------------------------------


def test_variants_of_the_papers_models(room):
    """Each constant down, as it is and up; each factor by itself; as it is, the model is the scene's own."""
    named = variants(room, VISIBILITY_TESTS)
    assert len({contender.name for _, contender in named}) == len(named) == 2 * (2 * 3 + 4)
    camera, points, normals = room.cameras[0], room.state.points_m[:5], room.state.normals[:5]
    usual = noise_model("corrected", ccd_noise=room.sensor.ccd_noise).covariance(camera, points, normals)
    by_name = {contender.name: contender.noise for _, contender in named}
    for constant in ("px2_per_m2", "ccd_noise"):
        np.testing.assert_array_equal(by_name[f"corrected, {constant} × 1"].covariance(camera, points, normals), usual)
        more, less = (
            by_name[f"corrected, {constant} × {times:g}"].covariance(camera, points, normals) for times in (10, 0.1)
        )
        assert (np.trace(more, axis1=1, axis2=2) > np.trace(less, axis1=1, axis2=2)).all()
    alone = {f.name for f in by_name["as-printed, defocus alone"].factors}
    assert alone == {"defocus"}
    distance, incidence = (by_name[f"corrected, {part} alone"].factors[0] for part in ("distance", "incidence"))
    assert (distance.distance, distance.incidence) == (True, False)
    assert (incidence.distance, incidence.incidence) == (False, True)
