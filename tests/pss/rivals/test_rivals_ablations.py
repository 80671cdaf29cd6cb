"""Nulls and ablations: a score that knows nothing, means over views, and PSS with another model of R."""

import dataclasses
import math

import numpy as np
import pytest

from pss import (
    Appearance,
    ConstantVelocity,
    FieldOfView,
    ImageSensor,
    PerPoint,
    PositionFix,
    PTZCamera,
    RandomWalk,
    SelfOcclusion,
    evaluate,
    noise_model,
)
from pss.noise import BrightnessContrast, Defocus, DistanceIncidence, IdentityNoise, NoiseModel, Resolution
from pss.rivals.ablations import evaluation_with
from tests.helpers.rivals import APPEARANCE, BALL, BY_NAME, CAMERAS, scene, scene_points

# Relative; the same sums in another order.
SAME_TO_ROUNDING = 1e-9
# Relative; other sensors' part is what is left of J after the cameras' is taken away, some digits of it.
OTHER_SENSORS = 1e-6
# Relative: the next term of P∞ = Q + C − C²/Q + … is C/Q, here (17 mm)²/(1 m)² at most.
LARGE_Q = 1e-3


def score(name, evaluation):
    return BY_NAME[name].score(evaluation)


# ---- nulls -----------------------------------------------------------------------------------------------------------


def test_the_random_score_depends_on_every_setting_and_on_nothing_else():
    first = score("random", scene(CAMERAS))
    assert score("random", scene(CAMERAS[::-1], noise="identity", process=RandomWalk(0.1))) == first
    assert score("random", scene([dataclasses.replace(CAMERAS[0], name="left"), *CAMERAS[1:]])) == first
    changes = [
        {"pan_deg": CAMERAS[0].pan_deg + 1e-9},
        {"zoom": 2.5},
        {"focus_distance_m": 3.0},
        {"f_number": 2.0},
        {"resolution": (640, 480)},
        {"radial_distortion": (0.01, 0.0)},
        {"position_m": (-2.8, 0.2, 2.7)},
    ]
    others = {score("random", scene([dataclasses.replace(CAMERAS[0], **c), *CAMERAS[1:]])) for c in changes}
    assert len(others | {first}) == len(changes) + 1


def test_the_random_score_is_spread_from_zero_to_one():
    scores = [
        score("random", evaluate([PTZCamera((x, -4, 1), 0, 0)], [[0, 0, 1]], [[0, -1, 0]])) for x in np.arange(200.0)
    ]
    assert 0 <= min(scores) < 0.05
    assert 0.95 < max(scores) < 1
    assert np.mean(scores) == pytest.approx(0.5, abs=4 / math.sqrt(12 * 200))


def test_means_over_views_are_loops_over_visible_points():
    result, distances, densities = scene(CAMERAS), [], []
    for camera, seen in zip(CAMERAS, result.visible, strict=True):
        for point in result.points_m[seen]:
            distances.append(math.dist(camera.position_m, point))
            step = 1e-4 * camera.rotation[0]  # across the axis
            moved = camera.project(point + step)[0] - camera.project(point - step)[0]
            densities.append(np.linalg.norm(moved) / 0.2)
    assert score("mean-distance", result) == pytest.approx(np.mean(distances))
    assert score("pixels-per-mm", result) == pytest.approx(np.mean(densities))


# ---- another model of R ----------------------------------------------------------------------------------------------


def same(found, expected, rel=SAME_TO_ROUNDING):
    np.testing.assert_array_equal(found.observable, expected.observable)
    for name in ("information", "sigma_m", "single_frame_sigma_m", "covariance"):
        size = np.nanmax(np.abs(getattr(expected, name)))
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), rtol=rel, atol=1e-12 * size)
    assert found.pss == pytest.approx(expected.pss, rel=rel)


MODELS = {
    "plain": {},
    "tightened visibility": {"visibility": (FieldOfView(40), SelfOcclusion(60))},
    "velocity": {"process": ConstantVelocity(0.05)},
    "two processes": {"process": PerPoint([RandomWalk(), ConstantVelocity(0.05)], np.arange(44) % 2)},
}


@pytest.mark.parametrize("models", MODELS.values(), ids=MODELS)
@pytest.mark.parametrize("noise", ["as-printed", "corrected", "physical", "identity"])
def test_another_noise_model_is_what_evaluate_says_with_it(noise, models):
    """Whatever the model was before; visibility stays as it was asked for."""
    expected = scene(CAMERAS, noise=noise, **models)
    for before in ("as-printed", "identity"):
        same(evaluation_with(scene(CAMERAS, noise=before, **models), noise_model(noise)), expected)
    assert 0 < expected.observable.mean() < 1


@pytest.mark.parametrize("process", [RandomWalk(), ConstantVelocity(0.05)], ids=["walk", "velocity"])
def test_other_sensors_keep_what_they_measured(process):
    fix = PositionFix(5e-3)
    before, expected = (
        scene(CAMERAS, noise=noise, process=process, sensors=[fix]) for noise in ("as-printed", "identity")
    )
    same(evaluation_with(before, noise_model("identity")), expected, OTHER_SENSORS)
    assert expected.observable.all()
    nobody = scene([], sensors=[fix])
    assert evaluation_with(nobody, noise_model("identity")).pss == nobody.pss > 0


class Velocimeter:
    """Measures the velocity, which only a state of six numbers has."""

    name = "velocimeter"

    def measure(self, points_m):
        return np.zeros_like(points_m)

    def jacobian(self, points_m):
        return np.tile(np.eye(3, 6, 3), (len(points_m), 1, 1))

    def covariance(self, points_m):
        return np.tile(1e-4 * np.eye(3), (len(points_m), 1, 1))

    def reaches(self, points_m, normals, occluder):
        return np.ones(len(points_m), dtype=bool)


