"""Light: Lambert's formula against closed forms and Monte Carlo; furnaces, energy and shadows in whole rooms."""

import dataclasses
import math

import numpy as np
import pytest
import scipy.stats

from pss import Box, Rectangle, Sphere
from render.light import patches
from render.light.radiosity import LIFT_M, Radiosity, form_factors, solve_radiosity
from render.world.geometry import LAMP_DROP_M, Surface, surfaces
from render.world.state import Light, MarkerPrint, Panel, Room, SceneObject, SceneState

# Relative; Lambert's formula sums four angles.
SAME_TO_ROUNDING = 1e-12
# A disc drawn as 720 triangles lacks 1.3e-5 of its area.
DISC_TRIANGLES = 720
DISC_RELATIVE = 2e-5
# Chance that the family of Monte Carlo comparisons fails by itself (Šidák); the seed is fixed.
FAMILY_WISE = 1e-3
RAYS = 200_000
# In an empty room nothing is approximate: sums over some hundred patches.
EMPTY_ROOM = 1e-9
# With objects, a patch is seen whole or not at all (by its centre): an error of the size of a patch's form factor.
POINT_WITH_OBJECTS = 0.04
MEAN_WITH_OBJECTS = 0.01
# Patches of 0.5 m stand for the light at their middle: 2.7 and 2.9 % too much light altogether.
ENERGY = 0.035

PRINT = MarkerPrint("DICT_4X4_100", 1.0, 0.85, 0.04)
# The box floats, so that no patch is shut in between it and the floor.
OBJECTS = (
    SceneObject(Sphere("ball", (0.25, 0.1, 1.25), 0.45), 0.5),
    SceneObject(Box("box", (-1.0, -1.0, 0.3), (-0.5, -0.4, 0.9)), 0.5),
)
PANELS = (Panel((-0.7, 0.6), (0.2, 0.6)), Panel((0.7, 0.6), (0.2, 0.6)))


def room(albedo: float = 0.0, *, objects=(), panels=PANELS, radiance: float = 0.2, size=(3.0, 3.0, 2.5)) -> SceneState:
    return SceneState(Room(*size, albedo, albedo, albedo), Light(radiance, panels), tuple(objects), (), PRINT)


def quad(corner, u, v) -> np.ndarray:
    """Corners (4, 3), counter-clockwise as seen from the side that u × v points to."""
    corner, u, v = (np.array(x, dtype=float) for x in (corner, u, v))
    return np.array([corner, corner + u, corner + u + v, corner + v])


def below(polygon: np.ndarray) -> float:
    """Form factor from the origin, which looks up, to a polygon."""
    return float(form_factors(np.zeros((1, 3)), np.array([[0, 0, 1.0]]), polygon[None])[0])


# ---- Lambert's formula -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("width", "length", "height"), [(1, 1, 1), (0.6, 1.2, 3), (4, 0.1, 0.5), (1e-3, 1e-3, 1)])
def test_form_factor_of_a_parallel_rectangle_in_closed_form(width, length, height):
    """Above its middle: four times the textbook's corner formula, F = (X/√(1+X²) atan(Y/√(1+X²)) + …)/(2π)."""
    x, y = width / 2 / height, length / 2 / height
    a, b = math.hypot(1, x), math.hypot(1, y)
    expected = 4 * (x / a * math.atan(y / a) + y / b * math.atan(x / b)) / (2 * math.pi)
    # The lamp looks down: its corners are counter-clockwise from below.
    lamp = quad((-width / 2, -length / 2, height), (0, length, 0), (width, 0, 0))
    assert below(lamp) == pytest.approx(expected, rel=1e-9)
    assert below(lamp[::-1]) == pytest.approx(-expected, rel=1e-9)  # the sign tells the bright side


@pytest.mark.parametrize(("radius", "height"), [(1.0, 1.0), (0.2, 3.0), (5.0, 0.5)])
def test_form_factor_of_a_parallel_disc_in_closed_form(radius, height):
    """R²/(R² + h²), from a fan of triangles, each of which repeats its last corner."""
    turn = -2 * math.pi * np.arange(DISC_TRIANGLES + 1) / DISC_TRIANGLES
    rim = np.column_stack([radius * np.cos(turn), radius * np.sin(turn), np.full_like(turn, height)])
    centre = np.broadcast_to([0.0, 0.0, height], (DISC_TRIANGLES, 3))
    fan = np.stack([centre, rim[:-1], rim[1:], rim[1:]], axis=1)
    up = np.broadcast_to([0.0, 0.0, 1.0], (DISC_TRIANGLES, 3))
    total = form_factors(np.zeros((DISC_TRIANGLES, 3)), up, fan).sum()
    assert total == pytest.approx(radius**2 / (radius**2 + height**2), rel=DISC_RELATIVE)


