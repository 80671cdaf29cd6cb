"""Files gone wrong, the same for the same generator: documents with other keys and values, and bytes that are off."""

from __future__ import annotations

import copy
import json
import math
import struct
from typing import Any

import numpy as np

Generator = np.random.Generator

# What may stand where something else should.
NUMBERS = (0, -1, 1, 3, 7, 0.1, 1000, 100_000, 1e9, -1e9, 10**12, 1e-29, 1e29, -1e29, 5e-324, 1e300, 2**63 - 1, 10**400)
NO_NUMBERS = (math.nan, math.inf, -math.inf)
TEXTS = (
    "",
    "x",
    "a\nb\x1b[31m\x9b",
    "é ⟂",
    "none",
    "../../secret",
    "/dev/zero",
    "~/x.toml",
    "room.toml\x00",
    "https://example.org/a.ply",
    "$x",
)
OTHERS = (True, False, [], {}, [[]], [1, 2, 3], [1.0, "2", [3]], {"name": "x"}, [{"name": "1"}, {"name": "1"}])
MANY = (2, 40, 1200)
DEEP = (1, 3, 20, 40, 3000)
LONG = (100, 300, 2000, 20_000, 600_000)


def chosen(rng: Generator, items: Any) -> Any:
    return items[int(rng.integers(len(items)))]


def odd_value(rng: Generator) -> tuple[Any, str]:
    """A value of any type, and what it is."""
    kind = chosen(rng, ("number", "no number", "text", "other", "long text", "deep list", "deep table", "long list"))
    match kind:
        case "long text":
            size = chosen(rng, LONG)
            return "y" * size, f"a text of {size}"
        case "deep list" | "deep table":
            size = chosen(rng, DEEP)
            return Deep(size, kind == "deep table"), f"a {kind} of {size}"
        case "long list":
            size, item = chosen(rng, LONG) // 10, chosen(rng, NUMBERS)
            return [item] * size, f"{size} times {str(item)[:20]}"
    value = chosen(rng, {"number": NUMBERS, "no number": NO_NUMBERS, "text": TEXTS, "other": OTHERS}[kind])
    return copy.deepcopy(value), repr(value)[:40]


class Deep:
    """A value within many lists or tables, which no writer with recursion could write."""

    def __init__(self, size: int, tables: bool) -> None:
        self.size, self.tables = size, tables

    def text(self, equals: str) -> str:
        opening, closing = ('{"a"' + equals, "}") if self.tables else ("[", "]")
        return opening * self.size + "1" + closing * self.size


def places(document: Any, path: tuple = ()) -> list[tuple]:
    """The paths of all that is in a document."""
    found = []
    keys = document if isinstance(document, dict) else range(len(document)) if isinstance(document, list) else ()
    for key in keys:
        found += [(*path, key), *places(document[key], (*path, key))]
    return found


