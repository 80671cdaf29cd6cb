"""Names of views and of solved light: hashes of everything that determines them.

A name has two parts. The first identifies the content: scene state, camera, sensor, sampling and renderer. The second
identifies the code that renders it and the versions of the libraries it uses (`render.code_digest`). Random numbers
depend on the first part only, so that results before and after a change of the code have the same noise.
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
    "EXCLUDED",
    "content_of",
    "digest_of",
    "light_code",
    "light_key",
    "state_key",
    "view_code",
    "view_key",
]

# Hexadecimal digits of the content in a view's name; those of the code follow.
CONTENT_DIGITS = 16
STATE_DIGITS = 24
EXCLUDED = {
    "render.code_digest": "computes the names, which do not depend on itself",
    "pss.surrogates._mesh_files": "reads a mesh from its file, and the name includes the mesh itself",
    "archspec": "finds the kind of processor, which the renderer's name includes",
    "cv2": "prints the markers, and the name includes their black and white modules",
}
"""Modules and libraries that a view's code does not count, with the reason."""


def view_code() -> Code:
    """The code that renders and stores views."""
    return code_of("render.renderer", "render.files.exr", excluded=tuple(EXCLUDED))


def light_code() -> Code:
    """The code that solves a scene's light; Mitsuba traces rays for it where meshes occlude."""
    return code_of("render.light.lit_scene", "render.light.radiosity", "mitsuba", "drjit", excluded=tuple(EXCLUDED))


def view_key(content: object) -> str:
    """The name of a view of `content`, which `digest_of` can hash."""
    return digest_of(content)[:CONTENT_DIGITS] + view_code().digest


def content_of(key: str) -> str:
    """The content part of a view's name, independent of the code that rendered it."""
    return key[:CONTENT_DIGITS]


@lru_cache(maxsize=256)
def state_key(state: SceneState) -> str:
    """Hash of a scene state, with the modules of its markers; cached, since hashing a person is slow."""
    modules = [np.packbits(pattern(state.print.dictionary, marker.id)).tobytes().hex() for marker in state.markers]
    return digest_of([state, modules])[:STATE_DIGITS]


def light_key(state: SceneState) -> str:
    """The name of a scene state's solved light; it depends on the kind of processor, which affects rounding."""
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
