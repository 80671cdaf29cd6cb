"""Too little light: the markers whose contrast is lost in the noise of a capture, and messages about them."""

from __future__ import annotations

import numpy as np

from pss import Appearance, Evaluation, ImageSensor, PTZCamera
from pss.cameras.luminous import illuminance_lux
from pss.cameras.views import Views
from pss.hints import Bools, Floats
from pss.noise.photometric import sides_e
from pss.visibility.targets import LEAST_CONTRAST_OVER_NOISE, contrast_over_noise
from render.world.state import SceneState
from validate.runs.numbers import two_digits

__all__ = ["brightest_in_view", "dark_words", "light_words", "markers_too_dark", "white_irradiance"]


def markers_too_dark(evaluation: Evaluation, sensor: ImageSensor) -> Bools:
    """(C, N), the marker's contrast is below what markers are found from; False without an appearance."""
    task = evaluation.task
    if task.appearance is None:
        return np.zeros_like(evaluation.visible)
    views = Views(evaluation.cameras, task.points_m, task.normals, task.appearance)
    return np.asarray(contrast_over_noise(views, sensor) < LEAST_CONTRAST_OVER_NOISE)


def brightest_in_view(views: Views, sensor: ImageSensor) -> list[tuple[float, float, int]]:
    """Of each camera: contrast over noise, electrons of white, and number of the best lit marker in view and facing it.

    Occlusion is ignored. (0, 0, −1) where none is in view.
    """
    contrast, (white, _) = contrast_over_noise(views, sensor), sides_e(views, _appearance(views), sensor)
    found = []
    for row, seen in enumerate(views.in_frustum & (views.cos_incidence > 0)):
        best = int(np.where(seen, white[row], -1.0).argmax())
        found.append((float(contrast[row, best]), float(white[row, best]), best) if seen.any() else (0.0, 0.0, -1))
    return found


def white_irradiance(views: Views, state: SceneState) -> Floats:
    """W/m², of the light on each marker as each camera's light makes it, (C, N): π L over the white's albedo."""
    appearance = _appearance(views)
    radiance = np.broadcast_to(np.asarray(appearance.white_w_per_m2_sr, dtype=float), views.depth_m.shape)
    if appearance.ring_light:  # the radiances are those at 1 m, face to face
        with np.errstate(invalid="ignore", divide="ignore"):
            radiance = radiance * np.maximum(views.cos_incidence, 0) / views.range_m**2
    return np.asarray(np.pi * radiance / state.print.white_albedo)


def light_words(irradiance_w_per_m2: float, wavelength_nm: float) -> str:
    """1.2 W/m² (820 lux at 550 nm)."""
    lux = float(illuminance_lux(irradiance_w_per_m2, wavelength_nm))
    return f"{two_digits(irradiance_w_per_m2)} W/m² ({two_digits(lux)} lux at {wavelength_nm:g} nm)"


def dark_words(
    white_e: float, contrast: float, irradiance_w_per_m2: float, camera: PTZCamera, sensor: ImageSensor
) -> str:
    """Why a camera's markers are too dark: all the figures that a slip of units would be in."""
    return (
        f"white gives {white_e:.2g} e⁻ at camera {camera.name}, a contrast of {contrast:.2g} times the noise of a "
        f"capture (markers are found from {LEAST_CONTRAST_OVER_NOISE:g}); light on it "
        f"{light_words(irradiance_w_per_m2, sensor.wavelength_nm)}, exposure {sensor.exposure_ms:g} ms, "
        f"f/{camera.f_number:g}, pixels of {camera.pixel_pitch_m * 1e6:g} µm. What helps: a longer "
        "sensor.exposure_ms (in milliseconds), more light, a smaller f_number"
    )


def _appearance(views: Views) -> Appearance:
    assert views.appearance is not None
    return views.appearance
