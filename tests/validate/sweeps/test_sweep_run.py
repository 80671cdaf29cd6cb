"""The command end to end, on a closet with four cameras and twelve large markers: what a run leaves and reuses."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import OpenImageIO as oiio
import pytest

from render.files.exr import read_view
from tests.helpers.closet import (
    ALONE,
    DETERMINED,
    FACTOR,
    ROOT,
    SCENE,
    SELECTION,
    SWEEP,
    command,
    rows,
    run,
    whole_views,
)

pytestmark = pytest.mark.render


# Columns that outside programs rely on.
CONFIGURATION_COLUMNS = [
    "sweep",
    "configuration",
    "parameter",
    "value",
    "cameras",
    "noise_model",
    "points",
    "observable",
    "detected",
    "pss",
    "measured_pss_filter",
    "pss_single_frame",
    "measured_pss_single_frame",
    "measured_pss_ci_low",
    "measured_pss_ci_high",
    "sigma_inf_rms_m",
    "predicted_rms_m",
    "measured_rms_m",
    "measured_rms_ci_low_m",
    "measured_rms_ci_high_m",
    "measured_rms_opencv_m",
    "measured_prior_rms_m",
    "measured_posterior_rms_m",
    "share_under_5mm",
    "noise_share",
    "budget_visibility",
    "budget_noise_model",
    "budget_detector",
    "budget_geometry",
]
POINT_COLUMNS = [
    "sweep",
    "configuration",
    "noise_model",
    "point",
    "object",
    "x_m",
    "y_m",
    "z_m",
    "views",
    "detection_rate",
    "sigma_inf_m",
    "single_frame_sigma_m",
    "single_frame_rms_m",
    "measured_sigma_m",
    "measured_rms_m",
    "measured_bias_m",
    "measured_std_m",
    "nees",
]
VIEW_COLUMNS = [
    "view",
    "camera",
    "pan_deg",
    "tilt_deg",
    "zoom",
    "focus_distance_m",
    "f_number",
    "markers_visible",
    "markers_detected",
    "render_noise_ratio",
    "samples",
    "saturated_share",
    "exr",
]
CORRELATION_COLUMNS = [
    "sweep",
    "metric",
    "noise_model",
    "level",
    "measure",
    "cameras",
    "n",
    "spearman",
    "spearman_ci_low",
    "spearman_ci_high",
    "kendall",
    "pearson_log",
    "regret",
]
SLOPE_COLUMNS = [
    "sweep",
    "parameter",
    "noise_model",
    "steps",
    "points",
    "predicted_slope",
    "measured_slope",
    "measured_slope_ci_low",
    "measured_slope_ci_high",
]


@pytest.fixture(scope="module")
def closet(tmp_path_factory):
    """A folder with scene and sweeps, and the finished first run in it."""
    folder = tmp_path_factory.mktemp("closet")
    files = (("closet", SCENE), ("zooming", SWEEP), ("pairs", SELECTION), ("alone", ALONE))
    for name, text in files:
        (folder / f"{name}.toml").write_text(text)
    result = run(folder, "zooming.toml", "pairs.toml", "alone.toml", "--out", "first", "--report")
    assert result.returncode == 0, result.stdout + result.stderr
    (folder / "first.log").write_text(result.stdout + result.stderr)
    return folder


def test_every_file_has_its_columns(closet):
    """The tables have the promised columns, and a row for each configuration and noise model."""
    table = rows(closet / "first" / "configurations.csv")
    assert len(table) == (3 + 3 + 2) * 2
    assert set(CONFIGURATION_COLUMNS) <= set(table[0])
    points = rows(closet / "first" / "points.csv")
    assert len(points) == len(table) * 12
    assert set(POINT_COLUMNS) <= set(points[0])
    assert set(VIEW_COLUMNS) <= set(rows(closet / "first" / "views.csv")[0])
    assert set(CORRELATION_COLUMNS) <= set(rows(closet / "first" / "correlation.csv")[0])
    assert {"view", "render_seconds", "detect_seconds"} <= set(rows(closet / "first" / "timings.csv")[0])
    # Of sweeps over numbers: a selection has no slope.
    slopes = rows(closet / "first" / "slopes.csv")
    assert [row["sweep"] for row in slopes] == ["zooming"] * 2
    assert set(SLOPE_COLUMNS) <= set(slopes[0])
    assert float(slopes[0]["measured_slope_ci_low"]) < float(slopes[0]["measured_slope_ci_high"])
    record = json.loads((closet / "first" / "run.json").read_text())
    assert {"scenes", "sweeps", "seeds", "versions", "seconds"} <= set(record)


def test_a_shared_view_is_rendered_once(closet):
    """Three sweeps of eight configurations need eight camera settings, of which "away" is one."""
    views = rows(closet / "first" / "views.csv")
    settings = {(v["camera"], v["zoom"]) for v in views}
    assert len(views) == len(settings) == 8
    assert len(list((closet / "store" / "views").rglob("*.exr"))) == 8


def test_measured_errors_are_those_of_markers_found(closet):
    """Three cameras that see the board measure most of its points, to a fraction of a millimetre."""
    row = next(r for r in rows(closet / "first" / "configurations.csv") if r["configuration"] == "zoom=2")
    assert row["points"] == "12"
    assert int(row["detected"]) >= 9
    assert float(row["measured_rms_m"]) < 2e-3
    assert float(row["measured_rms_ci_low_m"]) < float(row["measured_rms_m"]) < float(row["measured_rms_ci_high_m"])
    assert 0 < float(row["noise_share"]) <= 1


def test_one_camera_is_a_result_not_an_error(closet):
    """A configuration of one camera observes nothing: PSS 0 on both sides, and a line says so."""
    alone = [r for r in rows(closet / "first" / "configurations.csv") if r["sweep"] == "alone"]
    assert {r["cameras"] for r in alone} == {"1"}
    assert {float(r[name]) for r in alone for name in ("pss", "measured_pss_single_frame", "observable")} == {0.0}
    assert "one camera observes no point" in (closet / "first.log").read_text()


def test_a_view_without_markers_is_a_result_not_an_error(closet):
    """The camera that looks away finds nothing, and a line says so."""
    away = next(v for v in rows(closet / "first" / "views.csv") if v["camera"] == "away")
    assert float(away["markers_detected"]) == 0
    assert "no marker found in the view of camera away" in (closet / "first.log").read_text()


def test_a_sweep_of_the_scene_predicts_each_step_by_its_own_sensor_and_light(closet):
    """Views of another exposure are other views; by the physical model the error falls with it, by the paper's not."""
    (closet / "factor.toml").write_text(FACTOR)
    result = run(closet, "factor.toml", "--out", "factor", "--set", 'noise.models=["corrected", "physical"]')
    assert result.returncode == 0, result.stdout + result.stderr
    slopes = {row["noise_model"]: row for row in rows(closet / "factor" / "slopes.csv")}
    assert slopes["corrected"]["parameter"] == "exposure_ms"
    assert float(slopes["corrected"]["predicted_slope"]) == pytest.approx(0, abs=1e-9)
    # Between light that is limited by photons and by the sensor.
    assert -1 < float(slopes["physical"]["predicted_slope"]) < -0.45
    assert float(slopes["physical"]["measured_slope"]) < 0
    views = rows(closet / "factor" / "views.csv")
    assert len(views) == 4
    shared = {row["view"] for row in views} & {row["view"] for row in rows(closet / "first" / "views.csv")}
    assert len(shared) == 2  # those of the step that is the closet as it is
    assert "Log-log slopes" in result.stdout
    assert "The paper's claims" not in result.stdout
    assert (closet / "factor" / "figures" / "factor.png").exists()


