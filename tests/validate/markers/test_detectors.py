"""Detectors by name: what they are passed, what they find on exactly drawn markers, and their measurements' names."""

from __future__ import annotations

import dataclasses
import functools
import importlib.metadata
import inspect
from pathlib import Path

import cv2
import numpy as np
import pytest

import scenes
import validate
from pss import ImageSensor, RangeError
from render.sensor import capture
from tests.helpers.closet import SCENE
from tests.helpers.entry_points import Entry
from tests.helpers.exact_drawing import draw_exactly
from tests.helpers.synthetic import DICTIONARY, SENSOR, homography
from validate import Detections, Targets
from validate.markers.aruco_corners import APRILTAG_OFFSET_PX, ARUCO, crossing
from validate.markers.detector_table import DEFAULT_DETECTOR, DETECTORS, DetectorTable
from validate.markers.registering import Registering
from validate.markers.view_measurement import EQUAL_SIGMA_PX, MeasureTask, detections_in, measure_capture

MARKER = 7
TARGETS = Targets(DICTIONARY, (3, MARKER))
SIZE, CENTRE = 121, 60.0
DRAWINGS = 40
# (px per module, squeeze, circle of confusion in px): in focus, tilted, blurred.
CASES = [(6.0, 1.0, 0.3), (10.0, 0.7, 0.5), (10.0, 1.0, 3.0)]
# px: constant offset left, and RMS per axis about it. Of unrefined corners, whole pixels, the mean is good to 0.04.
LARGEST = {
    "registration": (0.002, 0.005),
    "aruco": (0.15, 0.45),
    "aruco-subpix": (0.03, 0.08),
    "aruco-contour": (0.04, 0.12),
    "aruco-apriltag": (0.06, 0.1),
}


@functools.cache
def drawings(px: float, squeeze: float, disc: float):
    """Captures of exactly drawn markers at random places and angles, and their true centres."""
    rng = np.random.default_rng(5)
    made = []
    for _ in range(DRAWINGS):
        centre = tuple(CENTRE + rng.uniform(-0.5, 0.5, 2))
        h = homography(px, centre, rng.uniform(0, 360), squeeze, (0, 0))
        white = draw_exactly(DICTIONARY, MARKER, h, (SIZE, SIZE), disc)
        made.append((capture(3000 * (1 + 16 * white) / 17, SENSOR, rng), np.array(centre)))
    return made


def errors_px(detector, case):
    found = [(detector.detect(image, SENSOR, TARGETS), centre) for image, centre in drawings(*case)]
    return np.array([each.centres_px[0] - centre for each, centre in found if each.ids.tolist() == [MARKER]])


@pytest.mark.parametrize("case", CASES, ids=str)
@pytest.mark.parametrize("name", LARGEST)
def test_centres_have_no_constant_offset(name, case):
    errors = errors_px(DETECTORS[name], case)
    assert len(errors) >= 0.95 * DRAWINGS
    offset, rms = LARGEST[name]
    assert np.abs(errors.mean(axis=0)).max() < offset
    assert np.sqrt(((errors - errors.mean(axis=0)) ** 2).mean()) < rms


@pytest.mark.parametrize(
    ("case", "low", "high"), [(CASES[0], 0.40, 0.46), (CASES[1], 0.40, 0.46), (CASES[2], 0.44, 0.50)]
)
def test_the_offset_of_apriltags_refinement_is_the_documented_one(case, low, high):
    """OpenCV's own corners, nothing subtracted: the constant lies between those in focus and out of it."""
    offset = errors_px(dataclasses.replace(DETECTORS["aruco-apriltag"], offset_px=0.0), case).mean(axis=0)
    assert ((low < offset) & (offset < high)).all()
    assert 0.40 < APRILTAG_OFFSET_PX < 0.50


def test_the_diagonals_cross_at_the_image_of_the_centre():
    h = homography(10.0, (60.0, 50.0), 20.0, 0.6, (1e-3, -2e-3))
    corners = np.array([[-3, -3, 1], [3, -3, 1], [3, 3, 1], [-3, 3, 1]]) @ h.T
    centre = h @ [0, 0, 1]
    found = crossing((corners[:, :2] / corners[:, 2:])[None])
    np.testing.assert_allclose(found, [centre[:2] / centre[2]], rtol=0, atol=1e-9)
    assert np.abs(found - (corners[:, :2] / corners[:, 2:]).mean(axis=0)).max() > 0.1
    assert crossing(np.empty((0, 4, 2))).shape == (0, 2)


