"""Sweeps that vary the scene: each step has its own scene, sensor and noise, and every mistake is told."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import scenes
import scenes.steps.sweep_file
from pss import evaluate
from render.keys import state_key
from render.lens.sampling import Sampling
from scenes import SceneError, known_sweeps, load_sweep
from validate.sweeps.sweep import plan

FOLDER = Path(scenes.__file__).parent
EXPOSURE = (FOLDER / "sweeps" / "exposure.toml").read_text().replace("../bench", f"{FOLDER}/bench")
FACTORS = {
    "aperture": 6,
    "cameras": 6,
    "distance": 5,
    "distance-same-size": 5,
    "exposure": 5,
    "incidence": 6,
    "resolution": 5,
    "ring-distance": 5,
}
# Of another scene, with a topic of its own.
MOTION = "exposure-motion"
# m and 1: positions in the files have four decimals.
ROUNDED = 2e-4
MIDDLE, NORMAL = (0.0, -3.5, 2.2), (0.0, 1.0, 0.0)


@pytest.fixture(scope="module")
def bench():
    return scenes.load(FOLDER / "bench.toml")


def steps(name, bench):
    return load_sweep(name).configurations(bench)


def configurations(folder, text, *replacements):
    for old, new in replacements:
        assert old in text, old
        text = text.replace(old, new, 1)
    path = folder / "sweep.toml"
    path.write_text(text)
    sweep = load_sweep(path)
    return sweep.configurations(scenes.load(sweep.scene_path))


def test_sweeps_of_one_factor_are_those_that_vary_the_scene():
    assert {name for name in known_sweeps() if load_sweep(name).varies_scene} == {*FACTORS, MOTION}


@pytest.mark.parametrize("name", FACTORS)
def test_the_factor_sweeps_fit_the_bench(name, bench):
    """All steps are scenes without warnings, in which nearly every marker is in view of all cameras that look."""
    found = steps(name, bench)
    assert len(found) == FACTORS[name]
    for step in found:
        assert not step.scene.warnings
        assert step.value > 0
        state = step.scene.state
        seen = evaluate(step.cameras, state.points_m, state.normals, noise="corrected", occluder=state.occluders)
        assert seen.visible.mean() > 0.97, step.label


def test_the_exposure_of_walkers_fits_the_hallway():
    """All steps are one scene without warnings, in which both avatars walk and nothing but the sensor differs."""
    sweep = load_sweep(MOTION)
    found = sweep.configurations(scenes.load(sweep.scene_path))
    assert [step.scene.sensor.exposure_ms for step in found] == [step.value for step in found]
    assert len({state_key(step.scene.state) for step in found}) == 1
    speeds = [np.linalg.norm(item.motion.velocity_m_per_s) for item in found[0].scene.state.objects]
    assert speeds == pytest.approx([1.2, 1.2])
    for step in found:
        assert not step.scene.warnings
        for number, camera in enumerate(step.cameras):
            body = step.scene.state.objects[number // 2].shape.vertices_m
            assert camera.in_frustum(body).mean() > 0.97


def test_a_step_has_its_own_sensor_noise_and_views(bench):
    """Exposure and pixels reach the sensor, the noise models and the names of the views; the bench itself stays."""
    found = steps("exposure", bench)
    assert [step.scene.sensor.exposure_ms for step in found] == [2.5, 5, 10, 20, 40]
    assert bench.sensor.exposure_ms == 5
    assert [step.scene.noise_models[2].factors[0].sensor.exposure_ms for step in found] == [2.5, 5, 10, 20, 40]
    planned = plan(load_sweep("exposure"), bench, "renderer", Sampling())
    requests = [item.request for views in planned.views for item in views]
    assert len({request.key for request in requests}) == 10
    assert len({state_key(request.state) for request in requests}) == 1
    assert [request.sensor.exposure_ms for request in requests[::2]] == [2.5, 5, 10, 20, 40]
    for step in steps("resolution", bench):
        camera = step.cameras[0]
        assert camera.resolution[0] == step.value
        assert camera.resolution[0] * camera.pixel_pitch_m == pytest.approx(5.952e-3)


def test_a_step_that_changes_nothing_is_the_scene_itself(bench):
    """Its views are the same views."""
    (same,) = (step for step in steps("exposure", bench) if step.value == 5)
    assert state_key(same.scene.state) == state_key(bench.state)
    assert (same.scene.sensor, same.cameras) == (bench.sensor, bench.cameras[:2])


@pytest.mark.parametrize("name", ["distance", "distance-same-size", "ring-distance"])
def test_distance_alone_is_varied(name, bench):
    """The angles to the boards stay; with the zoom following, the pixels a metre stay as well."""
    px_per_m = []
    for step in steps(name, bench):
        for camera in step.cameras:
            assert float(camera.range_m(MIDDLE)) == pytest.approx(step.value, abs=ROUNDED)
            assert camera.focus_distance_m == step.value
            assert float(camera.cos_incidence(MIDDLE, NORMAL)) == pytest.approx(np.cos(np.pi / 6), abs=ROUNDED)
        px_per_m.append(step.cameras[0].focal_px / step.value)
        assert bool(step.scene.state.light.ring_w_per_sr) == (name == "ring-distance")
    assert (np.ptp(px_per_m) < 0.1) == (name != "distance")


def test_incidence_alone_is_varied(bench):
    """Both cameras have the incidence that the step says, at 3 m, with 60 degrees between their rays."""
    for step in steps("incidence", bench):
        for camera in step.cameras:
            assert float(camera.cos_incidence(MIDDLE, NORMAL)) == pytest.approx(step.value, abs=ROUNDED)
            assert float(camera.range_m(MIDDLE)) == pytest.approx(3, abs=ROUNDED)
        a, b = (np.array(camera.position_m) - MIDDLE for camera in step.cameras)
        assert a @ b / 9 == pytest.approx(0.5, abs=ROUNDED)


def test_the_light_that_is_collected_stays_where_the_aperture_is_varied(bench):
    """And the circle of confusion is as the file says."""
    found = steps("aperture", bench)
    light = [step.scene.sensor.exposure_ms / step.value**2 for step in found]
    np.testing.assert_allclose(light, light[0], rtol=1e-3)
    blur = [float(step.cameras[0].circle_of_confusion_px(MIDDLE)) for step in found]
    assert blur[0] == pytest.approx(5.1, abs=0.1)
    assert blur[-1] == pytest.approx(0.9, abs=0.05)


def test_from_three_cameras_on_information_grows_with_their_number(bench):
    """With R = I, at the boards' middle, J of n cameras is n / 3 times that of three."""
    information = []
    for step in steps("cameras", bench):
        assert len(step.cameras) == step.value
        jacobian = np.array([camera.jacobian(MIDDLE) for camera in step.cameras])
        information.append(np.einsum("cij,cik->jk", jacobian, jacobian))
    for count, found in zip(range(3, 8), information[1:], strict=True):
        np.testing.assert_allclose(found, information[1] * count / 3, atol=1e-3 * information[1].max())


