"""The rules of a scene file for its sensor, its lens and the cameras' settings, on the draft's valid parts."""

from __future__ import annotations

import math

from pss import PTZCamera, RangeError
from pss.cameras.camera import MOST_BLADES
from render.images import MOST_PIXELS
from scenes.errors import Location, Problems, allowed_in
from scenes.reading.spec import known, present
from scenes.schema.camera_tables import CameraSpec
from scenes.schema.scene_tables import SceneSpec

__all__ = ["FAR_M", "aperture_allows", "check_optics"]

# Beyond the image distance of any lens: it keeps the focus out of the check of another setting.
FAR_M = 1e9


def check_optics(draft: SceneSpec, problems: Problems) -> None:
    """All of these rules."""
    _check_sensor(draft, problems)
    _check_lens(draft, problems)
    _check_apertures(draft, problems)
    for index, camera in present(draft.cameras):
        _check_settings(("cameras", index), camera, draft, problems)


def _check_sensor(draft: SceneSpec, problems: Problems) -> None:
    sensor = draft.sensor
    if sensor is not None and known(sensor.resolution_px) and math.prod(sensor.resolution_px) > MOST_PIXELS:
        problems.add(("sensor", "resolution_px"), f"at most {MOST_PIXELS} pixels in all")
    if sensor is not None and known(sensor.bits, sensor.black_level_dn):
        highest = 2**sensor.bits - 2
        if sensor.black_level_dn > highest:
            problems.add(("sensor", "black_level_dn"), f"0 to {highest} with {sensor.bits} bits")
    if sensor is not None and isinstance(sensor.exposure_ms, float):
        for key in ("auto_exposure_share", "longest_exposure_ms"):
            if problems.given(("sensor", key)):
                problems.warn(("sensor", key), 'has no effect without exposure_ms = "auto"')


def _check_lens(draft: SceneSpec, problems: Problems) -> None:
    """Blades must form a polygon, and distortion must not fold the image of the camera with the widest view."""
    lens, sensor = draft.lens, draft.sensor
    if lens is None:
        return
    if lens.aperture_blades in (1, 2):
        problems.add(("lens", "aperture_blades"), f"0 (round), or a whole number from 3 to {MOST_BLADES}")
    zooms = [camera.zoom for camera in draft.cameras or () if camera is not None and known(camera.zoom)]
    if sensor is None or not zooms or not known(sensor.resolution_px, lens.radial_distortion, lens.widest_fov_deg):
        return
    try:
        camera = PTZCamera(
            (0, 0, 0),
            0,
            0,
            zoom=max(1.0, min(zooms)),
            max_zoom=math.inf,
            focus_distance_m=FAR_M,
            resolution=sensor.resolution_px,
            widest_fov_deg=lens.widest_fov_deg,
            radial_distortion=lens.radial_distortion,
        )
        camera.undistorted_px((-0.5, -0.5))
    except RangeError as error:
        allowed = allowed_in(error)
        problems.add(("lens", "radial_distortion"), f"what images the whole sensor at the smallest zoom, {allowed}")


def _check_apertures(draft: SceneSpec, problems: Problems) -> None:
    """No camera may be opened wider than the lens; a camera with the lens's own f-number is not reported again."""
    lens = draft.lens
    if lens is None or lens.widest_f_number is None:
        return
    settings = [(("lens",), lens), *((("cameras", index), camera) for index, camera in present(draft.cameras))]
    for place, item in settings:
        if item.f_number is not None and item.f_number < lens.widest_f_number:
            problems.add((*place, "f_number"), aperture_allows(lens.widest_f_number))


def aperture_allows(widest_f_number: float) -> str:
    """What is allowed for an f-number."""
    return f"{widest_f_number:g} or more, lens.widest_f_number"


def _check_settings(place: Location, camera: CameraSpec, draft: SceneSpec, problems: Problems) -> None:
    """Zoom and focus, as checked by `PTZCamera`, each with valid values of the other settings."""
    lens, sensor = draft.lens, draft.sensor
    optics = {}
    if lens is not None:
        optics |= {"max_zoom": lens.max_zoom, "widest_fov_deg": lens.widest_fov_deg}
    # Without a valid upper limit the lower one still applies.
    optics = {key: value for key, value in optics.items() if value is not None}
    optics.setdefault("max_zoom", math.inf)
    zoom_fits = camera.zoom is not None
    if zoom_fits:
        try:
            PTZCamera((0, 0, 0), 0, 0, zoom=camera.zoom, focus_distance_m=FAR_M, **optics)
        except RangeError as error:
            zoom_fits = False
            problems.add((*place, "zoom"), allowed_in(error))
    if not zoom_fits or sensor is None or "widest_fov_deg" not in optics:
        return
    if known(camera.focus_distance_m, sensor.resolution_px, sensor.pixel_pitch_um):
        optics |= {"resolution": sensor.resolution_px, "pixel_pitch_m": sensor.pixel_pitch_um * 1e-6}
        try:
            PTZCamera((0, 0, 0), 0, 0, zoom=camera.zoom, focus_distance_m=camera.focus_distance_m, **optics)
        except RangeError as error:
            problems.add((*place, "focus_distance_m"), allowed_in(error))
