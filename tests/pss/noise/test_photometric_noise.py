"""Brightness and contrast: the closed form against the Fisher information of tags drawn pixel by pixel."""

import dataclasses
import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from pss import Appearance, ImageSensor, PTZCamera, RangeError, ShapeError, evaluate, noise_model
from pss.cameras.sensor import electrons_per_radiance
from pss.noise import BrightnessContrast, NoiseModel

# The closed form is of an average tag, the pixels' of a mean over CODES random ones.
CODES = 12
# The variance: random tags, which are not quite symmetric, know their centres less well than an average one (0.06 to
# 0.16 here). An edge sharper than a pixel is known better or worse by where in the pixel it falls.
RESOLVED, SHARPER_THAN_A_PIXEL = 0.25, 0.8
# A way of most of a module that crosses both kinds of edges askew: neighbours overlap as boxes do, not as Gaussians.
SLANTED_WAY = 0.5
PSF_UM = 3.5
SUPER = 8

SENSOR = ImageSensor()
CAMERA = PTZCamera((0, 0, 1), 0, 0, zoom=4, focus_distance_m=3)
POINT = np.array([[0.0, 3.0, 1.0]])


def appearance(module_m=0.03, white=0.05, black=0.006, along=((1.0, 0.0, 0.0),)):
    return Appearance(module_m, white, black, np.array(along))


def covariance(target_appearance, camera=CAMERA, point=POINT, normal=((0.0, -1.0, 0.0),), **changed):
    camera = dataclasses.replace(camera, **changed)
    return NoiseModel("alone", (BrightnessContrast(SENSOR),)).covariance(camera, point, normal, target_appearance)[0]


