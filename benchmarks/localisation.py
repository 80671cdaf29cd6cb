"""Bias, noise and efficiency of the localisation over the room's seven views: `python benchmarks/localisation.py`.

Bias: registration of noise-free renders against the camera model. Noise: spread over trials, beside the σ that each
detection claims for itself, and the Cramér–Rao bound of every fifth marker, drawn without the renderer. By module size
in pixels. `--parts` exchanges one piece of the localisation after another and prints the bias that it leaves.
"""

from __future__ import annotations

import argparse
import contextlib
import dataclasses
import itertools
import time
from collections.abc import Iterator
from pathlib import Path
from unittest.mock import patch

import cv2
import numpy as np

import scenes
from render import backend
from render.lens.sampling import Sampling
from render.random_streams import random_stream
from render.renderer import Renderer
from render.sensor import capture
from render.store.folder import Store
from render.store.light import baked
from validate.markers import localise as localisation
from validate.markers import marker_image, registration
from validate.markers.cramer_rao import centre_bound, draw_finely, on_marker, pixel_sums
from validate.markers.detect import find_markers
from validate.markers.localise import localise
from validate.markers.view_measurement import measure_capture

SIZES_PX = (0, 4, 6, 8, 12, 40)
# A bound takes about a second; of so many markers one is drawn, with so many samples along a pixel's side.
BOUND_EVERY, SAMPLES = 5, 8
RATIOS = (0.1, 0.25, 0.6)
DEFOCUSED_M = (2.0, 6.0)
_blurred_steps = marker_image.blurred_steps


class Room:
    """The shipped room, with a renderer."""

    def __init__(self, store: Path) -> None:
        self.scene = scenes.load(Path(__file__).parents[1] / "scenes" / "room.toml")
        self.sensor, self.dictionary = self.scene.sensor, self.scene.state.print.dictionary
        self.ids = [marker.id for marker in self.scene.state.markers]
        self.chosen = backend.choose()
        self.renderer = Renderer(self.scene.state, baked(self.scene.state, Store(store)), self.chosen)

    def render(self, camera, noise_ratio):
        """Name and mean electrons of a view."""
        request = self.renderer.request(camera, self.sensor, Sampling(noise_ratio=noise_ratio))
        return request.key, self.renderer.render(request).expected_electrons()

    def clean(self, electrons):
        """Digital numbers without noise or rounding."""
        numbers = electrons / self.sensor.gain_e_per_dn + self.sensor.black_level_dn
        return numbers.astype(np.float32)

    def found(self, electrons) -> Iterator[tuple[int, np.ndarray]]:
        """Number in the scene and corners of each marker that is found without noise."""
        found = find_markers(np.rint(self.clean(electrons)).astype(np.uint16), self.dictionary)
        for marker, corners in zip(found.ids.tolist(), found.corners_px, strict=True):
            yield self.ids.index(marker), corners

    def drawn(self, camera, number, electrons):
        """A marker drawn finely with the levels of its render, its homography, and its corner in the image."""
        marker = self.scene.state.markers[number]
        centre, right, down = np.array(marker.centre_m), np.array(marker.right), -np.array(marker.up)
        ends = np.array([[-4, -4], [4, -4], [4, 4], [-4, 4]], dtype=np.float32)
        outline = camera.project(centre + marker.module_m * (ends[:, :1] * right + ends[:, 1:] * down))[0]
        corner = np.maximum(np.floor(outline.min(axis=0)).astype(int), 0)
        end = np.minimum(np.ceil(outline.max(axis=0)).astype(int) + 1, electrons.shape[::-1])
        width, height = end - corner
        h = cv2.getPerspectiveTransform(ends, (outline - corner).astype(np.float32))
        disc = float(camera.circle_of_confusion_px(centre))
        unit = draw_finely(self.dictionary, marker.id, h, (height, width), (0.0, 1.0), disc, SAMPLES)
        part = electrons[corner[1] : corner[1] + height, corner[0] : corner[0] + width]
        # The plate's edge is blurred, and what is beyond it is not white.
        _, _, inside = on_marker(h, part.shape, 3.5)
        gain, black = np.polyfit(pixel_sums(unit, SAMPLES)[0][inside], part[inside], 1)
        levels = (black, black + gain)
        return draw_finely(self.dictionary, marker.id, h, (height, width), levels, disc, SAMPLES), h, corner