def test_figures_are_there(closet):
    """A figure of curves, one of points and a contact sheet for each sweep, as pictures."""
    for sweep in ("zooming", "pairs", "alone"):
        for suffix in ("", "_points", "_captures"):
            path = closet / "first" / "figures" / f"{sweep}{suffix}.png"
            image = oiio.ImageBuf(str(path))
            assert image.spec().width > 300, path


def test_figures_are_drawn_again_only_if_what_they_show_has_changed(closet):
    """The same tables leave them as they are; one that is missing, or another number of trials, draws them anew."""

    def drawn(*options) -> dict[str, int]:
        result = run(closet, "pairs.toml", "--out", "twice", *options)
        assert result.returncode == 0, result.stderr
        return {path.name: path.stat().st_mtime_ns for path in (closet / "twice" / "figures").iterdir()}

    first = drawn()
    assert drawn() == first
    (closet / "twice" / "figures" / "pairs_points.png").unlink()
    again = drawn()
    assert set(again) == set(first)
    assert again != first
    other = drawn("--trials", 2)
    assert all(other[name] != again[name] for name in first)


def test_the_report_made_again_is_the_report_of_the_run(closet):
    """`report FOLDER` reads the tables and the store, the run has all at hand; what they write is the same."""
    path = closet / "first" / "report.html"
    before, model = path.read_bytes(), (closet / "first" / "scene.glb").read_bytes()
    path.unlink()
    script = [sys.executable, str(ROOT / "validate" / "run_sweep.py"), "report", "first", "--allow-outside"]
    result = subprocess.run(script, capture_output=True, text=True, timeout=400, check=False, cwd=closet)
    assert result.returncode == 0, result.stderr
    assert path.read_bytes() == before
    assert (closet / "first" / "scene.glb").read_bytes() == model
    changed = (closet / "zooming.toml").read_text()
    (closet / "zooming.toml").write_text(changed.replace("trials = 4", "trials = 5"))
    try:
        result = subprocess.run(script, capture_output=True, text=True, timeout=400, check=False, cwd=closet)
    finally:
        (closet / "zooming.toml").write_text(changed)
    assert result.returncode == 2
    assert "has changed since the run" in result.stderr


