"""A view's name is the hash of all that determines its pixels; its random numbers come from that name."""

from __future__ import annotations

import dataclasses
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pss import Box, ImageSensor, PTZCamera, Sphere
from render.code_digest import Code
from render.keys import light_key, state_key
from render.lens.sampling import Sampling
from render.random_streams import random_stream
from render.renderer import ViewRequest
from render.world.marker_print import pattern
from render.world.state import Light, Motion, SceneState
from tests.helpers.keyed_state import MARKER, OBJECTS, STATE

CAMERA = PTZCamera((0.0, 2.8, 2.8), 180.0, -20.0, zoom=3.0, focus_distance_m=3.8, name="4")
SENSOR = ImageSensor(550.0, 0.5, 4.0, 10_000.0, 6.0, 12, 64)
REQUEST = ViewRequest(STATE, CAMERA, SENSOR, Sampling(), "mitsuba-3.9.0-llvm_ad_mono-llvm23")

# Another value for every field but a camera's name: a new field without a line here fails the test.
OTHER_CAMERA = {
    "position_m": (0.0, 2.8, 2.7),
    "pan_deg": 181.0,
    "tilt_deg": -20.001,
    "zoom": 3.5,
    "focus_distance_m": 3.9,
    "f_number": 2.0,
    "resolution": (1280, 961),
    "pixel_pitch_m": 4.6e-6,
    "max_zoom": 9.0,
    "widest_fov_deg": 89.0,
    "radial_distortion": (0.01, 0.0),
    "psf_sigma_um": 1.5,
    "aperture_blades": 6,
}
OTHER_SENSOR = {
    "wavelength_nm": 551.0,
    "quantum_efficiency": 0.6,
    "exposure_ms": 4.5,
    "full_well_e": 10_001.0,
    "read_noise_e": 6.5,
    "bits": 14,
    "black_level_dn": 65,
    "dark_current_e_per_s": 1.0,
    "prnu_share": 0.01,
    "dsnu_e": 1.0,
    "system_gain_dn_per_e": 0.41,
}
OTHER_SAMPLING = {"noise_ratio": 0.26, "pilot": 16, "fewest": 10, "most": 2048}
OTHER_ROOM = {
    "width_m": 6.5,
    "length_m": 6.5,
    "height_m": 3.5,
    "wall_albedo": 0.5,
    "floor_albedo": 0.3,
    "ceiling_albedo": 0.7,
}
OTHER_MARKER = {
    "id": 6,
    "object_name": "ball",
    "centre_m": (0.0, -1.0, 1.31),
    "normal": (0.0, -1.0, 0.0),
    "up": (1.0, 0.0, 0.0),
    "module_m": 0.021,
}
OTHER_RECTANGLE = {
    "centre_m": (0.0, -1.0, 1.4),
    "width_m": 2.5,
    "height_m": 1.9,
    "facing_deg": 1.0,
    "elevation_deg": 1.0,
}
OTHER_SPHERE = {"centre_m": (0.2, 0.1, 1.3), "radius_m": 0.41}
OTHER_BOX = {"lowest_m": (0.01, -0.1, 0.0), "highest_m": (0.4, 0.3, 0.81)}
OTHER_MESH = {
    "vertices_m": np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 1e-9, 1)]),
    "faces": np.array([(0, 1, 3), (0, 2, 3)]),
}
OTHER_MOTION = {
    "velocity_m_per_s": (0.0, 1.2, 0.0),
    "turn_rate_deg_per_s": (0.0, 0.0, 30.0),
    "about_m": (0.0, 0.0, 1.0),
}
OTHER_PRINT = {"dictionary": "DICT_5X5_100", "quiet_zone_modules": 0.9, "white_albedo": 0.8, "black_albedo": 0.05}


def changes(value: object, others: dict[str, object], but: tuple[str, ...] = ()) -> list[object]:
    """`value` with each of its fields changed in turn."""
    assert {field.name for field in dataclasses.fields(value)} - set(but) == set(others)
    return [dataclasses.replace(value, **{name: other}) for name, other in others.items()]


