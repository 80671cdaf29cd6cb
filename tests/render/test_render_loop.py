"""Closing the loop: where the detector finds the markers of a noise-free render is where the camera model puts them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from pss.surrogates import any_blocks
from render.lens.sampling import Sampling
from render.renderer import RenderedView
from validate.markers.detect import find_markers
from validate.markers.localise import localise

pytestmark = pytest.mark.render

CAMERAS = tuple("1234567")
# px per axis. The localisation's frozen bias differs from marker to marker (RMS 0.004 to 0.016 px here), so that its
# mean over 26 to 40 markers is known to 0.003 px; pixels half a pixel off would give 0.5.
MEAN_PX = 0.01
# px, length of the error vector, for modules as large as these (on the axis of the marker, not foreshortened).
RMS_PX = 0.05
LARGE_MODULE_PX = 6.0
# Of the markers that a camera sees whole, foreshortened to no less than this cosine, so many are found.
FACING = 0.35
FOUND_SHARE = 0.9
# Plates are flat and stand off a ball: within 6° of grazing (a cosine of 0.1) one may be seen from behind, over the
# ball's outline, or be hidden by a neighbour, which the metric's sphere knows nothing of.
GRAZING = 0.1
# Relative; Mitsuba's single precision over a few metres.
SINGLE = 1e-5
# Sampling noise of the sensor's: what is left of it shifts a marker by 0.002 px.
SAMPLING = Sampling(noise_ratio=0.25)


@dataclass(frozen=True, eq=False)
class Loop:
    """A view, and its markers: residual (N, 2) in px (nan: not found), projected pixel (N, 2), module (N,) in px."""

    view: RenderedView
    residual_px: np.ndarray
    pixel: np.ndarray
    module_px: np.ndarray
    in_sight: np.ndarray
    cos_incidence: np.ndarray


def close(room, renderer, name: str) -> Loop:
    state, camera = room.state, room.camera(name)
    view = renderer.render(renderer.request(camera, room.sensor, SAMPLING))
    # Digital numbers as they would be without any noise, quantisation included.
    numbers = view.expected_electrons() / room.sensor.gain_e_per_dn + room.sensor.black_level_dn
    pixel, depth = camera.project(state.points_m)
    residual = np.full_like(pixel, np.nan)
    index = {marker.id: number for number, marker in enumerate(state.markers)}
    found = find_markers(numbers, state.print.dictionary)
    for marker, corners in zip(found.ids.tolist(), found.corners_px, strict=True):
        localised = localise(numbers, corners, marker, state.print.dictionary, room.sensor)
        if localised is not None:
            residual[index[marker]] = localised.centre_px - pixel[index[marker]]
    cosine = camera.cos_incidence(state.points_m, state.normals)
    cameras = np.broadcast_to(np.array(camera.position_m), state.points_m.shape)
    clear = ~any_blocks(state.occluders, state.points_m, cameras)
    in_sight = camera.in_frustum(state.points_m) & (cosine > 0) & clear
    module_px = camera.focal_px * np.array([marker.module_m for marker in state.markers]) / depth
    return Loop(view, residual, pixel, module_px, in_sight, cosine)


@pytest.fixture(scope="module")
def loops(room, room_renderer) -> dict[str, Loop]:
    """All seven cameras of the shipped room, as the scene sets them: focused on what they are aimed at."""
    return {name: close(room, room_renderer, name) for name in CAMERAS}


@pytest.mark.parametrize("name", CAMERAS)
def test_markers_are_found_where_the_camera_model_projects_them(loops, name):
    """Convention: OpenCV's pixels, no offset between rendering and prediction; the residual is the detector's own."""
    loop = loops[name]
    large = np.isfinite(loop.residual_px[:, 0]) & (loop.module_px >= LARGE_MODULE_PX)
    error = loop.residual_px[large]
    mean, rms = error.mean(axis=0), np.sqrt((error**2).sum(axis=1).mean())
    print(
        f"camera {name}: {large.sum()} markers of {loop.in_sight.sum()} in sight, "
        f"mean {mean[0]:+.4f}, {mean[1]:+.4f} px, RMS {rms:.4f}, largest {np.linalg.norm(error, axis=1).max():.3f} px"
    )
    assert large.sum() >= 20
    assert np.abs(mean).max() <= MEAN_PX
    assert rms <= RMS_PX


def test_all_cameras_together(loops):
    """Over the 240 markers of all cameras the mean is known to 0.001 px: half of what one camera may show is left."""
    error = np.concatenate([loop.residual_px[np.isfinite(loop.residual_px[:, 0])] for loop in loops.values()])
    mean, rms = error.mean(axis=0), np.sqrt((error**2).mean(axis=0))
    print(f"{len(error)} markers: mean {mean[0]:+.4f}, {mean[1]:+.4f} px, RMS {rms[0]:.4f}, {rms[1]:.4f} px per axis")
    assert np.abs(mean).max() <= MEAN_PX / 2


@pytest.mark.parametrize("name", CAMERAS)
def test_what_is_found_is_in_sight(loops, name):
    """The detector finds no marker that the metric's shapes hide, and nearly all that they show."""
    loop = loops[name]
    found = np.isfinite(loop.residual_px[:, 0])
    assert not (found & ~loop.in_sight).any()
    margin = 7 * loop.module_px[:, None]  # the plate has 8 modules; its diagonal, half of it, and some
    whole = ((loop.pixel > margin) & (loop.pixel < np.array(loop.view.camera.resolution) - 1 - margin)).all(axis=1)
    easy = loop.in_sight & whole & (loop.cos_incidence > FACING) & _plates_uncovered(loop)
    assert easy.sum() >= 15
    assert found[easy].mean() >= FOUND_SHARE


