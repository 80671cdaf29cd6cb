"""Avatars: bodies that are closed and walk on the floor, suits that move with them, and what a file may say of them."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pytest
import trimesh

import scenes
from pss import PTZCamera, evaluate
from scenes import SceneError
from scenes.markers.layout import overlapping
from scenes.markers.plates import stand_off_problem
from scenes.markers.suit import SUIT_KEYS, SUIT_SIZE, suit_markers
from scenes.people.avatar import Stance, avatar_frames, avatar_mesh, cylinder_radius_m
from scenes.people.body import PARTS, part
from scenes.people.gait import joints, phase_at, stride_of_speed
from scenes.schema.avatar import SuitSpec

HALLWAY = Path(__file__).parents[3] / "scenes" / "hallway.toml"
HEIGHT_M = 1.75
STRIDE_M = stride_of_speed(1.2, HEIGHT_M)
MODULES_MM = {key: getattr(SuitSpec(first_id=0), key) for key in SUIT_KEYS}
# A marker of 4 × 4 bits, its border and its margin.
SIDE_MODULES = 8.0
PHASES = (0.0, 0.3, 0.62, 0.87)
ROUNDING_M = 1e-9
# The sole's rounded edges, and the pitch of a foot on which the body stands.
HEIGHT_TOLERANCE_M = 1e-3
# Sagitta of the widest plate on the most curved part, and the 2 mm that any plate may float.
MOST_STAND_OFF_M = 0.035
# Half a millimetre where the surface is highest, which may be between the places that are asked.
NEAREST_M = 3e-3


def stance(phase: float = 0.0, stride_m: float = STRIDE_M, height_m: float = HEIGHT_M, **keys) -> Stance:
    return Stance("H", height_m, stride_m, phase, **({"position_m": (0.0, 0.0), "heading_deg": 0.0} | keys))


def suit(at: Stance):
    return suit_markers(at, 0, MODULES_MM, SIDE_MODULES)


def solid(mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices_m, mesh.faces, process=False)


def crossings(starts_m: np.ndarray, way: np.ndarray, corners_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Metres along `way` (3,) from starts (N, 3) to each face (F, 3, 3), inf for a miss, and +1 out of it or −1 in.

    By signed volumes, which the project's own search for rays does not use.
    """
    a, b, c = (corner - starts_m[:, None] for corner in np.moveaxis(corners_m, 1, 0))
    volumes = np.stack([np.cross(u, v) @ way for u, v in ((a, b), (b, c), (c, a))])
    out = np.where((volumes > 0).all(axis=0), 1, np.where((volumes < 0).all(axis=0), -1, 0))
    normals = np.cross(b - a, c - a)
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (a * normals).sum(axis=-1) / (normals @ way)
    return np.where((out != 0) & (along > 0), along, np.inf), out


def inside(points_m: np.ndarray, corners_m: np.ndarray) -> np.ndarray:
    """Whether points (N, 3) are inside any part: a ray from there leaves more parts than it enters."""
    along, out = crossings(points_m, np.array([0.31, 0.55, 0.77]), corners_m)
    return np.where(np.isfinite(along), out, 0).sum(axis=1) > 0


# ---- the body --------------------------------------------------------------------------------------------------------


def test_every_part_is_closed_and_wound_outwards():
    """By trimesh's own count of edges; a piece that is inside out has a negative volume."""
    mesh = avatar_mesh(stance(0.3))
    pieces = solid(mesh).split(only_watertight=False)
    assert len(pieces) == len(PARTS)
    assert len(mesh.faces) <= 3000
    for piece in pieces:
        assert piece.is_watertight
        assert piece.is_winding_consistent
        assert piece.volume > 0


def test_the_body_has_the_volume_of_a_person():
    """An adult of 1.75 m has 60 to 80 l at the density of water; what parts share at the joints counts twice here."""
    litres = 1e3 * sum(solid(part(name, HEIGHT_M)).volume for name in PARTS)
    assert 60 < litres < 88


