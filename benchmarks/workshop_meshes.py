"""Make the meshes of scenes/workshop.toml anew: a figure to put markers on, in metres, and a stool, in millimetres.

python benchmarks/workshop_meshes.py
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

FOLDER = Path(__file__).resolve().parents[1] / "scenes" / "workshop"
# Height and radius of the rings of a standing figure, m, from foot to crown; between them its sides are flat.
FIGURE = (
    (0.0, 0.24),
    (0.06, 0.24),
    (0.12, 0.13),
    (0.74, 0.16),
    (0.80, 0.19),
    (1.22, 0.27),
    (1.42, 0.23),
    (1.50, 0.09),
    (1.56, 0.09),
    (1.62, 0.15),
    (1.84, 0.16),
    (1.92, 0.07),
)
SIDES = 8


def lathed(profile: tuple[tuple[float, float], ...], sides: int) -> trimesh.Trimesh:
    """A closed body whose rings are regular polygons, one side of which looks along +y."""
    turn = 2 * np.pi * (np.arange(sides) + 0.5) / sides + np.pi / 2
    rings = [np.column_stack([r * np.cos(turn), r * np.sin(turn), np.full(sides, z)]) for z, r in profile]
    vertices = np.concatenate([*rings, [[0, 0, profile[0][0]], [0, 0, profile[-1][0]]]])
    here = np.arange(sides)
    beyond, bottom, top = (here + 1) % sides, len(vertices) - 2, len(vertices) - 1
    faces = [np.column_stack([beyond, here, np.full(sides, bottom)])]
    for ring in range(len(profile) - 1):
        low, high = ring * sides, (ring + 1) * sides
        faces += [
            np.column_stack([low + here, low + beyond, high + beyond]),
            np.column_stack([low + here, high + beyond, high + here]),
        ]
    last = (len(profile) - 1) * sides
    faces.append(np.column_stack([last + here, last + beyond, np.full(sides, top)]))
    return trimesh.Trimesh(vertices, np.concatenate(faces), process=False)


def stool() -> trimesh.Trimesh:
    """A round seat on four legs, 450 mm high; each part is closed by itself."""
    seat = trimesh.creation.cylinder(radius=170, height=40, sections=24)
    seat.apply_translation([0, 0, 430])
    parts = [seat]
    for x, y in ((-1, -1), (-1, 1), (1, -1), (1, 1)):
        leg = trimesh.creation.box(extents=[35, 35, 420])
        leg.apply_translation([100 * x, 100 * y, 210])
        parts.append(leg)
    return trimesh.util.concatenate(parts)


def main() -> None:
    """Write both files."""
    FOLDER.mkdir(exist_ok=True)
    lathed(FIGURE, SIDES).export(FOLDER / "figure.ply")
    stool().export(FOLDER / "stool.glb")


if __name__ == "__main__":
    main()
