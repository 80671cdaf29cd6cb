"""A view's file gives back what was written, says what it is to other programs, and is refused when it is not ours."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import OpenImageIO as oiio
import pytest

import render.files.exr
from pss import PSSError
from render.files.exr import CHANNELS, ImageFileError, read_view, write_view
from render.keys import view_code
from render.renderer import RenderedView, ViewRequest
from tests.helpers.views import AWKWARD_RESOLUTION, an_awkward_view

WIDTH, HEIGHT = AWKWARD_RESOLUTION
# Half floats carry 11 bits: the normal's layer is for the eye.
HALF = 2.0**-11


@pytest.fixture
def request_and_view() -> tuple[ViewRequest, RenderedView]:
    """A view of awkward numbers, made without rendering."""
    return an_awkward_view()


@pytest.fixture
def path(tmp_path, request_and_view):
    request, view = request_and_view
    path = tmp_path / "view.exr"
    write_view(path, view, request)
    return path


def test_a_header_that_is_no_text_is_one_line(path):
    """What mutated files found: messages of bytes that are no UTF-8, and some that would speak to the terminal."""
    whole = path.read_bytes()
    key = whole.index(b"quantum_efficiency")
    for place, found in [(key + 3, b"\xff\x1b"), *((place, b"\xff" * 5) for place in range(0, 400, 5))]:
        path.write_bytes(whole[:place] + found + whole[place + (2 if place > key else 0) :])
        try:
            read_view(path)
        except ImageFileError as error:
            assert str(error).isprintable()  # noqa: PT017 -- some places may be changed without harm
        else:
            assert place != key + 3


def test_a_certificate_is_numbers_and_the_image_is_as_large_as_its_cameras(path, request_and_view):
    request, view = request_and_view
    write_view(path, dataclasses.replace(view, camera=dataclasses.replace(view.camera, resolution=(8, 4))), request)
    with pytest.raises(ImageFileError, match="37 × 23 pixels of a camera of 8 × 4"):
        read_view(path)
    odd = dataclasses.replace(view.certificate, samples="many")
    write_view(path, dataclasses.replace(view, certificate=odd), request)
    with pytest.raises(ImageFileError, match="'samples' of a certificate is 'many'; allowed: a number, or null"):
        read_view(path)
    wrong = view.marker_id.astype(np.float32)
    wrong[3, 3] = np.nan
    write_view(path, dataclasses.replace(view, marker_id=wrong), request)
    with pytest.raises(ImageFileError, match="not a whole number from -1"):
        read_view(path)


def test_round_trip_bit_for_bit(path, request_and_view):
    """Camera, sensor, radiance, depth, capture, marker numbers and certificate come back bit for bit, types included.

    The normals alone are stored in half precision.
    """
    _, view = request_and_view
    back = read_view(path)
    assert back.key == view.key
    assert back.camera == view.camera
    assert back.camera.name == view.camera.name
    assert back.sensor == view.sensor
    for name in ("radiance", "depth_m", "capture_dn", "marker_id"):
        ours, theirs = getattr(view, name), getattr(back, name)
        assert theirs.dtype == ours.dtype
        np.testing.assert_array_equal(theirs, ours)
    np.testing.assert_allclose(back.normal, view.normal, atol=HALF)
    np.testing.assert_array_equal(dataclasses.astuple(back.certificate), dataclasses.astuple(view.certificate))
    assert isinstance(back.certificate.samples, int)
    np.testing.assert_array_equal(back.expected_electrons(), view.expected_electrons())


def test_a_view_read_back_asks_for_the_same_key(path, request_and_view):
    """The camera and the sensor of the file name the same view again."""
    request, _ = request_and_view
    back = read_view(path)
    assert dataclasses.replace(request, camera=back.camera, sensor=back.sensor).key == back.key


def test_other_programs_see_the_layers(path):
    """OpenImageIO by itself: named channels in their types, the size, lossless compression."""
    image = oiio.ImageInput.open(str(path))
    spec = image.spec()
    image.close()
    assert (spec.width, spec.height) == (WIDTH, HEIGHT)
    formats = [str(spec.channelformat(channel)) for channel in range(spec.nchannels)]
    assert dict(zip(spec.channelnames, formats, strict=True)) == {
        "Y": "float",
        "capture.Y": "float",
        "depth.Z": "float",
        "marker.id": "float",
        "normal.X": "half",
        "normal.Y": "half",
        "normal.Z": "half",
    }
    assert spec.get_string_attribute("compression") == "zip"


def test_channels_group_as_layers(path):
    """What stands before a name's last dot is its layer; the first layer and the captures have a luminance to show."""
    layers: dict[str, set[str]] = {}
    for name in oiio.ImageBuf(str(path)).spec().channelnames:
        layer, _, channel = name.rpartition(".")
        layers.setdefault(layer, set()).add(channel)
    assert layers == {"": {"Y"}, "capture": {"Y"}, "depth": {"Z"}, "normal": {"X", "Y", "Z"}, "marker": {"id"}}


