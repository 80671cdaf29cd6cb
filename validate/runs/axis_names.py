"""Names of the parameters of sweeps on the axes of figures."""

from __future__ import annotations

__all__ = ["AXIS_NAMES"]

AXIS_NAMES = {
    "zoom": "zoom (90° / field of view)",
    "focus_distance_m": "focus distance in m",
    "pan_deg": "pan in degrees",
    "tilt_deg": "tilt in degrees",
    "f_number": "f-number",
    "selection": "cameras",
    "distance_m": "distance in m",
    "cos_incidence": "cosine of the angle of incidence",
    "exposure_ms": "exposure in ms",
    "width_px": "pixels across the sensor",
    "cameras": "number of cameras",
}