def mutated_document(document: dict[str, Any], rng: Generator) -> tuple[dict[str, Any], str]:
    """A document with one to three changes, and what they are."""
    document, changes = copy.deepcopy(document), []
    other: Any
    for _ in range(int(rng.integers(1, 4))):
        path = chosen(rng, places(document) or [("x",)])
        owner = document
        for key in path[:-1]:
            owner = owner[key]
        key, where = path[-1], ".".join(map(str, path))[:60]
        value = owner.get(key) if isinstance(owner, dict) else owner[key]
        what = chosen(
            rng,
            ("nudge", "nudge", "nudge", "scale", "scale", "replace", "drop", "double", "rename", "move", "many", "add"),
        )
        match what:
            case "drop":
                owner.pop(key, None) if isinstance(owner, dict) else owner.pop(key)
            case "double" if isinstance(owner, dict):
                owner[Again(str(key))] = owner.get(key, 1)
            case "rename" if isinstance(owner, dict):
                name = chosen(
                    rng, (str(key)[:-1], str(key) + "s", "a.b", "", "a\nb", "k" * chosen(rng, LONG), "name", "€")
                )
                owner[name] = owner.pop(key, 1)
                what += f" to {name[:20]!r} of"
            case "scale" if isinstance(value, float) or (isinstance(value, int) and abs(value) < 2**64):
                factor = chosen(rng, (-1, 0, 10, 1e-3, 1e3, 1e6, 1e-9, 1e200))
                owner[key] = value * factor
                what += f" by {factor:g}"
            case "nudge" if isinstance(value, float):
                # As likely to be allowed as not, so that what comes after the first checks is asked too.
                owner[key] = value * float(rng.uniform(0.8, 1.2))
            case "nudge" if isinstance(value, int) and not isinstance(value, bool):
                owner[key] = value + int(rng.integers(-2, 3))
            case "nudge" if isinstance(value, str):
                owner[key] = value + chosen(rng, ("", " ", "s", "2"))
            case "move":
                other = document
                for step in chosen(rng, places(document) or [()]):
                    other = other[step]
                owner[key] = copy.deepcopy(other)
            case "many" if isinstance(owner, list):
                owner += [copy.deepcopy(owner[key]) for _ in range(chosen(rng, MANY))]
            case "add" if isinstance(owner, dict):
                other, shown = odd_value(rng)
                owner[chosen(rng, ("extra", "markers", "file", "name", "phase", "uri", "scale"))] = other
                what += f" {shown} beside"
            case _:
                owner[key], shown = odd_value(rng)
                what = f"put {shown} at"
        changes.append(f"{what} {where}")
    return document, "; ".join(changes)


class Again(str):
    """A key that is written a second time: equal to nothing, so that a dict holds it beside the first."""

    __slots__ = ()

    def __eq__(self, other: object) -> bool:
        return self is other

    __hash__ = object.__hash__


def written(value: Any, equals: str = "=") -> str:
    """A value as TOML has it in one line (or JSON, with ":" for `equals`)."""
    if isinstance(value, Deep):
        return value.text(equals)
    if isinstance(value, dict):
        return "{" + ", ".join(f"{written(str(k))}{equals}{written(v, equals)}" for k, v in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(written(item, equals) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        # Python writes thousands of digits only when asked to.
        return hex(value) if equals == "=" and value > 10**300 else str(value)
    if isinstance(value, float):
        names = {"nan": "NaN", "inf": "Infinity", "-inf": "-Infinity"} if equals == ":" else {}
        return names.get(repr(value), repr(value))
    return json.dumps(value if isinstance(value, str) else str(value), ensure_ascii=False).replace("\x7f", "\\u007f")


def as_toml(document: dict[str, Any]) -> bytes:
    """The text of a TOML file."""
    lines = [f"{written(str(key))} = {written(value)}" for key, value in document.items()]
    return ("\n".join(lines) + "\n").encode("utf-8", errors="surrogatepass")


def mutated_bytes(content: bytes, rng: Generator, most: int | None = None) -> tuple[bytes, str]:
    """Content with bytes flipped, cut, put in or repeated (within the first `most`), and what was done."""
    data, end = bytearray(content), min(most or len(content), len(content))
    what = chosen(rng, ("flip a bit", "flip bits", "cut", "cut out", "put in", "repeat", "number", "digits"))
    place = int(rng.integers(max(end, 1)))
    length = int(rng.integers(1, 40))
    match what:
        case "flip a bit":
            data[place] ^= 1 << int(rng.integers(8))
        case "flip bits":
            for at in rng.integers(end, size=length).tolist():
                data[at] ^= 1 << int(rng.integers(8))
        case "cut":
            del data[place:]
        case "cut out":
            del data[place : place + length]
        case "put in":
            data[place:place] = rng.bytes(length)
        case "repeat":
            data[place:place] = bytes(data[place : place + length]) * int(rng.integers(1, 50))
        case "number":
            data[place : place + 4] = struct.pack("<I", chosen(rng, (0, 1, 0x7FFFFFFF, 0x80000000, 0xFFFFFFFF, 1000)))
        case _:
            digits = [at for at in range(end) if 48 <= data[at] <= 57] or [0]
            at = chosen(rng, digits)
            data[at : at + 1] = chosen(rng, (b"9" * 12, b"-1", b"1e300", b"nan", b"x", b"9" * 5000))
    return bytes(data), f"{what} at byte {place} of {len(content)}"
