"""Backdrops from Mitsuba scene files: geometry and diffuse reflectance, read without the renderer.

Supported are shapes (obj, ply, rectangle, cube, sphere, disk) with `to_world`; diffuse bsdfs, alone, two-sided or by
reference, with constant, checkerboard or bitmap reflectance; and defaults ($name). A file's light, sensors and
integrator are ignored. Everything else is skipped and named in a warning.
"""

from __future__ import annotations

import math
import os
import xml.etree.ElementTree as ElementTree
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pss import GeometryError, PSSError, RangeError, Sphere
from pss.files import is_inside, read_bounded
from pss.hints import Floats
from pss.surrogates import Mesh
from render.world.geometry import tile_sphere
from render.world.reflectance import DEFAULT_ALBEDO, Reflectances
from render.world.state import SceneObject

__all__ = ["Backdrop", "read_backdrop"]

Element = ElementTree.Element

SHAPES = ("obj", "ply", "rectangle", "cube", "sphere", "disk")
# Elements of a Mitsuba file about rendering, not about the scene.
ABOUT_RENDERING = {"integrator", "sensor", "sampler", "film", "rfilter"}
# An icosphere of three subdivisions (1280 faces) stays within 0.3 % of its radius.
SPHERE_SUBDIVISIONS = 3
DISK_CORNERS = 64

# Ten thousand shapes with a matrix each.
MOST_XML_BYTES = 4 * 2**20
MOST_ELEMENTS = 100_000
# Every value with a $ is searched for each of them.
MOST_DEFAULTS = 100
# Of a value with defaults substituted: a spectrum of a thousand wavelengths.
LONGEST_VALUE = 20_000
# Each is tested for every line of sight.
MOST_SHAPES = 1000
# Of all meshes in a scene together: more than a scene accepts of a backdrop.
MOST_FACES = 1_000_000


@dataclass(frozen=True)
class Backdrop:
    """Shapes in the file's own axes and units, and warnings about skipped and guessed parts, a line each."""

    parts: tuple[SceneObject, ...]
    warnings: tuple[str, ...]


def read_backdrop(path: Path, *, within: Path | None = None) -> Backdrop:
    """The shapes of the Mitsuba scene at `path`.

    Args:
        within: the folder in which all referenced files have to be, symbolic links resolved; None: anywhere.

    Raises:
        RangeError: the file is missing, not XML, has a document type, is not a Mitsuba scene, or exceeds a limit; or a
            shape's file or numbers are wrong.
        GeometryError: it has no supported shape.
    """
    root = _root(path)
    passed: Counter[str] = Counter()
    reflectances = Reflectances(root, path.parent, within)
    faces = 0
    parts: list[SceneObject] = []
    emitters = 0
    for element in root:
        kind = element.get("type", "")
        match element.tag:
            case "shape" if kind in SHAPES:
                name = element.get("id") or f"{kind} {len(parts) + 1}"
                emitters += sum(child.tag == "emitter" for child in element)
                try:
                    mesh = _shape(element, kind, f"backdrop {name}", path.parent, within)
                    albedo = reflectances.of_shape(element, name)
                except (ValueError, IndexError, ArithmeticError) as error:
                    reason = str(error) if isinstance(error, PSSError) else f"a number is wrong ({error!s:.60})"
                    raise RangeError(f"shape {name!r:.60}: {reason}") from error
                parts.append(SceneObject(mesh, albedo))
                faces += len(mesh.faces)
                if len(parts) > MOST_SHAPES or faces > MOST_FACES:
                    raise RangeError(
                        f"{len(parts)} shapes and more, of {faces} faces; allowed: at most {MOST_SHAPES} shapes and "
                        f"{MOST_FACES} faces"
                    )
            case "emitter":
                emitters += 1
            case "default" | "bsdf" | "texture":
                pass
            case tag if tag not in ABOUT_RENDERING:
                passed[f'{tag} "{kind}"' if kind else tag] += 1
    if not parts:
        raise GeometryError(f"no shape in it that is understood; allowed: {', '.join(SHAPES)}")
    warnings = []
    if emitters:
        warnings.append(f"its {emitters} emitters give no light here (their shapes stay), as the scene's [light] does")
    if passed:
        what = ", ".join(name if count == 1 else f"{count} × {name}" for name, count in passed.items())
        warnings.append(f"passed over: {what}; understood are the shapes {', '.join(SHAPES)}")
    if reflectances.guessed:
        shapes = ", ".join(reflectances.guessed)
        warnings.append(f"albedo {DEFAULT_ALBEDO:g} taken for {shapes}, not of a diffuse bsdf that is understood")
    return Backdrop(tuple(parts), tuple(warnings))


class _PlainTree(ElementTree.TreeBuilder):
    """Builds the tree, but refuses document types: their entities may grow without bound, or read files."""

    def doctype(self, name: str, _public: str | None, _system: str | None) -> None:
        raise RangeError(f"it has a document type, <!DOCTYPE {name:.60}>; allowed: XML without one, as Mitsuba writes")


