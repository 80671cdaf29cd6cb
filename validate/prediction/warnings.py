"""Warnings about likely problems of a scene, a line each, with a remedy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pss.visibility.targets import LEAST_CONTRAST_OVER_NOISE
from validate.markers.darkness import dark_words, light_words
from validate.prediction.foresight import ENOUGH, LARGEST_BLUR_MODULES, SMALLEST_MODULE_PX, Foreseen
from validate.prediction.own_metrics import failures_of

__all__ = ["warnings_of"]

# In a warning; all are in the table of markers.
MOST_NAMED = 12


def warnings_of(seen: Foreseen) -> list[str]:
    """What will most likely disappoint, a line each, with what would help."""
    lines = [*seen.scene.warnings, *failures_of(seen.own_scores.values())]
    ids = np.array([marker.id for marker in seen.scene.state.markers])
    sees = seen.visible.sum(axis=1)
    finds = seen.legible.sum(axis=1)
    for number, camera in enumerate(seen.scene.cameras):
        if sees[number] == 0:
            lines.append(f"camera {camera.name} sees no marker; its aim, zoom or place would have to change")
        elif finds[number] == 0:
            causes = {"small": seen.too_small, "blurred": seen.too_blurred, "dark": seen.too_dark}
            why = max(causes, key=lambda cause: int(causes[cause][number].sum()))
            lines.append(f"camera {camera.name} sees {sees[number]} markers, but will find none: most are too {why}")
        if sees[number]:
            lines += _of_light(seen, number)
    views = seen.visible.sum(axis=0)
    found = seen.legible.sum(axis=0)
    if (lost := views < ENOUGH).any():
        lines.append(
            f"{lost.sum()} of {len(ids)} markers are seen by fewer than two cameras and add nothing to PSS: "
            f"{_named(ids[lost])}"
        )
    if (weak := ~lost & (found < ENOUGH)).any():
        lines.append(
            f"{weak.sum()} more are seen by two or more cameras, but found by fewer than two (modules under "
            f"{SMALLEST_MODULE_PX} px, blur over {LARGEST_BLUR_MODULES} modules, contrast under "
            f"{LEAST_CONTRAST_OVER_NOISE:g} times the noise, or cut): {_named(ids[weak])}"
        )
    return lines


def _of_light(seen: Foreseen, number: int) -> list[str]:
    """A line if a camera's best lit marker is too dark, or beyond saturation."""
    camera, sensor = seen.scene.cameras[number], seen.scene.sensor
    best = int(np.where(seen.visible[number], seen.white_share[number], -1.0).argmax())
    contrast, bright = float(seen.contrast[number, best]), float(seen.white_share[number, best])
    irradiance = float(seen.irradiance_w_per_m2[number, best])
    if bright > 1:
        light = light_words(irradiance, sensor.wavelength_nm)
        line = f"camera {camera.name}: the white of its brightest marker is {bright:,.1f} times the saturation; "
        line += f"light on it {light}, exposure {sensor.exposure_ms:g} ms; "
        return [line + 'a shorter sensor.exposure_ms, a larger f_number, or exposure_ms = "auto" helps']
    if contrast < LEAST_CONTRAST_OVER_NOISE:
        return ["too dark: " + dark_words(float(seen.white_e[number, best]), contrast, irradiance, camera, sensor)]
    return []


def _named(ids: Sequence[int] | NDArray[np.int64]) -> str:
    """Marker numbers, runs of them as "3–7"; of many the first."""
    ordered = sorted(int(number) for number in ids)
    runs: list[list[int]] = []
    for number in ordered:
        if runs and number == runs[-1][1] + 1:
            runs[-1][1] = number
        else:
            runs.append([number, number])
    words = [f"{first}" if first == last else f"{first}–{last}" for first, last in runs]
    return ", ".join(words[:MOST_NAMED]) + (", …" if len(words) > MOST_NAMED else "")
