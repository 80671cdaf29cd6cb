"""Names of views and of solved light: hashes of all that determines them.

A name has two parts. The first stands for what is seen: scene state, camera, sensor, sampling and renderer. The second
stands for the code that makes it, and the versions of the libraries that the code uses (`render.code_digest`). Random
numbers hang on the first part alone, so that results before and after a change of the code have the same noise.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from functools import lru_cache

import numpy as np

from pss.surrogates import Mesh
from render import backend
from render.code_digest import Code, code_of
from render.world.marker_print import pattern
from render.world.state import SceneState

__all__ = [
    "APART",
    "content_of",
    "digest_of",
    "light_code",
    "light_key",
    "state_key",
    "view_code",
    "view_key",
]

# Hexadecimal digits of a view's name that stand for what is seen; those of the code follow.
CONTENT_DIGITS = 16
STATE_DIGITS = 24
APART = {
    "render.code_digest": "makes names; what it finds is the name",
    "pss.surrogates._mesh_files": "reads a mesh from its file, and the name holds the mesh itself",
    "archspec": "finds the kind of processor, which the renderer's name holds",
    "cv2": "prints the markers, and the name holds their black and white modules",
}
"""Modules and libraries that a view's code does not count, with the reason."""


def view_code() -> Code:
    """The code that renders and stores views."""
    return code_of("render.renderer", "render.files.exr", apart=tuple(APART))


def light_code() -> Code:
    """The code that solves a scene's light; Mitsuba casts rays for it where meshes stand in the way."""
    return code_of("render.light.lit_scene", "render.light.radiosity", "mitsuba", "drjit", apart=tuple(APART))


def view_key(content: object) -> str:
    """The name of a view of `content`, which `digest_of` can hash."""
    return digest_of(content)[:CONTENT_DIGITS] + view_code().digest


def content_of(key: str) -> str:
    """The part of a view's name that stands for what is seen, whatever code rendered it."""
    return key[:CONTENT_DIGITS]


@lru_cache(maxsize=256)
def state_key(state: SceneState) -> str:
    """Hash of a scene state, with the black and white modules of its markers; kept, since a person is long to hash."""
    modules = [np.packbits(pattern(state.print.dictionary, marker.id)).tobytes().hex() for marker in state.markers]
    return digest_of([state, modules])[:STATE_DIGITS]


def light_key(state: SceneState) -> str:
    """The name under which a scene state's solved light is stored; kinds of processor round it differently."""
    return f"{state_key(state)}-{light_code().digest}{backend.processor_mark()}"


def digest_of(content: object) -> str:
    """SHA-256, hexadecimal, of plain data, dataclasses and meshes."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), default=_plain)
    return hashlib.sha256(text.encode()).hexdigest()


def _plain(value: object) -> object:
    if isinstance(value, Mesh):
        return {"type": "Mesh", "name": value.name, "digest": value.digest}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {field.name: getattr(value, field.name) for field in dataclasses.fields(value) if field.compare}
        return {"type": type(value).__name__, **fields}
    raise TypeError(f"{type(value).__name__} has no place in a view's hash")
