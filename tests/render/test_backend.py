"""The choice of the renderer: a libLLVM that works, or scalar, and one line that says why; never an aborted process."""

from __future__ import annotations

import _ctypes
import glob
import os
import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from pss import MissingLibraryError, RangeError
from render import backend
from render.lens.sampling import Sampling
from render.sensor import expected_electrons
from tests.helpers.views import window

pytestmark = pytest.mark.render

HERE = Path(__file__).parents[2]
PACKAGED = sys.platform == "linux" and platform.machine() == "x86_64"
# A view of 64 × 48 pixels with few samples: what it takes the scalar variant is seconds.
SAMPLING = Sampling(noise_ratio=0.5, most=256)
MARKER = 20
# The difference of two renders over what their certificates state together (measured: 1.0).
AGREEMENT = 1.4
# Standard errors of the mean difference over the view's 3072 pixels; the seeds are fixed (measured: 2.2).
LARGEST_SCORE = 4.0


def run(code: str, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run `code` in a process of its own, since Dr.Jit loads one libLLVM and can abort with it."""
    keep = {name: value for name, value in os.environ.items() if name != "DRJIT_LIBLLVM_PATH"}
    command = [sys.executable, "-c", code]
    return subprocess.run(
        command, env=keep | environment, cwd=HERE, capture_output=True, text=True, check=False, timeout=300
    )


@pytest.fixture(autouse=True)
def _no_choice_of_the_users(monkeypatch):
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH", raising=False)


def system_llvm_too_old() -> str | None:
    """A libLLVM of this machine that is older than Dr.Jit needs, such as Debian 12's 14 and 15."""
    libraries = [path for major in range(10, 16) for path in glob.glob(f"/usr/lib/*/libLLVM-{major}.so*")]
    return libraries[-1] if libraries else None


@pytest.fixture(params=["old", "no LLVM", "text", "missing"])
def unfit(request, tmp_path) -> str:
    """A library that `DRJIT_LIBLLVM_PATH` must not get away with."""
    if request.param == "old":
        return system_llvm_too_old() or pytest.skip("this machine has no old libLLVM")
    if request.param == "no LLVM":
        return _ctypes.__file__
    path = tmp_path / "libLLVM.so"
    if request.param == "text":
        path.write_text("not a library")
    return str(path)


def test_an_unknown_variant_is_refused():
    """The message carries the value and what is allowed."""
    with pytest.raises(RangeError, match=r"'llvm_ad_rgb'.*llvm_ad_mono, cuda_ad_mono, scalar_rgb"):
        backend.choose("llvm_ad_rgb")


@pytest.mark.skipif(not PACKAGED, reason="the packaged libLLVM is for Linux x86_64")
def test_the_packaged_libllvm_is_chosen():
    """On Linux x86_64 a plain install renders with LLVM, whatever the system has."""
    chosen = backend.choose()
    assert chosen.variant == "llvm_ad_mono"
    assert chosen.llvm_major >= backend.OLDEST_LLVM
    assert Path(chosen.libllvm) == backend.packaged_libllvm()
    assert chosen.reason == f"packaged libLLVM {chosen.llvm_major}"
    assert chosen == backend.choose("llvm_ad_mono")
    assert f"llvm_ad_mono-llvm{chosen.llvm_major}" in chosen.identity


def test_the_users_own_library_comes_first(monkeypatch):
    """`DRJIT_LIBLLVM_PATH` is taken if it is new enough."""
    library = backend.packaged_libllvm() or pytest.skip("no libLLVM to name")
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", str(library))
    assert backend.choose().reason.startswith("DRJIT_LIBLLVM_PATH libLLVM")


def test_an_unfit_library_is_passed_over(monkeypatch, unfit):
    """A libLLVM that is too old, none, or not there is not used, and the line says so."""
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", unfit)
    chosen = backend.choose()
    assert chosen.libllvm != unfit
    assert f"DRJIT_LIBLLVM_PATH {unfit}" in str(chosen)
    assert "is older than 16" in chosen.reason or "does not load" in chosen.reason


def test_an_unfit_library_aborts_nothing(unfit):
    """A process that is told to use it renders with another, or in scalar, and ends well."""
    code = """
from render import backend
mi = backend.start()
parts = {"light": {"type": "constant"}, "camera": {"type": "perspective"}, "integrator": {"type": "path"}}
scene = mi.load_dict({"type": "scene", **parts})
print(mi.variant(), round(float(mi.TensorXf(mi.render(scene, spp=1)).array[0]), 3))
"""
    done = run(code, DRJIT_LIBLLVM_PATH=unfit)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == [backend.choose().variant, "1.0"]


def test_scalar_where_there_is_no_libllvm(monkeypatch):
    """Without any libLLVM it is slower but works; asking for LLVM then is the user's mistake, in one line."""
    monkeypatch.setattr(backend, "_candidates", list)
    chosen = backend.choose()
    assert (chosen.variant, chosen.libllvm) == ("scalar_rgb", "")
    assert "no libLLVM ≥ 16 found" in str(chosen)
    with pytest.raises(MissingLibraryError, match="no libLLVM ≥ 16 found"):
        backend.choose("llvm_ad_mono")


def test_drjit_loaded_unchecked_is_refused():
    """Whoever imports drjit before the choice gets an error instead of a libLLVM that nobody asked for its version."""
    code = """
import drjit
from pss import MissingLibraryError
from render import backend
try:
    backend.start(backend.Backend("llvm_ad_mono", "/some/libLLVM.so", 23, ""))
except MissingLibraryError as error:
    print(error)
"""
    assert "before its libLLVM was chosen" in run(code).stdout


SCALAR_VIEW = """
import sys
import numpy as np
from pathlib import Path
from render import backend
from render.renderer import Renderer
import scenes
from tests.render.test_backend import MARKER, SAMPLING
from tests.helpers.views import window
from render.store.light import baked
from render.store.folder import Store

room = scenes.load(sys.argv[1])
renderer = Renderer(room.state, baked(room.state, Store(Path(sys.argv[2]))), backend.choose("scalar_rgb"))
camera = window(room.camera("4"), room.state.points_m[MARKER])
view = renderer.render(renderer.request(camera, room.sensor, SAMPLING))
layers = {name: getattr(view, name) for name in ("radiance", "depth_m", "normal", "marker_id")}
np.savez(sys.argv[3], key=view.key, image_rms=view.certificate.image_rms, **layers)
"""


def test_scalar_renders_the_same_view(room, room_store, room_renderer, tmp_path):
    """The variant of last resort, with its own way of sampling and no lists of rays, makes the same image and layers.

    The two renders differ by the noise that their certificates state, and not in the mean.
    """
    if room_renderer.name.endswith("scalar_rgb"):
        pytest.skip("there is only the scalar variant here")
    arguments = [str(room.path), str(room_store.folder), str(tmp_path / "scalar.npz")]
    done = run(f"import sys; sys.argv[1:] = {arguments!r}\n{SCALAR_VIEW}")
    assert done.returncode == 0, done.stderr
    camera = window(room.camera("4"), room.state.points_m[MARKER])
    llvm = room_renderer.render(room_renderer.request(camera, room.sensor, Sampling()))
    with np.load(arguments[-1]) as scalar:
        electrons = expected_electrons(np.ones(llvm.radiance.shape), camera, room.sensor)
        sigma = room.sensor.noise_electrons(llvm.radiance * electrons) / electrons
        difference = scalar["radiance"] - llvm.radiance
        rms = float(np.sqrt(((difference / sigma) ** 2).mean()))
        stated = float(np.hypot(scalar["image_rms"], llvm.certificate.image_rms))
        score = difference.mean() / (difference.std() / np.sqrt(difference.size))
        print(f"RMS {rms:.3f} of the sensor noise, stated {stated:.3f}; mean off by {score:+.1f} standard errors")
        assert 1 / AGREEMENT < rms / stated < AGREEMENT
        assert abs(score) < LARGEST_SCORE
        assert str(scalar["key"]) != llvm.key
        # Rays are the same but for rounding, which may decide what a pixel's centre on an edge hits.
        same = scalar["marker_id"] == llvm.marker_id
        assert same.mean() > 0.998
        np.testing.assert_allclose(scalar["depth_m"][same], llvm.depth_m[same], rtol=1e-5)
        np.testing.assert_allclose(scalar["normal"][same], llvm.normal[same], atol=1e-5)


def test_importing_render_loads_no_renderer():
    """`render` can be imported, and views read, before the libLLVM is chosen: only `backend.start` loads Mitsuba."""
    modules = sorted(path.stem for path in (HERE / "render").glob("[a-z]*.py"))
    imports = "".join(f"import render.{name}\n" for name in modules)
    done = run(f"{imports}import sys\nprint('drjit' in sys.modules, 'mitsuba' in sys.modules)")
    assert done.stdout.split() == ["False", "False"], done.stderr
