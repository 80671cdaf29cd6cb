"""`run_sweep.py check`: what it foresees agrees with the metric, with geometry by hand, and with the solved light."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest

import pss
import scenes
from pss import RangeError
from pss.noise.calibrated import Calibration
from render.light.estimated_light import estimated_irradiance
from render.light.radiosity import solve_radiosity
from render.world.state import Light, Panel
from tests.helpers.visible_points import visible_points
from validate.commands.check import execute
from validate.commands.subcommands import Check
from validate.plots.plan import plan_figure
from validate.prediction import foresight as module
from validate.prediction.foresight import camera_rows, foresee, headline, marker_rows, model_rows
from validate.prediction.warnings import warnings_of
from validate.run_sweep import main

ROOT = Path(__file__).parents[3]
# Of the light on markers: what is sent back is taken to be even, and objects to send nothing. Measured medians:
# 1.02 on the bench, 1.09 in the room, 1.13 in the hallway.
ESTIMATE_WITHIN = 0.2
# An on-axis module in the image, by the pinhole's own formula.
PINHOLE_RELATIVE = 0.02


@pytest.fixture(scope="module")
def seen():
    """The paper's room, foreseen."""
    return foresee(scenes.load(ROOT / "scenes" / "room.toml"))


def bench(*overrides):
    """The bench with some keys changed."""
    return scenes.load(ROOT / "scenes" / "bench.toml", overrides)


def test_rows_count_what_the_metric_sees(seen):
    """Cameras' and markers' counts are two sums over one table, and PSS is that of pss.evaluate."""
    cameras, markers = camera_rows(seen), marker_rows(seen)
    state = seen.scene.state
    by_itself = visible_points(seen.scene.cameras, state.points_m, state.normals, state.occluders)
    np.testing.assert_array_equal(seen.visible, by_itself)
    assert sum(row["markers_visible"] for row in cameras) == sum(row["visible_to"] for row in markers)
    assert [row["markers_visible"] for row in cameras] == [
        sum(name in row["cameras"].split() for row in markers) for name in (c.name for c in seen.scene.cameras)
    ]
    for row in cameras:
        parts = row["too_small"] + row["too_blurred"] + row["likely_found"]
        assert parts == row["whole"] <= row["markers_visible"]
    [physical] = [row for row in model_rows(seen) if row["noise_model"] == seen.shown_model == "physical"]
    sigma = np.array([row["sigma_inf_m"] for row in markers])
    assert physical["pss"] == pytest.approx(np.nan_to_num(1 / sigma).mean(), rel=1e-12)
    assert physical["observable"] == sum(row["visible_to"] >= 2 for row in markers)


def test_predictions_are_those_of_the_stored_reference(seen):
    """PSS of the sweep's step at the scene's own settings; the paper's R knows no light, and is the same."""
    reference = ROOT / "results" / "reference" / "configurations.csv"
    rows = csv.DictReader(io.StringIO(reference.read_text()))
    step = {row["noise_model"]: row for row in rows if row["configuration"] == "zoom=3"}
    found = {row["noise_model"]: row["pss_single_frame"] for row in model_rows(seen)}
    for model, row in step.items():
        # With a light that is a tenth too bright: σ of a marker goes with light to a power between −1 and −1/2.
        within = ESTIMATE_WITHIN if model in ("physical", "calibrated") else 1e-5
        assert found[model] == pytest.approx(float(row["pss_single_frame"]), rel=within)