def other_states() -> list[SceneState]:
    board, ball, plinth, tent = OBJECTS
    light = STATE.light
    panel = light.panels[0]
    other_objects = [
        *(dataclasses.replace(item, albedo=0.6) for item in OBJECTS),
        *(dataclasses.replace(ball, motion=motion) for motion in [Motion(), *changes(Motion(), OTHER_MOTION)]),
        *(dataclasses.replace(board, shape=shape) for shape in changes(board.shape, OTHER_RECTANGLE, but=("name",))),
        *(dataclasses.replace(ball, shape=shape) for shape in changes(ball.shape, OTHER_SPHERE, but=("name",))),
        *(dataclasses.replace(plinth, shape=shape) for shape in changes(plinth.shape, OTHER_BOX, but=("name",))),
        *(dataclasses.replace(tent, shape=shape) for shape in changes(tent.shape, OTHER_MESH, but=("name",))),
    ]
    other_lights = [
        Light(0.21, light.panels),
        Light(0.2, ()),
        Light(0.2, (), 0.4),
        Light(0.2, light.panels * 2),
        Light(0.2, (dataclasses.replace(panel, centre_m=(1.1, 1.2)),)),
        Light(0.2, (dataclasses.replace(panel, size_m=(0.6, 1.1)),)),
    ]
    return [
        *(dataclasses.replace(STATE, room=room) for room in changes(STATE.room, OTHER_ROOM)),
        *(dataclasses.replace(STATE, light=light) for light in other_lights),
        *(dataclasses.replace(STATE, objects=(item,)) for item in other_objects),
        dataclasses.replace(STATE, objects=OBJECTS[:2]),
        dataclasses.replace(STATE, markers=()),
        *(dataclasses.replace(STATE, markers=(marker,)) for marker in changes(MARKER, OTHER_MARKER)),
        *(dataclasses.replace(STATE, print=style) for style in changes(STATE.print, OTHER_PRINT)),
    ]


def test_the_key_changes_with_all_that_determines_pixels():
    """Camera, sensor, sampling, scene state and renderer: every field of each, and no two changes share a name."""
    requests = [
        REQUEST,
        *(dataclasses.replace(REQUEST, camera=camera) for camera in changes(CAMERA, OTHER_CAMERA, but=("name",))),
        *(dataclasses.replace(REQUEST, sensor=sensor) for sensor in changes(SENSOR, OTHER_SENSOR)),
        *(dataclasses.replace(REQUEST, sampling=sampling) for sampling in changes(Sampling(), OTHER_SAMPLING)),
        *(dataclasses.replace(REQUEST, state=state) for state in other_states()),
        dataclasses.replace(REQUEST, renderer="mitsuba-3.9.0-scalar_rgb"),
    ]
    keys = [request.key for request in requests]
    assert len(set(keys)) == len(keys) > 50


@pytest.mark.parametrize("item", OBJECTS, ids=lambda item: item.shape.name)
def test_the_key_changes_with_a_shape_in_place(item):
    """A shape of another kind at the same place in the list is another state."""
    others = [Sphere(item.shape.name, (0.0, 0.0, 1.0), 0.4), Box(item.shape.name, (0.0, 0.0, 0.0), (0.4, 0.4, 0.4))]
    states = [dataclasses.replace(STATE, objects=(dataclasses.replace(item, shape=shape),)) for shape in others]
    states.append(dataclasses.replace(STATE, objects=(item,)))
    assert len({state_key(state) for state in states}) == 3


def test_the_key_does_not_know_the_cameras_name():
    """Two cameras that see the same share a view, whatever tables call them."""
    renamed = dataclasses.replace(REQUEST, camera=dataclasses.replace(CAMERA, name="north"))
    assert renamed.key == REQUEST.key


