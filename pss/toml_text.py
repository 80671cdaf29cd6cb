"""TOML as text: documents of tables, as scene files and calibrations are."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping

__all__ = ["toml_text"]

BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


def toml_text(document: Mapping[str, object]) -> str:
    """The text of a document: its single values, then a table for each mapping and each mapping in a list.

    What is below a table is written in one line; `tomllib.loads` returns the same document, tuples as lists.

    Args:
        document: text, finite numbers, truth values, lists, and mappings with text for keys.

    Raises:
        TypeError: any other value.
    """
    single = {key: value for key, value in document.items() if not _is_table(value) and not _are_tables(value)}
    parts = ["\n".join(_lines(single))] if single else []
    for key, value in document.items():
        if isinstance(value, Mapping):
            parts.append("\n".join([f"[{_key(key)}]", *_lines(value)]))
        elif isinstance(value, list | tuple) and _are_tables(value):
            parts += ["\n".join([f"[[{_key(key)}]]", *_lines(item)]) for item in value]
    return "\n\n".join(parts) + "\n"


def _is_table(value: object) -> bool:
    return isinstance(value, Mapping)


def _are_tables(value: object) -> bool:
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(item, Mapping) for item in value)


def _lines(table: Mapping[str, object]) -> list[str]:
    lines = []
    for key, value in table.items():
        if isinstance(value, list | tuple) and _are_tables(value):
            lines += [f"{_key(key)} = [", *(f"  {_value(item)}," for item in value), "]"]
        else:
            lines.append(f"{_key(key)} = {_value(value)}")
    return lines


def _key(key: str) -> str:
    return key if BARE_KEY.fullmatch(key) else _quoted(key)


def _value(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return _quoted(value)
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, Mapping):
        return f"{{ {', '.join(f'{_key(key)} = {_value(item)}' for key, item in value.items())} }}" if value else "{}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_value, value))}]"
    raise TypeError(f"{type(value).__name__} has no place in TOML")


def _quoted(text: str) -> str:
    # JSON's escapes are TOML's too, but for the one control character that JSON does not escape.
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