@pytest.mark.parametrize("height_m", [1.2, 1.6, 2.1])
def test_who_stands_is_as_high_as_asked(height_m):
    z = avatar_mesh(stance(0.4, 0.0, height_m)).vertices_m[:, 2]
    assert z.max() == pytest.approx(height_m, abs=HEIGHT_TOLERANCE_M)
    assert z.min() == pytest.approx(0, abs=ROUNDING_M)


def test_the_feet_stay_on_the_floor_and_the_head_bobs_as_in_a_walk():
    """Twice a cycle, lowest when both feet are down: by 3 to 5 cm for adults (Gard and others 2004)."""
    tops = []
    for phase in np.arange(0, 1, 0.05):
        z = avatar_mesh(stance(phase)).vertices_m[:, 2]
        assert z.min() == pytest.approx(0, abs=ROUNDING_M)
        tops.append(z.max())
    assert 0.02 < max(tops) - min(tops) < 0.06
    assert max(tops) < HEIGHT_M + 2e-3
    np.testing.assert_allclose(tops[:10], tops[10:], atol=ROUNDING_M)
    assert min(tops) == pytest.approx(tops[0], abs=5e-3)


@pytest.mark.parametrize("speed_m_per_s", [0.8, 1.2, 1.6])
def test_the_foot_that_bears_the_body_stays_where_it_is(speed_m_per_s):
    """From flat foot to the other heel's strike its ball goes 6 cm at most, while the body goes half a metre."""
    stride_m = stride_of_speed(speed_m_per_s, HEIGHT_M)
    phases = np.linspace(0.08, 0.5, 8)
    ball = [avatar_frames(stance(p, stride_m, position_m=(0, p * stride_m)))["right toes"].origin_m[1] for p in phases]
    assert np.ptp(ball) < 0.06
    assert 0.42 * stride_m > 0.45


def test_stride_and_speed_of_a_walk():
    """An adult at 1.2 to 1.4 m/s: strides of 1.3 to 1.5 m, 105 to 120 steps a minute; slower ones are shorter."""
    for speed in (1.2, 1.3, 1.4):
        stride_m = stride_of_speed(speed, 1.7)
        assert 1.3 < stride_m < 1.5
        assert 105 < 2 * 60 * speed / stride_m < 120
    assert stride_of_speed(0.6, 1.7) == pytest.approx(stride_of_speed(1.2, 1.7) / 2**0.5)
    assert stride_of_speed(0.0, 1.7) == 0
    assert phase_at(-0.25 * 1.4, 1.4) == pytest.approx(0.75)
    assert phase_at(3.0, 0.0) == 0


def test_joints_bend_the_way_joints_do():
    for phase in np.linspace(0, 1, 41):
        at = joints(phase, 0.8)
        assert -25 < at.thigh_deg < 30
        assert 0 < at.knee_deg < 65
        assert 0 < at.elbow_deg < 60
    # The arm goes with the other leg.
    assert joints(0.0, 0.8).thigh_deg > 15 > 0 > joints(0.0, 0.8).upper_arm_deg
    assert joints(0.5, 0.8).thigh_deg < -10 < 0 < joints(0.5, 0.8).upper_arm_deg


def test_half_a_cycle_later_the_body_is_its_mirror_image():
    now, later = (avatar_mesh(stance(phase)).vertices_m for phase in (0.2, 0.7))

    def ordered(points):
        return points[np.lexsort(np.round(points, 6).T)]

    np.testing.assert_allclose(ordered(now * [-1, 1, 1]), ordered(later), atol=2e-6)


def test_heading_is_counted_as_a_cameras_pan():
    """At 90° who walked along +y walks along +x, about the place between the hips."""
    ahead = avatar_mesh(stance(0.1)).vertices_m
    turned = avatar_mesh(stance(0.1, position_m=(2.0, -1.0), heading_deg=90.0)).vertices_m
    expected = np.column_stack([ahead[:, 1] + 2.0, -ahead[:, 0] - 1.0, ahead[:, 2]])
    np.testing.assert_allclose(turned, expected, atol=ROUNDING_M)