def test_other_code_renders_views_of_other_names(monkeypatch):
    """Views and light of older code are not taken for today's; their random numbers stay."""
    before, light = REQUEST.key, light_key(STATE)
    monkeypatch.setattr("render.keys.view_code", lambda: Code((), (), 8 * "0"))
    assert dataclasses.replace(REQUEST).key == before[:16] + 8 * "0" != before
    assert dataclasses.replace(REQUEST).content == REQUEST.content
    monkeypatch.setattr("render.keys.light_code", lambda: Code((), (), 8 * "1"))
    assert light_key(STATE) != light


def test_the_key_changes_with_the_bits_of_the_markers(monkeypatch):
    """A library that prints other modules under a dictionary's name makes other images."""
    before = dataclasses.replace(REQUEST).key
    state_key.cache_clear()
    monkeypatch.setattr("render.keys.pattern", lambda dictionary, marker_id: ~pattern(dictionary, marker_id))
    assert dataclasses.replace(REQUEST).key != before
    state_key.cache_clear()


def test_equal_numbers_from_numpy_give_the_same_key():
    """A camera whose settings come out of numpy is the same camera."""
    camera = dataclasses.replace(CAMERA, zoom=np.float64(3.0), position_m=tuple(np.array([0.0, 2.8, 2.8])))
    assert dataclasses.replace(REQUEST, camera=camera).key == REQUEST.key


def test_the_key_is_the_same_in_another_process():
    """Nothing of a process (its hash seed, the order of a set) is in a key: workers and later runs find the view."""
    ask = "import tests.render.test_view_keys as t; print(t.REQUEST.key)"
    answers = [
        subprocess.run(
            [sys.executable, "-c", ask], env={"PYTHONHASHSEED": seed}, capture_output=True, text=True, check=True
        ).stdout.strip()
        for seed in ("1", "2")
    ]
    assert answers == [REQUEST.key] * 2


# ---- random numbers --------------------------------------------------------------------------------------------------

# The first number of one stream, below 2^63.
PINNED = 4183459641753437456
DRAWS = 20_000
# The correlation of two independent streams has a σ of 1/√n.
CORRELATION = 5 / DRAWS**0.5


def test_a_stream_is_pinned():
    """Stored measurements are made of these numbers: numpy's SeedSequence and PCG64 promise to keep them."""
    assert random_stream(7, "0123456789abcdef", "capture", 3).integers(2**63) == PINNED


@given(st.integers(0, 2**64), st.text("0123456789abcdef", min_size=1), st.text(max_size=20), st.integers(0, 2**40))
def test_a_stream_is_reproducible(seed, key, stream, trial):
    """The same seed, view, stream and trial give the same numbers, whatever was drawn before."""
    random_stream(seed, key, "other", trial).random(3)
    first, second = (random_stream(seed, key, stream, trial).random(8) for _ in range(2))
    np.testing.assert_array_equal(first, second)


def test_streams_are_independent():
    """Another seed, view, stream or trial gives numbers that have nothing to do with the first."""
    arguments = [
        (0, "a0", "capture", 0),
        (1, "a0", "capture", 0),
        (0, "a1", "capture", 0),
        (0, "a0", "render", 0),
        (0, "a0", "capture", 1),
        (1, "a0", "capture", 1),
        (0, "a0", "sample capture", 0),
    ]
    draws = np.array([random_stream(*argument).standard_normal(DRAWS) for argument in arguments])
    correlation = np.corrcoef(draws) - np.eye(len(draws))
    assert np.abs(correlation).max() < CORRELATION
    # Seed and trial do not change places.
    assert random_stream(1, "a0", "capture", 0).random() != random_stream(0, "a0", "capture", 1).random()


def test_trials_do_not_share_numbers():
    """Thousands of trials of a view begin with thousands of different numbers."""
    firsts = {int(random_stream(0, "a0", "capture", trial).integers(2**63)) for trial in range(3000)}
    assert len(firsts) == 3000
