"""A scene's tables as they are written in Python, as the plain document that a file would have."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from scenes.reading.spec import Spec

__all__ = ["document_of"]


def document_of(tables: Mapping[str, object]) -> dict[str, Any]:
    """Tables of mappings, lists, numpy arrays and the schema's own objects as TOML's types; None is a missing key."""
    return {str(key): _plain(value) for key, value in tables.items() if value is not None}


def _plain(value: object) -> Any:
    if isinstance(value, Spec):
        return value.model_dump(mode="json", by_alias=True, exclude_unset=True)
    if isinstance(value, Mapping):
        return document_of(value)
    if isinstance(value, list | tuple | Iterator):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, os.PathLike):
        return Path(value).as_posix()
    return value