# ---- the suit --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("phase", PHASES)
def test_no_plate_sticks_into_the_body_and_none_floats(phase):
    """By rays, apart from the project's rule: 25 places of each plate are outside of every part, and near their own."""
    at = stance(phase)
    corners = avatar_mesh(at).corners_m
    line = np.linspace(-0.5, 0.5, 5) * SIDE_MODULES
    for marker in suit(at):
        u, v = (grid.ravel()[:, None] * marker.module_m for grid in np.meshgrid(line, line))
        plate = np.array(marker.centre_m) + u * marker.right + v * np.array(marker.up)
        assert not inside(plate, corners).any(), marker.id
        # Straight down from the plate there is the body, at most the sagitta and 2 mm away.
        fall = crossings(plate, -np.array(marker.normal), corners)[0].min(axis=1)
        assert fall.max() < MOST_STAND_OFF_M, marker.id
        assert fall.min() < NEAREST_M, marker.id


@pytest.mark.parametrize(("height_m", "phase"), [(1.6, 0.1), (1.75, 0.55), (2.1, 0.3)])
def test_suits_keep_the_rule_of_markers_placed_by_hand(height_m, phase):
    at = stance(phase, stride_of_speed(1.2, height_m), height_m)
    mesh, markers = avatar_mesh(at), suit(at)
    sides = [SIDE_MODULES * marker.module_m for marker in markers]
    for marker, side in zip(markers, sides, strict=True):
        assert stand_off_problem(marker, side, mesh, ()) is None
    assert list(overlapping(list(markers), sides, mesh)) == []


def test_normals_look_out_of_the_body_and_prints_are_square():
    at = stance(0.2)
    markers, corners = suit(at), avatar_mesh(at).corners_m
    assert len(markers) == SUIT_SIZE
    centres, normals, ups = (np.array([getattr(m, key) for m in markers]) for key in ("centre_m", "normal", "up"))
    np.testing.assert_allclose((normals * ups).sum(axis=1), 0, atol=1e-12)
    for vectors in (normals, ups):
        np.testing.assert_allclose(np.linalg.norm(vectors, axis=1), 1, atol=1e-12)
    assert not inside(centres + 1e-3 * normals, corners).any()
    assert inside(centres - 0.02 * normals, corners).all()
    assert {marker.id for marker in markers} == set(range(SUIT_SIZE))


def test_markers_of_one_part_move_rigidly():
    """Their distances and the angles between them are the same all over the cycle; those of two parts are not."""
    torso = [number for number, key in enumerate(SUIT_KEYS) if key in ("torso_module_mm", "flank_module_mm")]
    shin = [number for number, key in enumerate(SUIT_KEYS) if key == "shin_module_mm"]
    groups = [torso, shin[:3], shin[3:]]
    apart = []
    for phase in PHASES:
        markers = suit(stance(phase))
        centres, normals = (np.array([getattr(m, key) for m in markers]) for key in ("centre_m", "normal"))
        apart.append((np.linalg.norm(centres[:, None] - centres, axis=-1), normals @ normals.T))
    for group in groups:
        for distances, angles in apart[1:]:
            np.testing.assert_allclose(distances[np.ix_(group, group)], apart[0][0][np.ix_(group, group)], atol=1e-12)
            np.testing.assert_allclose(angles[np.ix_(group, group)], apart[0][1][np.ix_(group, group)], atol=1e-12)
    assert np.ptp([distances[shin[0], shin[3]] for distances, _ in apart]) > 0.1


def test_the_left_sides_markers_are_the_right_sides_mirrored():
    now, later = suit(stance(0.15)), suit(stance(0.65))
    arms = [number for number, key in enumerate(SUIT_KEYS) if key == "arm_module_mm"]
    for right, left in zip(arms[:3], arms[3:], strict=True):
        np.testing.assert_allclose(np.array(now[right].centre_m) * [-1, 1, 1], later[left].centre_m, atol=ROUNDING_M)
        np.testing.assert_allclose(np.array(now[right].normal) * [-1, 1, 1], later[left].normal, atol=ROUNDING_M)


# ---- what cameras see ------------------------------------------------------------------------------------------------


def seen(cameras, markers, bodies):
    points, normals = (np.array([getattr(m, key) for m in markers]) for key in ("centre_m", "normal"))
    return evaluate(cameras, points, normals, noise="corrected", occluder=bodies).visible


