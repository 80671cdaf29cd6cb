"""The public functions of `validate`: from an image to a comparison, the same numbers as the commands'."""

from __future__ import annotations

import csv
import dataclasses
import os
import subprocess
import sys
import textwrap
from types import SimpleNamespace

import numpy as np
import pytest

import render
import scenes
import validate
from pss import PSSError, RangeError, ShapeError
from render import backend
from tests.helpers.closet import ROOT, SCENE
from validate.markers.detector import Detections
from validate.run_sweep import main

TRIALS, SEED = 4, 3
NAMES = ("west", "middle", "east")
# px: detections of sharp markers of 40 px are good to hundredths; a wrong half pixel would show.
CENTRE_PX = 0.3


@pytest.fixture(scope="module")
def closet(tmp_path_factory):
    """A scene of twelve large markers, and the folder that it is in."""
    folder = tmp_path_factory.mktemp("library")
    (folder / "closet.toml").write_text(SCENE)
    return scenes.load(folder / "closet.toml")


@pytest.fixture(scope="module")
def store(closet):
    return closet.path.parent / "store"


@pytest.fixture(scope="module")
def found(closet, store):
    """Detections in one capture of each camera."""
    views = [render.view(closet, camera, store=store) for camera in closet.select(*NAMES)]
    return [validate.detect(view.capture(seed=SEED), closet) for view in views]


@pytest.fixture(scope="module")
def measured(closet, store):
    return validate.measure(closet, closet.select(*NAMES), trials=TRIALS, seed=SEED, store=store)


def test_importing_validate_loads_nothing_that_is_slow():
    """A second for the figures of a sweep is no second for `--help`."""
    code = "import sys, validate; assert not {'numpy', 'cv2', 'pss', 'matplotlib', 'rich'} & set(sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stderr == ""


def test_every_public_name_is_there_and_documented():
    for package in (render, scenes, validate):
        for name in package.__all__:
            assert getattr(package, name).__doc__, f"{package.__name__}.{name}"
        assert set(package.__all__) <= set(dir(package))
    with pytest.raises(AttributeError, match="no attribute 'detekt'"):
        _ = validate.detekt


@pytest.mark.render
def test_detections_are_where_the_markers_are(closet, found):
    """Against the projection of the scene's points, which the detector does not know."""
    truth = {marker.id: marker.centre_m for marker in closet.state.markers}
    for camera, detections in zip(closet.select(*NAMES), found, strict=True):
        assert len(detections) >= 6
        assert set(detections.ids.tolist()) <= set(truth)
        pixels, _ = camera.project(np.array([truth[marker] for marker in detections.ids.tolist()]))
        off = detections.centres_px - pixels
        assert np.abs(off).max() < CENTRE_PX
        assert (np.linalg.eigvalsh(detections.covariance_px2) > 0).all()
        squared = np.einsum("ki,kij,kj->k", off, np.linalg.inv(detections.covariance_px2), off)
        assert np.median(squared) < 10  # of two degrees of freedom: covariances of the errors' size


@pytest.mark.render
def test_detections_are_those_of_the_measurement(closet, found, measured):
    """Trial 0 with the same seed, view by view."""
    assert (measured.result.plan.sweep.seed, measured.result.plan.sweep.trials) == (SEED, TRIALS)
    for number, detections in enumerate(found):
        index = [measured.ids.index(marker) for marker in detections.ids.tolist()]
        assert (measured.view_detection_rate[number, index] >= 1 / TRIALS).all()


@pytest.mark.render
def test_triangulated_markers_are_those_of_the_first_trial(closet, found, measured):
    """By the measurement's own way, over arrays of trials and all markers."""
    points = validate.triangulate(closet.select(*NAMES), found)
    of_trial = measured.measured.triangulated
    assert len(points) >= 6
    rows = [measured.ids.index(marker) for marker in points.ids.tolist()]
    assert np.flatnonzero(np.isfinite(of_trial.points_m[0, :, 0])).tolist() == sorted(rows)
    np.testing.assert_allclose(points.points_m, of_trial.points_m[0, rows], rtol=0, atol=1e-9)
    np.testing.assert_allclose(points.covariance_m2, of_trial.covariance_m2[0, rows], rtol=1e-6)
    assert (points.views == measured.views[0, rows]).all()
    errors = points.points_m - closet.state.points_m[rows]
    np.testing.assert_allclose(errors, measured.errors.errors_m[0, rows], rtol=0, atol=1e-9)