def test_a_module_is_as_large_as_the_pinhole_makes_it(seen):
    """f·module/depth, times the cosine at which it is seen, on the board's marker nearest to camera 4's axis."""
    camera = seen.scene.camera("4")
    row = [c.name for c in seen.scene.cameras].index("4")
    pixels, depth = camera.project(seen.scene.state.points_m)
    on_board = np.array([marker.object_name == "board" for marker in seen.scene.state.markers])
    off_axis = np.where(
        seen.visible[row] & on_board, np.linalg.norm(pixels - camera.principal_point_px, axis=-1), np.inf
    )
    nearest = int(off_axis.argmin())
    marker = seen.scene.state.markers[nearest]
    ray = np.array(camera.position_m) - marker.centre_m
    cosine = ray @ marker.normal / np.linalg.norm(ray)
    expected = camera.focal_px * marker.module_m / depth[nearest] * cosine
    assert seen.module_px[row, nearest] == pytest.approx(expected, rel=PINHOLE_RELATIVE)


def test_limits_are_those_that_the_bank_fitted():
    """Constants that would otherwise go stale when the bank is run again."""
    fitted = Calibration.from_file(ROOT / "results" / "reference" / "bank" / "calibrated.toml").limits
    assert fitted == {
        "smallest_module_px": module.SMALLEST_MODULE_PX,
        "largest_blur_modules": module.LARGEST_BLUR_MODULES,
    }


def test_the_estimated_light_is_near_the_solved_one():
    """Median over the markers of the bench, without its objects: the solution takes seconds then."""
    state = bench().state
    chosen = dataclasses.replace(state, objects=(), markers=state.markers[::6])
    solved = solve_radiosity(chosen).irradiance(chosen.points_m, chosen.normals)
    assert np.median(estimated_irradiance(chosen) / solved) == pytest.approx(1, abs=ESTIMATE_WITHIN)


def test_a_scene_gives_the_appearance_that_physical_and_calibrated_models_ask_for():
    """docs/own-noise.md: from a diffuse marker of albedo ρ leaves ρE/π."""
    scene = bench()
    target_appearance = scene.appearance()
    white = scene.state.print.white_albedo / np.pi * estimated_irradiance(scene.state)
    np.testing.assert_allclose(target_appearance.white_w_per_m2_sr, white)
    points, normals = scene.state.points_m, scene.state.normals
    evaluation = pss.evaluate(scene.cameras, points, normals, noise="physical", appearance=target_appearance)
    assert evaluation.observable.any()


def test_a_lamp_straight_above_by_hand():
    """L·A·cos²/d² on a marker that looks up at a far, small lamp in a room that sends nothing back."""
    state = bench().state
    marker = dataclasses.replace(state.markers[0], centre_m=(0.0, 0.0, 1.0), normal=(0.0, 0.0, 1.0), up=(0.0, 1.0, 0.0))
    black = dataclasses.replace(state.room, wall_albedo=0.0, floor_albedo=0.0, ceiling_albedo=0.0)
    light = Light(2.0, (Panel((0.0, 0.0), (0.02, 0.03)),))
    alone = dataclasses.replace(state, room=black, light=light, objects=(), markers=(marker,))
    distance_m = black.height_m - 1.0
    assert estimated_irradiance(alone)[0] == pytest.approx(2.0 * 0.02 * 0.03 / distance_m**2, rel=1e-3)


def test_reflected_light_by_hand():
    """On a marker that looks down, in a room of one albedo: Φ/A · ρ/(1 − ρ), the integrating sphere's."""
    state = bench().state
    marker = dataclasses.replace(
        state.markers[0], centre_m=(0.0, 0.0, 1.0), normal=(0.0, 0.0, -1.0), up=(0.0, 1.0, 0.0)
    )
    grey = dataclasses.replace(state.room, wall_albedo=0.6, floor_albedo=0.6, ceiling_albedo=0.6)
    light = Light(2.0, (Panel((0.0, 0.0), (0.5, 0.4)),))
    alone = dataclasses.replace(state, room=grey, light=light, objects=(), markers=(marker,))
    width, length, height = grey.width_m, grey.length_m, grey.height_m
    area = 2 * (width * length + width * height + length * height)
    assert estimated_irradiance(alone)[0] == pytest.approx(np.pi * 2.0 * 0.2 / area * 0.6 / 0.4, rel=1e-9)