def table(room: Room, trials: int, zooms: list[float]) -> None:
    """Print a row for each range of module sizes."""
    scene, rows, seconds, registrations = room.scene, [], 0.0, 0
    for zoom, camera in itertools.product(zooms, scene.cameras):
        camera = dataclasses.replace(camera, zoom=zoom)
        key, electrons = room.render(camera, 0.25)
        truth, depth = camera.project(scene.state.points_m)
        clean = room.clean(electrons)
        measured = [
            measure_capture(
                capture(electrons, room.sensor, random_stream(1, key, "capture", trial)),
                room.dictionary,
                tuple(room.ids),
                room.sensor,
            )[:2]
            for trial in range(trials)
        ]
        pixels, covariance = (np.array(part) for part in zip(*measured, strict=True))
        for n, corners in room.found(electrons):
            begin = time.thread_time()
            exact = localise(clean, corners, room.ids[n], room.dictionary, room.sensor)
            seconds, registrations = seconds + time.thread_time() - begin, registrations + 1
            if exact is None or np.isfinite(pixels[:, n, 0]).sum() < trials:
                continue
            module = scene.state.markers[n].module_m * camera.focal_px / depth[n]
            claimed = covariance[:, n].trace(axis1=1, axis2=2).mean() / 2
            spread, bound = pixels[:, n].var(axis=0, ddof=1).mean(), np.nan
            if len(rows) % BOUND_EVERY == 0:
                fine, h, _ = room.drawn(camera, n, electrons)
                bound = np.trace(centre_bound(fine, SAMPLES, h, 6, room.sensor)) / 2
            rows.append((module, *(exact.centre_px - truth[n]), spread, claimed, bound))
    print("module px   markers  mean bias x, y px   RMS bias px  noise σ px  claimed σ px  bound σ px  efficiency")
    numbers = np.array(rows)
    for low, high in itertools.pairwise(SIZES_PX):
        part = numbers[(numbers[:, 0] >= low) & (numbers[:, 0] < high)]
        if not len(part):
            continue
        mean, rms = part[:, 1:3].mean(axis=0), np.sqrt((part[:, 1:3] ** 2).mean())
        known = part[np.isfinite(part[:, 5])]
        efficiency = 1 / (known[:, 3] / known[:, 5]).mean() if len(known) else np.nan
        sigmas = np.sqrt([part[:, 3].mean(), part[:, 4].mean(), np.nanmean(part[:, 5]) if len(known) else np.nan])
        print(
            f"{low:3d} to {high:2d}   {len(part):6d}   {mean[0]:+.4f} {mean[1]:+.4f}     {rms:.4f}       "
            f"{sigmas[0]:.4f}      {sigmas[1]:.4f}        {sigmas[2]:.4f}      {efficiency:.2f}"
        )
    print(f"{1000 * seconds / registrations:.1f} ms of processor time a registration")


# ---- part by part ----------------------------------------------------------------------------------------------------


def _fixed(*parameters: int) -> contextlib.AbstractContextManager:
    """The fit without some of its parameters."""
    original = registration._inverse
    rest = np.ix_(*2 * [np.setdiff1d(np.arange(registration.PARAMETERS), parameters)])

    def changed(normal):
        covariance, inverse = np.zeros_like(normal), original(normal[rest])
        if inverse is not None:
            covariance[rest] = inverse
        return covariance

    return patch.object(registration, "_inverse", changed)


def _without_corners() -> contextlib.AbstractContextManager:
    original = marker_image.MarkerImage.__init__

    def changed(image, *arguments):
        original(image, *arguments)
        image._cross = np.float32(0)

    return patch.object(marker_image.MarkerImage, "__init__", changed)


def _true_blur(room: Room, camera, number) -> contextlib.AbstractContextManager:
    """The blur of the camera model from the first step on, and never changed."""
    variance = float(camera.circle_of_confusion_px(np.array(room.scene.state.markers[number].centre_m))) ** 2 / 16
    original = localisation.coarse_fit

    def changed(*arguments):
        fit = original(*arguments)
        return fit and dataclasses.replace(fit, blur_px2=variance)

    stack = contextlib.ExitStack()
    stack.enter_context(patch.object(localisation, "coarse_fit", changed))
    stack.enter_context(_fixed(12))
    return stack