def test_refinements_are_opencvs():
    assert [each.refinement for each in ARUCO] == [
        getattr(cv2.aruco, f"CORNER_REFINE_{name}") for name in ("NONE", "SUBPIX", "CONTOUR", "APRILTAG")
    ]


# ---- nothing leaks ---------------------------------------------------------------------------------------------------


class Recorder:
    """Keeps what it is passed."""

    name, targets = "recorder", ("square-tags",)

    def __init__(self, found: object = None) -> None:
        self.passed: list[tuple[tuple, dict]] = []
        self.found = Detections(np.array([], dtype=int), np.empty((0, 2))) if found is None else found

    def detect(self, *passed, **named):
        self.passed.append((passed, named))
        return self.found


@pytest.fixture
def table_with(monkeypatch):
    """Put a detector into the table as an entry point does."""

    def put(detector, name=None):
        entry = Entry(name or detector.name, detector)
        monkeypatch.setattr(importlib.metadata, "entry_points", lambda *, group, **_: (entry,))
        DETECTORS.reload_entry_points()
        return detector

    yield put
    monkeypatch.undo()
    DETECTORS.reload_entry_points()


def test_a_detector_is_passed_image_sensor_and_what_is_printed(table_with, tmp_path):
    (tmp_path / "closet.toml").write_text(SCENE)
    scene = scenes.load(tmp_path / "closet.toml")
    recorder = table_with(Recorder())
    image = np.full((24, 32), 64, dtype=np.uint16)
    assert len(validate.detect(image, scene, detector="recorder")) == 0
    ((passed, named),) = recorder.passed
    assert not named
    assert [type(each) for each in passed] == [np.ndarray, ImageSensor, Targets]
    assert passed[0].tobytes() == image.tobytes()
    assert passed[1] == scene.sensor
    assert {field.name for field in dataclasses.fields(Targets)} == {"dictionary", "ids"}
    assert type(passed[2].dictionary) is str
    assert {type(number) for number in passed[2].ids} == {int}
    assert vars(passed[2]).keys() == {"dictionary", "ids"}


@pytest.mark.parametrize("name", LARGEST)
def test_built_in_detectors_take_no_more(name):
    assert list(inspect.signature(DETECTORS[name].detect).parameters) == ["image", "sensor", "targets"]


def test_measuring_passes_no_more_than_that(table_with):
    """Workers go this way for every trial."""
    recorder = table_with(Recorder())
    measure_capture(np.zeros((4, 4), dtype=np.uint16), TARGETS, SENSOR, "recorder")
    ((passed, _),) = recorder.passed
    assert passed[1:] == (SENSOR, TARGETS)


# ---- what comes back -------------------------------------------------------------------------------------------------


def test_numbers_found_twice_or_unexpected_are_left_out(table_with):
    centres = np.arange(10.0).reshape(5, 2)
    table_with(Recorder(Detections(np.array([7, 4, 3, 9, 9]), centres, unexpected_ids=1)))
    found = detections_in(np.zeros((4, 4), dtype=np.uint16), TARGETS, SENSOR, "recorder")
    assert found.ids.tolist() == [3, 7]
    assert found.centres_px.tolist() == [[4, 5], [0, 1]]
    assert (found.covariance_px2, found.unexpected_ids) == (None, 3)
    twice = Detections(np.array([7, 7]), np.zeros((2, 2)))
    table_with(Recorder(twice))
    assert len(detections_in(np.zeros((4, 4), dtype=np.uint16), TARGETS, SENSOR, "recorder")) == 0


def test_detections_without_covariance_have_equal_weights(table_with):
    table_with(Recorder(Detections(np.array([7]), np.array([[1.0, 2.0]]))))
    pixels, covariance, unexpected_ids = measure_capture(np.zeros((4, 4), dtype=np.uint16), TARGETS, SENSOR, "recorder")
    assert np.isnan(pixels[0]).all()
    assert np.isnan(covariance[0]).all()
    assert pixels[1].tolist() == [1, 2]
    np.testing.assert_allclose(covariance[1], EQUAL_SIGMA_PX**2 * np.eye(2))
    assert unexpected_ids == 0