@pytest.mark.render
def test_the_comparison_has_the_numbers_of_the_command(closet, store, measured, tmp_path, capsys):
    """`measure` over the same store writes measurement.csv, and renders nothing."""
    comparison = validate.compare(validate.predict(closet, closet.select(*NAMES), store=store), measured)
    command = ["measure", str(closet.path), "--cameras", *NAMES, "--store", str(store), "--out", str(tmp_path / "run")]
    assert main([*command, "--trials", str(TRIALS), "--seed", str(SEED), "--no-report"]) == 0
    assert "0 rendered, 0 measured now" in capsys.readouterr().out
    with (tmp_path / "run" / "measurement.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(comparison.rows) == 2 * len(closet.noise_models)
    for written, row in zip(rows, comparison.rows, strict=True):
        assert list(written) == list(row)
        for column, value in row.items():
            if isinstance(value, str):
                assert written[column] == value
            else:
                assert (written[column] == "") == bool(np.isnan(value))
                assert float(written[column] or "nan") == pytest.approx(value, rel=1e-6, nan_ok=True)
    text = str(comparison)
    for word in ("closet: PSS in 1/m", "as-printed", "single frame", "measured / predicted", "NEES/3"):
        assert word in text
    assert repr(comparison) == text


@pytest.mark.render
def test_cameras_with_other_settings_are_measured_as_they_are(closet, store, measured):
    """An object with another zoom is measured, not the scene's camera of that name."""
    cameras = [dataclasses.replace(camera, zoom=1.5) for camera in closet.select("west", "middle")]
    other = validate.measure(closet, cameras, trials=2, seed=SEED, store=store)
    assert [camera.zoom for camera in other.cameras] == [1.5, 1.5]
    with pytest.raises(ShapeError, match=r"is of \(3, 12\); allowed: \(cameras, points\) = \(2, 12\)"):
        validate.compare(validate.predict(closet, closet.select(*NAMES), store=store), other)


@pytest.mark.render
def test_a_view_that_fails_is_named_with_its_cause(closet, tmp_path, monkeypatch):
    def fail(self, request):
        raise MemoryError("no room for the image")

    monkeypatch.setattr("render.renderer.Renderer.render", fail)
    with pytest.raises(PSSError, match="camera west: MemoryError: no room for the image"):
        validate.measure(closet, closet.select("west"), trials=2, store=tmp_path / "store")


@pytest.mark.render
def test_a_script_needs_no_guard_for_its_main_module(closet, store, tmp_path):
    """Workers that measure do not run the script again: it prints once."""
    script = tmp_path / "script.py"
    script.write_text(
        textwrap.dedent(
            f"""
            import scenes, validate
            print("begin")
            scene = scenes.load({str(closet.path)!r})
            print(validate.measure(scene, scene.select("west", "east"), trials=2, seed=77, store={str(store)!r}))
            """
        )
    )
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, script], capture_output=True, text=True, timeout=300, env=environment)
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("begin") == 1
    assert "RMS error" in done.stdout


@pytest.mark.parametrize(
    ("cameras", "options", "line"),
    [
        ((), {}, r"cameras \(\); allowed: one or more"),
        (("west",), {"trials": 1}, "trials = 1; allowed: 2 or more"),
        (("west",), {"seed": -1}, "seed = -1; allowed: 0 or more"),
    ],
)
def test_what_cannot_be_measured_is_refused_before_anything_is_made(closet, tmp_path, cameras, options, line):
    with pytest.raises(RangeError, match=line):
        validate.measure(closet, [closet.camera(name) for name in cameras], store=tmp_path / "store", **options)
    assert not (tmp_path / "store").exists()


def test_a_camera_twice_is_refused(closet, tmp_path):
    twice = [closet.camera("west")] * 2
    with pytest.raises(RangeError, match="cameras west, west; allowed: one or more, each name once"):
        validate.measure(closet, twice, store=tmp_path)


@pytest.mark.parametrize(
    ("image", "error", "line"),
    [
        (np.zeros((4, 4, 3), dtype=np.uint16), ShapeError, r"image \(4, 4, 3\); allowed: \(height, width\)"),
        (np.zeros((0, 4), dtype=np.uint16), ShapeError, r"image \(0, 4\)"),
        (np.zeros((4, 4)), RangeError, "image of float64; allowed: whole numbers"),
        (np.full((4, 4), -1), RangeError, "image from -1 to -1; allowed: 0 to 65535"),
        (np.full((4, 4), 70000), RangeError, "image from 70000 to 70000"),
    ],
)
def test_what_is_no_capture_is_refused(closet, image, error, line):
    with pytest.raises(error, match=line):
        validate.detect(image, closet)