def _plates_uncovered(loop: Loop) -> np.ndarray:
    """Whether the layer of marker numbers shows each plate from end to end, along its image's rows and columns."""
    layer, height = loop.view.marker_id, loop.view.marker_id.shape[0]
    uncovered = np.zeros(len(loop.pixel), dtype=bool)
    for number in np.flatnonzero(loop.in_sight):
        x, y = np.rint(loop.pixel[number]).astype(int)
        seen = (layer[max(y - 200, 0) : min(y + 200, height), max(x - 200, 0) : x + 200] == layer[y, x]).sum()
        # A plate's area in pixels, 8 × 8 modules, foreshortened.
        uncovered[number] = seen > 0.9 * (8 * loop.module_px[number]) ** 2 * loop.cos_incidence[number]
    return uncovered


@pytest.mark.parametrize("name", CAMERAS)
def test_layers_agree_with_scene_and_camera(room, loops, name):
    """At a marker's pixel the layers say its number, its normal, and the depth where the pixel's ray meets its plane.

    A marker that the metric's shapes hide (or that looks away) is not in the layer at its pixel.
    """
    loop, camera = loops[name], room.camera(name)
    inside = camera.in_frustum(room.state.points_m) & (np.abs(loop.cos_incidence) > GRAZING)
    assert (inside & loop.in_sight).sum() >= 20
    assert (inside & ~loop.in_sight).sum() >= 5
    for number, marker in enumerate(room.state.markers):
        if not inside[number]:
            continue
        x, y = np.rint(loop.pixel[number]).astype(int)
        if not loop.in_sight[number]:
            assert loop.view.marker_id[y, x] != marker.id
            continue
        assert loop.view.marker_id[y, x] == marker.id
        np.testing.assert_allclose(loop.view.normal[y, x], marker.normal, atol=SINGLE)
        # The ray through the pixel's centre, (x, y, 1) · depth in the camera frame, meets n · (p − centre) = 0.
        ray = camera.rotation.T @ np.linalg.solve(camera.intrinsic_matrix, (x, y, 1.0))
        to_centre = np.array(marker.centre_m) - camera.position_m
        depth = to_centre @ marker.normal / (ray @ marker.normal)
        assert loop.view.depth_m[y, x] == pytest.approx(depth, rel=SINGLE / loop.cos_incidence[number])


def test_cameras_are_focused_on_their_target(room):
    """The loop is closed with the scene as shipped, where each camera's plane of focus is near what it aims at."""
    for camera in room.cameras:
        _, depth = camera.project((0.0, -0.7, 1.3))
        assert abs(depth - camera.focus_distance_m) < 0.15