@pytest.mark.parametrize(
    ("found", "line"),
    [
        ([], "returned \\[\\]; allowed: validate.Detections"),
        (Detections(np.array([0.5]), np.zeros((1, 2))), "ids \\(1,\\) of float64; allowed: whole numbers"),
        (Detections(np.array([7]), np.zeros((2, 2))), "centres_px \\(2, 2\\); allowed: finite, \\(1, 2\\)"),
        (Detections(np.array([7]), np.full((1, 2), np.nan)), "allowed: finite"),
        (Detections(np.array([7]), np.zeros((1, 2)), np.eye(2)), "covariance_px2 \\(2, 2\\); allowed: \\(1, 2, 2\\)"),
        (Detections(np.array([7]), np.zeros((1, 2)), -np.eye(2)[None]), "symmetric, positive definite"),
    ],
)
def test_what_is_no_detection_is_refused_with_the_detectors_name(table_with, found, line):
    table_with(Recorder(found))
    with pytest.raises(RangeError, match=f"detector 'recorder'.*{line}"):
        detections_in(np.zeros((4, 4), dtype=np.uint16), TARGETS, SENSOR, "recorder")


def test_an_exception_is_refused_with_the_detectors_name(table_with):
    table_with(type("Broken", (Recorder,), {"detect": lambda self, *_: 1 / 0})())
    with pytest.raises(RangeError, match="detector 'recorder' raised ZeroDivisionError"):
        detections_in(np.zeros((4, 4), dtype=np.uint16), TARGETS, SENSOR, "recorder")


# ---- names -----------------------------------------------------------------------------------------------------------


def test_the_default_is_registration_and_its_files_have_the_names_from_before():
    """The name of the default is no part of the content: only the code's digest is."""
    assert DEFAULT_DETECTOR == "registration"
    assert [*LARGEST] == list(DETECTORS.own)
    task = MeasureTask(Path("store"), "a" * 24, DICTIONARY, (1, 2), 0, 3, code="12345678")
    assert task.path.name == "aaaaaaaaaaaaaaaaaaaaaaaa-82c371b20e7e.npz"


def test_detectors_have_measurements_of_their_own():
    tasks = [MeasureTask(Path("store"), "a" * 24, DICTIONARY, (1, 2), 0, 3, name) for name in DETECTORS.own]
    assert len({task.path for task in tasks}) == len(LARGEST)


@pytest.mark.parametrize(
    ("loaded", "name", "line"),
    [
        (Recorder, "recorder", "allowed: an object with name, targets and detect"),
        (object(), "recorder", "allowed: an object with name, targets and detect"),
        (Recorder(), "other", "the detector's name 'recorder'; allowed: that of its entry point, 'other'"),
        (Recorder(), "a/b", "the name 'a/b'; allowed: letters"),
        (type("Balls", (Recorder,), {"targets": ("balls",)})(), "recorder", "targets \\('balls',\\); allowed"),
    ],
)
def test_what_is_no_detector_is_left_out_with_a_warning(monkeypatch, loaded, name, line):
    monkeypatch.setattr(importlib.metadata, "entry_points", lambda *, group: (Entry(name, loaded),))
    table = DetectorTable([Registering()])
    with pytest.warns(UserWarning, match=line):
        assert list(table) == ["registration"]


def test_an_unknown_detector_is_refused_before_anything_is_made(tmp_path):
    (tmp_path / "closet.toml").write_text(SCENE)
    scene = scenes.load(tmp_path / "closet.toml")
    line = "detector 'sift'; allowed: registration, aruco, aruco-subpix"
    with pytest.raises(RangeError, match=line):
        validate.detect(np.zeros((4, 4), dtype=np.uint16), scene, detector="sift")
    with pytest.raises(RangeError, match=line):
        validate.measure(scene, scene.cameras[:2], store=tmp_path / "store", detector="sift")
    with pytest.raises(RangeError, match=line):
        validate.sweep("zoom", store=tmp_path / "store", detector="sift")
    assert not (tmp_path / "store").exists()
