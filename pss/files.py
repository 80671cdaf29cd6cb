"""Files that others may have written: read whole or refused, and never more of them than is allowed."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from pss.errors import RangeError

__all__ = ["DEEPEST_TABLE", "MOST_TOML_BYTES", "is_inside", "read_bounded", "read_toml"]

# A hundred times the longest file that comes with the project; a thousand cameras take half of it.
MOST_TOML_BYTES = 512 * 1024
# No file of the project goes deeper than six; Python's own stack, which each level uses, holds a few hundred.
DEEPEST_TABLE = 32
# TOML's own range; beyond it some numbers could be read, but not be written or be made a float.
LARGEST_INTEGER = 2**63 - 1

# A dotted key of more parts than tables may be deep: the time to read one grows with the square of its parts.
# Possessive (+): without them the search for it would take as long.
_LONG_KEY = re.compile(
    r"""(?<![\w.-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){%d}""" % DEEPEST_TABLE  # noqa: UP031
)


def is_inside(path: str | os.PathLike[str], folders: Iterable[str | os.PathLike[str]]) -> bool:
    """Whether `path` lies in one of `folders` or below, when all symbolic links are followed; it need not exist."""
    try:
        real = Path(path).resolve()
        return any(real.is_relative_to(Path(folder).resolve()) for folder in folders)
    except (OSError, ValueError, RuntimeError):
        # A null character, or links that go round in a circle: nowhere.
        return False


def read_bounded(path: str | os.PathLike[str], most_bytes: int) -> bytes:
    """The bytes of a file that has at most `most_bytes`.

    Raises:
        RangeError: it has more; one line, which starts with the size.
        OSError: it cannot be read.
    """
    with open(path, "rb") as file:
        content = file.read(most_bytes + 1)
        if len(content) > most_bytes:
            size = max(os.fstat(file.fileno()).st_size, len(content))
            raise RangeError(f"{size} bytes; allowed: at most {most_bytes}")
    return content


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The document in a TOML file of at most `MOST_TOML_BYTES`, whose tables are at most `DEEPEST_TABLE` deep.

    Raises:
        RangeError: one line that starts with the path: the file is not there, cannot be read, is larger or deeper than
            that, or is no TOML (then with line and column).
    """
    text = ""
    try:
        text = read_bounded(path, MOST_TOML_BYTES).decode("utf-8")
        if found := _LONG_KEY.search(text):
            number = text.count("\n", 0, found.start()) + 1
            raise RangeError(
                f"line {number}: a key of more than {DEEPEST_TABLE} parts; allowed: at most {DEEPEST_TABLE}"
            )
        document = tomllib.loads(text)
        _check_values(document)
    except FileNotFoundError:
        raise RangeError(f"{path}: there is no such file") from None
    except UnicodeDecodeError as error:
        raise RangeError(f"{path}: byte {error.start} is no UTF-8, which TOML must be") from None
    except OSError as error:
        raise RangeError(f"{path}: {error.strerror}") from None
    except RecursionError:
        raise RangeError(f"{path}: lists or tables too deep; allowed: at most {DEEPEST_TABLE} levels") from None
    except tomllib.TOMLDecodeError as error:
        reason, _, place = str(error).rpartition(" (at ")
        found = re.fullmatch(r"line (\d+), column (\d+)\)", place)
        lines = text.split("\n")
        line, column = found.groups() if found else (str(len(lines)), str(len(lines[-1]) + 1))
        raise RangeError(f"{path}: line {line}, column {column}: {reason or error}") from None
    except ValueError as error:
        # What is wrong with a value itself (a number of thousands of digits, a date in month 13), or a `RangeError`.
        raise RangeError(f"{path}: {error}") from None
    return document


def _check_values(document: dict[str, Any]) -> None:
    """That nothing lies too deep, and all whole numbers are TOML's; without recursion, as it is about that."""
    level: list[object] = [document]
    for _ in range(DEEPEST_TABLE + 1):
        if not level:
            return
        below: list[object] = []
        for value in level:
            if isinstance(value, dict):
                below += value.values()
            elif isinstance(value, list):
                below += value
            elif isinstance(value, int) and abs(value) > LARGEST_INTEGER:
                raise RangeError(f"a whole number of {value.bit_length()} bits; allowed: within ±{LARGEST_INTEGER}")
        level = below
    raise RangeError(f"lists or tables too deep; allowed: at most {DEEPEST_TABLE} levels")
