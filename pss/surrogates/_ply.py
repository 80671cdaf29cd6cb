"""PLY as polygons, text or binary: trimesh fans larger faces, and reads no binary file of mixed face sizes.

"The PLY Polygon File Format" (Turk 1994): a header of elements and their properties, then the elements in that order.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pss.errors import RangeError
from pss.hints import Integers
from pss.surrogates._polygon_files import FEWEST, at_line
from pss.surrogates._polygons import Polygons

__all__ = ["read_ply"]


SPELLINGS = {
    "i1": "char int8",
    "u1": "uchar uint8",
    "i2": "short int16",
    "u2": "ushort uint16",
    "i4": "int int32",
    "u4": "uint uint32",
    "f4": "float float32",
    "f8": "double float64",
}
TYPES = {name: kind for kind, names in SPELLINGS.items() for name in names.split()}
ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
INDEX_NAMES = ("vertex_index", "vertex_indices")
LONGEST_HEADER = 2**16


@dataclass(frozen=True)
class _Property:
    """`count_kind` is the type of a list's length; "" for a single value."""

    name: str
    kind: str
    count_kind: str = ""


@dataclass(frozen=True)
class _Element:
    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class _Table:
    """An element's data by property name: single values, (N,), and lists with their lengths, (Σ,) and (N,)."""

    values: dict[str, NDArray[Any]]
    lists: dict[str, tuple[Integers, Integers]]
    place: Callable[[int], str]


def read_ply(content: bytes) -> Polygons:
    """The vertices and faces of a PLY; other elements and properties are skipped, and no texture is opened.

    Raises:
        RangeError: the header is invalid, or the data do not match it.
    """
    elements, order, start = _header(content)
    read = _text_tables if order == "" else _binary_tables
    tables = dict(zip([element.name for element in elements], read(content, start, elements, order), strict=True))
    if "vertex" not in tables or not {"x", "y", "z"} <= tables["vertex"].values.keys():
        raise RangeError("no x, y and z of an element `vertex`; allowed: a PLY with vertices and faces")
    vertices = np.column_stack([tables["vertex"].values[axis] for axis in "xyz"]).astype(float)
    faces = tables.get("face")
    if faces is None:
        none = np.zeros(0, dtype=np.int64)
        return Polygons(vertices, none, none, at_line([]))
    names = [name for name in INDEX_NAMES if name in faces.lists] or list(faces.lists)
    if len(names) != 1:
        raise RangeError(f"its faces have {len(names)} lists; allowed: one called {' or '.join(INDEX_NAMES)}")
    corners, counts = faces.lists[names[0]]
    few = np.flatnonzero(counts < FEWEST)
    if len(few):
        raise RangeError(f"{faces.place(int(few[0]))}: a face of {counts[few[0]]} corners; allowed: {FEWEST} or more")
    return Polygons(vertices, corners, counts, faces.place)


def _header(content: bytes) -> tuple[list[_Element], str, int]:
    """The elements, the byte order ("" for text), and the offset of the data."""
    head, found, _ = content[:LONGEST_HEADER].partition(b"end_header")
    start = content.find(b"\n", len(head)) + 1
    lines = [line.split() for line in head.decode("latin-1").splitlines()]
    if not found or not start or not lines or lines[0] != ["ply"]:
        raise RangeError("it does not begin as a PLY; allowed: `ply` to `end_header`, and the data")
    order, elements = None, list[_Element]()
    for number, words in enumerate(lines[1:], start=2):
        match words:
            case [] | ["comment" | "obj_info", *_]:
                continue
            case ["format", name, _] if name in ORDERS:
                order = ORDERS[name]
            case ["element", name, count] if count.isdecimal():
                elements.append(_Element(name, int(count)))
            case ["property", "list", count_kind, kind, name] if elements and {count_kind, kind} <= TYPES.keys():
                elements[-1].properties.append(_Property(name, TYPES[kind], TYPES[count_kind]))
            case ["property", kind, name] if elements and kind in TYPES:
                elements[-1].properties.append(_Property(name, TYPES[kind]))
            case _:
                raise RangeError(
                    f"line {number}: {' '.join(words)[:60]!r}; allowed: format, element, property, comment"
                )
    if order is None:
        raise RangeError(f"no format; allowed: {', '.join(ORDERS)}")
    return elements, order, start


def _short(element: _Element) -> RangeError:
    return RangeError(f"it ends before the last {element.name} of {element.count}; allowed: whole files")


# ---- text ------------------------------------------------------------------------------------------------------------


def _text_tables(content: bytes, start: int, elements: list[_Element], order: str) -> list[_Table]:
    first = content[:start].count(b"\n") + 1
    lines = [(number, line.split()) for number, line in enumerate(content[start:].splitlines(), start=first)]
    lines = [(number, words) for number, words in lines if words]
    tables, at = [], 0
    for element in elements:
        rows = lines[at : at + element.count]
        if len(rows) < element.count:
            raise _short(element)
        at += element.count
        tables.append(_text_table(element, rows))
    return tables


