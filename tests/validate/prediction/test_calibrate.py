"""Calibration: weights that made the data are found again, what they do not ask for is left out, files are checked."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import pss
from pss import ImageSensor, NoiseModel, PTZCamera, RangeError, noise_model
from pss.cameras.views import Views
from pss.noise import CALIBRATION_FACTORS, Calibration, calibration_factor
from validate.prediction.weights import (
    BLUNDER_RATIO,
    FEWEST_DETECTIONS,
    PixelMoments,
    factor_covariances,
    fit,
    fit_best_form,
    fit_scale,
    model_covariance,
    pixel_moments,
)

# 2000 moments of 20 trials fix a weight that matters to about 2 %; five times that.
FOUND = 0.1
# How far the search over weights stops from the minimum, relative: its gradient is 1e-6.
SEARCHED = 1e-5
SENSOR = ImageSensor()
CAMERAS = (
    PTZCamera((0.0, -3.0, 2.5), 0, -15, zoom=3, focus_distance_m=2.0, name="a"),
    PTZCamera((2.5, -2.0, 2.0), -40, -10, zoom=4, focus_distance_m=4.0, name="b"),
)


@pytest.fixture(scope="module")
def world():
    """1000 markers that two cameras see: points, normals and how they look."""
    rng = np.random.default_rng(1)
    points = rng.uniform((-0.8, 0.2, 0.6), (0.8, 1.6, 1.8), size=(1000, 3))
    normals = np.array([0.2, -1.0, 0.1]) + 0.4 * rng.standard_normal((1000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    target_appearance = pss.Appearance(rng.uniform(0.005, 0.03, size=1000), np.full(1000, 0.02), np.full(1000, 0.001))
    return points, normals, target_appearance


@pytest.fixture(scope="module")
def all_cells(world):
    points, normals, target_appearance = world
    view, point = (part.ravel() for part in np.meshgrid([0, 1], np.arange(len(points)), indexing="ij"))
    empty = PixelMoments(np.zeros((len(view), 2, 2)), np.full(len(view), 20), view, point)
    return empty, factor_covariances(CAMERAS, points, normals, target_appearance, SENSOR, empty)


def moments_of(model: np.ndarray, empty: PixelMoments, seed: int) -> PixelMoments:
    """Second moments over 20 draws from each of the covariances `model` (M, 2, 2)."""
    draws = np.random.default_rng(seed).standard_normal((len(model), 20, 2)) @ np.linalg.cholesky(model).mT
    return PixelMoments(np.einsum("mti,mtj->mij", draws, draws) / 20, empty.trials, empty.view, empty.point)


@pytest.mark.slow
def test_weights_are_found_again(all_cells):
    """Data made with 1.3 of the physical factor and a floor: both come back, and nothing else."""
    empty, covariances = all_cells
    true = {"brightness-contrast": 1.3, "floor": 2e-4}
    model = sum(true[name] * covariances[CALIBRATION_FACTORS.index(name)] for name in true)
    found = fit_best_form(CALIBRATION_FACTORS, covariances, moments_of(model, empty, 2))
    assert set(found.weights) == set(true)
    for name, weight in true.items():
        assert found.weights[name] == pytest.approx(weight, rel=FOUND)
    assert found.left_out == 0
    assert found.moments == 2000


def test_every_factor_can_be_found(all_cells):
    """Each factor alone makes data that it alone explains."""
    empty, covariances = all_cells
    for index, name in enumerate(CALIBRATION_FACTORS):
        scale = 1e-3 / np.median(np.trace(covariances[index], axis1=1, axis2=2))
        model = scale * covariances[index] + 1e-9 * np.eye(2)
        found = fit(CALIBRATION_FACTORS, covariances, moments_of(model, empty, 3 + index))
        explained = np.einsum("j,jmab->mab", [found.weights[n] for n in CALIBRATION_FACTORS], covariances)
        ratio = np.trace(explained, axis1=1, axis2=2) / np.trace(model, axis1=1, axis2=2)
        assert np.median(np.abs(np.log(ratio))) < FOUND, name


def test_weights_are_the_minimum_of_the_deviance(all_cells):
    """No neighbouring weights fit better."""
    empty, covariances = all_cells
    names = ("brightness-contrast", "floor", "defocus")
    chosen = covariances[[CALIBRATION_FACTORS.index(name) for name in names]]
    moments = moments_of(chosen[0] + 1e-4 * chosen[1] + 1e-6 * chosen[2], empty, 20)

    def deviance(weights):
        model = np.einsum("j,jmab->mab", weights, chosen)
        spread = np.trace(np.linalg.solve(model, moments.moment_px2), axis1=1, axis2=2)
        return (20 * (np.log(np.linalg.det(model)) + spread)).sum()

    found = fit(names, chosen, moments)
    best = np.array([found.weights[name] for name in names])
    assert deviance(best) == pytest.approx(found.deviance, rel=1e-9)
    for index in range(3):
        for factor in (0.97, 1.03):
            moved = best.copy()
            moved[index] = moved[index] * factor + (1e-12 if moved[index] == 0 else 0)
            assert deviance(moved) >= found.deviance - 1e-3


def test_blunders_are_left_out_and_counted(all_cells):
    """A marker that was taken for another, with an error a hundred times its noise, does not move the weights."""
    empty, covariances = all_cells
    chosen = covariances[:2]
    moments = moments_of(1.0 * chosen[0] + 1e-4 * chosen[1], empty, 21)
    moments.moment_px2[::100] *= 2 * BLUNDER_RATIO
    found = fit(CALIBRATION_FACTORS[:2], chosen, moments)
    assert found.left_out == 20
    assert found.weights["brightness-contrast"] == pytest.approx(1, rel=FOUND)


def test_a_scale_is_found_again_and_is_the_likeliest(world, all_cells):
    """Data of 1e-5 of the paper's R: the scale comes back, from the closed form as from the search over weights."""
    points, normals, target_appearance = world
    empty, _ = all_cells
    model = noise_model("as-printed")
    covariance = model_covariance(model, Views(list(CAMERAS), points, normals, target_appearance), empty)
    for index in (0, 999, 1500):
        alone = model.covariance(CAMERAS[index // 1000], points[[index % 1000]], normals[[index % 1000]])
        np.testing.assert_allclose(covariance[index], alone[0], rtol=1e-12)
    # Some markers are found more often than others, and count as much more.
    trials = np.where(np.arange(2000) % 3, 20, 7)
    moments = dataclasses.replace(moments_of(1e-5 * covariance, empty, 23), trials=trials)
    scale = fit_scale(covariance, moments)
    assert scale == pytest.approx(1e-5, rel=FOUND)
    by_search = fit(["whole R"], covariance[None], moments)
    assert by_search.left_out == 0
    assert scale == pytest.approx(by_search.weights["whole R"], rel=SEARCHED)
    # A model that is wrong in its form keeps all moments: none is a blunder because the model does not explain it.
    wrong = covariance.copy()
    wrong[:20] /= 100
    ratio = np.trace(np.linalg.solve(wrong, moments.moment_px2), axis1=1, axis2=2) / 2
    assert fit_scale(wrong, moments) == pytest.approx((trials * ratio).sum() / trials.sum(), rel=1e-12)
    assert fit(["whole R"], wrong[None], moments).left_out == 20


def test_a_scale_needs_moments_and_a_whole_model(all_cells):
    """None at all, and an R that is zero somewhere."""
    empty, covariances = all_cells
    nothing = np.zeros(len(empty.trials), dtype=bool)
    with pytest.raises(RangeError, match="no moments of pixel errors"):
        fit_scale(covariances[0][nothing], empty[nothing])
    hole = covariances[0].copy()
    hole[3] = 0
    with pytest.raises(RangeError, match="not positive definite"):
        fit_scale(hole, empty)


def test_moments_of_residuals():
    """About zero, of what was detected; markers that were found too rarely have none."""
    rng = np.random.default_rng(22)
    residuals = rng.standard_normal((2, 8, 3, 2)) + 1
    residuals[0, FEWEST_DETECTIONS - 1 :, 1] = np.nan
    found = pixel_moments(residuals)
    assert list(zip(found.view, found.point, strict=True)) == [(0, 0), (0, 2), (1, 0), (1, 1), (1, 2)]
    np.testing.assert_allclose(found.moment_px2[2], residuals[1, :, 0].T @ residuals[1, :, 0] / 8)
    with pytest.raises(RangeError, match="no marker was detected"):
        fit(["floor"], np.zeros((1, 0, 2, 2)), pixel_moments(residuals[:, :2]))


# ---- the file --------------------------------------------------------------------------------------------------------


def test_a_file_gives_the_same_model(tmp_path, world):
    """Written, and read by its path: the same covariances, with the scene's own sensor; provenance comes back."""
    points, normals, target_appearance = world
    weights = {"brightness-contrast": 1.1, "floor": 3.3e-5, "relative-defocus": 0.0, "module-size": 1e-3}
    scales = {"as-printed": 1.5e-5, "corrected": 8e-6, "identity": 0.002}
    calibration = Calibration("mine", weights, {"scene": 'a "room"', "views": 60, "deviance": -9.25}, scales=scales)
    path = tmp_path / "mine.toml"
    path.write_text(calibration.to_toml())
    assert Calibration.from_file(path) == calibration
    other = ImageSensor(read_noise_e=2.0)
    model = noise_model(path, sensor=other)
    assert model.name == "mine"
    assert [factor.name for factor in model.factors] == ["brightness-contrast", "floor", "module-size"]
    views = Views(list(CAMERAS), points, normals, target_appearance)
    expected = sum(
        weight * calibration_factor(name, other).covariance(views).matrix(2, len(points))
        for name, weight in weights.items()
    )
    np.testing.assert_allclose(model.of_views(views).matrix(2, len(points)), expected, rtol=1e-12)
    evaluation = pss.evaluate(CAMERAS, points, normals, noise=noise_model(str(path)), appearance=target_appearance)
    assert isinstance(evaluation.task.noise, NoiseModel)
    assert evaluation.pss > 0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("weights = 3", "weights = 3; allowed: a table of"),
        ("[weights]\nfloor = -1.0", "weights.floor = -1.0; allowed: 0 or more"),
        ("[weights]\nfloor = true", "weights.floor = True; allowed: 0 or more"),
        ("[weights]\nbloor = 1.0", "weights.bloor; allowed: brightness-contrast, floor"),
        ("[weights]\nfloor = 0.0", "all weights are 0"),
        ("[weights]\nfloor = 1.0\n[fit]\n", "'fit'; allowed: name, weights, limits, detection, scales, provenance"),
        ("[weights]\nfloor = 1.0\n[scales]\nidentity = 1.0", "allowed: none, or as-printed and corrected and identity"),
        (
            "[weights]\nfloor = 1.0\n[scales]\nas-printed = 1.0\ncorrected = 0.0\nidentity = 1.0",
            "scales.corrected = 0.0; allowed: above 0, finite",
        ),
        ("weights = [", "line 1, column 12: Invalid value"),
    ],
)
def test_a_wrong_file_is_one_line(tmp_path, text, message):
    """Key, value, what is allowed, and where."""
    path = tmp_path / "wrong.toml"
    path.write_text(text)
    with pytest.raises(RangeError) as caught:
        noise_model(path)
    assert message in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_missing_file_and_a_wrong_name():
    """A path that is not there; a name that is neither a model nor a path."""
    with pytest.raises(RangeError, match=r"nowhere.toml: there is no such file.*allowed"):
        noise_model("nowhere.toml")
    with pytest.raises(RangeError, match=r"'calibratde'; allowed: as-printed, .*path"):
        noise_model("calibratde")
    with pytest.raises(RangeError, match="allowed in a calibration"):
        calibration_factor("colour")


def test_relative_factors_by_hand():
    """A marker of 20 mm that faces the camera 4 m away: its module in px, and the circle of confusion over it."""
    camera = PTZCamera((0, 0, 1), 0, 0, zoom=4, focus_distance_m=2.0)
    target_appearance = pss.Appearance(np.array([0.02]), np.array([0.1]), np.array([0.01]))
    views = Views([camera], np.array([[0.0, 4.0, 1.0]]), np.array([[0.0, -1.0, 0.0]]), target_appearance)
    module_px = 0.02 * camera.focal_px / 4
    blur_px = camera.circle_of_confusion_px(np.array([[0.0, 4.0, 1.0]]))[0]
    for name, expected in (("module-size", module_px**-2), ("relative-defocus", (blur_px / module_px) ** 2)):
        matrix = calibration_factor(name).covariance(views).matrix(1, 1)[0, 0]
        np.testing.assert_allclose(matrix, expected * np.eye(2), rtol=1e-9)
        with pytest.raises(RangeError, match="no appearance"):
            calibration_factor(name).covariance(Views([camera], views.points_m, views.normals))
