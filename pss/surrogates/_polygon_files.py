"""OBJ and OFF as polygons with their line numbers: trimesh fans faces of more than three corners on reading."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from pss.errors import RangeError
from pss.hints import Integers
from pss.surrogates._polygons import Polygons

__all__ = ["FEWEST", "at_line", "read_obj", "read_off"]


# Least number of corners of a face.
FEWEST = 3


def read_obj(content: bytes) -> Polygons:
    """The `v` and `f` lines of a Wavefront OBJ; indices from 1, or backwards from the last vertex so far.

    Materials, textures, normals, groups, lines and points are skipped.

    Raises:
        RangeError: a line is invalid; the message has its number.
    """
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    lines: list[int] = []
    for number, line in _joined(content):
        words = line.split()
        if not words or words[0] not in (b"v", b"f"):
            continue
        try:
            if words[0] == b"v":
                x, y, z = words[1:4]
                vertices.append([float(x), float(y), float(z)])
                continue
            face = [int(word.split(b"/", 1)[0]) for word in words[1:]]
        except ValueError:
            raise RangeError(f"line {number}: {_shown(line)}; allowed: `v X Y Z`, `f 1 2 3`") from None
        # 0 is not a vertex number: it stays out of range.
        faces.append([index - 1 if index >= 0 else len(vertices) + index for index in face])
        lines.append(number)
    return Polygons(_vertices(vertices), *_flat_faces(faces, lines), place=at_line(lines))


def read_off(content: bytes) -> Polygons:
    """A text OFF or COFF: the numbers of vertices and faces, the vertices and the faces, one line each.

    Raises:
        RangeError: a line is invalid, or there are too few.
    """
    lines = [(number, line.split(b"#", 1)[0].strip()) for number, line in enumerate(content.splitlines(), start=1)]
    lines = [(number, line) for number, line in lines if line]
    if not lines or not lines[0][1].upper().startswith((b"OFF", b"COFF")):
        raise RangeError("it does not begin with OFF; allowed: OFF or COFF, as text")
    # The numbers may follow on the first line.
    number, line = lines[0]
    rest = line[line.upper().index(b"OFF") + 3 :].strip()
    lines = [(number, rest), *lines[1:]] if rest else lines[1:]
    counts = _whole(*lines[0], fewest=2) if lines else [0]
    if len(counts) < 2 or min(counts[:2]) < 0 or len(lines) <= counts[0] + counts[1]:
        raise RangeError(f"{len(lines)} lines; allowed: the numbers of vertices and faces, and as many lines as those")
    of_vertices, of_faces = lines[1 : counts[0] + 1], lines[counts[0] + 1 : counts[0] + counts[1] + 1]
    vertices = []
    for number, line in of_vertices:
        try:
            x, y, z = line.split()[:3]
            vertices.append([float(x), float(y), float(z)])
        except ValueError:
            raise RangeError(f"line {number}: {_shown(line)}; allowed: X Y Z of a vertex") from None
    faces = []
    for number, line in of_faces:
        words = line.split()
        count = _whole(number, words[0], fewest=1)[0]
        faces.append(_whole(number, b" ".join(words[1 : 1 + max(count, 0)]), fewest=count))
    numbers = [number for number, _ in of_faces]
    return Polygons(_vertices(vertices), *_flat_faces(faces, numbers), place=at_line(numbers))


def _flat_faces(faces: Sequence[Sequence[int]], lines: Sequence[int]) -> tuple[Integers, Integers]:
    """The corners of all faces in sequence, and the number of corners of each.

    Raises:
        RangeError: a face has fewer than three.
    """
    counts = np.array([len(face) for face in faces], dtype=np.int64)
    few = np.flatnonzero(counts < FEWEST)
    if len(few):
        raise RangeError(f"line {lines[few[0]]}: a face of {counts[few[0]]} corners; allowed: {FEWEST} or more")
    return np.fromiter((index for face in faces for index in face), np.int64, int(counts.sum())), counts


def at_line(lines: Sequence[int]) -> Callable[[int], str]:
    """Function from a face's number to its place in the file."""
    return lambda face: f"line {lines[face]}"


def _joined(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Lines with the numbers of their first physical lines; a backslash at the end continues a line."""
    begun, first = b"", 0
    for number, line in enumerate(content.splitlines(), start=1):
        first = first if begun else number
        if line.endswith(b"\\"):
            begun += line[:-1] + b" "
            continue
        yield first, begun + line
        begun = b""
    if begun:
        yield first, begun


def _whole(number: int, text: bytes, fewest: int) -> list[int]:
    try:
        values = [int(word) for word in text.split()]
    except ValueError:
        values = []
    if len(values) < fewest or fewest < 0:
        raise RangeError(f"line {number}: {_shown(text)}; allowed: whole numbers, {max(fewest, FEWEST)} of them")
    return values


def _vertices(rows: Sequence[Sequence[float]]) -> NDArray[np.float64]:
    return np.array(rows, dtype=float).reshape(-1, 3)


def _shown(text: bytes) -> str:
    return repr(text[:60].decode("utf-8", "replace"))