def test_warnings_name_cameras_and_markers():
    """A camera that looks away, one out of focus, markers that one camera sees, and too much light."""
    room = ROOT / "scenes" / "room.toml"
    away = warnings_of(foresee(scenes.load(room, ["cameras.4.aim_m=[0.0, 2.9, 2.8]"])))
    assert any("camera 4 sees no marker" in line for line in away)
    blurred = warnings_of(foresee(scenes.load(room, ["cameras.4.focus_distance_m=0.2"])))
    assert any("camera 4" in line and "too blurred" in line for line in blurred)
    bright = warnings_of(foresee(scenes.load(room, ["sensor.exposure_ms=400.0"])))
    assert sum("times the saturation" in line for line in bright) == 7
    usual = warnings_of(foresee(scenes.load(room)))
    (line,) = [line for line in usual if "fewer than two cameras and" in line]
    lost = [row["marker"] for row in marker_rows(foresee(scenes.load(room))) if row["visible_to"] < 2]
    assert line.startswith(f"{len(lost)} of 84")
    assert not any("saturation" in line or "sees no" in line for line in usual)


def test_an_exposure_that_is_to_be_chosen_is_chosen():
    """As a run does, from the light as it is estimated: the brightest white comes to seven tenths of the saturation."""
    found = foresee(bench('sensor.exposure_ms="auto"', "sensor.longest_exposure_ms=10000.0"))
    assert found.white_share[found.visible].max() <= 0.7
    assert found.scene.auto_exposure is None


def test_the_title_follows_the_error():
    """Four times the light halves the error where shot noise rules: so must the title's number of mm, and its PSS."""
    dim, bright = (foresee(bench(f"sensor.exposure_ms={ms}")) for ms in (4.0, 16.0))
    titles = [plan_figure(each).get_suptitle() for each in (dim, bright)]
    assert [title.split(": ", 1)[1].replace("\n", "; ") for title in titles] == [headline(dim), headline(bright)]
    pss, error = (
        [float(re.search(rf"{what} (\S+)", title)[1].replace(",", "")) for title in titles] for what in ("PSS", "error")
    )
    # Noise falls by 2 to 4: shot noise as the root of the light, read noise as the light itself.
    assert 1.8 < pss[1] / pss[0] < 4
    assert 1.8 < error[0] / error[1] < 4
    found = sum(row["likely_found_by"] >= 2 for row in marker_rows(dim))
    assert f"found by two cameras and more: {found} of {len(marker_rows(dim))} markers" in titles[0]


@pytest.mark.parametrize("kind", ["png", "svg"])
def test_the_drawing_is_there(tmp_path, capsys, kind):
    """The plan is written as the kind of file that was asked for, and the table is on stdout alone."""
    path = tmp_path / f"plan.{kind}"
    assert main(["check", "room", "--out", str(path), "--table", "csv", "--rows", "markers"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    assert len(rows) == 84
    if kind == "png":
        assert path.read_bytes().startswith(b"\x89PNG")
    else:
        assert ElementTree.parse(path).getroot().tag.endswith("svg")


def test_mistakes_are_said(tmp_path):
    """A sweep in a scene's place, and a drawing of no known kind."""
    with pytest.raises(RangeError, match=r"is a sweep.*room\.toml"):
        execute(Check(str(ROOT / "scenes" / "sweeps" / "zoom.toml")))
    with pytest.raises(RangeError, match=r"\.png"):
        execute(Check("room", tmp_path / "plan.gif"))


def test_no_renderer_is_loaded(tmp_path):
    """In a process of its own: seconds, and no Mitsuba."""
    script = (
        "import json, sys; from validate.run_sweep import main; "
        f"main(['check', 'bench', '--out', {str(tmp_path / 'plan.png')!r}, '--table', 'md']); "
        "print(json.dumps([name for name in ('mitsuba', 'drjit') if name in sys.modules]))"
    )
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout.splitlines()[-1]) == []
