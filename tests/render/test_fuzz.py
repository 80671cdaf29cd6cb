"""Mutated files of every kind are read or refused: no other exception, no end of the process, no hang, no full memory.

A failure says kind, seed, number and mutation of the file; `python -m tests.helpers.fuzzing KIND SEED NUMBER NUMBER+1
FOLDER SECONDS` reads it again, and leaves it in the folder (which `fuzzing.prepare` and the fixture below have filled).
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from pss import ImageSensor, PTZCamera
from render.certificate import Certificate
from render.files.exr import write_view
from render.lens.sampling import Sampling
from render.renderer import RenderedView, ViewRequest
from render.store.folder import Store
from render.world.state import Light, MarkerPrint, Room, SceneState
from tests.helpers.fuzzing import campaign, prepare

# A few seconds each; the first is what the shipped files were fuzzed with most often, the second is as good.
SHORT, FULL = 2026, 31
KINDS = {
    # kind: files of the short campaign, and of the full one
    "scene": (24, 500),
    "sweep": (20, 350),
    "calibration": (20, 150),
    "mesh": (20, 100),
    "backdrop": (10, 60),
    "view": (20, 200),
    "archive": (10, 40),
    "table": (20, 300),
    "run file": (20, 300),
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What mutated files start from and name."""
    folder = tmp_path_factory.mktemp("fuzzed")
    prepare(folder)
    base = folder / "base"
    crate = trimesh.creation.box(extents=(0.3, 0.4, 0.5))
    for suffix in ("stl", "ply", "obj", "off", "glb"):
        crate.export(base / f"crate.{suffix}")
    crate.export(base / "crate.ascii.stl", file_type="stl_ascii")
    (base / "crate.ascii.ply").write_bytes(trimesh.exchange.ply.export_ply(crate, encoding="ascii"))
    rng = np.random.default_rng(5)
    Store(base).save(base / "light.npz", {"numbers": rng.random((20, 3)), "ids": np.arange(7)})
    write_a_view(base / "view.exr", rng)
    return folder


def write_a_view(path, rng):
    """A small view of noise."""
    width, height = 37, 23
    camera = PTZCamera((0.1, 0.2, 2.8), 12.0, -20.1, 3.0, focus_distance_m=3.3, resolution=(width, height), name="4")
    state = SceneState(
        Room(6.0, 6.0, 3.0, 0.5, 0.5, 0.5), Light(0.2, ()), (), (), MarkerPrint("DICT_4X4_100", 1.0, 0.85, 0.04)
    )
    request = ViewRequest(state, camera, ImageSensor(), Sampling(noise_ratio=0.1), "mitsuba-3.9.0-scalar_rgb")
    view = RenderedView(
        request.key,
        camera,
        ImageSensor(),
        rng.random((height, width), dtype=np.float32),
        rng.uniform(0.5, 9, (height, width)).astype(np.float32),
        rng.random((height, width, 3), dtype=np.float32),
        rng.integers(-1, 1000, (height, width)).astype(np.int32),
        rng.integers(0, 2**12, (height, width)).astype(np.uint16),
        Certificate(0.1, 0.2, 0.3, 1e-7, 0.4, 1000, 0.25),
    )
    write_view(path, view, request)


def check(kind: str, seed: int, count: int, folder) -> None:
    done = campaign(kind, seed, count, folder)
    assert not done.faults, "\n".join(done.faults)
    # Neither so little changed nor so much that nothing was asked.
    assert done.read + done.refused == count
    assert done.refused
    # The checksums of an archive notice nearly every change.
    assert done.read or kind == "archive"


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_few_mutated_files_are_read_or_refused(kind, folder):
    check(kind, SHORT, KINDS[kind][0], folder)


@pytest.mark.acceptance
@pytest.mark.parametrize("kind", KINDS)
def test_many_mutated_files_are_read_or_refused(kind, folder):
    check(kind, FULL, KINDS[kind][1], folder)


@pytest.mark.slow
def test_a_campaign_notices_what_it_looks_for(tmp_path):
    """Another exception, too much memory, no end, and a line that nobody could read; and it goes on behind each."""
    done = campaign("fault", 1, 4, tmp_path, cpu_s=1)
    other, memory, endless, line = done.faults
    assert "KeyError" in other
    assert "MemoryError" in memory
    assert "ended by -24" in endless  # SIGXCPU
    assert "a bad line" in line
    assert (done.read, done.refused) == (0, 0)