def test_an_image_without_markers_has_none(closet):
    found = validate.detect(np.full((240, 320), 64, dtype=np.uint16), closet)
    assert (len(found), found.centres_px.shape, found.covariance_px2.shape) == (0, (0, 2), (0, 2, 2))
    points = validate.triangulate(closet.select("west", "east"), [found, found])
    assert (len(points), points.points_m.shape, points.covariance_m2.shape) == (0, (0, 3), (0, 3, 3))
    with pytest.raises(ShapeError, match="1 cameras and 2 detections"):
        validate.triangulate(closet.select("west"), [found, found])


def test_markers_that_one_camera_found_are_not_triangulated(closet):
    """And exact projections of the others give the points themselves."""
    truth, ids = closet.state.points_m, np.array([marker.id for marker in closet.state.markers])
    cameras = closet.select("west", "east")
    seen = [np.arange(0, 8), np.arange(2, 12)]
    found = [
        Detections(ids[rows], camera.project(truth[rows])[0], np.tile(0.01 * np.eye(2), (len(rows), 1, 1)))
        for camera, rows in zip(cameras, seen, strict=True)
    ]
    points = validate.triangulate(cameras, found)
    assert points.ids.tolist() == ids[2:8].tolist()
    np.testing.assert_allclose(points.points_m, truth[2:8], atol=1e-7)


def test_a_prediction_takes_the_light_that_it_is_given(closet):
    """With an appearance, nothing is solved; "auto" becomes the exposure that is chosen for these cameras."""
    look = closet.appearance()
    cameras = closet.select(*NAMES)
    assert set(validate.predict(closet, cameras, look)) == {model.name for model in closet.noise_models}
    auto = closet.with_settings({"sensor.exposure_ms": "auto", "noise.models": ["physical"]})
    predicted = validate.predict(auto, cameras, look)["physical"].pss_single_frame
    low, high = (
        validate.predict(auto.with_exposure(ms), cameras, look)["physical"].pss_single_frame for ms in (0.01, 100.0)
    )
    assert predicted not in (low, high)
    # That of `scene.sensor`, which is the longest that is allowed, would be another number.
    longest = validate.predict(auto.with_exposure(auto.sensor.exposure_ms), cameras, look)["physical"].pss_single_frame
    assert predicted != longest


@pytest.mark.render
def test_without_an_appearance_it_is_the_solved_light_of_the_runs(closet, store, measured):
    """As in the measurement's own assessment, which took it from the store."""
    assert backend.choose().identity == measured.result.views[0][0].request.renderer
    predicted = validate.predict(closet, closet.select(*NAMES), store=store)
    (assessment,) = measured.result.assessments
    for name, evaluation in predicted.items():
        assert (evaluation.single_frame_sigma_m == assessment.predicted[name].single_frame_sigma_m)[
            evaluation.observable
        ].all()


def test_names_in_place_of_objects_are_one_line(closet, tmp_path):
    west, look, image = closet.select("west"), closet.appearance(), np.zeros((4, 4), dtype=np.uint16)
    for call, line in (
        (lambda: validate.predict(closet, [], look), r"cameras = \(\); allowed: one or more"),
        (lambda: validate.predict("closet", west, look), "scene is 'closet' of type str; allowed: a scene"),
        (lambda: validate.detect(image, "closet"), "scene is 'closet' of type str; allowed: a scene"),
        (lambda: validate.measure("closet", west, store=tmp_path), "scene is 'closet' of type str"),
        (lambda: validate.measure(closet, ["west"], store=tmp_path), r"cameras\[0\] is 'west' of type str"),
        (lambda: validate.measure(closet, west, trials="3", store=tmp_path), "trials is '3' of type str"),
        (lambda: validate.sweep("zoom", trials="3", store=tmp_path), "trials is '3' of type str"),
        (lambda: validate.sweep("zoom", overrides="sweep.trials=3", store=tmp_path), "overrides = "),
        (lambda: render.view(closet, "west"), "camera is 'west' of type str; allowed: a camera"),
        (lambda: render.view("closet", west[0]), "scene is 'closet' of type str; allowed: a scene"),
    ):
        with pytest.raises(PSSError, match=line):
            call()


def test_a_prediction_of_others_is_not_compared(closet):
    """Cameras in another order, and other points, though they are as many."""
    look, names = closet.appearance(), ("west", "east")
    measured = SimpleNamespace(ids=range(12), cameras=closet.select(*names), scene=closet)
    with pytest.raises(RangeError, match="is of cameras east, west; allowed: west, east, as measured"):
        validate.compare(validate.predict(closet, closet.select("east", "west"), look), measured)
    moved = dataclasses.replace(closet.state, markers=closet.state.markers[::-1])
    other = validate.predict(closet.replace(state=moved), closet.select(*names), look)
    with pytest.raises(RangeError, match="is of other points; allowed: the markers' centres"):
        validate.compare(other, measured)