def _root(path: Path) -> Element:
    if not os.path.isfile(path):
        raise RangeError("there is no such file")
    try:
        content = read_bounded(path, MOST_XML_BYTES)
        root = ElementTree.fromstring(content, ElementTree.XMLParser(target=_PlainTree()))
    except OSError as error:
        raise RangeError(f"cannot be read ({error.strerror})") from None
    except (ElementTree.ParseError, UnicodeError, LookupError) as error:
        raise RangeError(f"no XML ({error})") from None
    if root.tag != "scene":
        raise RangeError(f"its root is <{root.tag:.60}>; allowed: <scene>, as Mitsuba writes it")
    elements = sum(1 for _ in root.iter())
    defaults = {element.get("name", ""): element.get("value", "") for element in root.iter("default")}
    for count, what, most in ((elements, "elements", MOST_ELEMENTS), (len(defaults), "defaults", MOST_DEFAULTS)):
        if count > most:
            raise RangeError(f"{count} {what}; allowed: at most {most}")
    # Longer names first, so that $size does not replace the start of $size_x.
    names = sorted(defaults, key=len, reverse=True)
    for element in root.iter():
        for key, value in element.items():
            for name in names if "$" in value else ():
                # Nested defaults can grow without bound.
                if len(value) + value.count(f"${name}") * len(defaults[name]) > LONGEST_VALUE:
                    raise RangeError(
                        f"${name:.60} makes a value of more than {LONGEST_VALUE} characters; allowed: as many"
                    )
                value = value.replace(f"${name}", defaults[name])
            element.set(key, value)
    return root


# ---- shapes ----------------------------------------------------------------------------------------------------------


def _shape(element: Element, kind: str, name: str, folder: Path, within: Path | None) -> Mesh:
    match kind:
        case "obj" | "ply":
            file = next((child.get("value", "") for child in element if child.get("name") == "filename"), "")
            if within is not None and not is_inside(folder / file, [within]):
                raise RangeError(f"{file!r:.60} leads outside the scene's folder; allowed: a file in it or below")
            mesh = Mesh.from_file(folder / file, name=name)
        case "rectangle":
            mesh = Mesh(name, np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)]), _fan(4))
        case "disk":
            turn = 2 * math.pi * np.arange(DISK_CORNERS) / DISK_CORNERS
            mesh = Mesh(name, np.column_stack([np.cos(turn), np.sin(turn), 0 * turn]), _fan(DISK_CORNERS))
        case "cube":
            mesh = _cube(name)
        case _:
            centre = next((_triple(child) for child in element if child.get("name") == "center"), (0.0, 0.0, 0.0))
            radius = next((float(child.get("value", "")) for child in element if child.get("name") == "radius"), 1.0)
            mesh = Mesh(name, *tile_sphere(Sphere(name, centre, radius), SPHERE_SUBDIVISIONS))
    matrix = np.eye(4)
    for child in element:
        if child.tag == "transform" and child.get("name") == "to_world":
            for step in child:
                with np.errstate(all="ignore"):
                    matrix = _transform(step) @ matrix
    # Numbers that are no longer finite are refused by the mesh.
    with np.errstate(all="ignore"):
        moved = replace(mesh, vertices_m=mesh.vertices_m @ matrix[:3, :3].T + matrix[:3, 3])
        upright = np.linalg.det(matrix[:3, :3]) > 0
    # A reflection inverts the orientation.
    return moved if upright else replace(moved, faces=moved.faces[:, ::-1])


def _fan(corners: int) -> NDArray[np.int64]:
    rim = np.arange(1, corners - 1)
    return np.column_stack([0 * rim, rim, rim + 1])


def _cube(name: str) -> Mesh:
    corners = np.array([(x, y, z) for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return Mesh(name, corners, np.array([face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]))


# ---- transforms ------------------------------------------------------------------------------------------------------


def _numbers(text: str) -> list[float]:
    return [float(part) for part in text.replace(",", " ").split()]


def _triple(element: Element, default: float = 0.0) -> tuple[float, float, float]:
    """x, y and z of an element, by three keys or one value of three numbers (or one for all)."""
    if value := element.get("value"):
        numbers = _numbers(value)
        x, y, z = numbers * 3 if len(numbers) == 1 else numbers
        return x, y, z
    x, y, z = (float(element.get(axis, default)) for axis in "xyz")
    return x, y, z


def _transform(step: Element) -> Floats:
    """The (4, 4) matrix of one step of a transform.

    Raises:
        ValueError: numbers are missing or wrong, or Mitsuba has no such step.
    """
    matrix = np.eye(4)
    match step.tag:
        case "translate":
            matrix[:3, 3] = _triple(step)
        case "scale":
            matrix[:3, :3] = np.diag(_triple(step, 1.0))
        case "rotate":
            axis, angle = np.array(_triple(step)), math.radians(float(step.get("angle", "")))
            # Mitsuba does not normalise the axis; one whose length is not 1 causes shear.
            x, y, z = axis / np.linalg.norm(axis)
            across = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            matrix[:3, :3] += math.sin(angle) * across + (1 - math.cos(angle)) * across @ across
        case "matrix":
            numbers = _numbers(step.get("value", ""))
            size = math.isqrt(len(numbers))
            if size not in (3, 4) or size**2 != len(numbers):
                raise ValueError(f"a matrix of {len(numbers)} numbers, allowed are 9 or 16")
            matrix[:size, :size] = np.reshape(numbers, (size, size))
        case "lookat":
            origin, target, up = (np.array(_numbers(step.get(key, ""))) for key in ("origin", "target", "up"))
            forward = (target - origin) / np.linalg.norm(target - origin)
            left = np.cross(up, forward) / np.linalg.norm(np.cross(up, forward))
            matrix[:3] = np.column_stack([left, np.cross(forward, left), forward, origin])
        case tag:
            raise ValueError(f"unknown transform <{tag}>")
    return matrix