def test_views_point_into_the_store(closet):
    """The run's views/ are readable images with the camera that the table names."""
    for view in rows(closet / "first" / "views.csv"):
        camera = read_view(closet / "first" / view["exr"]).camera
        assert (camera.name, camera.zoom) == (view["camera"], float(view["zoom"]))


def test_a_repeated_run_renders_nothing_and_says_the_same(closet):
    """The second run finds all views and detections, and its tables are the first's, byte for byte."""
    result = run(closet, "zooming.toml", "pairs.toml", "alone.toml", "--out", "second")
    assert result.returncode == 0, result.stderr
    assert "0 rendered, 0 measured now" in result.stdout
    for name in DETERMINED:
        assert (closet / "first" / name).read_bytes() == (closet / "second" / name).read_bytes(), name


def test_order_and_company_of_sweeps_change_nothing(closet):
    """A sweep gives the same rows alone as among others."""
    assert run(closet, "pairs.toml", "--out", "pairs").returncode == 0
    together = [r for r in rows(closet / "first" / "configurations.csv") if r["sweep"] == "pairs"]
    assert rows(closet / "pairs" / "configurations.csv") == together


def test_damaged_files_are_made_again(closet):
    """A view and a measurement cut short are noticed, and the tables come out the same."""
    view = next((closet / "store" / "views").rglob("*.exr"))
    view.write_bytes(view.read_bytes()[:100])
    measurement = next((closet / "store" / "measurements").rglob("*.npz"))
    measurement.write_bytes(b"")
    result = run(closet, "zooming.toml", "pairs.toml", "alone.toml", "--out", "mended")
    assert result.returncode == 0, result.stdout + result.stderr
    for name in DETERMINED:
        assert (closet / "first" / name).read_bytes() == (closet / "mended" / name).read_bytes(), name


def test_one_marker_more_one_camera_more_another_sensor(closet):
    """Only the TOML changes: a fourth row of markers, a fifth camera, 16:9; tables and figures follow."""
    changed = (
        SCENE.replace("rows = 3", "rows = 4")
        .replace("module_mm = 35.0", "module_mm = 30.0")
        .replace("[320, 240]", "[384, 216]")
        .replace("pixel_pitch_um = 18.6", "pixel_pitch_um = 15.5")
    )
    fifth = changed.split("[[cameras]]")[2].replace('"middle"', '"high"').replace("[0.0, 1.3, 2.0]", "[0.0, 1.3, 2.3]")
    changed = changed.replace("[markers]", f"[[cameras]]{fifth.split('[markers]')[0]}\n[markers]", 1)
    (closet / "wider.toml").write_text(changed)
    sweep = SWEEP.replace("closet.toml", "wider.toml").replace('"east"]', '"east", "high"]', 1)
    (closet / "wide.toml").write_text(sweep.replace("[1.5, 2.0, 3.0]", "[1.5, 2.0]"))
    result = run(closet, "wide.toml", "--out", "wide", "--trials", 2)
    assert result.returncode == 0, result.stdout + result.stderr
    table = rows(closet / "wide" / "configurations.csv")
    assert {(r["points"], r["cameras"]) for r in table} == {("16", "4")}
    view = rows(closet / "wide" / "views.csv")[0]
    assert read_view(closet / "wide" / view["exr"]).radiance.shape == (216, 384)
    assert (closet / "wide" / "figures" / "wide.png").exists()


