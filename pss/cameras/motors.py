"""Motors of a pan-tilt-zoom camera: the settings they can hold, and those they reach in a given time (section 4.2).

Pan and tilt move in degrees; zoom in its logarithm, because its steps and speeds are relative; focus in dioptres (1/m),
because the travel of a lens group is roughly proportional to them. All functions are pure. They return whole numbers of
motor steps, or an end of the range, rounded to `DECIMALS`, so that equal settings are equal to the bit and hash alike.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass

from pss.cameras.camera import MAX_ABS_TILT_DEG, PTZCamera
from pss.cameras.motor_limits import FULL_TURN_DEG, SLACK_STEPS, PTZLimits, number, refuse
from pss.hints import Floats

__all__ = ["PTZLimits", "fitting_zoom", "follow", "moved_towards", "quantised"]


# Far below any motor's step, far above the rounding errors of degrees, zooms and metres.
DECIMALS = 9
MOTORISED = ("pan_deg", "tilt_deg", "zoom", "focus_distance_m")


def quantised(camera: PTZCamera, limits: PTZLimits) -> PTZCamera:
    """The setting nearest to that of `camera` that the motors can hold.

    Within the ranges it is off by at most half a step, in degrees, log zoom and dioptres. An endless pan is wrapped
    into [−180°, 180°).

    Raises:
        RangeError: the limits allow no zoom of this camera.
    """
    pan, tilt, zoom, focus = _motors(camera, limits)
    near = _within(camera.pan_deg, pan, camera.pan_deg)
    return _set(
        camera,
        limits,
        pan.level(near),
        tilt.level(camera.tilt_deg),
        zoom.level(math.log(camera.zoom)),
        focus.level(1 / camera.focus_distance_m),
    )


def fitting_zoom(camera: PTZCamera, centre_m: Sequence[float] | Floats, radius_m: float) -> float:
    """The zoom at which a sphere just fits the image at the camera's pan and tilt; below 1 if it never does.

    The planes through the lens and a column of the image that touch the sphere are at the angles
    atan(x/z) ± asin(r/√(x² + z²)) to the axis, for any y; likewise for rows. Exact for a lens without distortion: with
    barrel distortion (k₁ < 0) some margin remains, with pincushion distortion part of the sphere is cut off.

    Args:
        centre_m: m, centre of the sphere, (3,).
        radius_m: m.

    Raises:
        RangeError: the radius is not a finite number above 0.
    """
    if not 0 < number("radius_m", radius_m) < math.inf:
        refuse("radius_m", radius_m, "a finite number above 0 in metres")
    x, y, z = camera.to_camera_frame(centre_m)
    width, height = camera.resolution
    across, up = _widest_angle(x, z, radius_m), _widest_angle(y, z, radius_m)
    half = math.pi / 2
    if max(across, up) < half:
        half = max(across, math.atan(math.tan(up) * width / height))
    return math.radians(camera.widest_fov_deg) / 2 / half


def follow(
    camera: PTZCamera, target_m: Sequence[float] | Floats, radius_m: float, limits: PTZLimits | None = None
) -> PTZCamera:
    """The setting that follows a target: aimed at it, focused on it, with a sphere about it just fitting the image.

    The paper's Fig. 4 uses spheres too, and the outline of a sphere needs only a centre and a radius: the zoom depends
    on the distance alone and does not jump when the avatar turns or the camera tilts down. A sphere includes more than
    a standing person, the more so the steeper the view; choose the radius for the margin.

    The zoom is rounded down to a step, so that the sphere fits; if none fits, it is the lowest zoom. Speeds do not
    count here, see `moved_towards`. Of two pans a full turn apart, the one nearer to the current pan is used.

    Args:
        target_m: m, centre of the sphere, (3,).
        radius_m: m.
        limits: ranges and steps; None for `PTZLimits()`.

    Raises:
        GeometryError: the target is at the lens.
        RangeError: a wrong radius; no zoom within the limits; a sphere so small that the lens cannot focus at the zoom
            where it fits.
    """
    limits = PTZLimits() if limits is None else limits
    pan, tilt, zoom, focus = _motors(camera, limits)
    pan_deg, tilt_deg = camera.direction_to(target_m)
    pan_deg = pan.level(_within(pan_deg, pan, camera.pan_deg))
    aimed = dataclasses.replace(camera, pan_deg=pan_deg, tilt_deg=tilt.level(tilt_deg))
    fitting = math.log(fitting_zoom(aimed, target_m, radius_m))
    depth_m = float(aimed.to_camera_frame(target_m)[2])
    if depth_m <= 0:  # the stops prevent the camera from turning there
        depth_m = float(aimed.range_m(target_m))
    return _set(camera, limits, pan_deg, aimed.tilt_deg, zoom.level_below(fitting), focus.level(1 / depth_m))


def moved_towards(current: PTZCamera, requested: PTZCamera, limits: PTZLimits, seconds: float) -> PTZCamera:
    """The setting that the motors reach from `current` in `seconds` on their way to `requested`; all move at once.

    An endless pan takes the shorter way round; one with stops never passes them. The motors move by whole steps,
    rounded towards `current`: they never exceed a speed, and fall short by less than a step in each call. `current` is
    rounded to its nearest steps first.

    Raises:
        RangeError: `seconds` is negative or not finite; `requested` is another camera; `current` is outside the ranges;
            a
            motor is too slow to move by one step in that time, so that it would never move.
    """
    if not 0 <= number("seconds", seconds) < math.inf:
        refuse("seconds", seconds, "0 or more")
    for field in dataclasses.fields(current):
        mine, other = getattr(current, field.name), getattr(requested, field.name)
        if field.compare and field.name not in MOTORISED and mine != other:
            refuse(f"requested.{field.name}", other, f"{mine!r}, as of the camera that moves")
    pan, tilt, zoom, focus = _motors(current, limits)
    pan_now = _within(current.pan_deg, pan, current.pan_deg)
    if abs(_turn(pan_now - current.pan_deg)) > max(SLACK_STEPS * pan.step, 10.0**-DECIMALS):
        refuse("pan_deg", current.pan_deg, f"within the limits' {limits.pan_range_deg}")
    pan_goal = _within(requested.pan_deg, pan, pan_now)
    return _set(
        current,
        limits,
        pan.moved(pan_now, pan_goal, seconds),
        tilt.moved(current.tilt_deg, requested.tilt_deg, seconds),
        zoom.moved(math.log(current.zoom), math.log(requested.zoom), seconds),
        focus.moved(1 / current.focus_distance_m, 1 / requested.focus_distance_m, seconds),
    )


@dataclass(frozen=True)
class _Motor:
    """One motor. Its levels are the multiples of `step` in its range, and the range's ends; any value if step is 0."""

    name: str
    lowest: float
    highest: float
    step: float
    speed: float

    def level(self, value: float) -> float:
        """The level nearest to `value`."""
        value = min(max(value, self.lowest), self.highest)
        if self.step == 0:
            return value
        on_step = min(max(round(value / self.step) * self.step, self.lowest), self.highest)
        return min((on_step, self.lowest, self.highest), key=lambda level: abs(level - value))

    def level_below(self, value: float) -> float:
        """The highest level not above `value`, up to rounding; the lowest level if all are above."""
        if self.step == 0 or value >= self.highest:
            return min(max(value, self.lowest), self.highest)
        return max(math.floor(value / self.step + SLACK_STEPS) * self.step, self.lowest)

    def moved(self, current: float, requested: float, seconds: float) -> float:
        """The level reached from `current` on the way to `requested`."""
        slack = max(SLACK_STEPS * self.step, 10.0**-DECIMALS)
        if not self.lowest - slack <= current <= self.highest + slack:
            refuse(self.name, current, f"within the limits' {self.lowest:g} to {self.highest:g}")
        reach = math.inf if math.isinf(self.speed) else self.speed * seconds
        if 0 < reach < (1 - SLACK_STEPS) * self.step:
            allowed = f"at least one step of {self.step:g}, or the motor never moves"
            refuse(f"{self.name}: speed · time", float(f"{reach:.4g}"), allowed)
        start, goal = self.level(current), self.level(requested)
        if abs(goal - start) <= reach + SLACK_STEPS * self.step:
            return goal
        way = math.copysign(1.0, goal - start)
        stop = start + way * reach
        if self.step > 0:
            stop = way * math.floor(way * stop / self.step + SLACK_STEPS) * self.step
        return start if way * (stop - start) < 0 else stop


