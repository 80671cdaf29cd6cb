"""The noise models, Eqs. 11–15, by hand on two small cameras."""

import numpy as np
import pytest

from pss import NOISE_MODELS, Appearance, NoiseModel, PSSError, PTZCamera, RangeError, noise_model
from pss.noise import (
    DEFAULT_CCD_NOISE,
    SMALLEST_COS_INCIDENCE,
    Defocus,
    DistanceIncidence,
    IdentityNoise,
    PixelCovariance,
    Resolution,
)

# Relative; a few roundings.
SAME_TO_ROUNDING = 1e-12

# f_px = 500, v = 5 mm, f = 1/200.5 m, a = 1/401 m, focus at 2 m (by hand in tests/pss/cameras/test_camera.py).
CAMERA = PTZCamera((0, 0, 0), 0, 0, resolution=(1000, 800), pixel_pitch_m=1e-5, focus_distance_m=2, f_number=2)
# A 3-4-5 triangle: D = 5 m, depth 4 m, cos θ = 0.8; the second normal is turned to cos α = 1, the first has 0.8.
POINTS = np.array([[3.0, 4.0, 0.0], [3.0, 4.0, 0.0]])
APPEARANCE = Appearance(module_m=0.02, white_w_per_m2_sr=0.05, black_w_per_m2_sr=0.005)
NORMALS = np.array([[0.0, -1.0, 0.0], [-0.6, -0.8, 0.0]])
FACTORS = ("distance-incidence", "resolution", "defocus")


def alone(factor) -> NoiseModel:
    """A model of one factor, with the convenience of looking at one camera."""
    return NoiseModel("alone", (factor,))


def diagonal(factor) -> np.ndarray:
    covariance = alone(factor).covariance(CAMERA, POINTS, NORMALS)
    assert covariance.shape == (2, 2, 2)
    np.testing.assert_array_equal(covariance[:, [0, 1], [1, 0]], 0)
    return covariance[:, [0, 1], [0, 1]]


def test_equation_11_as_printed_by_hand():
    """D² cos α: 25 · 0.8 = 20 and 25 · 1 = 25, on both axes."""
    np.testing.assert_allclose(diagonal(DistanceIncidence()), [[20, 20], [25, 25]], rtol=SAME_TO_ROUNDING)
    np.testing.assert_allclose(diagonal(DistanceIncidence(px2_per_m2=0.1)), [[2, 2], [2.5, 2.5]], rtol=SAME_TO_ROUNDING)


def test_the_correction_divides_by_the_cosine():
    """D² / cos α: 25 / 0.8 = 31.25 and 25, so that noise falls as the surface turns to the camera."""
    values = diagonal(DistanceIncidence(corrected=True))
    np.testing.assert_allclose(values, [[31.25, 31.25], [25, 25]], rtol=SAME_TO_ROUNDING)


def test_printed_and_corrected_disagree_about_the_direction():
    turned = np.radians([0, 30, 60, 80, 89])
    normals = np.column_stack([np.sin(turned), -np.cos(turned), np.zeros(5)])
    points = np.tile([0.0, 2.0, 0.0], (5, 1))
    printed, corrected = (
        alone(DistanceIncidence(corrected=c)).covariance(CAMERA, points, normals)[:, 0, 0] for c in (False, True)
    )
    assert (np.diff(printed) < 0).all()
    assert (np.diff(corrected) > 0).all()
    np.testing.assert_allclose(printed * corrected, 2.0**4, rtol=SAME_TO_ROUNDING)


def test_only_the_corrected_model_is_bounded_at_grazing_incidence():
    """D²/cos α would grow without bound; D² cos α falls to zero, and as printed it stays as printed."""
    for cosine, corrected in ((1e-3, 25 / SMALLEST_COS_INCIDENCE), (0.02, 25 / 0.02)):
        sine = np.sqrt(1 - cosine**2)
        # the direction to the camera, (−0.6, −0.8), and the one across it
        normal = cosine * np.array([[-0.6, -0.8, 0.0]]) + sine * np.array([[-0.8, 0.6, 0.0]])
        for factor, expected in ((DistanceIncidence(), 25 * cosine), (DistanceIncidence(corrected=True), corrected)):
            covariance = alone(factor).covariance(CAMERA, POINTS[:1], normal)
            np.testing.assert_allclose(covariance[0], expected * np.eye(2), rtol=1e-9)


def test_equations_12_and_13_by_hand():
    """(0.001 · 1000 · 0.8)² = 0.64 across and (0.001 · 800 · 0.8)² = 0.4096 down: the sensor is wider than high."""
    np.testing.assert_allclose(diagonal(Resolution(0.001)), [[0.64, 0.4096]] * 2, rtol=SAME_TO_ROUNDING)


def test_equations_14_and_15_by_hand():
    """cc = a·f_px/d·|z − d|/z = 125/401 px at a depth of 4 m, though the range is 5 m."""
    np.testing.assert_allclose(diagonal(Defocus()), [[(125 / 401) ** 2] * 2] * 2, rtol=SAME_TO_ROUNDING)
    in_focus = alone(Defocus()).covariance(CAMERA, np.array([[0.0, 2.0, 0.0]]), NORMALS[:1])
    np.testing.assert_allclose(in_focus, 0, atol=1e-20)