BROKEN = {
    "as many": ([("[2.5, 5.0, 10.0, 20.0, 40.0]\n\n", "[2.5, 5.0]\n\n")], "as many as the values, 2"),
    "twice": ([("[2.5, 5.0, 10.0", "[2.5, 2.5, 10.0")], "nothing twice"),
    "unknown key": ([("sensor.exposure_ms", "sensor.exposur_ms")], 'did you mean "exposure_ms"'),
    "no scene": ([('_ms" = [2.5,', '_ms" = [-2.5,')], "vary.set at exposure_ms = 2.5:"),
    "auto": ([('_ms" = [2.5,', '_ms" = ["auto",')], "an exposure that is a number of ms at every step"),
    "markers": (
        [("[vary.set]", '[vary.set]\n"objects.large.markers.first_id" = [46, 47, 48, 49, 50]')],
        "markers of the same ids",
    ),
    "noise": ([("[vary.set]", '[vary.set]\n"noise.models" = [["identity"]]')], "as many as the values, 5"),
    "unknown camera": ([('["1", "2"]', '["1", "9"]')], "1, 2, 3, 4, 5, 6, 7 (the cameras of"),
    "two words": ([("[vary.set]", 'active = [["1"], ["2"], ["3"], ["4"], ["5"]]\n[vary.set]')], "no active beside"),
    "few active": (
        [('active = ["1", "2"]\n', ""), ("[vary.set]", 'active = [["1"]]\n[vary.set]')],
        "as many as the values, 5",
    ),
    "no list": ([("= [2.5, 5.0, 10.0, 20.0, 40.0]\n\n", "= 2.5\n\n")], "a list of one or more numbers"),
    "no axis": ([('axis = "exposure_ms"\n', "")], "what the values are of"),
}


@pytest.mark.parametrize("what", BROKEN)
def test_a_mistake_of_a_step_is_told(what, tmp_path):
    """With the step, the key and what is allowed there."""
    replacements, allowed = BROKEN[what]
    with pytest.raises(SceneError) as caught:
        configurations(tmp_path, EXPOSURE, *replacements)
    assert any(allowed in problem for problem in caught.value.problems), caught.value.problems


def test_a_scene_whose_exposure_is_still_to_be_chosen_is_refused(tmp_path):
    """Steps of another light would each ask for another one."""
    sweep = load_sweep("aperture")
    with pytest.raises(SceneError, match='exposure_ms = "auto"; allowed: a number of ms'):
        sweep.configurations(scenes.load(sweep.scene_path, ["sensor.exposure_ms=auto"]))


def test_overrides_of_the_scene_hold_at_every_step():
    """A step starts from the scene as it was loaded."""
    sweep = load_sweep("exposure", ["sweep.trials=5"])
    scene = scenes.load(sweep.scene_path, ["sensor.read_noise_e=3", "cameras.1.zoom=2"])
    for step in sweep.configurations(scene):
        assert step.scene.sensor.read_noise_e == 3
        assert step.cameras[0].zoom == 2
    assert sweep.resolved()["vary"]["set"] == {"sensor.exposure_ms": [2.5, 5.0, 10.0, 20.0, 40.0]}
