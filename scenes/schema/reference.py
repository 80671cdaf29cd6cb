"""Every key of a file, as comments for new files, generated from the schema itself."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator
from typing import Any, Literal, get_args, get_origin

from scenes.reading.spec import Spec, allowed_keys, child_tables

__all__ = ["described_keys"]

WIDTH = 118
"""Columns of a comment line."""
KEY_COLUMNS = 36


def described_keys(model: type[Spec]) -> str:
    """Comment lines, one for each key of a file of the kind `model`: its dotted name, and what is allowed there.

    Keys of a list's tables are named as those of one of them ("cameras.zoom"). If a table is one of several kinds, each
    kind has its own lines, under a heading.
    """
    return "\n".join(_lines(model, ""))


def _lines(table: type[Spec], prefix: str) -> Iterator[str]:
    for key in allowed_keys(table):
        field = _field(table, key)
        below = child_tables(table, key)
        allowed = field.description or ("" if below else _choices(field.annotation))
        if allowed or not below:
            yield _line(prefix + key, allowed + _default(field))
        for kind in below:
            yield "#"
            yield _wrapped(f"[{prefix}{key}] {_heading(kind)}", "# ", "# ")
            yield from _lines(kind, f"{prefix}{key}.")


def _field(table: type[Spec], key: str) -> Any:
    return next(field for name, field in table.model_fields.items() if key in (name, field.alias))


def _heading(table: type[Spec]) -> str:
    """Heading of a table: the first sentence of its docstring, without the key, which precedes it."""
    first = " ".join((table.__doc__ or "").split("\n\n")[0].split())
    head, colon, rest = first.partition(": ")
    return rest if colon and head.startswith("[") else first


def _choices(annotation: Any) -> str:
    if get_origin(annotation) is Literal:
        return ", ".join(f'"{choice}"' for choice in get_args(annotation))
    return {float: "a number", int: "a whole number", bool: "true or false"}.get(annotation, "")


def _default(field: Any) -> str:
    if field.is_required() or field.default is None or isinstance(field.default, Spec):
        return ""
    shown = list(field.default) if isinstance(field.default, tuple) else field.default
    return f" (if left out: {shown})"


def _line(key: str, text: str) -> str:
    return _wrapped(text, f"# {key:<{KEY_COLUMNS}} ", f"# {'':<{KEY_COLUMNS}} ")


def _wrapped(text: str, first: str, others: str) -> str:
    return textwrap.fill(text, WIDTH, initial_indent=first, subsequent_indent=others)