def _motors(camera: PTZCamera, limits: PTZLimits) -> tuple[_Motor, _Motor, _Motor, _Motor]:
    """Pan and tilt in degrees, zoom in its natural logarithm, focus in dioptres."""
    tilt_low, tilt_high = limits.tilt_range_deg or (-MAX_ABS_TILT_DEG, MAX_ABS_TILT_DEG)
    zoom_low, zoom_high = _zoom_ends(camera, limits)
    focus_step = limits.focus_step_dioptre or 0.0
    return (
        _Motor("pan_deg", *(limits.pan_range_deg or (-math.inf, math.inf)), *_pace(limits, "pan")),
        _Motor("tilt_deg", max(tilt_low, -MAX_ABS_TILT_DEG), min(tilt_high, MAX_ABS_TILT_DEG), *_pace(limits, "tilt")),
        _Motor(
            "log zoom",
            math.log(zoom_low),
            math.log(zoom_high),
            math.log1p(limits.zoom_step or 0.0),
            math.log(limits.zoom_factor_per_s or math.inf),
        ),
        _Motor("focus in dioptres", focus_step, math.inf, focus_step, limits.focus_speed_dioptre_per_s or math.inf),
    )


def _zoom_ends(camera: PTZCamera, limits: PTZLimits) -> tuple[float, float]:
    low, high = limits.zoom_range[0], min(camera.max_zoom, limits.zoom_range[1] or math.inf)
    if low > high:
        refuse("zoom_range", limits.zoom_range, f"a lowest zoom of at most {camera.max_zoom:g}, the camera's max_zoom")
    return low, high


