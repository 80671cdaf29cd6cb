"""What registration errs without noise in a bank's views, beside `physical`: `python benchmarks/bias_of_views.py`.

Markers of the room's held-out views are drawn exactly (`tests/helpers/exact_drawing.py`), with their electrons and in
focus, but without noise and without the renderer, and registered from corners that are half a pixel off. Bias is in px
per axis. `1 + b'R⁻¹b/2` is what NEES/2 of pixels would be if the `physical` R held for the noise and nothing else
erred; with a floor, the same for R + floor² and noise of R. Perspective is how much the scale of the image changes over
a plate.
"""

from __future__ import annotations

import argparse
from itertools import pairwise
from pathlib import Path

import cv2
import numpy as np

import scenes
from pss import PTZCamera
from pss.cameras.views import Views
from pss.noise.photometric import sides_e
from pss.visibility.targets import WholeTarget, blur_modules, narrow_side_px
from render.light.estimated_light import estimated_appearance
from render.world.state import Marker
from scenes import Scene
from tests.helpers.exact_drawing import draw_exactly
from validate.bank.design import BankDesign, held_out_views
from validate.markers.localise import Localised, register
from validate.prediction.foresight import LARGEST_BLUR_MODULES, SMALLEST_MODULE_PX

ROOM = Path(__file__).parents[1] / "scenes" / "room.toml"
# Radiance of the lamps, W/(m² sr): the room's own is 0.2.
LIGHTS = (0.2, 0.8, 2.0, 6.0)
CORNERS_OFF_PX = 0.5
# Modules beside a plate that the image reaches.
MARGIN_MODULES = 2.0
PERSPECTIVES = (0.0, 0.015, 0.025, 0.035, 0.2)


def homography_of(camera: PTZCamera, marker: Marker) -> np.ndarray:
    """From modules about a marker's centre to pixels, 1 there."""
    axes = np.column_stack([marker.right, -np.array(marker.up)]) * marker.module_m
    columns = np.column_stack([axes, np.array(marker.centre_m) - np.array(camera.position_m)])
    found = camera.intrinsic_matrix @ camera.rotation @ columns
    return np.asarray(found / found[2, 2])


def biases(scene: Scene, step: int) -> dict[str, np.ndarray]:
    """Of each marker in each `step`th view: bias (px, 2), physical R (px², 2 × 2), white in e⁻, perspective, object."""
    cameras = held_out_views(scene, BankDesign(), "none").cameras[::step]
    state, rng = scene.state, np.random.default_rng(1)
    appearance = estimated_appearance(state)
    views = Views(cameras, state.points_m, state.normals, appearance)
    clear = WholeTarget().passed(views, views.in_frustum & (views.cos_incidence > 0), state.occluders)
    clear &= (narrow_side_px(views) > SMALLEST_MODULE_PX) & (blur_modules(views, scene.sensor) < LARGEST_BLUR_MODULES)
    white, black = (np.broadcast_to(side, clear.shape) for side in sides_e(views, appearance, scene.sensor))
    physical = scene.noise_model("physical").of_views(views).matrix(len(cameras), len(state.markers))
    half = appearance.modules / 2 + 1
    ends = np.array([[[-half, -half], [half, -half], [half, half], [-half, half]]])
    rows = []
    for view, number in np.argwhere(clear):
        marker, white_e, black_e = state.markers[number], white[view, number], black[view, number]
        homography = homography_of(cameras[view], marker)
        outline = cv2.perspectiveTransform(ends * (half + MARGIN_MODULES) / half, homography)[0]
        low = np.floor(outline.min(axis=0)).astype(int)
        width, height = np.ceil(outline.max(axis=0)).astype(int) + 1 - low
        local = np.array([[1.0, 0.0, -low[0]], [0.0, 1.0, -low[1]], [0.0, 0.0, 1.0]]) @ homography
        share = draw_exactly(state.print.dictionary, marker.id, local, (height, width))
        numbers = (black_e + (white_e - black_e) * share) / scene.sensor.gain_e_per_dn + scene.sensor.black_level_dn
        corners = cv2.perspectiveTransform(ends * (half - 1) / half, local)[0]
        corners += rng.uniform(-CORNERS_OFF_PX, CORNERS_OFF_PX, (4, 2))
        found = register(numbers.astype(np.float32), corners, marker.id, state.print.dictionary, scene.sensor)
        if isinstance(found, Localised):
            # The scale goes with the inverse of the denominator of the homography.
            change = 2 * half * float(np.hypot(*local[2, :2]))
            bias = found.centre_px - local[:2, 2]
            rows.append((bias, physical[view, number], white_e, change, marker.object_name))
    names = ("bias", "physical", "white", "perspective", "object")
    return {name: np.array(column) for name, column in zip(names, zip(*rows, strict=True), strict=True)}


def consistency(bias: np.ndarray, physical: np.ndarray, floor_px: float) -> np.ndarray:
    """Expected NEES/2 of each marker, under R + floor², of noise with R and a bias."""
    stated = physical + floor_px**2 * np.eye(2)
    moment = physical + bias[:, :, None] * bias[:, None, :]
    return np.trace(np.linalg.solve(stated, moment), axis1=1, axis2=2) / 2


def main() -> None:
    """Print rows for each light."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lights", type=float, nargs="+", default=list(LIGHTS), help="radiance of the lamps")
    parser.add_argument("--step", type=int, default=7, help="take every so many-th view")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    print("light  which                 markers  white e-  bias RMS  median   largest  physical 1 + b'R⁻¹b/2  floor")
    for light in options.lights:
        of = biases(scenes.load(ROOM, [f"light.radiance_w_per_m2_sr={light}"]), options.step)
        bias, physical, change = of["bias"], of["physical"], of["perspective"]
        floor_px = float(np.sqrt(np.mean(bias**2)))
        groups = {"all": np.ones(len(bias), dtype=bool)}
        groups |= {name: of["object"] == name for name in dict.fromkeys(of["object"])}
        for low, high in pairwise(PERSPECTIVES):
            groups[f"perspective {low:.3f}-{high:.3f}"] = (change >= low) & (change < high)
        for name, chosen in groups.items():
            if chosen.any():
                errs, r = bias[chosen], physical[chosen]
                sizes = np.abs(errs).max(axis=1)
                print(
                    f"{light:5g}  {name:20s}  {len(errs):7d}  {np.median(of['white'][chosen]):8.0f}  "
                    f"{np.sqrt((errs**2).mean()):.5f}  {np.median(sizes):.5f}  {sizes.max():.5f}  "
                    f"{np.sqrt(np.trace(r, axis1=1, axis2=2).mean() / 2):.5f}  "
                    f"{consistency(errs, r, 0.0).mean():.2f}           {consistency(errs, r, floor_px).mean():.2f}",
                    flush=True,
                )


if __name__ == "__main__":
    main()