def _gaussian(places, to_modules, blurs_px2):
    """Steps blurred by the pixel and by a Gaussian of the disc's variance, by sums of a sampled Gaussian."""
    at, weights = np.polynomial.hermite_e.hermegauss(24)
    sigmas = np.sqrt(blurs_px2)[:, None] * np.hypot(*to_modules.T)
    steps = np.zeros((len(blurs_px2), 3, *places.shape))
    for number, sigma in enumerate(sigmas):
        for place, weight in zip(at, weights / weights.sum(), strict=True):
            shift = (place * sigma).reshape(2, *(1,) * (places.ndim - 1))
            steps[number] += weight * _blurred_steps(places + shift, to_modules, np.zeros(1))[0]
    return steps


VARIANTS = {
    "as it is": lambda *_: contextlib.nullcontext(),
    "fitted until nothing moves": lambda *_: patch.object(localisation, "CONVERGED_SIGMAS", 1e-3),
    "blur of the camera model": _true_blur,
    "Gaussian for the lens's disc": lambda *_: patch.object(marker_image, "blurred_steps", _gaussian),
    "no shading": lambda *_: _fixed(10, 11),
    "corners by projections alone": lambda *_: _without_corners(),
    "coarse registration alone": None,
}


def parts(room: Room) -> None:
    """Print the RMS bias that each variant leaves, in focus and out of it, for markers with modules of 6 px or more."""
    focused = list(room.scene.cameras)
    defocused = [
        dataclasses.replace(room.scene.camera(name), focus_distance_m=focus)
        for name, focus in itertools.product("246", DEFOCUSED_M)
    ]
    for title, cameras in (("in focus", focused), ("focused at 2 and 6 m", defocused)):
        views = {ratio: [room.render(camera, ratio)[1] for camera in cameras] for ratio in RATIOS}
        print(title)
        for ratio in RATIOS:
            _row(f"render at noise ratio {ratio}", room, cameras, views[ratio], VARIANTS["as it is"])
        _row("drawn, with the render's levels", room, cameras, views[0.1], VARIANTS["as it is"], drawn=True)
        for name, variant in VARIANTS.items():
            _row(name, room, cameras, views[0.1], variant)


def _row(name: str, room: Room, cameras, views, variant, drawn: bool = False) -> None:
    errors, refused = [], 0
    for camera, electrons in zip(cameras, views, strict=True):
        truth, _ = camera.project(room.scene.state.points_m)
        clean = room.clean(electrons)
        for number, (n, corners) in enumerate(room.found(electrons)):
            numbers, origin = clean, 0
            if drawn:
                if number % BOUND_EVERY:
                    continue
                fine, _, origin = room.drawn(camera, n, electrons)
                numbers = room.clean(pixel_sums(fine, SAMPLES)[0])
            if variant is None:
                start = localisation._start(corners, 3.0)
                fit = localisation.coarse_fit(numbers, start, room.ids[n], room.dictionary)
                centre = None if fit is None else registration.centre_of(fit.homography)
            else:
                with variant(room, camera, n):
                    found = localise(numbers, corners - origin, room.ids[n], room.dictionary, room.sensor)
                centre = None if found is None else found.centre_px
            if centre is None:
                refused += 1
            else:
                errors.append(centre + origin - truth[n])
    error = np.array(errors)
    rms, typical = np.sqrt((error**2).mean()), np.median(np.abs(error)) / 0.6745
    print(f"  {name:34s} {len(error):4d} markers, {refused:2d} refused: RMS {rms:.4f}, typical {typical:.4f} px")


def main() -> None:
    """Print the table, or with `--parts` the bias part by part."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=10)
    parser.add_argument("--zooms", type=float, nargs="+", default=[2.0, 3.0, 5.0])
    parser.add_argument("--store", type=Path, default=Path("results/store"))
    parser.add_argument("--parts", action="store_true")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    room = Room(options.store)
    print(room.chosen)
    if options.parts:
        parts(room)
    else:
        table(room, options.trials, options.zooms)


if __name__ == "__main__":
    main()
