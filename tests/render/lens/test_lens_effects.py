"""What the lens has beyond Mitsuba's: blur in focus, radial distortion, blades; each against another route."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from pss import PTZCamera, RangeError
from pss.cameras.distortion import furthest_radius, stretch
from render.lens import thin_lens
from render.lens.lens_effects import PlaceOnFilm
from render.lens.sampling import Sampling, pixel_means, sample_image
from render.sensor import relative_illumination
from tests.helpers.views import window
from validate.markers.detect import find_markers
from validate.markers.localise import localise

pytestmark = pytest.mark.render

SAMPLES = 4096
# W/(m² sr) over the contrast of a marker: sampling noise of SAMPLES samples and the Gaussian's discretisation.
SAME_BLUR = 0.01
# px, mean over the found markers per axis: the localisation's own bias is below 0.01, and a marker's curvature by
# distortion, which a homography cannot follow, adds a little.
LOOP_MEAN_PX, LOOP_RMS_PX = 0.02, 0.04
LENSES = [(-0.12, 0.0), (0.06, 0.02)]
# px on the image, where a sample is drawn for another place than its own; single precision of 1,000 px is 6e-5.
SAME_PLACE_PX = 1e-3


def noise_free(camera, renderer, mi, extra=True):
    """W/(m² sr), (height, width), by SAMPLES samples in every pixel."""
    sampler = pixel_means(renderer._scene, thin_lens.load_sensor(camera, mi), mi, camera if extra else None)
    most = Sampling(fewest=SAMPLES, most=SAMPLES)
    rng = np.random.default_rng(0)
    return sample_image(sampler, camera.resolution, lambda image: np.ones_like(image), most, rng).mean


def test_quantiles_of_a_pixels_response():
    """Mean ½, variance 1/12 + σ² (Sheppard), symmetric; the pixel itself without blur."""
    np.testing.assert_array_equal(np.diff(thin_lens.pixel_response(0.0)), 1 / thin_lens.RESPONSE_QUANTILES)
    for sigma in (0.1, 0.5, 3.0):
        table = thin_lens.pixel_response(sigma)
        middle = (table[1:] + table[:-1]) / 2
        assert middle.mean() == pytest.approx(0.5, abs=1e-6)
        assert middle.var() == pytest.approx(1 / 12 + sigma**2, rel=6e-3)  # the outermost steps of the table are long
        np.testing.assert_allclose(table + table[::-1], 1.0, atol=1e-6)


@pytest.mark.parametrize("sigma_px", [0.6, 1.5])
def test_blur_in_focus_is_a_gaussian_on_the_image(room, room_renderer, mi, sigma_px):
    """A render with blur is the convolution of the render without."""
    camera = window(room.camera("4"), room.state.points_m[20], (48, 40))
    blurred = dataclasses.replace(camera, psf_sigma_um=sigma_px * camera.pixel_pitch_m * 1e6)
    assert blurred.psf_sigma_px == pytest.approx(sigma_px)
    sharp, found = (noise_free(c, room_renderer, mi).astype(float) for c in (camera, blurred))
    margin = math.ceil(5 * sigma_px)
    inside = np.s_[margin:-margin, margin:-margin]
    # Discrete convolution of pixel-integrated values: exact but for frequencies beyond the pixel's own.
    expected = gaussian_filter(sharp, sigma_px, truncate=6)
    contrast = sharp.max() - sharp.min()
    assert np.abs(found - expected)[inside].max() < (SAME_BLUR if sigma_px > 1 else 6 * SAME_BLUR) * contrast
    assert np.abs(found - sharp)[inside].max() > 12 * SAME_BLUR * contrast


@pytest.mark.parametrize("distortion", LENSES, ids=str)
def test_distorted_markers_are_found_where_the_camera_model_puts_them(room, room_renderer, mi, distortion):
    """The loop closes: rendered through the distorting lens, registered, compared with `project`."""
    camera = dataclasses.replace(
        room.camera("4"), resolution=(640, 480), pixel_pitch_m=9.3e-6, zoom=2.5, radial_distortion=distortion
    )
    request = room_renderer.request(camera, room.sensor, Sampling())
    view = room_renderer.render(request)
    electrons = view.expected_electrons()
    numbers = np.clip(electrons / room.sensor.gain_e_per_dn + room.sensor.black_level_dn, 0, 4095).astype(np.uint16)
    found = find_markers(numbers, room.state.print.dictionary)
    truth = {m.id: p for m, p in zip(room.state.markers, camera.project(room.state.points_m)[0], strict=True)}
    straight = dataclasses.replace(camera, radial_distortion=(0.0, 0.0)).project(room.state.points_m)[0]
    errors = []
    for marker, corners in zip(found.ids.tolist(), found.corners_px, strict=True):
        located = localise(numbers, corners, marker, room.state.print.dictionary, room.sensor)
        if located is not None:
            errors.append(located.centre_px - truth[marker])
    errors = np.array(errors)
    moved = np.linalg.norm(straight - np.array(list(truth.values())), axis=1).max()
    print(
        f"{len(errors)} markers, mean {errors.mean(axis=0)}, RMS {np.sqrt((errors**2).mean(axis=0))}; moved {moved:.1f}"
    )
    assert len(errors) >= 20
    assert (np.abs(errors.mean(axis=0)) < LOOP_MEAN_PX).all()
    assert (np.sqrt((errors**2).mean(axis=0)) < LOOP_RMS_PX).all()
    assert moved > 50 * LOOP_RMS_PX
    # Depth and marker numbers see through the same lens.
    compared = 0
    for marker, pixel in truth.items():
        x, y = np.round(pixel).astype(int)
        index = [m.id for m in room.state.markers].index(marker)
        facing = camera.cos_incidence(room.state.points_m[index], room.state.normals[index]) > 0.3
        if 0 <= x < 640 and 0 <= y < 480 and facing and view.marker_id[y, x] == marker:
            assert view.depth_m[y, x] == pytest.approx(camera.project(room.state.points_m[index])[1], abs=0.02)
            compared += 1
    assert compared >= 10


@pytest.mark.parametrize("distortion", LENSES, ids=str)
def test_light_through_a_distorting_lens_is_neither_lost_nor_made(distortion):
    """The light within a cone is the same, however its image is drawn: a change of variables, summed over pixels."""
    plain = PTZCamera((0, 0, 0), 0, 0, zoom=1.5, resolution=(1600, 1600))
    curved = dataclasses.replace(plain, radial_distortion=distortion)
    cone = 0.35  # slope

    def inside(camera):
        pixels = np.stack(np.meshgrid(np.arange(1600), np.arange(1600)), axis=-1).astype(float)
        slopes = (camera.undistorted_px(pixels) - camera.principal_point_px) / camera.focal_px
        return relative_illumination(camera)[np.linalg.norm(slopes, axis=-1) < cone].sum() / camera.focal_px**2

    # ∫ cos⁴ over slopes: 2π ∫ r/(1 + r²)² dr = π r²/(1 + r²)
    assert inside(plain) == pytest.approx(math.pi * cone**2 / (1 + cone**2), rel=1e-3)
    assert inside(curved) == pytest.approx(inside(plain), rel=1e-3)


@pytest.mark.parametrize("blades", [3, 5, 6, 8])
def test_the_aperture_is_a_regular_polygon_of_the_round_ones_area(mi, blades):
    """Area πr², evenly filled: within every blade, second moment R²(2 + cos 2π/n)/6 about each axis of two."""
    camera = PTZCamera((0, 0, 0), 0, 0, resolution=(64, 48), aperture_blades=blades)
    rng = np.random.default_rng(blades)
    square = mi.Point2f(*(mi.Float(rng.random(200_000, dtype=np.float32)) for _ in range(2)))
    disk = mi.warp.square_to_uniform_disk_concentric(PlaceOnFilm(camera, mi).aperture(square))
    points = np.array([disk.x.numpy(), disk.y.numpy()], dtype=float)
    turns = 2 * math.pi * (np.arange(blades) + 0.5) / blades
    outermost = np.stack([np.cos(turns), np.sin(turns)], axis=-1) @ points
    assert outermost.max() <= math.cos(math.pi / blades) + 1e-4
    corner = thin_lens.circumradius(blades)
    assert blades / 2 * corner**2 * math.sin(2 * math.pi / blades) == pytest.approx(math.pi)
    second = (2 + math.cos(2 * math.pi / blades)) / 12
    np.testing.assert_allclose(np.cov(points), second * np.eye(2), atol=0.004)  # four standard errors
    np.testing.assert_allclose(points.mean(axis=1), 0, atol=0.006)


@pytest.mark.parametrize("k", [(-0.3, 0.0), (-0.2, -0.1), (0.1, -0.02), (-0.18, 0.03), (-0.3, 0.0406)], ids=str)
def test_samples_are_drawn_for_their_own_place_up_to_the_very_fold(mi, k):
    """The film position, distorted again, is where the sample was; beyond the fold it is the fold's."""
    camera = PTZCamera((0, 0, 0), 0, 0, resolution=(2000, 2000), radial_distortion=k)
    furthest = min(furthest_radius(*k), 1.1)
    radii = furthest * np.concatenate([np.linspace(0, 0.99, 12), 1 - np.geomspace(1e-2, 1e-7, 9), [1.001, 1.1]])
    middle = camera.principal_point_px[0] + 0.5
    places = middle + camera.focal_px * radii[:, None] * [0.6, -0.8]
    x, y = (mi.Float(axis.astype(np.float32)) for axis in places.T)
    film = PlaceOnFilm(camera, mi).film(x, y, mi.Float(0), mi.Float(0))
    slopes = (np.array([film.x.numpy(), film.y.numpy()], dtype=float).T - middle) / camera.focal_px
    again = slopes * stretch((slopes**2).sum(axis=1), *k)[0][:, None]
    expected = np.minimum(radii, furthest_radius(*k))[:, None] * [0.6, -0.8]
    np.testing.assert_allclose(again * camera.focal_px, expected * camera.focal_px, atol=SAME_PLACE_PX)


def test_a_lens_that_folds_its_image_is_refused(mi):
    camera = PTZCamera((0, 0, 0), 0, 0, zoom=1, radial_distortion=(-0.3, 0.0))
    with pytest.raises(RangeError, match="off the axis; allowed: up to"):
        thin_lens.load_sensor(camera, mi)