def test_form_factor_of_a_wall_that_stands_on_the_receivers_plane():
    """A half-infinite wall fills half of the cosine-weighted sky."""
    wall = quad((-1e4, 1, 0), (2e4, 0, 0), (0, 0, 1e4))
    assert below(wall) == pytest.approx(0.5, abs=1e-3)


def hits(directions: np.ndarray, polygon: np.ndarray) -> np.ndarray:
    """Whether rays from the origin pass through a parallelogram: t·way = corner + u·e + v·f."""
    e, f = polygon[1] - polygon[0], polygon[3] - polygon[0]
    systems = np.stack([directions, np.broadcast_to(-e, directions.shape), np.broadcast_to(-f, directions.shape)], -1)
    t, u, v = np.linalg.solve(systems, np.broadcast_to(polygon[0], directions.shape)[..., None])[..., 0].T
    return (t > 0) & (u >= 0) & (u <= 1) & (v >= 0) & (v <= 1)


def cosine_weighted(rng: np.random.Generator, count: int) -> np.ndarray:
    """Directions about +z with density cos θ/π (Malley: a disc lifted onto the hemisphere)."""
    radius, turn = np.sqrt(rng.random(count)), 2 * math.pi * rng.random(count)
    x, y = radius * np.cos(turn), radius * np.sin(turn)
    return np.column_stack([x, y, np.sqrt(1 - x**2 - y**2)])


def test_form_factors_agree_with_monte_carlo():
    """The form factor is the share of cosine-weighted rays that hit; random parallelograms above the horizon."""
    rng = np.random.default_rng(9)
    rays, polygons = cosine_weighted(rng, RAYS), []
    while len(polygons) < 12:
        polygon = quad(rng.uniform((-2, -2, 0.3), (2, 2, 2)), rng.uniform(-2, 2, 3), rng.uniform(-2, 2, 3))
        if polygon[:, 2].min() > 0.05:
            facing = np.cross(polygon[1] - polygon[0], polygon[3] - polygon[0]) @ polygon[0] < 0
            polygons.append(polygon if facing else polygon[::-1])
    bound = scipy.stats.norm.isf((1 - (1 - FAMILY_WISE) ** (1 / len(polygons))) / 2)
    for polygon in polygons:
        factor, share = below(polygon), hits(rays, polygon).mean()
        assert 0 < factor < 1
        assert abs(share - factor) < bound * math.sqrt(factor * (1 - factor) / RAYS)


def test_only_the_part_of_a_patch_above_the_horizon_counts():
    """Clipped at the receiver's horizon: the same as the part above it alone, whichever corner comes first."""
    upper = below(quad((-1, 1, 0), (2, 0, 0), (0, 0, 1)))
    for low in (-5, -0.5, -0.02):
        wall = quad((-1, 1, low), (2, 0, 0), (0, 0, 1 - low))
        for first in range(4):
            assert below(np.roll(wall, first, axis=0)) == pytest.approx(upper, rel=1e-9)
    # One corner above, three above, and a triangle.
    rays = cosine_weighted(np.random.default_rng(4), RAYS)
    for corner, u, v in (((0, 1, 0.5), (1, 0.5, -1), (-1, 0.5, -1)), ((0, 1, -0.5), (1, 0.5, 1), (-1, 0.5, 1))):
        tilted = quad(corner, u, v)
        share = hits(rays, tilted).mean()
        assert abs(below(tilted)) == pytest.approx(share, abs=4 * math.sqrt(share / RAYS))
        first_half, second_half = tilted[[0, 1, 2, 2]], tilted[[0, 2, 3, 3]]
        assert below(first_half) + below(second_half) == pytest.approx(below(tilted), rel=1e-9)
    assert below(quad((-1, 1, -2), (2, 0, 0), (0, 0, 1))) == 0


def test_receivers_and_emitters_can_be_swapped():
    """Reciprocity: A₁F₁₂ = A₂F₂₁, exactly for patches that are small beside their distance (1 cm at 1 m: 1e-4)."""
    rng = np.random.default_rng(5)
    for _ in range(10):
        frames = [np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(2)]
        sides = rng.uniform(0.002, 0.01, (2, 2))
        away = rng.normal(size=3)
        centres = [np.zeros(3), away / np.linalg.norm(away)]
        normals, patches = [], []
        for frame, (a, b), centre, other in zip(frames, sides, centres, centres[::-1], strict=True):
            u, v = frame[0] * a, frame[1] * b
            if np.cross(u, v) @ (other - centre) < 0:
                u, v = v, u
            patches.append(quad(centre - (u + v) / 2, u, v))
            normals.append(np.cross(u, v) / np.linalg.norm(np.cross(u, v)))
        there, back = form_factors(np.array(centres), np.array(normals), np.array(patches[::-1]))
        assert there * sides[0].prod() == pytest.approx(back * sides[1].prod(), rel=3e-4)