def _pace(limits: PTZLimits, axis: str) -> tuple[float, float]:
    """Step and speed of pan or tilt."""
    return getattr(limits, f"{axis}_step_deg") or 0.0, getattr(limits, f"{axis}_speed_deg_per_s") or math.inf


def _set(
    camera: PTZCamera, limits: PTZLimits, pan_deg: float, tilt_deg: float, log_zoom: float, dioptre: float
) -> PTZCamera:
    """The camera at these levels, rounded so that equal levels have equal bits."""
    pan_deg = _rounded(pan_deg)
    if limits.pan_range_deg is None:
        pan_deg = _rounded(_turn(pan_deg))
    lowest, highest = _zoom_ends(camera, limits)
    zoom = min(max(_rounded(math.exp(log_zoom)), lowest), highest)
    return dataclasses.replace(
        camera, pan_deg=pan_deg, tilt_deg=_rounded(tilt_deg), zoom=zoom, focus_distance_m=_rounded(1 / dioptre)
    )


def _rounded(value: float) -> float:
    return round(value, DECIMALS) + 0.0  # −0.0 would be other bits than 0.0


def _turn(angle_deg: float) -> float:
    """Degrees, the same direction in [−180°, 180°)."""
    return (angle_deg + FULL_TURN_DEG / 2) % FULL_TURN_DEG - FULL_TURN_DEG / 2


def _within(pan_deg: float, motor: _Motor, near_deg: float) -> float:
    """Degrees, `pan_deg` plus the full turns that bring it nearest to `near_deg` in the range; else the nearest end."""
    if math.isinf(motor.lowest):
        return near_deg + _turn(pan_deg - near_deg)
    slack = SLACK_STEPS * max(motor.step, 10.0**-DECIMALS)
    first = math.ceil((motor.lowest - slack - pan_deg) / FULL_TURN_DEG)
    last = math.floor((motor.highest + slack - pan_deg) / FULL_TURN_DEG)
    if first > last:
        return min((motor.lowest, motor.highest), key=lambda end: abs(_turn(end - pan_deg)))
    return pan_deg + FULL_TURN_DEG * min(max(round((near_deg - pan_deg) / FULL_TURN_DEG), first), last)


def _widest_angle(aside: float, ahead: float, radius: float) -> float:
    """Radians from the axis to the farther of the two tangents from the lens to a circle; π from inside the circle."""
    distance = math.hypot(aside, ahead)
    return abs(math.atan2(aside, ahead)) + math.asin(radius / distance) if radius < distance else math.pi