def test_what_is_measured_beyond_the_position_stays():
    models = {"process": ConstantVelocity(0.05), "sensors": [Velocimeter()]}
    before, expected = (scene(CAMERAS, noise=noise, **models) for noise in ("as-printed", "identity"))
    assert expected.information.shape[1:] == (6, 6)
    same(evaluation_with(before, noise_model("identity")), expected, OTHER_SENSORS)
    assert expected.pss > scene(CAMERAS, noise="identity", process=ConstantVelocity(0.05)).pss


ALONE = {
    "pss-identity-noise": lambda views: np.ones_like(views.range_m),
    "pss-distance-alone": lambda views: views.range_m**2,
    "pss-incidence-printed-alone": lambda views: np.maximum(views.cos_incidence, 0) + 1 / 12,
    "pss-incidence-corrected-alone": lambda views: 1 / np.maximum(views.cos_incidence, 0.01),
    "pss-defocus-alone": lambda views: views.circle_of_confusion_px**2 + 1 / 12,
}


@pytest.mark.parametrize("name", ALONE)
def test_each_factor_alone_is_pss_with_its_r(name):
    """R by hand, isotropic, as a factor of the user's."""

    class ByHand:
        name = "by hand"

        def covariance(self, views):
            return IdentityNoise().covariance(views) * ALONE[name](views)

    expected = scene(CAMERAS, noise=NoiseModel("by hand", (ByHand(),))).pss
    assert score(name, scene(CAMERAS)) == pytest.approx(expected, rel=SAME_TO_ROUNDING)
    assert expected != pytest.approx(scene(CAMERAS).pss, rel=1e-3)


def test_resolution_and_contrast_alone():
    for name, factor in (
        ("pss-resolution-alone", Resolution()),
        ("pss-brightness-contrast-alone", BrightnessContrast()),
    ):
        expected = scene(CAMERAS, noise=NoiseModel("alone", (factor,))).pss
        assert score(name, scene(CAMERAS)) == pytest.approx(expected, rel=SAME_TO_ROUNDING)
    assert score("pss-brightness-contrast-alone", scene(CAMERAS, appearance=None)) == 0


def test_a_factor_alone_keeps_the_constants_of_the_evaluations_model():
    """The scale of Eq. 11, the dark noise, the sensor; a weight says how much of a factor, and alone it is all."""
    model = NoiseModel(
        "own",
        (
            DistanceIncidence(corrected=True, px2_per_m2=3.0),
            Resolution(2e-3),
            Defocus(),
            BrightnessContrast(ImageSensor(exposure_ms=0.5)),
        ),
    ).weighted({"resolution": 0.0})
    expected = {
        "pss-distance-alone": DistanceIncidence(incidence=False, px2_per_m2=3.0),
        "pss-incidence-corrected-alone": DistanceIncidence(corrected=True, distance=False, px2_per_m2=3.0),
        "pss-resolution-alone": Resolution(2e-3),
        "pss-brightness-contrast-alone": BrightnessContrast(ImageSensor(exposure_ms=0.5)),
    }
    result = scene(CAMERAS, noise=model)
    for name, factor in expected.items():
        alone = scene(CAMERAS, noise=NoiseModel("alone", (factor,))).pss
        assert score(name, result) == pytest.approx(alone, rel=SAME_TO_ROUNDING), name
        assert score(name, scene(CAMERAS)) != pytest.approx(alone, rel=1e-3), name


def test_darker_targets_lower_what_contrast_alone_says_and_nothing_else():
    dark = Appearance(0.01, 0.001, 0.0001)
    values = {
        name: [score(name, scene(CAMERAS, appearance=a)) for a in (APPEARANCE, dark)]
        for name in (*ALONE, "pss-posterior")
    }
    assert all(bright == dim for bright, dim in values.values())
    bright, dim = (score("pss-brightness-contrast-alone", scene(CAMERAS, appearance=a)) for a in (APPEARANCE, dark))
    assert dim < bright


# ---- before and after the update -------------------------------------------------------------------------------------


def test_the_posterior_is_between_the_prior_and_what_q_allows():
    """P⁺ = P∞ − Q for a random walk: σ⁺² = σ∞² − q."""
    result = scene(CAMERAS, process=RandomWalk(2e-3))
    expected = np.nansum(1 / np.sqrt(result.sigma_m**2 - 4e-6)) / len(result.sigma_m)
    assert score("pss-posterior", result) == pytest.approx(expected, rel=SAME_TO_ROUNDING)
    assert result.pss < score("pss-posterior", result)


def test_without_a_process_the_posterior_is_c_and_the_prior_is_q_and_c():
    """Q → ∞: a step of 1 m against millimetres."""
    result = scene(CAMERAS, process=RandomWalk(1.0))
    seen = result.observable
    assert score("pss-posterior", result) == pytest.approx(result.pss_single_frame, rel=LARGE_Q)
    gathered = result.covariance[seen] - np.eye(3)
    C = result.single_frame_covariance[seen]
    size = np.linalg.norm(C, axis=(1, 2))
    assert (np.linalg.norm(gathered - C, axis=(1, 2)) < LARGE_Q * size).all()
    still = scene(CAMERAS, process=RandomWalk(1e-5))
    assert score("pss-posterior", still) > 2 * still.pss_single_frame


def test_the_scene_hides_some_points():
    points, _ = scene_points()
    result = scene(CAMERAS, occluder=[BALL])
    assert len(points) == 44
    assert 0 < result.observable.sum() < 44
