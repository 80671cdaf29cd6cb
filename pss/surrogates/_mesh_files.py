"""Mesh files from untrusted sources: few formats, bounded size, and no other file is opened."""

from __future__ import annotations

import io
import json
import struct
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from pss.errors import RangeError
from pss.files import read_bounded
from pss.hints import Floats
from pss.surrogates._ply import read_ply
from pss.surrogates._polygon_files import read_obj, read_off
from pss.surrogates._polygons import triangulated

__all__ = ["FORMATS", "MOST_BYTES", "MOST_CORNERS", "read_mesh"]


FORMATS = ("stl", "ply", "obj", "off", "glb")
# Formats whose faces may have more than three corners.
POLYGONS = {"ply": read_ply, "obj": read_obj, "off": read_off}
# A million faces as text; trimesh needs about ten times as much memory to read it.
MOST_BYTES = 64 * 2**20
# Of vertices, and of faces: the capacity of 64 MB. A GLB may instance one mesh many times, beyond its size in bytes.
MOST_CORNERS = 2_000_000
# Of the tree of a GLB: trimesh walks from the root to each node separately.
MOST_NODES = 5_000
DEEPEST_NODE = 64

_BYTES_OF = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
_NUMBERS_OF = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_JSON_CHUNK = 0x4E4F534A


class _NoFiles:
    """Replaces trimesh's resolver, which opens the materials, textures and buffers that a file references."""

    def get(self, name: str) -> NoReturn:
        raise RangeError(f"it names another file, {str(name)[:60]!r}; allowed: a mesh that is whole in its own file")


def read_mesh(path: Path) -> tuple[Floats, Any]:
    """The vertices (V, 3) and faces (F, 3) in the file at `path`, whose suffix is its format, in the file's units.

    Materials and textures are not read, and no other file is opened.

    Raises:
        RangeError: it has another format, is larger than `MOST_BYTES` or `MOST_CORNERS`, needs another file, or has a
            face that cannot be triangulated (`pss.surrogates._polygons`).
        Exception: any exception of trimesh's readers on a damaged file.
    """
    suffix = path.suffix.lower().removeprefix(".")
    if suffix not in FORMATS:
        raise RangeError(f"its ending is {path.suffix!r}; allowed: {', '.join(f'.{name}' for name in FORMATS)}")
    content = read_bounded(path, MOST_BYTES)
    if suffix == "glb":
        _check_glb(content)
    if suffix in POLYGONS:
        polygons = POLYGONS[suffix](content)
        _check_count("vertices", len(polygons.vertices))
        _check_count("corners of faces", len(polygons.corners))
        faces = triangulated(polygons)
        _check_count("faces", len(faces))
        return polygons.vertices, faces
    # Slow to import, and used only here.
    import trimesh

    # Unprocessed, so that errors in a file are reported, not repaired. From memory, so that no folder is known in which
    # to search for other files.
    loaded = trimesh.load_mesh(
        io.BytesIO(content), file_type=suffix, resolver=_NoFiles(), skip_materials=True, process=False
    )
    _check_count("vertices", len(loaded.vertices))
    _check_count("faces", len(loaded.faces))
    return np.array(loaded.vertices, dtype=float), np.array(loaded.faces)


def _check_count(what: str, count: int) -> None:
    if count > MOST_CORNERS:
        raise RangeError(f"{count} {what}; allowed: at most {MOST_CORNERS}")


def _check_glb(content: bytes) -> None:
    """Check that the data declared in the header are in the file, and that its meshes are not too many.

    Raises:
        RangeError: they are not.
        Exception: KeyError and the like, if a part of the header is missing or of another kind.
    """
    magic, _, _, length, kind = struct.unpack_from("<4sIIII", content)
    if magic != b"glTF" or kind != _JSON_CHUNK:
        raise RangeError("it does not begin as a GLB; allowed: binary glTF")
    header = json.loads(content[20 : 20 + length])
    for buffer in header.get("buffers", ()):
        if "uri" in buffer:
            raise RangeError("its numbers are in another file (uri); allowed: a mesh that is whole in its own file")
    accessors = header.get("accessors", [])
    declared = 0
    for accessor in accessors:
        count = _whole(accessor["count"])
        if count and "bufferView" not in accessor:
            raise RangeError("numbers that the file does not hold (sparse or compressed); allowed: plain accessors")
        declared += count * _NUMBERS_OF[accessor["type"]] * _BYTES_OF[accessor["componentType"]]
    if declared > MOST_BYTES:
        raise RangeError(f"its header declares {declared} bytes; allowed: at most {MOST_BYTES}")
    nodes = header.get("nodes", [])
    _check_tree(nodes, [root for scene in header.get("scenes", ()) for root in scene.get("nodes", ())])
    faces = [_faces_of(mesh["primitives"], accessors) for mesh in header.get("meshes", ())]
    _check_count("faces", sum(faces[_whole(node["mesh"])] for node in nodes if "mesh" in node))


def _faces_of(primitives: Iterable[dict[str, Any]], accessors: list[dict[str, Any]]) -> int:
    # An upper bound: strips have as many triangles as corners.
    corners = (part.get("indices", part["attributes"].get("POSITION")) for part in primitives)
    return sum(int(accessors[_whole(corner)]["count"]) for corner in corners if corner is not None)


def _check_tree(nodes: list[dict[str, Any]], roots: list[int]) -> None:
    """Check that no node has two parents, which could multiply it without bound, or is too deep."""
    if len(nodes) > MOST_NODES:
        raise RangeError(f"{len(nodes)} nodes; allowed: at most {MOST_NODES}")
    seen: set[int] = set()
    level = [_whole(root) for root in roots]
    for _ in range(DEEPEST_NODE):
        for number in level:
            if number in seen:
                raise RangeError(f"node {number} is in two places; allowed: a tree of nodes, as glTF has it")
            seen.add(number)
        level = [_whole(child) for number in level for child in nodes[number].get("children", ())]
        if not level:
            return
    raise RangeError(f"nodes within nodes; allowed: at most {DEEPEST_NODE} deep")


def _whole(value: object) -> int:
    if not isinstance(value, int) or value < 0:
        raise RangeError(f"{value!r:.60} stands for a number; allowed: a whole number, 0 or more")
    return value
