"""`run.json` of a folder of results: the only reader and writer of it.

The file may come from elsewhere: it is read whole, or refused in one line.
"""

from __future__ import annotations

import ast
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pss import RangeError
from pss.files import read_bounded
from pss.json_text import json_text
from render.store.folder import StoreError, write_text

__all__ = ["RUN_FILE", "as_options", "listed", "needed", "option", "read_run", "write_run"]

RUN_FILE = "run.json"
# Of a run of many sweeps it has a megabyte.
MOST_BYTES = 64 * 2**20
LONGEST_VALUE = 60
ALLOWED = "allowed: what a run left"


def read_run(folder: Path) -> dict[str, Any] | None:
    """The object in a folder's `run.json`; None where there is none.

    Raises:
        StoreError: it is no plain file, no JSON, or no object; one line with the file and the place in it.
    """
    path = folder / RUN_FILE
    try:
        content = json.loads(read_bounded(path, MOST_BYTES).decode("utf-8"))
    except FileNotFoundError:
        return None
    except json.JSONDecodeError as error:
        raise StoreError(f"{path}: line {error.lineno}, column {error.colno}: {error.msg}; {ALLOWED}") from None
    except UnicodeDecodeError as error:
        raise StoreError(f"{path}: byte {error.start} is no UTF-8; {ALLOWED}") from None
    except RecursionError:
        raise StoreError(f"{path}: lists or tables too deep; {ALLOWED}") from None
    except RangeError as error:
        raise StoreError(f"{path}: {error}") from None
    except OSError as error:
        raise StoreError(f"{path}: {error.strerror}; {ALLOWED}") from None
    except ValueError as error:  # a number of thousands of digits
        raise StoreError(f"{path}: {str(error)[:LONGEST_VALUE]}; {ALLOWED}") from None
    if not isinstance(content, dict):
        raise StoreError(f"{path}: {_shown(content)}; allowed: an object, as a run left")
    return content


def write_run(folder: Path, content: Mapping[str, object]) -> None:
    """Write a folder's `run.json`: the run's options, files, seeds, versions and counts, as far as it has them.

    Raises:
        StoreError: the folder cannot be written.
    """
    write_text(folder / RUN_FILE, json_text(content, indent=2) + "\n")


def as_options(options: Mapping[str, object]) -> dict[str, str]:
    """A run's options as `run.json` has them, for `option`, `needed` and `listed` to read."""
    return {name: str(value) for name, value in options.items()}


def option(folder: Path, options: Mapping[str, Any], name: str) -> str | None:
    """The text of an option that a run was given; None where it was not given.

    Raises:
        StoreError: it is no text.
    """
    value = options.get(name)
    if value is not None and not isinstance(value, str):
        raise StoreError(f"{folder / RUN_FILE}: options.{name} = {_shown(value)}; allowed: text")
    return None if value == "None" else value


def needed(folder: Path, options: Mapping[str, Any], name: str) -> str:
    """The text of an option that every run has.

    Raises:
        StoreError: it is missing, or no text.
    """
    value = option(folder, options, name)
    if value is None:
        raise StoreError(f"{folder / RUN_FILE}: options.{name} is missing; {ALLOWED}")
    return value


def listed(folder: Path, options: Mapping[str, Any], name: str) -> list[str]:
    """The texts of an option that may be given several times.

    Raises:
        StoreError: it is no list of texts.
    """
    text = option(folder, options, name)
    try:
        value = ast.literal_eval(text or "")
        if isinstance(value, list | tuple) and all(isinstance(each, str) for each in value):
            return list(value)
    except (ValueError, SyntaxError, TypeError, MemoryError, RecursionError):
        pass
    raise StoreError(f"{folder / RUN_FILE}: options.{name} = {_shown(text)}; allowed: a list of texts")


def _shown(value: object) -> str:
    text = repr(value)
    return text if len(text) <= LONGEST_VALUE else text[: LONGEST_VALUE - 1] + "…"