def test_what_is_on_the_back_is_not_seen_from_the_front():
    at = stance(0.1)
    mesh, markers = avatar_mesh(at), suit(at)
    before, behind = (PTZCamera((0, y, 1.5), 0, 0, focus_distance_m=3).aimed_at((0, 0, 0.9)) for y in (4, -4))
    from_front, from_back = seen([before, behind], markers, [mesh])
    facing = np.array([marker.normal[1] for marker in markers])
    torso = np.array(SUIT_KEYS) == "torso_module_mm"
    assert from_front[torso & (facing > 0)].all()
    assert not from_front[facing < -0.1].any()
    assert from_back[torso & (facing < 0)].all()
    assert not from_back[facing > 0.1].any()


def test_an_arm_hides_the_flank_and_another_avatar_all_behind_it():
    at = stance(0.3)
    mesh, markers = avatar_mesh(at), suit(at)
    beside = PTZCamera((4, 0, 1.1), 0, 0, focus_distance_m=3).aimed_at((0, 0, 1.1))
    alone = seen([beside], markers, [mesh])[0]
    bare = seen([beside], markers, [])[0]
    assert alone.sum() < bare.sum()
    blocker = avatar_mesh(dataclasses.replace(at, name="other", position_m=(2.0, 0.0)))
    both = seen([beside], markers, [mesh, blocker])[0]
    assert both.sum() < alone.sum() / 2
    assert not (both & ~alone).any()


# ---- the file --------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def hallway():
    return scenes.load(HALLWAY)


def test_the_shipped_hallway_is_the_papers(hallway):
    room, markers = hallway.state.room, hallway.state.markers
    assert (room.width_m, room.length_m, room.height_m) == (6, 10, 3)
    assert [camera.name for camera in hallway.cameras] == ["1", "2", "3", "4"]
    corners = np.array([camera.position_m for camera in hallway.cameras])
    assert (np.abs(corners) >= [2.7, 4.7, 2.8]).all()
    assert len({(x > 0, y > 0) for x, y, _ in corners}) == 4
    assert hallway.warnings == ()
    assert len(markers) == 2 * SUIT_SIZE
    first, second = hallway.state.objects
    assert (first.shape.name, second.shape.name) == ("H1", "H2")
    assert first.motion.velocity_m_per_s == pytest.approx((0, 1.2, 0))
    assert second.motion.velocity_m_per_s == pytest.approx((0, -1.2, 0))


def test_each_avatar_is_seen_by_the_cameras_that_follow_it(hallway):
    state = hallway.state
    visible = evaluate(
        hallway.cameras, state.points_m, state.normals, noise="corrected", occluder=state.occluders
    ).visible
    owner = np.array([marker.object_name for marker in state.markers])
    for name, followed in (("H1", (0, 1)), ("H2", (2, 3))):
        assert (visible[np.ix_(followed, owner == name)].sum(axis=1) >= 8).all()
        assert (visible[np.ix_(followed, owner == name)].sum(axis=0) == 2).sum() >= 5


def test_who_is_moved_walks_on(hallway):
    """The phase follows the way, unless the file says it: a foot that bears the body stays where it is."""
    mesh = hallway.state.objects[0].shape
    stride_m = stride_of_speed(1.2, 1.75)
    on = scenes.load(HALLWAY, [f"objects.H1.position_m=[-0.8, {-2.0 + 2 * stride_m}]"])
    moved = on.state.objects[0].shape.vertices_m
    np.testing.assert_allclose(moved, mesh.vertices_m + [0, 2 * stride_m, 0], atol=ROUNDING_M)
    assert [marker.id for marker in on.state.markers] == [marker.id for marker in hallway.state.markers]
    still = scenes.load(HALLWAY, ["objects.H1.speed_m_per_s=0", "objects.H1.stride_m=1.4", "objects.H1.phase=0.5"])
    assert still.state.objects[0].motion is None
    assert np.ptp(still.state.objects[0].shape.vertices_m[:, 1]) > 0.7
    again = still.resolved()["objects"][0]
    assert (again["phase"], again["stride_m"], again["position_m"]) == (0.5, 1.4, [-0.8, -2.0])


