"""The scene as glTF: colours are linear and materials matt, in the file's own JSON."""

from __future__ import annotations

import json
import struct

import numpy as np
import pytest
import trimesh

from validate.pages.gltf import COLOUR_KEY, glb_of, linear

# The darkest plate of the scale, and what glTF's linear values of it are, to the digits given.
DARK, DARK_LINEAR, DIGITS = (68, 1, 84), (14.7, 0.1, 22.6), 0.05


def document(content: bytes) -> dict:
    """The JSON chunk of a GLB: 12 bytes of header, then length, kind and text."""
    length, kind = struct.unpack_from("<I4s", content, 12)
    assert (content[:4], kind) == (b"glTF", b"JSON")
    return json.loads(content[20 : 20 + length])


@pytest.fixture(scope="module")
def model() -> dict:
    plate, body = trimesh.creation.box((1, 1, 0.01)), trimesh.creation.icosphere(1)
    lines = trimesh.load_path(np.array([[[0, 0, 0], [1, 0, 0]], [[1, 0, 0], [1, 1, 0.5]]]))
    for part, colour in ((plate, DARK), (body, (255, 255, 255)), (lines, DARK)):
        part.metadata[COLOUR_KEY] = colour
    return document(glb_of(trimesh.Scene({"plate": plate, "body": body, "lines": lines})))


def test_a_plates_colour_is_stored_linear(model):
    materials = {mesh["name"]: model["materials"][mesh["primitives"][0]["material"]] for mesh in model["meshes"]}
    red, green, blue, alpha = materials["plate"]["pbrMetallicRoughness"]["baseColorFactor"]
    assert [255 * red, 255 * green, 255 * blue] == pytest.approx(DARK_LINEAR, abs=DIGITS)
    assert alpha == 1
    assert materials["body"]["pbrMetallicRoughness"]["baseColorFactor"] == pytest.approx([1, 1, 1, 1])
    assert materials["lines"] == materials["plate"]
    assert len(model["materials"]) == 2


def test_no_material_is_a_metal_and_no_second_colour_multiplies_it(model):
    """glTF's metallicFactor is 1 where it is not given, which viewers show nearly black; COLOR_0 would multiply."""
    for mesh in model["meshes"]:
        for part in mesh["primitives"]:
            material = model["materials"][part["material"]]
            assert material["pbrMetallicRoughness"]["metallicFactor"] == 0
            assert material["pbrMetallicRoughness"]["roughnessFactor"] == 1
            assert material["doubleSided"]
            assert "COLOR_0" not in part["attributes"]


def test_linear_is_the_inverse_of_srgbs_own_curve():
    """IEC 61966-2-1 from linear to sRGB, for every byte."""
    for byte in range(256):
        (value,) = linear([byte])
        coded = 12.92 * value if value <= 0.0031308 else 1.055 * value ** (1 / 2.4) - 0.055
        assert coded * 255 == pytest.approx(byte, abs=1e-4)
