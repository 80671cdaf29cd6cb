"""One steering run: avatars are tracked from noisy, late positions, and the cameras follow the tracker's predictions.

In each frame, at time t: the measurement of t − latency arrives and updates an avatar's filter; at every decision, a
few frames apart, the strategy assigns the cameras; their motors then move, as far as they can, towards the settings for
where their avatars are predicted to be in the next frame. So aim, zoom and focus depend on predictions alone, and are
late where a motor is slow.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pss import PTZCamera, RangeError
from pss.cameras.motors import follow, moved_towards, quantised
from pss.hints import Bools, Floats
from validate.schedule.state import Assignment, Plan, StrategyState
from validate.schedule.strategies import Strategy
from validate.schedule.tracker import Measure, Track, Tracking, noisy_positions
from validate.schedule.walk import Passing

__all__ = ["Steered", "steer"]


# A step of the walk that is this part of a frame off a whole number of frames is one.
WHOLE_FRAMES = 1e-6


@dataclass(frozen=True, eq=False)
class Steered:
    """What a run reached at the K steps of the walk, with T avatars in the plan's order and C cameras.

    Attributes:
        times_s: s, (K,).
        predicted_m: m, where each avatar was expected to be at the step when the cameras last got their settings, (K,
        T, 3). covariance_m2: m², of that prediction by the filter's own covariance, (K, T, 3, 3).
        lost: whether an avatar was lost when the cameras last got their settings, (K, T).
        cameras: K × C settings, as the motors reached them.
        assignments: K × C names, the avatars that the cameras were on their way to.
        losses: how often each avatar was lost, by name, from the start of the warm-up to the last step.
        swaps: how many times a decision assigned a camera to another avatar than the one before, likewise.
    """

    times_s: Floats
    predicted_m: Floats
    covariance_m2: Floats
    lost: Bools
    cameras: tuple[tuple[PTZCamera, ...], ...]
    assignments: tuple[Assignment, ...]
    losses: dict[str, int]
    swaps: int


def steer(
    scene: Passing,
    cameras: Sequence[PTZCamera],
    strategy: Strategy,
    plan: Plan,
    tracking: Tracking | None = None,
    measure: Measure | None = None,
) -> Steered:
    """Steer `cameras` by `strategy` while the avatars of `scene` walk; the same numbers for the same arguments.

    Args:
        cameras: settings at the start of the warm-up; brought to the nearest that the motors can hold.
        plan: its avatars are the walks' by name. Its `step_s`, between decisions, and a step of the walk must both be
            whole numbers of frames.
        tracking: None for `Tracking()`.
        measure: what measures; None for Gaussian noise of the tracking's own sigma and seed.

    Raises:
        RangeError: the plan's avatars are not the walks'; steps that are no whole number of frames; a strategy's
            assignment that is none; a motor so slow that it does not move by a step in a frame.
    """
    tracking = Tracking() if tracking is None else tracking
    measure = noisy_positions(tracking.sigma_m, tracking.seed) if measure is None else measure
    walks = {walk.name: walk for walk in scene.walks}
    if set(walks) != set(plan.avatars):
        raise RangeError(f"the plan's avatars are {sorted(plan.avatars)}; allowed: the walks' {sorted(walks)}")
    frame_s, latency_s = tracking.frame_s, tracking.latency_s
    per_step = _whole_frames("a step of the walk", scene.step_s, frame_s)
    per_decision = _whole_frames("plan.step_s", plan.step_s, frame_s)
    # At least one frame, since a prediction comes from the frame before.
    warm_up = max(1, round(tracking.warm_up_s / frame_s))
    clock_s = scene.times_s[0] + frame_s * (np.arange((scene.steps - 1) * per_step + warm_up) - warm_up)
    tracks = {name: Track(walks[name].position_m(clock_s[0] - latency_s), tracking) for name in plan.avatars}

    settings = tuple(quantised(camera, plan.limits) for camera in cameras)
    assignment: Assignment | None = None
    decisions, swaps, reached = 0, 0, []
    for frame, now_s in enumerate(clock_s.tolist()):
        for name, track in tracks.items():
            if frame > 0:
                track.advance()
            track.update(measure(name, frame, walks[name].position_m(now_s - latency_s)))
        # Decisions are at the first frame, and such that the first step of the walk is one.
        if assignment is None or (frame - warm_up) % per_decision == 0:
            expected = {name: track.ahead(latency_s + plan.step_s)[0] for name, track in tracks.items()}
            state = StrategyState(decisions, now_s, settings, expected, plan, assignment)
            chosen = state.checked(strategy(state))
            swaps += sum(a != b for a, b in zip(chosen, assignment or chosen, strict=True))
            decisions, assignment = decisions + 1, chosen
        next_frame = {name: track.ahead(latency_s + frame_s) for name, track in tracks.items()}
        target_settings = (
            follow(camera, next_frame[name][0], plan.radius_m, plan.limits)
            for camera, name in zip(settings, assignment, strict=True)
        )
        settings = tuple(
            moved_towards(*pair, plan.limits, frame_s) for pair in zip(settings, target_settings, strict=True)
        )
        if frame + 1 >= warm_up and (frame + 1 - warm_up) % per_step == 0:
            places, covariances = zip(*next_frame.values(), strict=True)
            reached.append((places, covariances, [track.lost for track in tracks.values()], settings, assignment))
    places_at, covariances_at, lost_at, settings_at, assignment_at = zip(*reached, strict=True)
    return Steered(
        times_s=scene.times_s.copy(),
        predicted_m=np.array(places_at),
        covariance_m2=np.array(covariances_at),
        lost=np.array(lost_at),
        cameras=settings_at,
        assignments=assignment_at,
        losses={name: track.losses for name, track in tracks.items()},
        swaps=swaps,
    )


def _whole_frames(name: str, seconds: float, frame_s: float) -> int:
    frames = round(seconds / frame_s)
    if frames < 1 or abs(seconds / frame_s - frames) > WHOLE_FRAMES:
        raise RangeError(
            f"{name}, {seconds:.6g} s, is {seconds / frame_s:.6g} frames of {frame_s:.6g} s; allowed: a whole number"
        )
    return frames