# ---- rooms -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("albedo", [0.0, 0.3, 0.8])
def test_furnace_in_an_empty_room(albedo, monkeypatch):
    """Every surface emits M and reflects ρ: M + ρM + ρ²M + … = M/(1 − ρ) leaves every patch."""
    emitted = 2.0
    glowing = [dataclasses.replace(s, radiance=emitted / math.pi) for s in surfaces(room(albedo))]
    monkeypatch.setattr(patches, "surfaces", lambda state: glowing)
    monkeypatch.setattr(patches, "LAMP_PATCH_M", 0.5)
    solved = solve_radiosity(room(albedo, panels=()))
    np.testing.assert_allclose(solved.radiosity, emitted / (1 - albedo), rtol=EMPTY_ROOM)


def test_furnace_in_a_room_with_objects(monkeypatch):
    albedo, emitted = 0.5, 2.0
    state = room(albedo, objects=OBJECTS, panels=())
    glowing = [dataclasses.replace(s, radiance=emitted / math.pi) for s in surfaces(state)]
    monkeypatch.setattr(patches, "surfaces", lambda state: glowing)
    monkeypatch.setattr(patches, "LAMP_PATCH_M", 0.5)
    solved = solve_radiosity(state)
    np.testing.assert_allclose(solved.radiosity, emitted / (1 - albedo), rtol=POINT_WITH_OBJECTS)
    assert solved.radiosity.mean() == pytest.approx(emitted / (1 - albedo), rel=MEAN_WITH_OBJECTS)


