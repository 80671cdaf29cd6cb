"""Mesh files, backdrops and archives of others: bounded in size, without an end refused, and nothing else is opened."""

from __future__ import annotations

import io
import json
import os
import shutil
import zipfile
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

import render.images
import scenes
import scenes.errors
import scenes.mesh_file
from pss.noise.calibrated import Calibration
from pss.surrogates import Mesh, _mesh_files
from render.store.folder import Store
from render.world.backdrop import read_backdrop
from tests.helpers.foreign_files import CUBE, ROOM, crate, problem_of, write

# ---- meshes ----------------------------------------------------------------------------------------------------------


def glb(header: dict, numbers: bytes = b"") -> bytes:
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    chunk = np.array([len(numbers), 0x004E4942], "<u4").tobytes() + numbers
    sizes = np.array([2, 20 + len(text) + len(chunk), len(text), 0x4E4F534A], "<u4").tobytes()
    return b"glTF" + sizes + text + chunk


CORNERS = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], "<f4").tobytes()


def triangle(**parts) -> dict:
    """The header of a GLB of one triangle."""
    return {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": len(CORNERS)}],
        "bufferViews": [{"buffer": 0, "byteLength": len(CORNERS)}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    } | parts


def test_a_glb_written_by_hand_is_read(tmp_path):
    (tmp_path / "t.glb").write_bytes(glb(triangle(), CORNERS))
    np.testing.assert_array_equal(Mesh.from_file(tmp_path / "t.glb").vertices_m, [(0, 0, 0), (1, 0, 0), (0, 1, 0)])


def halls_of_mirrors() -> list[dict]:
    """Each node has the next one twice: 2 to the 40 triangles."""
    return [{"children": [n + 1, n + 1]} for n in range(40)] + [{"mesh": 0}]


GLB = {
    "a buffer elsewhere": (triangle(buffers=[{"uri": "../secret.bin", "byteLength": 36}]), "in another file"),
    "a buffer on the net": (triangle(buffers=[{"uri": "https://example.org/a", "byteLength": 36}]), "in another file"),
    "more than there is": (
        triangle(accessors=[{"bufferView": 0, "componentType": 5126, "count": 10**12, "type": "VEC3"}]),
        "its header declares 12000000000000 bytes; allowed: at most",
    ),
    "zeros": (triangle(accessors=[{"componentType": 5126, "count": 3, "type": "VEC3"}]), "does not hold"),
    "shared nodes": (triangle(nodes=halls_of_mirrors()), "node 1 is in two places"),
    "a circle": (triangle(nodes=[{"children": [1], "mesh": 0}, {"children": [0]}]), "node 0 is in two places"),
    "a long chain": (
        triangle(nodes=[{"children": [n + 1]} for n in range(100)] + [{"mesh": 0}]),
        "nodes within nodes; allowed: at most 64 deep",
    ),
    "many nodes": (
        triangle(nodes=[{"mesh": 0}] * 5001, scenes=[{"nodes": list(range(5001))}]),
        "5001 nodes; allowed: at most 5000",
    ),
    "a negative count": (
        triangle(accessors=[{"bufferView": 0, "componentType": 5126, "count": -3, "type": "VEC3"}]),
        "0 or more",
    ),
}  # fmt: skip


@pytest.mark.parametrize("what", GLB)
def test_a_glb_that_is_not_whole_or_has_no_end_is_one_line(tmp_path, what):
    header, message = GLB[what]
    path = tmp_path / "t.glb"
    path.write_bytes(glb(header, CORNERS))
    line = problem_of(Mesh.from_file, path)
    assert line.startswith(f"mesh {str(path)!r} cannot be read (")
    assert message in line


def test_one_mesh_at_many_nodes_is_counted_at_each(tmp_path, monkeypatch):
    (tmp_path / "t.glb").write_bytes(glb(triangle(nodes=[{"mesh": 0}] * 4, scenes=[{"nodes": [0, 1, 2, 3]}]), CORNERS))
    assert len(Mesh.from_file(tmp_path / "t.glb").faces) == 4
    monkeypatch.setattr(_mesh_files, "MOST_CORNERS", 3)
    assert "faces; allowed: at most 3" in problem_of(Mesh.from_file, tmp_path / "t.glb")


def test_a_mesh_file_that_is_too_large_is_one_line(tmp_path, monkeypatch):
    path = crate(tmp_path / "crate.ply")
    monkeypatch.setattr(_mesh_files, "MOST_BYTES", path.stat().st_size)
    Mesh.from_file(path)
    monkeypatch.setattr(_mesh_files, "MOST_BYTES", path.stat().st_size - 1)
    size = path.stat().st_size
    assert f"({size} bytes; allowed: at most {size - 1})" in problem_of(Mesh.from_file, path)


@pytest.mark.parametrize("suffix", ["zip", "3mf", "gltf", "dae", "json", "xyz", ""])
def test_other_formats_are_refused_by_their_ending(tmp_path, suffix):
    """Archives that unpack to anything, and formats that are made of several files, among them."""
    path = crate(tmp_path / "crate.stl").rename(tmp_path / f"crate.{suffix}".rstrip("."))
    assert "allowed: .stl, .ply, .obj, .off, .glb" in problem_of(Mesh.from_file, path)


@pytest.fixture
def opened(monkeypatch) -> list[str]:
    """The files that were opened, as Python and OpenImageIO tell."""
    names: list[str] = []

    def noting(whole):
        def opens(file, *arguments, **options):
            names.append(str(file))
            return whole(file, *arguments, **options)

        return opens

    for place, whole in (("builtins.open", open), ("os.open", os.open)):
        monkeypatch.setattr(place, noting(whole))
    return names


def test_materials_and_textures_that_a_mesh_names_are_not_opened(tmp_path, opened):
    write(tmp_path / "secret.mtl", "newmtl m\nmap_Kd secret.png\n")
    write(tmp_path / "secret.png", "nothing")
    write(tmp_path / "t.obj", "mtllib secret.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n")
    write(
        tmp_path / "t.ply",
        "ply\nformat ascii 1.0\ncomment TextureFile secret.png\nelement vertex 3\nproperty float x\nproperty float y\n"
        "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
        "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n",
    )
    textured = {"materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]}
    textured |= {"textures": [{"source": 0}], "images": [{"uri": "secret.png"}]}
    textured |= {"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "material": 0}]}]}
    (tmp_path / "t.glb").write_bytes(glb(triangle(**textured), CORNERS))
    for suffix in ("obj", "ply", "glb"):
        assert len(Mesh.from_file(tmp_path / f"t.{suffix}").faces) == 1
    assert any("t.obj" in name for name in opened)
    assert not [name for name in opened if "secret" in name]


# ---- backdrops -------------------------------------------------------------------------------------------------------


def backdrop(folder: Path, content: str, start: str = "") -> Path:
    return write(folder / "room.xml", f'{start}<scene version="3.0.0">{content}</scene>')


LAUGHS = (
    '<!DOCTYPE scene [<!ENTITY a "ha">'
    + "".join(f'<!ENTITY {chr(98 + n)} "{f"&{chr(97 + n)};" * 10}">' for n in range(9))
    + "]>"
)


DEFAULTS = "".join(f'<default name="n{number}" value="1"/>' for number in range(101))


def reflecting(bsdf: str) -> str:
    return CUBE.replace("</shape>", f"{bsdf}</shape>")


def chain_of_defaults() -> str:
    """Thirty defaults of the same length, each of two of the next: 2 to the 30 characters."""
    names = [f"d{number:02}" for number in range(30)]
    return "".join(
        f'<default name="{name}" value="{f"${after}" * 2 if after else "1"}"/>'
        for name, after in zip(names, [*names[1:], ""], strict=True)
    ) + CUBE.replace("0.2", "$d00")


@pytest.mark.parametrize(
    ("content", "start", "message"),
    [
        ("&j;" + CUBE, LAUGHS, "it has a document type"),
        ("&x;" + CUBE, '<!DOCTYPE scene [<!ENTITY x SYSTEM "secret.txt">]>', "it has a document type"),
        (CUBE, '<!DOCTYPE scene SYSTEM "https://example.org/a.dtd">', "it has a document type"),
        (CUBE * 1001, "", "shapes and more, of"),
        ("<a/>" * 100_001, "", "elements; allowed: at most 100000"),
        (DEFAULTS + CUBE, "", "101 defaults; allowed: at most 100"),
        (chain_of_defaults(), "", "makes a value of more than 20000 characters"),
        ("<!--" + "x" * 2**22 + "-->" + CUBE, "", "bytes; allowed: at most 4194304"),
        ('<shape type="ply"><string name="filename" value="../crate.ply"/></shape>', "", "leads outside the scene's"),
        ('<shape type="ply"><string name="filename" value="link.ply"/></shape>', "", "leads outside the scene's"),
        (
            reflecting('<bsdf type="diffuse"><texture type="bitmap" name="reflectance"><string name="filename" '
                       'value="../grey.png"/></texture></bsdf>'),
            "",
            "leads outside the scene's",
        ),
    ],
)  # fmt: skip
def test_a_backdrop_that_reaches_out_or_has_no_end_is_one_line(home, content, start, message):
    (home / "mine" / "link.ply").symlink_to(home / "crate.ply")
    path = backdrop(home / "mine", content, start)
    assert message in problem_of(read_backdrop, path, within=path.parent)


def test_a_backdrop_may_name_files_of_the_scenes_folder_and_with_the_option_any(home):
    ply = '<shape type="ply"><string name="filename" value="../crate.ply"/></shape>'
    path = backdrop(home / "mine" / "parts", ply)
    scene = write(home / "scene.toml", ROOM + '\n[backdrop]\nfile = "mine/parts/room.xml"\nposition_m = [0, 2, 1]\n')
    shutil.copy(home / "crate.ply", home / "mine" / "crate.ply")
    # The scene's folder counts, not the backdrop's own.
    assert len(scenes.load(scene).state.objects) == 4
    inner = write(home / "mine" / "parts" / "scene.toml", scene.read_text().replace("mine/parts/", ""))
    assert "leads outside the scene's folder" in problem_of(scenes.load, inner)
    assert len(scenes.load(inner, allow_outside=True).state.objects) == 4
    assert len(read_backdrop(path).parts) == 1


def test_includes_and_other_plugins_are_passed_over(tmp_path, opened):
    write(tmp_path / "secret.xml", f"<scene>{CUBE}</scene>")
    others = (
        '<include filename="secret.xml"/><shape type="serialized"><string name="filename" value="secret.xml"/></shape>'
    )
    read = read_backdrop(backdrop(tmp_path, others + CUBE))
    assert len(read.parts) == 1
    assert "passed over: include, shape" in read.warnings[0]
    assert not [name for name in opened if "secret" in name]


def test_references_that_go_round_in_a_circle_end(tmp_path):
    """Two-sided itself, and a checkerboard of itself: the default, with a warning."""
    twosided = '<bsdf type="twosided" id="a"><ref id="a"/></bsdf>'
    texture = '<texture type="checkerboard" id="t" name="color0"><ref id="t"/></texture>'
    boards = f'<bsdf type="diffuse" id="b">{texture.replace("color0", "reflectance")}</bsdf>'
    for bsdf in (twosided, boards):
        read = read_backdrop(backdrop(tmp_path, bsdf + reflecting(f'<ref id="{bsdf[bsdf.index("id=") + 4]}"/>')))
        assert 0 <= read.parts[0].albedo <= 1


def test_a_texture_is_an_image_of_bounded_size(tmp_path, monkeypatch):
    pixels = oiio.ImageBuf(oiio.ImageSpec(8, 4, 1, "uint8"))
    pixels.write(str(tmp_path / "grey.png"))
    shutil.copy(tmp_path / "grey.png", tmp_path / "grey.tif")
    bitmap = (
        '<bsdf type="diffuse"><texture type="bitmap" name="reflectance">'
        '<string name="filename" value="{}"/></texture></bsdf>'
    )
    read = read_backdrop(backdrop(tmp_path, reflecting(bitmap.format("grey.png"))))
    assert (read.parts[0].albedo, read.warnings) == (0.0, ())
    # Of a reader that is not asked.
    assert "taken for" in read_backdrop(backdrop(tmp_path, reflecting(bitmap.format("grey.tif")))).warnings[0]
    monkeypatch.setattr(render.images, "MOST_PIXELS", 31)
    path = backdrop(tmp_path, reflecting(bitmap.format("grey.png")))
    assert "its size is 8 × 4 × 1 pixels; allowed: at most 31" in problem_of(read_backdrop, path)


# ---- calibrations and the store --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name = 1\n[weights]\nfloor = 1.0\n", "name = 1; allowed: text"),
        ("provenance = 1\n[weights]\nfloor = 1.0\n", "provenance = 1; allowed: a table"),
        ("[weights]\nfloor = 1.0\n[provenance]\nviews = []\n", "provenance.views = []; allowed: text or a number"),
        ('[weights]\n"a\\nb" = 1.0\n', "weights.'a\\nb'; allowed:"),
        (f'weights = "{"w" * 5000}"\n', "…; allowed: a table of"),
    ],
)
def test_a_calibration_of_odd_values_is_one_line(tmp_path, text, message):
    line = problem_of(Calibration.from_file, write(tmp_path / "c.toml", text))
    assert message in line
    assert len(line) < 500


def test_a_calibration_of_odd_text_is_written_as_it_was_read(tmp_path):
    odd = 'tab\t quote" back\\ \x7f\x01 newline\n'
    calibration = Calibration(odd, {"floor": 1.0}, {"by whom": odd, "blind": True, "views": 3})
    assert Calibration.from_file(write(tmp_path / "c.toml", calibration.to_toml())) == calibration


def test_an_archive_that_promises_more_than_it_holds_is_nothing(tmp_path, monkeypatch):
    """numpy would make room for it first."""
    store = Store(tmp_path)
    path = store.light("key")
    store.save(path, {"numbers": np.arange(9.0)})
    np.testing.assert_array_equal(store.load(path)["numbers"], np.arange(9.0))
    asked = []
    monkeypatch.setattr(np, "load", lambda *arguments, **options: asked.append(arguments))
    member = io.BytesIO()
    message = {"descr": "<f8", "fortran_order": False, "shape": (9_000_000_000,)}
    np.lib.format.write_array_header_1_0(member, message)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("numbers.npy", member.getvalue() + bytes(72))
    assert store.load(path) is None
    assert not asked
    assert not path.exists()