def _text_table(element: _Element, rows: list[tuple[int, list[bytes]]]) -> _Table:
    values: dict[str, list[float]] = {item.name: [] for item in element.properties if not item.count_kind}
    lists: dict[str, list[list[int]]] = {item.name: [] for item in element.properties if item.count_kind}
    line = 0
    try:
        for line, words in rows:  # noqa: B007 -- for the message
            at = 0
            for item in element.properties:
                if item.count_kind:
                    end = at + 1 + int(words[at])
                    if not at < end <= len(words):
                        raise IndexError
                    lists[item.name].append([_index(word) for word in words[at + 1 : end]])
                    at = end
                else:
                    values[item.name].append(float(words[at]))
                    at += 1
    except (ValueError, IndexError):
        what = f"the {len(element.properties)} properties of `{element.name}`, lists with their length first"
        raise RangeError(f"line {line}: allowed: {what}") from None
    # A float in text has the precision declared in the header.
    kinds = {item.name: item.kind for item in element.properties}
    return _Table(
        {name: np.array(column, dtype=float).astype(kinds[name]) for name, column in values.items()},
        {name: _flat(column) for name, column in lists.items()},
        at_line([number for number, _ in rows]),
    )


def _index(word: bytes) -> int:
    """An integer; in other lists, such as texture coordinates, the integer part."""
    try:
        return int(word)
    except ValueError:
        return int(float(word))


def _flat(rows: Sequence[Sequence[int]]) -> tuple[Integers, Integers]:
    counts = np.array([len(row) for row in rows], dtype=np.int64)
    return np.fromiter((index for row in rows for index in row), np.int64, int(counts.sum())), counts


# ---- binary ----------------------------------------------------------------------------------------------------------


def _binary_tables(content: bytes, start: int, elements: list[_Element], order: str) -> list[_Table]:
    tables, at = [], start
    for element in elements:
        table, at = _binary_table(content, at, element, order)
        tables.append(table)
    return tables


def _binary_table(content: bytes, start: int, element: _Element, order: str) -> tuple[_Table, int]:
    """The element whose data begin at byte `start`, and the offset of their end."""
    names = [item.name for item in element.properties if item.count_kind]
    if (found := _rows_of_one_size(content, start, element, order)) is None:
        return _rows_of_many_sizes(content, start, element, order)
    data, end = found
    lists = {
        name: (data[name].astype(np.int64).reshape(-1), np.full(len(data), data[name].shape[1], dtype=np.int64))
        for name in names
    }
    values = {item.name: data[item.name] for item in element.properties if not item.count_kind}
    return _Table(values, lists, _numbered(element)), end


def _rows_of_one_size(content: bytes, start: int, element: _Element, order: str) -> tuple[NDArray[Any], int] | None:
    """All rows, if all have lists of the same lengths as the first, and the offset of their end; else None."""
    fields: list[tuple[Any, ...]] = []
    lengths: dict[str, int] = {}
    size = 0
    for item in element.properties:
        if item.count_kind:
            count_kind = np.dtype(order + item.count_kind)
            if not element.count:
                length = 0
            elif start + size + count_kind.itemsize > len(content):
                raise _short(element)
            else:
                length = int(np.frombuffer(content, count_kind, 1, start + size)[0])
            if length < 0 or length * np.dtype(item.kind).itemsize > len(content):
                raise RangeError(f"{_numbered(element)(0)}: a list of {length}; allowed: what the file can hold")
            fields.append((f"{item.name} length", count_kind))
            fields.append((item.name, order + item.kind, (length,)))
            lengths[f"{item.name} length"] = length
        else:
            fields.append((item.name, order + item.kind))
        size = np.dtype(fields).itemsize
    row = np.dtype(fields)
    if start + element.count * row.itemsize > len(content):
        if lengths:
            return None
        raise _short(element)
    data = np.frombuffer(content, row, element.count, start) if row.itemsize else np.zeros(0, row)
    if any((data[name] != length).any() for name, length in lengths.items()):
        return None
    return data, start + data.nbytes


def _rows_of_many_sizes(content: bytes, start: int, element: _Element, order: str) -> tuple[_Table, int]:
    """All rows, read one by one, and the offset of their end; single values of such elements are skipped."""
    endian = order or "<"
    steps = [
        (item.name, struct.Struct(endian + _code(item.count_kind)) if item.count_kind else None, _code(item.kind))
        for item in element.properties
    ]
    sizes = {name: struct.calcsize(endian + code) for name, _, code in steps}
    lists: dict[str, list[tuple[Any, ...]]] = {name: [] for name, counter, _ in steps if counter is not None}
    at = start
    try:
        for _ in range(element.count):
            for name, counter, code in steps:
                if counter is None:
                    at += sizes[name]
                    continue
                (length,) = counter.unpack_from(content, at)
                at += counter.size
                if not 0 <= length * sizes[name] <= len(content) - at:
                    raise _short(element)
                lists[name].append(struct.unpack_from(f"{endian}{length}{code}", content, at))
                at += length * sizes[name]
    except struct.error:
        raise _short(element) from None
    return _Table({}, {name: _flat(rows) for name, rows in lists.items()}, _numbered(element)), at


def _code(kind: str) -> str:
    """The type's code in `struct`."""
    return np.dtype(kind).char


def _numbered(element: _Element) -> Callable[[int], str]:
    return lambda number: f"{element.name} {number} from 0"
