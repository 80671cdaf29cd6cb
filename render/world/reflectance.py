"""Diffuse reflectance from a Mitsuba scene file: one albedo per shape, the mean of a texture."""

from __future__ import annotations

import math
import os
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np

from pss import PSSError, RangeError
from pss.files import is_inside

__all__ = ["DEFAULT_ALBEDO", "Reflectances"]

Element = ElementTree.Element

# Mitsuba's default for a diffuse bsdf without reflectance, and ours for all other bsdfs.
DEFAULT_ALBEDO = 0.5
CHECKERS = {"color0": 0.4, "color1": 0.2}
# Luminance of linear Rec. 709, as in Mitsuba's variants of one channel.
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])
# A checkerboard in two-sided plaster is four deep. References may be cyclic, or double at each step.
DEEPEST = 8
# Suffixes of textures, which determine the image reader.
TEXTURES = (".png", ".jpg", ".jpeg", ".exr", ".hdr", ".bmp", ".tga", ".ppm", ".pgm")


class Reflectances:
    """The reflectances of a file with textures in `folder`, restricted to `within` (None: anywhere).

    `guessed` names the shapes that got the default because their bsdf is not a supported diffuse one.
    """

    def __init__(self, root: Element, folder: Path, within: Path | None = None) -> None:
        self.guessed: list[str] = []
        self._folder, self._within = folder, within
        self._means: dict[tuple[str, bool], float] = {}
        self._named = {element.get("id"): element for element in root.iter() if element.tag != "ref"}

    def of_shape(self, shape: Element, name: str) -> float:
        """The albedo of a shape, 0 to 1; Mitsuba's default of 0.5 if it has no bsdf.

        Raises:
            RangeError: a texture is outside, or too large.
        """
        bsdf = self._child(shape, "bsdf")
        try:
            albedo = DEFAULT_ALBEDO if bsdf is None else self._of_bsdf(bsdf, DEEPEST)
            if not math.isfinite(albedo):
                raise ValueError("no number")
        except PSSError:
            raise
        except (ValueError, OSError, ArithmeticError, IndexError):
            self.guessed.append(name)
            albedo = DEFAULT_ALBEDO
        return float(np.clip(albedo, 0.0, 1.0))

    def _child(self, element: Element, *tags: str, name: str | None = None) -> Element | None:
        """The child, or the one it references, with one of `tags` (and the name)."""
        for child in element:
            found = self._named.get(child.get("id")) if child.tag == "ref" else child
            if found is not None and found.tag in tags and (name is None or child.get("name") == name):
                return found
        return None

    def _of_bsdf(self, bsdf: Element, deepest: int) -> float:
        if deepest == 0:
            raise ValueError("references without end")
        match bsdf.get("type"):
            case "twosided":
                inner = self._child(bsdf, "bsdf")
                if inner is None:
                    raise ValueError("two-sided nothing")
                return self._of_bsdf(inner, deepest - 1)
            case "diffuse":
                return self._value(bsdf, "reflectance", DEFAULT_ALBEDO, deepest - 1)
        raise ValueError("not diffuse")

    def _value(self, owner: Element, name: str, default: float, deepest: int) -> float:
        if deepest == 0:
            raise ValueError("references without end")
        value = self._child(owner, "rgb", "srgb", "spectrum", "float", "texture", name=name)
        if value is None:
            return default
        text = value.get("value", "")
        match value.tag, value.get("type"):
            case ("texture", "checkerboard"):
                shades = [self._value(value, key, shade, deepest - 1) for key, shade in CHECKERS.items()]
                return sum(shades) / len(shades)
            case ("texture", "bitmap"):
                return self._mean_of_image(value)
            case ("texture", _):
                raise ValueError("unknown texture")
            case ("spectrum", _) if ":" in text:
                pairs = np.array([[float(part) for part in pair.split(":")] for pair in text.replace(",", " ").split()])
                return float(np.trapezoid(pairs[:, 1], pairs[:, 0]) / np.ptp(pairs[:, 0]))
        if text.startswith("#"):
            encoded = np.array([int(text[place : place + 2], 16) for place in (1, 3, 5)]) / 255
            return float(_linear(encoded) @ LUMINANCE)
        numbers = [float(part) for part in text.replace(",", " ").split()]
        return float(np.array(numbers) @ LUMINANCE) if len(numbers) == 3 else float(*numbers)

    def _mean_of_image(self, texture: Element) -> float:
        named = {child.get("name"): child.get("value", "") for child in texture}
        file, raw = named.get("filename", ""), named.get("raw") == "true"
        if (file, raw) not in self._means:
            path = self._folder / file
            if self._within is not None and not is_inside(path, [self._within]):
                raise RangeError(f"texture {file!r:.60} leads outside the scene's folder; allowed: a file in it")
            if path.suffix.lower() not in TEXTURES or not os.path.isfile(path):
                raise OSError("no image")
            self._means[file, raw] = _mean(path, raw)
        return self._means[file, raw]


def _mean(path: Path, raw: bool) -> float:
    """The mean luminance of an image; `raw`: its numbers are linear, whatever their type."""
    # Imported late: most backdrops have no textures.
    import OpenImageIO as oiio

    from render.images import open_image

    image = open_image(path)
    try:
        pixels = image.read_image(0, 0, 0, image.spec().nchannels, oiio.FLOAT)
        if pixels is None:
            raise OSError(image.geterror())
        if image.spec().format == oiio.UINT8 and not raw:
            pixels = _linear(pixels)
    finally:
        image.close()
    mean = pixels.reshape(-1, pixels.shape[-1]).mean(axis=0, dtype=float)
    return float(mean[:3] @ LUMINANCE if len(mean) >= 3 else mean[0])


def _linear(encoded: np.ndarray) -> np.ndarray:
    """sRGB, 0 to 1, decoded."""
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
