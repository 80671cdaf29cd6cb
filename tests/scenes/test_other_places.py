"""The second and third scenes: other places than the room in every respect, whose cameras see what they must."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest

import scenes
import scenes.steps.sweep_file
from pss import evaluate

FOLDER = Path(scenes.__file__).parent
PLACES = ("room", "atrium", "studio")


@pytest.fixture(scope="module")
def places():
    return {name: scenes.load(FOLDER / f"{name}.toml") for name in PLACES}


@pytest.mark.parametrize("name", PLACES[1:])
def test_it_has_no_warning_and_all_its_points_are_inside(places, name):
    place = places[name]
    assert place.warnings == ()
    room, points = place.state.room, place.state.points_m
    assert (np.abs(points[:, :2]) < [room.width_m / 2, room.length_m / 2]).all()
    assert ((points[:, 2] > 0) & (points[:, 2] < room.height_m)).all()


@pytest.mark.parametrize(("one", "other"), list(combinations(PLACES, 2)))
def test_no_two_places_are_alike(places, one, other):
    """What a calibration in one could have learnt by heart is different: room, sensor, lens, prints, light, places."""

    def of(name):
        place = places[name]
        camera, light = place.cameras[0], place.state.light
        return {
            "room": place.state.room,
            "sensor": place.sensor,
            "read noise": place.sensor.read_noise_e,
            "full well": place.sensor.full_well_e,
            "exposed light": place.sensor.exposure_ms * light.radiance_w_per_m2_sr,
            "resolution": camera.resolution,
            "pitch": camera.pixel_pitch_m,
            "f-number": camera.f_number,
            "dictionary": place.state.print.dictionary,
            "white": place.state.print.white_albedo,
            "lamps": light.panels,
        }

    first, second = of(one), of(other)
    same = [key for key in first if first[key] == second[key]]
    assert same == []
    states = places[one].state, places[other].state
    assert not {m.module_m for m in states[0].markers} & {m.module_m for m in states[1].markers}
    cameras = places[one].cameras, places[other].cameras
    assert not {c.position_m for c in cameras[0]} & {c.position_m for c in cameras[1]}


def test_cameras_of_the_studio_stand_lower_than_all_others(places):
    heights = {name: [camera.position_m[2] for camera in place.cameras] for name, place in places.items()}
    assert max(heights["studio"]) < min(heights["room"] + heights["atrium"])


@pytest.mark.parametrize("name", PLACES[1:])
def test_every_camera_sees_markers_and_most_points_two_cameras(places, name):
    """At least 60 % of the points by two; each camera at least a quarter of them."""
    place = places[name]
    state = place.state
    seen = evaluate(place.cameras, state.points_m, state.normals, noise="corrected", occluder=state.occluders).visible
    assert (seen.mean(axis=1) > 0.25).all()
    assert (seen.sum(axis=0) >= 2).mean() >= 0.6
    # Bodies are in the way of some of them.
    alone = evaluate(place.cameras, state.points_m, state.normals, noise="corrected").visible
    assert seen.sum() < 0.99 * alone.sum()
