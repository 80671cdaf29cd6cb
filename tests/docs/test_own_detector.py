"""The detector of docs/own-detector.md: its blocks run over a folder of views, and find what was drawn there."""

from __future__ import annotations

import csv
import dataclasses
import re

import numpy as np
import pytest

import scenes
from render.files.exr import write_view
from render.lens.sampling import Sampling
from render.renderer import ViewRequest
from tests.helpers.documents import DOCS, ROOT, blocks_of
from tests.helpers.drawn_sweep import drawn

# Of the drawing's white, which is bright enough for a lamp close by: as the room's markers are lit.
DIMMED = 0.04
# m: corners that OpenCV refines to no better than a few tenths of a pixel, three metres away.
WITHIN_M = 0.01
# px: what another convention of pixels would put between detection and projection.
HALF_A_PIXEL = 0.5


@pytest.mark.slow
def test_the_documented_detector_finds_and_triangulates_drawn_markers(tmp_path, monkeypatch, capsys):
    """Five captures of two drawn views of the room; a view of another zoom is left alone, as the block says."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "results" / "zoom"
    (folder / "views").mkdir(parents=True)
    (tmp_path / "scenes").symlink_to(ROOT / "scenes")
    scene = scenes.load(ROOT / "scenes" / "room.toml")
    rows = []
    for number, zoom in ((0, 3.0), (1, 3.0), (2, 1.0)):
        camera = dataclasses.replace(scene.cameras[number], zoom=zoom)
        request = ViewRequest(scene.state, camera, scene.sensor, Sampling(noise_ratio=0.6), "drawn")
        view = drawn(request)
        view = dataclasses.replace(view, radiance=DIMMED * view.radiance)
        write_view(folder / "views" / f"{request.key}.exr", view, request)
        rows.append({"camera": camera.name, "zoom": zoom, "exr": f"views/{request.key}.exr"})
    with (folder / "views.csv").open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)

    names: dict[str, object] = {}
    for block in blocks_of(DOCS / "own-detector.md"):
        if block.language == "python":
            exec(compile(block.text, str(block), "exec"), names)
    assert len(names["views"]) == 2
    printed = re.fullmatch(r"(\d+) of 84 markers, median error ([\d.]+) mm\n", capsys.readouterr().out)
    assert printed is not None
    assert int(printed[1]) >= 10
    assert float(printed[2]) < 1e3 * WITHIN_M
    pixels = names["pixels"]
    seen = np.isfinite(pixels).all(axis=-1)
    for view, found, at in zip(names["views"], pixels, seen, strict=True):
        expected = np.broadcast_to(view.camera.project(scene.state.points_m)[0], found.shape)
        assert np.abs(np.median((found - expected)[at], axis=0)).max() < HALF_A_PIXEL / 2
