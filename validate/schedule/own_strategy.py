"""A strategy of the user's own: a function in a Python file."""

from __future__ import annotations

import importlib.util
from pathlib import Path

from pss import RangeError
from validate.schedule.strategies import Strategy

__all__ = ["own_strategy"]


def own_strategy(text: str) -> tuple[str, Strategy]:
    """The function that "FILE:FUNCTION" names, with its name; the file is run.

    Raises:
        RangeError: no such file, or no such function in it.
    """
    path, colon, name = text.rpartition(":")
    if not colon or not Path(path).is_file():
        raise RangeError(f"--strategy {text!r}; allowed: the path of a Python file, a colon, and a function in it")
    spec = importlib.util.spec_from_file_location(Path(path).stem, path)
    if spec is None or spec.loader is None:
        raise RangeError(f"--strategy {text!r}: {path} is no Python file")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:  # whatever the user's own code raises
        raise RangeError(f"--strategy {text!r}: {path} fails with {type(error).__name__}: {error}") from error
    function = getattr(module, name, None)
    if not callable(function):
        raise RangeError(f"--strategy {text!r}: {path} has no function {name!r}")
    return name, function