# What is changed, what its line begins with (that of H1's key, if nothing else is said), and what it says is allowed.
BROKEN = [
    ("H1.phase=1.2", "phase = 1.2", "a number from 0 to 1"),
    ("H1.height_m=2.4", "height_m = 2.4", "a number from 1.2 to 2.1, in metres"),
    ("H1.height_m=tall", 'height_m = "tall"', "a number from 1.2 to 2.1, in metres"),
    ("H1.position_m=[0, 1, 2]", "position_m = [0, 1, 2]", "[x, y], in metres"),
    ("H1.speed_m_per_s=-1", "speed_m_per_s = -1", "a number, 0 or more"),
    ("H1.speed_m_per_s=3", "speed_m_per_s = 3", "0 to 1.9, a walk at this height"),
    ("H1.stride_m=1.8", "stride_m = 1.8", "0 to 1.75"),
    ("H1.position_m=[-0.8, -4.9]", "position_m = [-0.8, -4.9]", "the whole avatar inside the room"),
    ("H1.position_m=[0.6, 1.6]", "objects.H2.position_m = [0.8, 2.0]", "at least "),
    ("H2.markers.first_id=72", "objects.H2.markers.first_id = 72", "0 to 71 (29 ids within DICT_4X4_100)"),
    ("H1.markers.first_id=30", "objects.H2.markers.first_id = 50", 'each id once; 50 to 58 already on "H1"'),
    ("H1.markers.arm_module_mm=15", "markers.arm_module_mm = 15", "at most 11."),
    ("H1.markers.wrist_module_mm=5", "override objects.H1.markers.wrist_module_mm = 5", "first_id, head_module_mm"),
]


@pytest.mark.parametrize(("override", "message", "allowed"), BROKEN, ids=[override for override, _, _ in BROKEN])
def test_a_broken_rule_is_one_line(override, message, allowed):
    with pytest.raises(SceneError) as caught:
        scenes.load(HALLWAY, [f"objects.{override}"])
    (problem,) = caught.value.problems
    start = message if "objects." in message else f"objects.H1.{message}"
    assert problem.partition("hallway.toml: ")[2].startswith(start)
    assert problem.partition("allowed: ")[2].startswith(allowed)


def test_avatars_may_pass_as_near_as_their_cylinders(hallway):
    """What the line says is allowed is allowed."""
    with pytest.raises(SceneError) as caught:
        scenes.load(HALLWAY, ["objects.H1.position_m=[0.1, 2.0]"])
    least = float(str(caught.value).partition("at least ")[2].split()[0])
    assert 0.5 < least < 1.2
    passing = scenes.load(HALLWAY, [f"objects.H1.position_m=[{0.8 - least}, 2.0]"])
    assert len(passing.state.markers) == 2 * SUIT_SIZE


def test_the_cylinder_holds_the_body():
    at = stance(0.0, position_m=(1.0, -2.0))
    apart = np.linalg.norm(avatar_mesh(at).vertices_m[:, :2] - [1.0, -2.0], axis=1)
    assert apart.max() < cylinder_radius_m(at) < apart.max() + 0.05
    assert 0.3 < cylinder_radius_m(at) < 0.6


def test_plates_stay_clear_of_other_objects(tmp_path):
    """A small board beside the arm cuts a plate."""
    at = stance(0.5, stride_of_speed(1.2, HEIGHT_M), position_m=(-0.8, -2.0))
    arm = suit(at)[SUIT_KEYS.index("arm_module_mm") + 2]
    x, y, z = arm.centre_m
    board = (
        '[[objects]]\nname = "board"\nkind = "rectangle"\nalbedo = 0.5\nfacing_deg = 0\nwidth_m = 0.05\n'
        f"height_m = 0.05\ncentre_m = [{x + 0.01}, {y}, {z}]\n"
    )
    path = tmp_path / "hallway.toml"
    path.write_text(HALLWAY.read_text() + board)
    with pytest.raises(SceneError, match=r'objects\.H1\.position_m.*allowed: .*sticks through "board"'):
        scenes.load(path, ["objects.H1.phase=0.5"])
