"""The search for markers: drawn ones of every light, size, turn and place, against OpenCV's stock parameters."""

from __future__ import annotations

import itertools
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from benchmarks.drawn_markers import DICTIONARY, DISTANCE_SIDES, IDS, edge_pictures, homography, paste, pictures
from pss import ImageSensor
from render.sensor import capture
from scenes.schema.dictionaries import DICTIONARIES
from validate.markers.detect import RIM_PX, find_markers
from validate.markers.localise import localise

SENSOR = ImageSensor(550.0, 0.5, 4.0, 10000.0, 6.0, 12, 64)
# px: small pictures, for the test's time.
PICTURE_PX = (640, 480)
POSES_DEG = list(itertools.product((0.0, 10.0, 25.0, 45.0), (0.0, 30.0, 55.0, 70.0)))
# px: a search gives whole pixels; noise may cut a corner off, which moves the mean of four by a quarter of that.
CORNER_PX, CENTRE_PX = 3.0, 1.5
# In a capture of 100 electrons neighbouring pixels differ by a seventh of white, and a corner may be cut off.
LEAST_AT_EDGES = 0.9


def _capture(light, white_e, rng):
    return capture((light * np.float32(white_e)).astype(np.float32), SENSOR, rng)


def _stock(capture_dn):
    """Numbers that OpenCV finds with its own parameters in the linear 8-bit image."""
    lit = np.maximum(capture_dn.astype(np.float32) - SENSOR.black_level_dn, 0)
    eight_bit = cv2.convertScaleAbs(lit, alpha=255 / np.percentile(lit, 99.9))
    dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY))
    _, ids, _ = cv2.aruco.ArucoDetector(dictionary, cv2.aruco.DetectorParameters()).detectMarkers(eight_bit)
    return set() if ids is None else set(np.ravel(ids).tolist())


def _check_places(found, drawing):
    """Each number at its own marker."""
    for marker, corners in zip(found.ids.tolist(), found.corners_px, strict=True):
        place = np.flatnonzero(drawing.ids == marker)
        assert len(place) == 1, marker
        np.testing.assert_allclose(corners.mean(axis=0), drawing.corners_px[place[0]].mean(axis=0), atol=CENTRE_PX)


@pytest.mark.parametrize("white_e", [100.0, 300.0, 1000.0, 3000.0, 10000.0])
def test_all_that_stock_parameters_find_is_found_and_more(white_e):
    """Sharp and slightly blurred markers, turned and tilted, in bright and dim light: as many in all, none wrong."""
    rng = np.random.default_rng(0)
    found = stock = 0
    for side_px, blur_px in ((18.0, 0.0), (20.0, 0.7), (30.0, 0.0), (60.0, 0.5)):
        for drawing in pictures(side_px, POSES_DEG, blur_px, rng, PICTURE_PX):
            numbers = _capture(drawing.light, white_e, rng)
            result = find_markers(numbers, DICTIONARY)
            _check_places(result, drawing)
            found += len(result.ids)
            stock += len(_stock(numbers) & set(drawing.ids.tolist()))
    print(f"{found} found, {stock} by stock parameters, of {4 * len(POSES_DEG)}")
    assert found >= stock
    assert stock > len(POSES_DEG)


@pytest.mark.parametrize(("white_e", "lamp"), [(25.0, 2.0), (40.0, 1.5), (55.0, 1.5)])
def test_no_fewer_than_by_stock_parameters_are_found_where_noise_is_near_the_contrast(white_e, lamp):
    """Markers as dim as at a short exposure, beside a stripe that is `lamp` times as bright as their white."""
    rng = np.random.default_rng(4)
    found = stock = 0
    for drawing in pictures(60.0, POSES_DEG, 0.5, rng, PICTURE_PX):
        light = drawing.light.copy()
        light[:, :24] = lamp
        numbers = _capture(light, white_e, rng)
        result = find_markers(numbers, DICTIONARY)
        _check_places(result, drawing)
        found += len(result.ids)
        stock += len(_stock(numbers) & set(drawing.ids.tolist()))
    assert found >= stock
    assert stock >= len(POSES_DEG) / 2


@pytest.mark.parametrize(("white_e", "least"), [(100.0, LEAST_AT_EDGES), (1000.0, 1.0), (9000.0, 1.0)])
def test_whole_markers_are_found_at_any_distance_from_the_edge(white_e, least):
    """Plates on a dark surround, 0 to 20 px from each of the image's edges."""
    rng = np.random.default_rng(2)
    gaps = range(21)
    found = 0
    for drawing in edge_pictures(40.0, gaps, rng, (320, 240)):
        result = find_markers(_capture(drawing.light, white_e, rng), DICTIONARY)
        _check_places(result, drawing)
        found += len(result.ids)
    assert found >= least * 4 * len(gaps)


def test_no_corner_is_outside_of_the_image():
    """The image goes on beyond its edge for the search alone: a marker that the edge cuts has no corner there."""
    rng = np.random.default_rng(3)
    for cut in range(0, 24, 2):
        light = np.full((200, 300), 0.5, dtype=np.float32)
        paste(light, 5, homography(60.0, (30.0 - cut, 100.0), 0.0, 0.0))
        found = find_markers(_capture(light, 3000.0, rng), DICTIONARY)
        assert (found.corners_px >= 0).all()
        assert found.ids.size == (cut < 2), cut


