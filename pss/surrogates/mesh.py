"""Triangulated surfaces as occluders: bodies, furniture, and meshes from files.

A mesh is a surface, not a solid: a segment entirely inside a closed mesh crosses nothing.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from pss.cameras.camera import as_points
from pss.errors import GeometryError, MissingLibraryError, RangeError, ShapeError
from pss.hints import Bools, Floats, Integers
from pss.inputs import place, plain
from pss.surrogates._checks import check_positive, turn_about_z
from pss.surrogates._mesh_files import read_mesh
from pss.surrogates._triangle_tree import TriangleTree

__all__ = ["Mesh"]


# A longer reason would hide the rest of the message.
LONGEST_REASON = 200


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangulated surface; closed or open, of one piece or several.

    Attributes:
        vertices_m: m, (V, 3), read-only.
        faces: (F, 3), indices of vertices, counterclockwise seen from outside; read-only.

    Meshes are equal if their names and numbers are equal.

    Raises:
        ShapeError, RangeError: arrays of wrong shape, not finite, or faces with vertices that do not exist.
        GeometryError: no face has an area.
    """

    name: str
    vertices_m: Floats
    faces: Integers

    def __post_init__(self) -> None:
        vertices = as_points(self.vertices_m, "Mesh.vertices_m")
        faces = plain(self.faces, "Mesh.faces", "(F, 3)")
        if vertices.ndim != 2:
            raise ShapeError(f"Mesh.vertices_m has shape {vertices.shape}; allowed is (V, 3)")
        if faces.ndim != 2 or faces.shape[1] != 3:
            raise ShapeError(f"Mesh.faces has shape {faces.shape}; allowed is (F, 3)")
        if len(faces) == 0:
            raise GeometryError(f"Mesh {self.name!r} has no faces; allowed: one or more")
        if not np.issubdtype(faces.dtype, np.integer):
            raise RangeError(f"Mesh.faces is of {faces.dtype}; allowed: whole numbers")
        wrong = faces[(faces < 0) | (faces >= len(vertices))]
        if len(wrong):
            raise RangeError(f"Mesh.faces names vertex {wrong[0]}; allowed: 0 to {len(vertices) - 1}")
        faces = faces.astype(np.int64)
        for name, array in (("vertices_m", vertices), ("faces", faces)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if not self.face_areas_m2.any():
            raise GeometryError(f"Mesh {self.name!r} has no face with an area")

    @classmethod
    def from_file(cls, path: str | os.PathLike[str], *, name: str | None = None, scale: float = 1.0) -> Mesh:
        """The mesh in a file that ends in .stl, .ply, .obj, .off or .glb, of at most 64 MB and 2,000,000 faces.

        Axes are used as they are in the file, without any format's convention of "up". No other file is opened, even if
        the file references materials or textures; a GLB with data in another file is refused. Faces of more than three
        corners are triangulated, concave ones too.

        Args:
            name: the mesh's name; the file's name without its suffix if None.
            scale: m, one unit of the file (0.001 for millimetres).

        Raises:
            RangeError, ShapeError: the file is missing, unreadable, too large, or has numbers out of range; a face is
                not a simple polygon near a plane (the message has its line).
            GeometryError: the file has no triangles.
            MissingLibraryError: the format needs a library that is not installed.
        """
        check_positive("Mesh.from_file", scale=scale)
        file = Path(path)
        if not os.path.isfile(file):
            raise RangeError(f"mesh {os.fspath(path)!r} is not a file; allowed: STL, PLY, OBJ, OFF or GLB")
        try:
            vertices, faces = read_mesh(file)
        except OSError as error:
            raise RangeError(f"mesh {os.fspath(path)!r} cannot be read ({error.strerror or error})") from error
        except RangeError as error:
            raise RangeError(f"mesh {os.fspath(path)!r} cannot be read ({error})") from error
        except ImportError as error:
            raise MissingLibraryError(f"mesh {os.fspath(path)!r}: {error}") from error
        except Exception as error:
            # Each of its readers fails differently on a damaged file: ValueError, IndexError, struct.error, …
            reason = f"{type(error).__name__}: {error}"
            raise RangeError(f"mesh {os.fspath(path)!r} cannot be read ({_line(reason)})") from error
        if len(faces) == 0:
            raise GeometryError(f"mesh {os.fspath(path)!r} holds no triangles")
        with np.errstate(over="ignore"):  # too large a number is refused as not finite
            scaled = scale * vertices
        return cls(file.stem if name is None else name, scaled, faces)

    @cached_property
    def digest(self) -> str:
        """Hash of vertices and faces: equal for equal numbers, on any machine."""
        content = hashlib.sha256(f"{self.vertices_m.shape} {self.faces.shape}".encode())
        # 0 and −0 are the same coordinate.
        content.update((self.vertices_m + 0.0).astype("<f8").tobytes())
        content.update(self.faces.astype("<i8").tobytes())
        return content.hexdigest()

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Mesh):
            return NotImplemented
        return self.name == other.name and self.digest == other.digest

    def __hash__(self) -> int:
        return hash((self.name, self.digest))

    @cached_property
    def corners_m(self) -> Floats:
        """Metres, the corners of each face, (F, 3, 3)."""
        return self.vertices_m[self.faces]

    @cached_property
    def _area_vectors(self) -> Floats:
        """m², (F, 3): along the outward normal, with the face's area as length."""
        first, second, third = np.moveaxis(self.corners_m, 1, 0)
        return np.asarray(np.cross(second - first, third - first) / 2)

    @property
    def face_areas_m2(self) -> Floats:
        """m², (F,)."""
        return np.asarray(np.linalg.norm(self._area_vectors, axis=1))

    @property
    def face_normals(self) -> Floats:
        """Unit normals of the faces, (F, 3); zero where a face has no area."""
        areas = self.face_areas_m2[:, None]
        return np.asarray(self._area_vectors / np.where(areas > 0, areas, 1.0))

    @cached_property
    def _tree(self) -> TriangleTree:
        return TriangleTree(self.corners_m)

    def blocks(self, starts_m: Floats, ends_m: Floats) -> Bools:
        """Whether the open segments, (..., 3) each, cross the surface; shape (...).

        A segment that only ends on the surface, or runs within a face, does not cross it; one through an edge or a
        vertex that faces share does.
        """
        starts, ends = np.broadcast_arrays(starts_m, ends_m)
        blocked = self._tree.crossed(starts.reshape(-1, 3), ends.reshape(-1, 3))
        return blocked.reshape(starts.shape[:-1])

    def moved(self, translation_m: tuple[float, float, float] = (0.0, 0.0, 0.0), turn_deg: float = 0.0) -> Mesh:
        """A copy rotated about world z, as cameras pan (90° take +y to +x), then moved by `translation_m` (3,)."""
        offset = place(translation_m, "Mesh.moved.translation_m")
        return Mesh(self.name, turn_about_z(self.vertices_m, turn_deg) + np.array(offset), self.faces)


def _line(text: str) -> str:
    """A library's message, which may be long and have parts of the file, as a part of one line."""
    text = " ".join(text.split())
    return text if len(text) <= LONGEST_REASON else text[: LONGEST_REASON - 1] + "…"
