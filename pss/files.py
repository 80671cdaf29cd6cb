"""Safe reading of files from others: limited in size and depth, and refused as a whole if anything is wrong."""

from __future__ import annotations

import errno
import math
import os
import re
import stat
import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any, BinaryIO

from pss.errors import RangeError

__all__ = [
    "DEEPEST_TABLE",
    "MOST_TOML_BYTES",
    "check_values",
    "is_inside",
    "open_plain",
    "read_bounded",
    "read_toml",
]

# A hundred times the longest file that comes with the project; enough for two thousand cameras.
MOST_TOML_BYTES = 512 * 1024
# No file of the project is deeper than six; Python's stack, which each level uses, has room for a few hundred.
DEEPEST_TABLE = 32
# TOML's own range; larger integers could be read, but neither written nor converted to a float.
LARGEST_INTEGER = 2**63 - 1
# Beyond any measure in any unit; products and quotients of several are still finite.
SMALLEST_NUMBER, LARGEST_NUMBER = 1e-30, 1e30

# A dotted key with more parts than tables may be deep: the time to parse one grows with the square of its parts. The
# possessive quantifiers (+) prevent the search itself from taking as long.
_LONG_KEY = re.compile(
    r"""(?<![\w.-])(?:(?:[\w-]++|"[^"\n]*+"|'[^'\n]*+')[ \t]*+\.[ \t]*+){%d}""" % DEEPEST_TABLE  # noqa: UP031
)


def is_inside(path: str | os.PathLike[str], folders: Iterable[str | os.PathLike[str]]) -> bool:
    """Whether `path` is in one of `folders` or below, with all symbolic links resolved; it need not exist."""
    try:
        real = Path(path).resolve()
        return any(real.is_relative_to(Path(folder).resolve()) for folder in folders)
    except (OSError, ValueError, RuntimeError):
        # A null character, or a cycle of links: in no folder.
        return False


def open_plain(path: str | os.PathLike[str]) -> BinaryIO:
    """A plain file, or a link to one, open for reading bytes. Pipes and devices, which may never end, are not opened.

    Raises:
        RangeError: it is a pipe, a device or a socket.
        OSError: it cannot be read.
    """
    _check_plain(os.stat(path).st_mode)
    # In case it was replaced since: opening a pipe in this mode does not block.
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    try:
        _check_plain(os.fstat(handle).st_mode)
        return os.fdopen(handle, "rb")
    except BaseException:
        os.close(handle)
        raise


def _check_plain(mode: int) -> None:
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
    if not stat.S_ISREG(mode):
        kind = "a pipe" if stat.S_ISFIFO(mode) else "a socket" if stat.S_ISSOCK(mode) else "a device"
        raise RangeError(f"it is {kind}; allowed: a plain file")


def read_bounded(path: str | os.PathLike[str], most_bytes: int) -> bytes:
    """The bytes of a file with at most `most_bytes`.

    Raises:
        RangeError: it is larger, and the message starts with its size; or it is not a plain file.
        OSError: it cannot be read.
    """
    with open_plain(path) as file:
        content = file.read(most_bytes + 1)
        if len(content) > most_bytes:
            size = max(os.fstat(file.fileno()).st_size, len(content))
            raise RangeError(f"{size} bytes; allowed: at most {most_bytes}")
    return content


def read_toml(path: str | os.PathLike[str]) -> dict[str, Any]:
    """The document in a TOML file of at most `MOST_TOML_BYTES`, with tables at most `DEEPEST_TABLE` deep.

    A byte order mark at its beginning is skipped.

    Raises:
        RangeError: one line that starts with the path: the file is missing, unreadable, too large or too deep, or is
            not valid TOML (then with line and column).
    """
    text = ""
    try:
        text = read_bounded(path, MOST_TOML_BYTES).decode("utf-8-sig")
        if found := _LONG_KEY.search(text):
            number = text.count("\n", 0, found.start()) + 1
            raise RangeError(
                f"line {number}: a key of more than {DEEPEST_TABLE} parts; allowed: at most {DEEPEST_TABLE}"
            )
        document = tomllib.loads(text)
        check_values(document)
    except FileNotFoundError:
        raise RangeError(f"{path}: there is no such file; allowed: the path of a .toml file") from None
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
        # An invalid value (a number of thousands of digits, a date in month 13), or a `RangeError`.
        raise RangeError(f"{path}: {error}") from None
    return document


def check_values(document: dict[str, Any]) -> None:
    """Check that a document is not too deep, and that its numbers are in a range that computations allow.

    Raises:
        RangeError: tables or lists deeper than `DEEPEST_TABLE`, an integer out of TOML's range, or a nonzero number
            larger than `LARGEST_NUMBER` or smaller than `SMALLEST_NUMBER` in size.
    """
    # Without recursion, since the depth is what is checked.
    level: list[tuple[str, object]] = [("", document)]
    for _ in range(DEEPEST_TABLE + 1):
        if not level:
            return
        below: list[tuple[str, object]] = []
        for key, value in level:
            if isinstance(value, dict):
                below += ((str(name), item) for name, item in value.items())
            elif isinstance(value, list):
                below += ((key, item) for item in value)
            elif isinstance(value, int):
                if abs(value) > LARGEST_INTEGER:
                    bits = value.bit_length()
                    raise RangeError(
                        f"{key!r:.60} has a whole number of {bits} bits; allowed: within ±{LARGEST_INTEGER}"
                    )
            elif isinstance(value, float) and not _is_measure(value):
                allowed = f"0, or of a size from {SMALLEST_NUMBER:g} to {LARGEST_NUMBER:g}"
                raise RangeError(f"{key!r:.60} has the number {value!r}; allowed: {allowed}")
        level = below
    raise RangeError(f"lists or tables too deep; allowed: at most {DEEPEST_TABLE} levels")


def _is_measure(value: float) -> bool:
    # nan and infinity are reported by the key that expects a number, with its own range.
    return value == 0 or not math.isfinite(value) or SMALLEST_NUMBER <= abs(value) <= LARGEST_NUMBER