def test_identity_is_the_same_everywhere():
    np.testing.assert_array_equal(diagonal(IdentityNoise()), np.ones((2, 2)))
    np.testing.assert_array_equal(noise_model("identity").covariance(CAMERA, POINTS, NORMALS), [np.eye(2)] * 2)


@pytest.mark.parametrize(("name", "first"), [("as-printed", 20), ("corrected", 31.25)])
def test_a_model_is_the_sum_of_its_factors_by_hand(name, first):
    """R_k = R_k1 + R_k2 + R_k3 (section 4), at the first point."""
    covariance = noise_model(name, ccd_noise=0.001).covariance(CAMERA, POINTS, NORMALS)
    blur = (125 / 401) ** 2
    expected = np.diag([first + 0.64 + blur, first + 0.4096 + blur])
    np.testing.assert_allclose(covariance[0], expected, rtol=SAME_TO_ROUNDING)


@pytest.mark.parametrize("name", ["as-printed", "corrected"])
def test_every_factor_can_be_switched_off_and_what_is_left_adds_up(name):
    whole = noise_model(name)
    single = {
        kept: noise_model(name, switched_off=[factor for factor in FACTORS if factor != kept]) for kept in FACTORS
    }
    for kept, model in single.items():
        assert [factor.name for factor in model.factors] == [kept]
    parts = sum(model.covariance(CAMERA, POINTS, NORMALS) for model in single.values())
    total = whole.covariance(CAMERA, POINTS, NORMALS)
    np.testing.assert_allclose(total, parts, rtol=SAME_TO_ROUNDING)
    for off in FACTORS:
        without = whole.without(off)
        rest = total - single[off].covariance(CAMERA, POINTS, NORMALS)
        np.testing.assert_allclose(without.covariance(CAMERA, POINTS, NORMALS), rest, rtol=1e-9, atol=1e-12)
        assert without.name == f"{name} without {off}"


def test_a_wide_sensor_makes_the_noise_anisotropic_and_a_square_one_does_not():
    for resolution, ratio in (((1000, 800), 1.25), ((800, 1000), 0.8), ((900, 900), 1.0)):
        camera = PTZCamera((0, 0, 0), 0, 0, resolution=resolution)
        covariance = alone(Resolution()).covariance(camera, POINTS, NORMALS)
        np.testing.assert_allclose(covariance[:, 0, 0] / covariance[:, 1, 1], ratio**2, rtol=SAME_TO_ROUNDING)
        others = noise_model("as-printed").without("resolution").covariance(camera, POINTS, NORMALS)
        np.testing.assert_array_equal(others[:, 0, 0], others[:, 1, 1])


@pytest.mark.parametrize("name", NOISE_MODELS)
def test_every_model_gives_positive_definite_covariances_for_any_number_of_points(name):
    rng = np.random.default_rng(3)
    points = rng.uniform((-2, 0.5, -2), (2, 9, 2), (200, 3))
    normals = -points / np.linalg.norm(points, axis=1, keepdims=True)
    for count in (0, 1, 200):
        covariance = noise_model(name).covariance(CAMERA, points[:count], normals[:count], APPEARANCE)
        assert covariance.shape == (count, 2, 2)
        assert (np.linalg.eigvalsh(covariance) > 0).all()


def test_a_users_own_factor_fits_in():
    class Flicker:
        name = "flicker"

        def covariance(self, views):
            return PixelCovariance.from_matrix(np.diag([4.0, 9.0]))

    model = NoiseModel("mine", (Resolution(0.001), Flicker()))
    np.testing.assert_allclose(model.covariance(CAMERA, POINTS, NORMALS)[0], np.diag([4.64, 9.4096]))
    assert model.without("resolution").factors[0].name == "flicker"


def test_the_constants_that_the_paper_leaves_open():
    """Eq. 11 at 1 px²/m²; CCDnoise is dark noise over full well, 6 e⁻ over 10 000 e⁻."""
    assert pytest.approx(6 / 10_000) == DEFAULT_CCD_NOISE
    first, second, _ = noise_model("as-printed").factors
    assert first == DistanceIncidence(corrected=False, px2_per_m2=1.0)
    assert second == Resolution(ccd_noise=DEFAULT_CCD_NOISE)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: noise_model("printed"), "'printed'; allowed: as-printed, corrected"),
        (lambda: noise_model("as-printed", ccd_noise=0.0), r"ccd_noise = 0\.0.*allowed: above 0"),
        (lambda: noise_model("as-printed", px2_per_m2=-1.0), r"px2_per_m2 = -1\.0; allowed: above 0"),
        (lambda: noise_model("as-printed", ccd_noise=np.nan), "nan.*allowed: above 0"),
        (lambda: noise_model("as-printed", switched_off=["focus"]), "'focus' is not in .*allowed: distance-incidence"),
        (lambda: noise_model("as-printed", switched_off=FACTORS), "no factor left; allowed: at least one"),
    ],
)
def test_mistakes_are_named_with_what_is_allowed(make, message):
    with pytest.raises(RangeError, match=message) as caught:
        make()
    assert isinstance(caught.value, PSSError)
    assert isinstance(caught.value, ValueError)
