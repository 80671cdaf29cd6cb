"""The second scene: another place than the room in every respect, in which the cameras see what they must."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import scenes.sweep_file
from pss import evaluate
from scenes import load_scene

FOLDER = Path(scenes.sweep_file.__file__).parent


@pytest.fixture(scope="module")
def atrium():
    return load_scene(FOLDER / "atrium.toml")


def test_it_has_no_warning_and_all_its_points_are_inside(atrium):
    assert atrium.warnings == ()
    room, points = atrium.state.room, atrium.state.points_m
    assert (np.abs(points[:, :2]) < [room.width_m / 2, room.length_m / 2]).all()
    assert ((points[:, 2] > 0) & (points[:, 2] < room.height_m)).all()


def test_it_is_not_the_room(atrium):
    """What a calibration in the room could have learnt by heart is different: sensor, pixels, prints, light, places."""
    room = load_scene(FOLDER / "room.toml")
    assert len(atrium.cameras) == 6
    assert atrium.sensor != room.sensor
    ours, theirs = atrium.cameras[0], room.cameras[0]
    assert (ours.resolution, ours.pixel_pitch_m, ours.f_number) != (
        theirs.resolution,
        theirs.pixel_pitch_m,
        theirs.f_number,
    )
    assert atrium.state.print != room.state.print
    assert atrium.state.light != room.state.light
    assert not {m.module_m for m in atrium.state.markers} & {m.module_m for m in room.state.markers}
    assert not {c.position_m for c in atrium.cameras} & {c.position_m for c in room.cameras}


def test_every_camera_sees_markers_and_most_points_two_cameras(atrium):
    """At least 60 % of the points by two; each camera at least a quarter of them."""
    state = atrium.state
    seen = evaluate(atrium.cameras, state.points_m, state.normals, noise="corrected", occluder=state.occluders).visible
    assert (seen.mean(axis=1) > 0.25).all()
    assert (seen.sum(axis=0) >= 2).mean() >= 0.6
    # Bodies are in the way of some of them.
    alone = evaluate(atrium.cameras, state.points_m, state.normals, noise="corrected").visible
    assert seen.sum() < 0.99 * alone.sum()