def test_the_units_of_all_channels_are_stated(path):
    """In the file's header by layer or channel, and in the module's docstring."""
    units = json.loads(oiio.ImageBuf(str(path)).spec().get_string_attribute("pss:units"))
    assert all(name in units or name.partition(".")[0] in units for name in CHANNELS)
    assert all(f"`{name}`" in render.files.exr.__doc__ for name in CHANNELS if name not in ("normal.Y", "normal.Z"))


def test_the_documented_way_to_read_a_view_runs(request_and_view, tmp_path, monkeypatch, capsys):
    """The Python of docs/scenes.md, beside a run's folder of views."""
    text = (Path(__file__).parents[3] / "docs" / "scenes.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    folder = Path("results/zoom/views")
    folder.mkdir(parents=True)
    request, view = request_and_view
    write_view(folder / f"{request.key}.exr", view, request)
    exec(compile(block, "scenes.md", "exec"), {})
    printed = capsys.readouterr().out
    assert printed.startswith("camera 4, f/1.8, 4 ms: ")
    assert f"{(view.marker_id >= 0).mean():.1%} of the pixels" in printed


def test_header_says_what_the_view_is(path, request_and_view):
    """OpenCV's K, R and t, lens, seed and versions are there for other tools, as JSON."""
    request, view = request_and_view
    image = oiio.ImageInput.open(str(path))
    spec = image.spec()
    image.close()

    def attribute(name: str):
        return json.loads(spec.get_string_attribute(f"pss:{name}"))

    camera = view.camera
    np.testing.assert_array_equal(attribute("K"), camera.intrinsic_matrix)
    np.testing.assert_array_equal(attribute("R"), camera.rotation)
    np.testing.assert_array_equal(attribute("t_m"), camera.translation_m)
    # With them alone another program projects as the camera does.
    point = np.array([1.0, 0.3, 1.1])
    x, y, w = np.array(attribute("K")) @ (np.array(attribute("R")) @ point + attribute("t_m"))
    np.testing.assert_allclose((x / w, y / w), camera.project(point)[0], rtol=1e-12)
    assert attribute("lens")["aperture_diameter_m"] == camera.aperture_diameter_m
    assert attribute("sampling") == dataclasses.asdict(request.sampling)
    assert attribute("seed") == {"run_seed": 0, "streams": ["render", "sample capture"], "trial": 0}
    versions = attribute("versions")
    assert versions["render"] == view_code().digest
    assert versions["renderer"] == request.renderer
    assert {"mitsuba", "drjit", "OpenImageIO", "numpy"} <= set(versions)
    assert spec.get_string_attribute("pss:key") == request.key


def foreign(path) -> None:
    image = oiio.ImageBuf(oiio.ImageSpec(8, 6, 3, "float"))
    assert image.write(str(path))


def cut_short(path) -> None:
    data = path.read_bytes()
    path.write_bytes(data[: len(data) // 2])


def cut_in_header(path) -> None:
    path.write_bytes(path.read_bytes()[:300])


def zeroed(path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) * 2 // 3 :] = bytes(len(data) - len(data) * 2 // 3)
    path.write_bytes(bytes(data))


def text(path) -> None:
    path.write_text("not an image")


def empty(path) -> None:
    path.write_bytes(b"")


def with_header(**attributes):
    """A file with the channels of ours, and these attributes."""

    def write(path) -> None:
        spec = oiio.ImageSpec(8, 6, len(CHANNELS), "float")
        spec.channelnames = CHANNELS
        for name, value in attributes.items():
            spec.attribute(f"pss:{name}", value)
        assert oiio.ImageBuf(spec).write(str(path))

    return write


def older_channels(path) -> None:
    """A whole view but for one channel, which went by another name."""
    image = oiio.ImageBuf(str(path))
    names = [{"capture.Y": "capture"}.get(name, name) for name in image.spec().channelnames]
    renamed = oiio.ImageBufAlgo.channels(image, tuple(range(len(names))), newchannelnames=tuple(names))
    assert renamed.write(str(path)), renamed.geterror()


DAMAGES = {
    "missing": lambda path: path.unlink(),
    "foreign": foreign,
    "cut short": cut_short,
    "cut in its header": cut_in_header,
    "overwritten with zeros": zeroed,
    "text": text,
    "empty": empty,
    "header that is no JSON": with_header(camera="{"),
    "channels of older code": older_channels,
    "header of another kind": with_header(camera='{"colour": 1}', sensor="{}", certificate="[1]"),
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_what_is_not_a_whole_view_is_refused(path, damage):
    """Missing, damaged or foreign files raise the project's own error, which is also an OSError and names the file."""
    damage(path)
    with pytest.raises(ImageFileError, match=r"view\.exr") as caught:
        read_view(path)
    assert isinstance(caught.value, PSSError)
    assert isinstance(caught.value, OSError)


def test_a_folder_that_is_not_there_is_named(tmp_path, request_and_view):
    """Writing into a missing folder raises ImageFileError with the path."""
    request, view = request_and_view
    with pytest.raises(ImageFileError, match="nowhere"):
        write_view(tmp_path / "nowhere" / "view.exr", view, request)
