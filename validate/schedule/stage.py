"""The stage: the hallway with its two people where they are at a time, and who wears which marker."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from pss.hints import Bools
from scenes import Scene, SceneError
from scenes.people.avatar import Stance
from scenes.people.gait import stride_of_speed
from scenes.schema.avatar import AvatarSpec, stance_of
from scenes.steps.schedule_file import ScheduleFile
from validate.schedule.walk import Passing, passing

__all__ = ["BOTH", "Stage", "stage_of", "stance_in"]


BOTH = "both"
"""In a table's column `avatar`: the markers of both."""


# Of the lens: all runs have the same, so that they share views; what a run may use is its motors' range.
LONGEST_ZOOM = 64.0


@dataclass(frozen=True, eq=False)
class Stage:
    """The scene that a schedule plays in.

    Attributes:
        scene: with the schedule's process and a zoom as good as endless; its avatars stand at the positions of its
        file. walk: of the two avatars, by their names in the scene.
    """

    scene: Scene
    walk: Passing

    @property
    def names(self) -> tuple[str, str]:
        """The avatars, H1 of the paper first."""
        first, second = self.walk.walks
        return first.name, second.name

    @property
    def first_ids(self) -> tuple[int, ...]:
        """The numbers that the avatars' suits begin with, in the order of `names`; none for one without a suit."""
        worn = {name: self._item(name).get("markers") for name in self.names}
        return tuple(int(suit["first_id"]) for suit in worn.values() if suit is not None)

    @property
    def groups(self) -> dict[str, Bools]:
        """Which of the scene's markers are on each avatar, and on both, (N,) each."""
        avatar_markers = np.array([marker.object_name for marker in self.scene.state.markers])
        of_avatars = {name: avatar_markers == name for name in self.names}
        return {**of_avatars, BOTH: np.any(list(of_avatars.values()), axis=0)}

    def at(self, time_s: float, moving: bool = False) -> Scene:
        """The scene at a time of the walk.

        Args:
            moving: whether the people walk while the shutter is open; else they are held as they are.

        Raises:
            SceneError: they would stand in each other's way or in a wall; with the time.
        """
        settings: dict[str, object] = {}
        for walk in self.walk.walks:
            x, y, _ = walk.position_m(time_s).tolist()
            velocity = walk.velocity_m_per_s
            heading_deg = math.degrees(math.atan2(velocity[0], velocity[1]))
            settings |= {
                f"objects.{walk.name}.position_m": [x, y],
                f"objects.{walk.name}.heading_deg": heading_deg,
                # Of its speed, which a person who is held does not have.
                f"objects.{walk.name}.stride_m": stride_of_speed(walk.speed_m_per_s, self._item(walk.name)["height_m"]),
                f"objects.{walk.name}.speed_m_per_s": walk.speed_m_per_s if moving else 0.0,
            }
        try:
            return self.scene.with_settings(settings)
        except SceneError as error:
            raise SceneError([f"at {time_s:.4g} s of the walk: {line}" for line in error.problems]) from error

    def _item(self, name: str) -> dict[str, Any]:
        return self._items[name]

    @cached_property
    def _items(self) -> dict[str, dict[str, Any]]:
        """The avatars' tables in the scene file."""
        return {name: _item_in(self.scene, name) for name in self.names}


def _item_in(scene: Scene, name: str) -> dict[str, Any]:
    """An object's table in a scene."""
    (item,) = (o for o in scene.resolved()["objects"] if o["name"] == name)
    return dict(item)


def stance_in(scene: Scene, name: str) -> Stance:
    """How the avatar of that name stands in a scene."""
    stance = stance_of(AvatarSpec.model_validate(_item_in(scene, name)))
    assert stance is not None  # the scene was validated with it
    return stance


def stage_of(schedule: ScheduleFile, scene: Scene) -> Stage:
    """The stage of a schedule.

    Raises:
        SceneError: the scene has not two avatars, has no fixed exposure, or has walls in the way of the walk.
        GeometryError, RangeError: walks that do not meet.
    """
    names = [item["name"] for item in scene.resolved()["objects"] if item["kind"] == "avatar"]
    if len(names) != 2:
        raise SceneError([f"{scene.path} has {len(names)} avatars ({', '.join(names) or 'none'}); allowed: two"])
    if scene.auto_exposure is not None:
        raise SceneError([f'{scene.path}: sensor.exposure_ms = "auto"; allowed: a number of ms, as all steps share it'])
    schedule_spec, room = schedule.spec, scene.state.room
    for what, value, most in (
        ("walk.reach_m", schedule_spec.walk.reach_m, room.length_m / 2),
        ("walk.lane_m", schedule_spec.walk.lane_m, room.width_m / 2),
    ):
        if value >= most:
            raise SceneError(
                [f"{schedule.path}: {what} = {value:g}; allowed: below {most:g}, where the walls of {scene.path} are"]
            )
    walk = passing(
        reach_m=schedule_spec.walk.reach_m,
        lane_m=schedule_spec.walk.lane_m,
        middle_height_m=schedule_spec.target.height_m,
        speed_m_per_s=schedule_spec.walk.speed_m_per_s,
        steps=schedule_spec.walk.steps,
        names=(names[0], names[1]),
    )
    process = {
        "model": "constant-velocity",
        "acceleration_density_m2_s3": schedule_spec.process.acceleration_density_m2_s3,
        "time_step_s": 1 / schedule_spec.process.frame_rate_hz,
    }
    return Stage(scene.with_settings({"process": process, "lens.max_zoom": LONGEST_ZOOM}), walk)
