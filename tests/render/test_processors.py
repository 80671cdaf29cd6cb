"""Kinds of processor: their views and light are kept apart, and what they make agrees within what is stated."""

from __future__ import annotations

import ctypes
import importlib.util
import os
import platform
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import archspec.cpu
import numpy as np
import pytest

from render import backend
from render.keys import light_key
from render.lens.sampling import Sampling
from render.renderer import Renderer, ViewRequest
from render.sensor import expected_electrons
from render.store.folder import Store
from render.store.light import baked
from render.store.views import save_view
from tests.helpers.views import window
from validate.markers.view_measurement import MeasureTask, load_measurement, measure

HERE = Path(__file__).parents[2]
# Variables that keep libraries from the instructions that x86_64_v4 has and x86_64_v3 lacks.
ONLY_V3 = {
    "NPY_DISABLE_CPU_FEATURES": "AVX512F AVX512CD AVX512_SKX AVX512_CLX AVX512_CNL AVX512_ICL AVX512_SPR",
    "OPENCV_CPU_DISABLE": "AVX512-SKX,AVX512-ICL",
    "OPENBLAS_CORETYPE": "Haswell",
}
MARKER, TRIALS = 20, 20
# Light is solved in double precision by sums of some hundred terms.
LIGHT_RTOL = 1e-11
# Single precision of rays that bounce nowhere: 24 bits, a few operations (measured: 3e-7).
DEPTH_RTOL = 1e-5
# Rounding moves samples over edges, and where more are taken differs with them: views differ as two independent renders
# do, at most; both certificates are good to some tens of percent.
MOST_OF_STATED = 1.4
# The draws of noise are others, as counts of dark pixels take more or fewer numbers from the stream: the differences of
# one marker's 2 × 20 coordinates over their own σ have a mean square of 1 ± √(2 / 40), with the bounds at 3.5 of it.
SQUARES = (0.2, 1.8)


def on_kind(monkeypatch, name: str) -> None:
    monkeypatch.setattr(archspec.cpu, "host", lambda: SimpleNamespace(generic=SimpleNamespace(name=name)))
    backend.processor_mark.cache_clear()


@pytest.fixture(autouse=True)
def _the_real_kind_afterwards():
    yield
    backend.processor_mark.cache_clear()


def test_the_kind_of_processor_is_part_of_a_views_and_a_lights_name(room, monkeypatch):
    """Two kinds never share a file, and the kind of the oldest stores has the names that it always had."""
    chosen = backend.Backend("llvm_ad_mono", "libLLVM.so", 23, "")
    camera, names, lights = room.cameras[0], {}, {}
    for kind in ("x86_64_v4", "x86_64_v3", "aarch64"):
        with monkeypatch.context() as patch:
            on_kind(patch, kind)
            names[kind] = ViewRequest(room.state, camera, room.sensor, Sampling(), chosen.identity).key
            lights[kind] = light_key(room.state)
    assert len(set(names.values())) == len(set(lights.values())) == 3
    on_kind(monkeypatch, backend.UNNAMED_PROCESSOR)
    assert chosen.identity.endswith("-llvm_ad_mono-llvm23")


def as_x86_64_v3() -> None:
    """From now on Dr.Jit compiles as for a processor of that level. It has no documented way to be told so."""
    chosen = backend.choose()
    mi = backend.start(chosen)
    mi.Float([1, 2])  # starts LLVM
    core = ctypes.CDLL(str(Path(importlib.util.find_spec("drjit").origin).parent / "libdrjit-core.so"))
    core._Z19jit_llvm_set_targetPKcS0_j(b"haswell", b"+avx2,+fma", 8)
    width = core._Z21jit_llvm_vector_widthv
    width.restype = ctypes.c_uint
    assert width() == 8


def made(room, store: Store) -> dict[str, np.ndarray]:
    """Light, a small view of one marker, and that marker's position in many captures, on this process's processor."""
    chosen = backend.choose()
    meshes = baked(room.state, store, chosen)
    renderer = Renderer(room.state, meshes, chosen)
    camera = window(room.camera("4"), room.state.points_m[MARKER], (320, 240))
    view = renderer.render(renderer.request(camera, room.sensor, Sampling()))
    save_view(store, view, renderer.request(camera, room.sensor, Sampling()))
    task = MeasureTask(store.folder, view.key, room.state.print.dictionary, (MARKER,), 1, TRIALS)
    measure(task)
    measured = load_measurement(task)
    return {
        "light": meshes.radiance,
        "radiance": view.radiance,
        "depth_m": view.depth_m,
        "marker_id": view.marker_id,
        "image_rms": np.array(view.certificate.image_rms),
        "pixels": measured.pixels[:, 0],
        "covariance": measured.covariance[:, 0],
    }


OTHER_KIND = """
import sys
from pathlib import Path
import numpy as np
from tests.render.test_processors import as_x86_64_v3, made
import scenes
from render.store.folder import Store

as_x86_64_v3()
np.savez(sys.argv[3], **made(scenes.load(sys.argv[1]), Store(Path(sys.argv[2]))))
"""


@pytest.mark.render
@pytest.mark.acceptance
def test_kinds_of_processor_agree_within_what_is_stated(room, tmp_path):
    """Light, layers, pixels and measured positions of x86_64_v3 beside those of this processor, each from nothing."""
    if platform.system() != "Linux" or "avx512f" not in archspec.cpu.host().features:
        pytest.skip("this processor has no level above x86_64_v3 to be compared with")
    here = made(room, Store(tmp_path / "here"))
    arguments = [str(room.path), str(tmp_path / "there"), str(tmp_path / "there.npz")]
    done = subprocess.run(
        [sys.executable, "-c", OTHER_KIND, *arguments],
        env=os.environ | ONLY_V3,
        cwd=HERE,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    with np.load(arguments[-1]) as there:
        assert not np.array_equal(there["radiance"], here["radiance"])  # or this test compares a kind with itself
        light_off = np.abs(there["light"] - here["light"]).max() / here["light"].max()
        depth_off = np.abs(there["depth_m"] / here["depth_m"] - 1).max()
        camera = window(room.camera("4"), room.state.points_m[MARKER], (320, 240))
        electrons = expected_electrons(np.ones(here["radiance"].shape), camera, room.sensor)
        sigma = room.sensor.noise_electrons(here["radiance"] * electrons) / electrons
        rms = float(np.sqrt((((there["radiance"] - here["radiance"]) / sigma) ** 2).mean()))
        stated = float(np.hypot(there["image_rms"], here["image_rms"]))
        difference = there["pixels"] - here["pixels"]
        summed = there["covariance"] + here["covariance"]
        squares = difference**2 / summed[:, [0, 1], [0, 1]]
        print(
            f"light {light_off:.1e}, depth {depth_off:.1e}, radiance RMS {rms:.3f} of the sensor noise (stated "
            f"{stated:.3f}), positions' mean square {squares.mean():.2f}"
        )
        assert (there["marker_id"] == here["marker_id"]).all()
    assert light_off < LIGHT_RTOL
    assert depth_off < DEPTH_RTOL
    assert rms < MOST_OF_STATED * stated
    assert SQUARES[0] < squares.mean() < SQUARES[1]