def smeared(image, way):
    """An image that goes `way` (x, y in its own samples), evenly and straight: its transform times that of a box."""
    rows, columns = (np.fft.fftfreq(count) for count in image.shape)
    box = np.sinc(columns[: image.shape[1] // 2 + 1] * way[0] + rows[:, None] * way[1])
    return np.fft.irfft2(np.fft.rfft2(image) * box, image.shape)


def drawn_covariance(sides_px, blur_px, white_e, black_e, sensor, rng, way_px=(0.0, 0.0)):
    """px², the Cramér–Rao bound of a tag's centre, estimated with its homography, gain and offset: mean over codes.

    `sides_px` (2, 2) has a module's two sides in its columns. The image is drawn SUPER times finer, blurred by all
    that `blur_px` is made of, and smeared evenly along `way_px`.
    """
    reach = 4.6 * np.abs(sides_px).sum(axis=1) + 5 * blur_px + np.abs(way_px)
    half = np.ceil(reach).astype(int)
    fine = [(np.arange((2 * h + 1) * SUPER) + 0.5) / SUPER - h - 0.5 for h in half]
    x, y = np.meshgrid(*fine)
    u, v = np.linalg.inv(sides_px) @ np.stack([x.ravel(), y.ravel()])
    total = np.zeros((2, 2))
    for _ in range(CODES):
        tag = np.zeros((6, 6))
        tag[1:5, 1:5] = rng.integers(0, 2, (4, 4))
        column, row = np.floor(u + 3).astype(int), np.floor(v + 3).astype(int)
        inside = (column >= 0) & (column < 6) & (row >= 0) & (row < 6)
        paper = np.ones(u.shape)
        paper[inside] = tag[row[inside], column[inside]]
        image = gaussian_filter(paper.reshape(x.shape), blur_px * SUPER, truncate=6)
        if any(way_px):
            image = smeared(image, np.multiply(way_px, SUPER))
        slope_y, slope_x = np.gradient(image, 1 / SUPER)
        middle = np.s_[SUPER // 2 :: SUPER, SUPER // 2 :: SUPER]
        level, gx, gy, px, py = (a[middle].ravel() for a in (image, slope_x, slope_y, x, y))
        beyond = np.linalg.inv(sides_px) @ np.stack([px, py])
        outside = np.abs(beyond).max(axis=0) > 4 + np.abs(np.linalg.inv(sides_px) @ way_px).max() / 2
        level, gx, gy, px, py = (a[~outside] for a in (level, gx, gy, px, py))
        radial = px * gx + py * gy
        columns = [gx, gy, px * gx, py * gx, px * gy, py * gy, px * radial, py * radial]
        G = np.stack([(white_e - black_e) * c for c in columns] + [level, np.ones_like(level)], axis=1)
        # The noise of the level between black and white, as the closed form has it.
        noise = float(sensor.noise_electrons(np.array((white_e + black_e) / 2))) ** 2
        scale = np.linalg.norm(G, axis=0)
        total += (np.linalg.inv((G / scale).T @ (G / scale)) / np.outer(scale, scale))[:2, :2] * noise
    return total / CODES


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module_m", "normal", "focus_m", "psf_um", "tolerance"),
    [
        (0.02, (0, -1, 0), 3.0, PSF_UM, RESOLVED),
        (0.015, (0, -1, 0), 3.0, PSF_UM, RESOLVED),
        (0.005, (0, -1, 0), 3.0, PSF_UM, RESOLVED),
        (0.015, (0.6, -0.8, 0), 3.0, PSF_UM, RESOLVED),
        (0.015, (0.9, -0.436, 0), 3.0, PSF_UM, RESOLVED),
        (0.015, (0.5, -0.6, 0.6245), 3.0, PSF_UM, RESOLVED),
        (0.015, (0, -1, 0), 1.5, 0.0, RESOLVED),
        (0.007, (0.6, -0.8, 0), 1.5, 0.0, RESOLVED),
        (0.02, (0, -1, 0), 3.0, 0.0, SHARPER_THAN_A_PIXEL),
        (0.015, (0.6, -0.8, 0), 3.0, 0.0, SHARPER_THAN_A_PIXEL),
    ],
)
def test_the_closed_form_is_the_bound_of_drawn_tags(module_m, normal, focus_m, psf_um, tolerance):
    """Compared along every direction, so that the ellipse's turn counts: eigenvalues of drawn⁻¹ · closed."""
    camera = dataclasses.replace(CAMERA, focus_distance_m=focus_m)
    normal = np.array(normal) / np.linalg.norm(normal)
    along = np.cross([0, 0, 1.0], normal)
    along /= np.linalg.norm(along)
    target_appearance = appearance(module_m, along=[along])
    closed = covariance(target_appearance, camera, normal=[normal], psf_sigma_um=psf_um)
    sides = camera.jacobian(POINT)[0] @ np.stack([along, np.cross(normal, along)], axis=1) * module_m
    blur = math.sqrt((psf_um / 4.65) ** 2 + 1 / 12 + (float(camera.circle_of_confusion_px(POINT)[0]) / 4) ** 2)
    electrons = electrons_per_radiance(camera, SENSOR)
    drawn = drawn_covariance(sides, blur, 0.05 * electrons, 0.006 * electrons, SENSOR, np.random.default_rng(0))
    ratios = np.linalg.eigvals(np.linalg.solve(drawn, closed)).real
    assert np.abs(np.log(ratios)).max() < math.log(1 + tolerance), ratios


@pytest.mark.slow
@pytest.mark.parametrize(
    ("module_m", "normal", "way", "tolerance"),
    [
        # The way in modules along the tag's sides.
        (0.015, (0, -1, 0), (0.25, 0.0), RESOLVED),
        (0.015, (0, -1, 0), (0.3, 0.3), RESOLVED),
        (0.005, (0, -1, 0), (0.4, 0.0), RESOLVED),
        (0.015, (0.5, -0.6, 0.6245), (0.5, 0.0), RESOLVED),
        (0.010, (0, -1, 0), (0.0, 0.8), RESOLVED),
        (0.015, (0.5, -0.6, 0.6245), (0.5, -0.6), SLANTED_WAY),
    ],
)
def test_the_closed_form_is_the_bound_of_drawn_tags_that_move(module_m, normal, way, tolerance):
    """Smeared by an even way, which the closed form takes for a Gaussian: again along every direction."""
    normal = np.array(normal) / np.linalg.norm(normal)
    along = np.cross([0, 0, 1.0], normal)
    along /= np.linalg.norm(along)
    sides_m = np.stack([along, np.cross(normal, along)], axis=1) * module_m
    velocity = sides_m @ way / (SENSOR.exposure_ms * 1e-3)
    target_appearance = dataclasses.replace(appearance(module_m, along=[along]), velocity_m_per_s=velocity[None])
    closed = covariance(target_appearance, normal=[normal], psf_sigma_um=PSF_UM)
    sides = CAMERA.jacobian(POINT)[0] @ sides_m
    blur, electrons = math.sqrt((PSF_UM / 4.65) ** 2 + 1 / 12), electrons_per_radiance(CAMERA, SENSOR)
    levels = 0.05 * electrons, 0.006 * electrons
    drawn = drawn_covariance(sides, blur, *levels, SENSOR, np.random.default_rng(0), sides @ way)
    ratios = np.linalg.eigvals(np.linalg.solve(drawn, closed)).real
    assert np.abs(np.log(ratios)).max() < math.log(1 + tolerance), ratios


def test_foreshortening_makes_the_covariance_full():
    """A tag that faces the camera has the same noise in all directions; one turned about a slant has not."""
    facing = covariance(appearance())
    assert facing[0, 0] == pytest.approx(facing[1, 1], rel=1e-9)
    assert facing[0, 1] == pytest.approx(0, abs=1e-12 * facing[0, 0])
    slanted = covariance(appearance(), normal=[np.array([0.5, -0.7071, 0.5])])
    assert abs(slanted[0, 1]) > 0.05 * slanted[0, 0]
    assert np.trace(slanted) > np.trace(facing)


def test_it_follows_the_light():
    """Shot noise alone: variance ∝ 1/electrons; contrast: less of it, more noise. White tags are told to 1/√signal."""
    quiet = dataclasses.replace(SENSOR, read_noise_e=0.0, bits=16, full_well_e=1e9, black_level_dn=0)
    quiet = dataclasses.replace(quiet, full_well_e=1e6)
    factor = NoiseModel("alone", (BrightnessContrast(quiet),))
    dim, bright = (
        factor.covariance(CAMERA, POINT, [[0, -1, 0]], appearance(white=w, black=w / 10))[0, 0, 0] for w in (0.5, 2.0)
    )
    assert dim / bright == pytest.approx(4, rel=0.02)  # what is left of quantisation
    contrasts = [covariance(appearance(black=b))[0, 0] for b in (0.0, 0.02, 0.04)]
    assert contrasts[0] < contrasts[1] < contrasts[2]
    saturated = covariance(appearance(white=50.0, black=40.0))
    assert np.isinf(saturated[0, 0])


def test_blur_and_size_work_as_an_edge_says():
    """σ² ∝ s/module while modules are wide; where they merge it rises faster."""
    sizes = np.array([0.02, 0.04, 0.08])
    sharp = np.array([covariance(appearance(size))[0, 0] for size in sizes])
    np.testing.assert_allclose(sharp[:-1] / sharp[1:], 2.0, rtol=1e-2)
    blurred = [covariance(appearance(), psf_sigma_um=4.65 * s)[0, 0] for s in (1.0, 2.0, 12.0, 24.0)]
    assert blurred[1] / blurred[0] == pytest.approx(math.sqrt((4 + 1 / 12) / (1 + 1 / 12)), rel=0.05)
    assert blurred[3] / blurred[2] > 2.5


def test_a_target_in_the_dark_tells_nothing_and_is_no_error():
    """No contrast, no information: a point seen by cameras that cannot tell it is unobservable."""
    cameras = [PTZCamera((x, 0, 1), 0, 0, zoom=2, focus_distance_m=3).aimed_at(POINT[0]) for x in (-1, 1)]
    dark = dataclasses.replace(SENSOR, full_well_e=1e-3)
    result = evaluate(
        cameras, POINT, [[0, -1, 0]], noise=noise_model("physical", sensor=dark), appearance=appearance(50.0, 40.0)
    )
    lit = evaluate(cameras, POINT, [[0, -1, 0]], noise="physical", appearance=appearance())
    assert result.visible.all()
    assert not result.observable.any()
    assert result.pss == 0 < lit.pss


def test_cameras_may_differ_in_their_sensor():
    cameras = [dataclasses.replace(CAMERA, name=name) for name in ("old", "new")]
    sensors = {"old": dataclasses.replace(SENSOR, read_noise_e=60.0), "new": SENSOR}
    result = evaluate(
        cameras, POINT, [[0, -1, 0]], noise=noise_model("physical", sensor=sensors), appearance=appearance()
    )
    assert result.noise_px2[0, 0, 0, 0] > 2 * result.noise_px2[1, 0, 0, 0]
    with pytest.raises(RangeError, match="no value for the camera 'new'; allowed: old"):
        noise_model("physical", sensor={"old": SENSOR}).covariance(cameras[1], POINT, [[0, -1, 0]], appearance())


def test_no_cameras_are_no_error():
    nothing = evaluate([], POINT, [[0, -1, 0]], noise="physical", appearance=appearance())
    assert nothing.noise_px2.shape == (0, 1, 2, 2)
    assert nothing.pss == 0
    by_name = noise_model("as-printed", ccd_noise={"1": 1e-3})
    assert evaluate([], POINT, [[0, -1, 0]], noise=by_name).pss == 0


@pytest.mark.parametrize(
    ("make", "error", "message"),
    [
        (lambda: evaluate([CAMERA], POINT, [[0, -1, 0]], noise="physical"), RangeError, "has no appearance; allowed"),
        (lambda: appearance(module_m=-1.0), RangeError, "module_m = .*-1.0.*allowed: 0 or more"),
        (lambda: appearance(module_m=0.0), RangeError, "module_m holds 0; allowed: above 0"),
        (lambda: appearance(white=0.001), RangeError, "black is not darker"),
        (lambda: Appearance([0.1, 0.1], [0.1] * 3, 0.01), ShapeError, "lengths .2, 3.; allowed: one"),
        (
            lambda: evaluate([CAMERA], POINT, [[0, -1, 0]], appearance=Appearance([0.1, 0.1], 0.1, 0.01)),
            ShapeError,
            "length 2; allowed: 1",
        ),
        (lambda: dataclasses.replace(CAMERA, psf_sigma_um=-1.0), RangeError, "psf_sigma_um = -1.0; allowed: 0 or more"),
        (
            lambda: dataclasses.replace(CAMERA, aperture_blades=2),
            RangeError,
            "aperture_blades = 2; allowed: 0 for a round",
        ),
    ],
)
def test_mistakes_are_named_with_what_is_allowed(make, error, message):
    with pytest.raises(error, match=message):
        make()