def slanted_points(state: SceneState, count: int) -> tuple[Radiosity, np.ndarray, np.ndarray]:
    """The room with uniform radiosity 1, and points in it with random normals, clear of the objects."""
    solved = solve_radiosity(state)
    rng = np.random.default_rng(1)
    normals = rng.normal(size=(count, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    points = rng.uniform((-1.4, -1.4, 1.8), (1.4, 1.4, 2.4), (count, 3))
    return dataclasses.replace(solved, radiosity=np.ones_like(solved.radiosity)), points, normals


def test_everything_seen_from_anywhere_in_an_empty_room_adds_up_to_one():
    """Closure: with uniform radiosity B, B arrives at every point and in every direction, to rounding."""
    uniform, points, normals = slanted_points(room(0.5, panels=()), 300)
    np.testing.assert_allclose(uniform.irradiance(points, normals), 1, rtol=EMPTY_ROOM)


def test_everything_seen_from_anywhere_among_objects_adds_up_to_one():
    """Closure again; more receivers than one chunk."""
    uniform, points, normals = slanted_points(room(0.5, objects=OBJECTS, panels=()), 800)
    arriving = uniform.irradiance(points, normals)
    assert arriving.mean() == pytest.approx(1, rel=MEAN_WITH_OBJECTS)
    np.testing.assert_allclose(arriving, 1, atol=2 * POINT_WITH_OBJECTS)
    np.testing.assert_allclose(uniform.irradiance(points[700:710], normals[700:710]), arriving[700:710], rtol=1e-12)
    assert uniform.irradiance(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)


@pytest.mark.parametrize("objects", [(), OBJECTS], ids=["empty", "objects"])
def test_the_light_that_the_lamps_give_is_what_the_surfaces_take(objects):
    """Energy: Σ π L A of the lamps = Σ (1 − ρ) E A over all surfaces, where a patch receives E = B/ρ."""
    albedo = 0.5
    solved = solve_radiosity(room(albedo, objects=objects))
    edges = solved.corners_m[:, 1:] - solved.corners_m[:, :1]
    area = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    area[(edges[:, 1] == edges[:, 2]).all(axis=1)] /= 2  # triangles
    lamps = np.isclose(solved.radiosity, math.pi * 0.2)
    assert area[lamps].sum() == pytest.approx(2 * 0.2 * 0.6)
    given = math.pi * 0.2 * area[lamps].sum()
    taken = ((1 - albedo) / albedo * solved.radiosity * area)[~lamps].sum()
    # The lamps are black and take what comes back to them.
    taken += (solved.irradiance(solved.centres_m[lamps], solved.normals[lamps]) * area[lamps]).sum()
    assert taken == pytest.approx(given, rel=ENERGY)


def test_direct_light_under_a_lamp_by_hand():
    """A black room: E = π L F of the lamp's rectangle, seen from the floor."""
    panel = Panel((0.0, 0.0), (0.6, 1.2))
    solved = solve_radiosity(room(panels=(panel,), radiance=0.2))
    height = 2.5 - LAMP_DROP_M - LIFT_M
    x, y = 0.3 / height, 0.6 / height
    a, b = math.hypot(1, x), math.hypot(1, y)
    factor = 4 * (x / a * math.atan(y / a) + y / b * math.atan(x / b)) / (2 * math.pi)
    up = np.array([[0.0, 0.0, 1.0]])
    assert solved.irradiance(np.zeros((1, 3)), up)[0] == pytest.approx(math.pi * 0.2 * factor, rel=1e-9)
    # Lamps shine downwards only, and a surface that looks down gets nothing from above.
    assert solved.irradiance(np.array([[0, 0, 2.4995]]), up)[0] == 0
    assert solved.irradiance(np.array([[0, 0, 1.0]]), -up)[0] == 0


def test_twice_the_radiance_is_twice_the_light():
    points, normals = np.array([[0.5, 0.5, 0.0], [1, -1, 0]]), np.tile([0, 0, 1.0], (2, 1))
    once, twice = (
        solve_radiosity(room(0.6, objects=OBJECTS[1:], radiance=r)).irradiance(points, normals) for r in (0.2, 0.4)
    )
    np.testing.assert_allclose(twice, 2 * once, rtol=SAME_TO_ROUNDING)


@pytest.mark.parametrize(
    "occluder",
    [
        Sphere("ball", (0, 0, 1.0), 0.3),
        Box("box", (-0.3, -0.3, 0.7), (0.3, 0.3, 1.3)),
        Rectangle("board", (0, 0, 1.0), 0.6, 0.6, elevation_deg=90),
    ],
    ids=lambda shape: shape.name,
)
def test_shadow_behind_an_occluder(occluder):
    """Umbra, penumbra, open floor: none of the lamp's light, some of it, all of it.

    By similar triangles the board's umbra ends at x = 0.37 m and its penumbra at 0.63 m.
    """
    panel = Panel((0.0, 0.0), (0.4, 0.4))
    with_it, without = (
        solve_radiosity(room(objects=objects, panels=(panel,))) for objects in ([SceneObject(occluder, 0.0)], [])
    )
    points = np.array([[0.0, 0, 0], [0.5, 0, 0], [1.4, 0, 0]])
    up = np.tile([0.0, 0, 1], (3, 1))
    share = with_it.irradiance(points, up) / without.irradiance(points, up)
    assert share[0] == 0
    assert 0 < share[1] < 1
    assert share[2] == 1


def test_half_a_lamp_behind_a_board_gives_half_its_light():
    """A board upright in the plane x = 0, from which the lamp's middle is straight above: its edge halves the lamp."""
    panel = Panel((0.0, 0.0), (0.8, 0.4))
    board = Rectangle("board", (1.5, 0, 1.5), 3.0, 3.0, facing_deg=0, elevation_deg=90)
    solved, free = (solve_radiosity(room(objects=o, panels=(panel,))) for o in ([SceneObject(board, 0.0)], []))
    up = np.array([[0.0, 0, 1]])
    share = solved.irradiance(np.zeros((1, 3)), up) / free.irradiance(np.zeros((1, 3)), up)
    assert share[0] == pytest.approx(0.5, rel=1e-9)


def test_walls_that_reflect_lighten_the_shadow():
    """Inter-reflection: in a white room the umbra gets light, and every point more than in a black one."""
    table, panel = SceneObject(Box("table", (-0.5, -0.5, 0.7), (0.5, 0.5, 0.8)), 0.0), Panel((0.0, 0.0), (0.4, 0.4))
    points = np.array([[0.0, 0, 0], [1.4, 0, 0]])
    up = np.tile([0.0, 0, 1], (2, 1))
    light_by_albedo = np.array(
        [solve_radiosity(room(a, objects=[table], panels=(panel,))).irradiance(points, up) for a in (0, 0.4, 0.8)]
    )
    assert light_by_albedo[0, 0] == 0
    assert (np.diff(light_by_albedo, axis=0) > 0).all()


def test_a_solution_is_a_value():
    solved = solve_radiosity(room())
    assert isinstance(solved, Radiosity)
    assert isinstance(surfaces(room())[0], Surface)
    with pytest.raises(dataclasses.FrozenInstanceError):
        solved.radiosity = None