@pytest.mark.parametrize(("outside", "axis"), [(-1.0, 0), (-1.0, 1), (300.0, 0), (200.0, 1)])
def test_a_corner_that_the_search_finds_outside_of_the_image_is_none(monkeypatch, outside, axis):
    """As it happens about once in a thousand cut markers; of two outlines the whole one is left."""
    whole = np.array([[100, 60], [160, 60], [160, 120], [100, 120]], dtype=np.float32)
    cut = whole.copy()
    cut[1, axis] = outside
    quads = [np.float32(RIM_PX) + corners[None] for corners in (cut, whole)]
    search = SimpleNamespace(detectMarkers=lambda picture: (quads, np.array([[5], [6]]), []))
    monkeypatch.setattr("validate.markers.detect._detector", lambda *_: search)
    found = find_markers(_capture(np.full((200, 300), 0.5, np.float32), 3000.0, np.random.default_rng(3)), DICTIONARY)
    assert found.ids.tolist() == [6]
    np.testing.assert_array_equal(found.corners_px, [whole])


def test_a_small_marker_on_white_is_found():
    """Its black is too small a part of the image for a percentile to notice."""
    light = np.ones(PICTURE_PX[::-1], dtype=np.float32)
    paste(light, 9, homography(20.0, (300.3, 200.6), 12.0, 20.0))
    assert find_markers(_capture(light, 3000.0, np.random.default_rng(4)), DICTIONARY).ids.tolist() == [9]


def test_markers_in_the_shade_are_found_beside_markers_in_the_light():
    """A twentieth of the light, in one picture: both halves have the same markers found."""
    rng = np.random.default_rng(5)
    light = np.full((300, 600), 0.5, dtype=np.float32)
    for number in range(8):
        paste(light, number, homography(40.0, (40 + 75 * number, 80), 7.0 * number, 30.0))
        paste(light, 20 + number, homography(40.0, (40 + 75 * number, 220), 7.0 * number, 30.0))
    light[150:] *= 0.05
    found = find_markers(_capture(light, 8000.0, rng), DICTIONARY)
    assert sorted(found.ids.tolist()) == [*range(8), *range(20, 28)]


def test_markers_are_found_in_a_dim_capture_beside_a_lamp():
    """A lamp a hundred times as bright as paper does not blind the search."""
    light = np.full((400, 400), 0.25, dtype=np.float32)
    corners = paste(light, 7, homography(60.0, (230.0, 220.0), 20.0, 30.0))
    light[:20, :60] = 40.0
    found = find_markers(_capture(light, 240.0, np.random.default_rng(1)), DICTIONARY)
    assert found.ids.tolist() == [7]
    np.testing.assert_allclose(found.corners_px[0], corners, atol=CORNER_PX)


def test_a_number_that_is_found_twice_is_left_out():
    """Two markers of one number name at least one wrong place."""
    light = np.full((200, 400), 0.25, dtype=np.float32)
    for x in (100.0, 300.0):
        paste(light, 7, homography(60.0, (x, 100.0), 5.0, 0.0))
    paste(light, 8, homography(40.0, (200.0, 100.0), 5.0, 0.0))
    assert find_markers(_capture(light, 300.0, np.random.default_rng(1)), DICTIONARY).ids.tolist() == [8]


@pytest.mark.parametrize("shape", [(200, 300), (1, 1), (3, 40)])
@pytest.mark.parametrize("electrons", [0.0, 80.0, 50000.0])
def test_nothing_is_found_in_an_empty_capture(shape, electrons):
    """An image without markers is a result, not an error: dark, grey or saturated."""
    found = find_markers(capture(np.full(shape, electrons), SENSOR, np.random.default_rng(2)), DICTIONARY)
    assert found.ids.shape == (0,)
    assert found.corners_px.shape == (0, 4, 2)


@pytest.mark.parametrize("dictionary", DICTIONARIES)
def test_markers_of_every_dictionary_are_found_and_localised(dictionary):
    """The first, the last and one between of each; the centre within its claim, as drawn by another route."""
    rng = np.random.default_rng(6)
    entry = DICTIONARIES[dictionary]
    ids = [0, entry.ids // 2, entry.ids - 1]
    light = np.full((130, 400), 0.5, dtype=np.float32)
    centres = []
    for number, marker in enumerate(ids):
        to_px = homography(80.0, (70.2 + 130 * number, 64.7), 8.0 + 11 * number, 25.0)
        paste(light, marker, to_px, dictionary=dictionary)
        centres.append(to_px[:2, 2] / to_px[2, 2])
    numbers = _capture(light, 3000.0, rng)
    found = find_markers(numbers, dictionary)
    assert sorted(found.ids.tolist()) == ids
    for marker, corners in zip(found.ids.tolist(), found.corners_px, strict=True):
        located = localise(numbers, corners, marker, dictionary, SENSOR)
        assert located is not None, marker
        np.testing.assert_allclose(located.centre_px, centres[ids.index(marker)], atol=0.1)


def test_the_drawing_has_its_size_and_perspective():
    """Sides of 60 px at a tilt of 0; tilted, the nearer side is the longer one."""
    level = paste(np.zeros((200, 200), np.float32), 1, homography(60.0, (100.0, 100.0), 0.0, 0.0))
    np.testing.assert_allclose(level, [[70, 70], [130, 70], [130, 130], [70, 130]], atol=1e-9)
    tilted = paste(np.zeros((200, 200), np.float32), 1, homography(60.0, (100.0, 100.0), 0.0, 60.0))
    widths = np.linalg.norm([tilted[1] - tilted[0], tilted[2] - tilted[3]], axis=1)
    depth = np.sin(np.radians(60)) / 2 / DISTANCE_SIDES
    np.testing.assert_allclose(widths, 60 / (1 + depth * np.array([-1, 1])), atol=1e-9)
    assert DICTIONARIES[DICTIONARY].ids >= IDS