def test_interrupted_run_ends_with_130_and_goes_on_from_there(closet, tmp_path):
    """Ctrl-C keeps what is rendered; the next run renders only the rest."""
    for name in ("closet", "zooming"):
        (tmp_path / f"{name}.toml").write_text((closet / f"{name}.toml").read_text())
    process = subprocess.Popen(
        command(tmp_path, "zooming.toml", "--out", "cut"),
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    deadline = time.monotonic() + 200
    while not whole_views(tmp_path) and time.monotonic() < deadline:
        time.sleep(0.05)
    os.killpg(process.pid, signal.SIGINT)
    _, message = process.communicate(timeout=60)
    assert process.returncode == 130, message
    assert "Traceback" not in message
    kept = len(whole_views(tmp_path))
    assert kept >= 1
    assert not list((tmp_path / "store").rglob(".*"))
    result = run(tmp_path, "zooming.toml", "--out", "cut")
    assert result.returncode == 0, result.stderr
    assert f"({7 - kept} rendered" in result.stdout
    whole = [r for r in rows(closet / "first" / "configurations.csv") if r["sweep"] == "zooming"]
    assert rows(tmp_path / "cut" / "configurations.csv") == whole


def test_set_overrides_scene_and_sweep(closet):
    """--set reaches both files; a brighter exposure is not the stored view."""
    result = run(closet, "pairs.toml", "--set", "sensor.exposure_ms=4", "--set", "sweep.trials=2", "--dry-run")
    assert result.returncode == 0, result.stderr
    assert "4 views: 4 to render (0 stored), 4 to measure (0 stored)" in result.stdout


def test_too_much_light_is_said_aloud(closet):
    """A hundred times the exposure: every view is overexposed, the table says by how much, and one line what helps."""
    table = rows(closet / "first" / "views.csv")
    assert {float(view["saturated_share"]) for view in table} == {0.0}
    assert "saturated" not in (closet / "first.log").read_text()
    result = run(closet, "alone.toml", "--set", "sensor.exposure_ms=200", "--out", "glaring")
    assert result.returncode == 0, result.stderr
    shares = {v["camera"]: float(v["saturated_share"]) for v in rows(closet / "glaring" / "views.csv")}
    worst = max(shares, key=shares.get)
    assert shares[worst] > 0.3
    (line,) = [line for line in result.stderr.splitlines() if "saturated" in line]
    start = "2 of 2 views have more than 0.1% of the pixels on markers saturated; the worst is "
    assert line.startswith(start)
    assert f"{start}the view of camera {worst} at {worst} of alone: {shares[worst]:.1%}. What helps: " in line


def test_an_exposure_of_auto_is_chosen_said_and_kept(closet):
    """The line's number is that of run.json and of the views, in which the brightest marker is as bright as asked."""
    result = run(closet, "alone.toml", "--set", "sensor.exposure_ms=auto", "--out", "auto", "--dry-run")
    assert result.returncode == 0, result.stderr
    (announced,) = [line for line in result.stdout.splitlines() if line.startswith("exposure: ")]
    result = run(closet, "alone.toml", "--set", "sensor.exposure_ms=auto", "--out", "auto")
    assert result.returncode == 0, result.stderr
    assert announced in result.stdout.splitlines()
    assert "saturated" not in result.stderr
    found = re.fullmatch(
        r"exposure: (\S+) ms chosen "
        r"\(brightest marker at (\d+)% of saturation, requested: 70%; it is (\d+) in camera (\w+)\)",
        announced,
    )
    exposure_ms, percent, marker, camera = found.groups()
    sensor = json.loads((closet / "auto" / "run.json").read_text())["scenes"]["alone"]["sensor"]
    assert sensor["exposure_ms"] == float(exposure_ms)
    views = {v["camera"]: read_view(closet / "auto" / v["exr"]) for v in rows(closet / "auto" / "views.csv")}
    assert {view.sensor.exposure_ms for view in views.values()} == {float(exposure_ms)}
    brightest = {
        name: np.percentile((view.expected_electrons() / view.sensor.saturation_e)[view.marker_id >= 0], 99)
        for name, view in views.items()
    }
    # cos⁴ θ takes up to a few per cent off what is reckoned on the axis.
    on_marker = views[camera].expected_electrons()[views[camera].marker_id == int(marker)]
    assert 0.9 * int(percent) / 100 < np.percentile(on_marker, 90) / views[camera].sensor.saturation_e < 0.7
    assert max(brightest.values()) < 0.7
