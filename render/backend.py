"""The Mitsuba variant and the libLLVM in use. Import Mitsuba only through `start`.

Dr.Jit searches for libLLVM at its first import, and a libLLVM older than 16 can abort the whole process ("Cannot select
… fmaximum"), which no handler can catch. Therefore a library is chosen before that import, and its version is queried
in a separate process.
"""

from __future__ import annotations

import ctypes.util
import importlib.metadata
import os
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from pss import MissingLibraryError, RangeError

__all__ = ["VARIANTS", "Backend", "choose", "processor_mark", "set_threads", "start"]

# A monochrome sensor needs one channel only; Mitsuba's wheel has no scalar variant with one channel.
VARIANTS = ("llvm_ad_mono", "cuda_ad_mono", "scalar_rgb")
OLDEST_LLVM = 16
# The kind of processor without a mark in names: results stored before the mark was introduced were made on it.
UNNAMED_PROCESSOR = "x86_64_v4"
PACKAGED_LLVM = "karellen-llvm-core"

# LLVMGetVersion came with LLVM 16, so a library without it is too old.
VERSION_SCRIPT = """
import ctypes, sys
try:
    library = ctypes.CDLL(sys.argv[1])
    major = ctypes.c_uint()
    library.LLVMGetVersion(ctypes.byref(major), None, None)
    print(major.value)
except AttributeError:
    print(0)
"""


@dataclass(frozen=True)
class Backend:
    """The backend: Mitsuba's `variant`, the `libllvm` it compiles with ("" if none), and the reason for it."""

    variant: str
    libllvm: str
    llvm_major: int
    reason: str

    @property
    def identity(self) -> str:
        """Variant, libLLVM and kind of processor in one word.

        Between different ones pixels agree only within rounding, so that views are kept apart.
        """
        llvm = f"-llvm{self.llvm_major}" if self.libllvm else ""
        return f"mitsuba-{importlib.metadata.version('mitsuba')}-{self.variant}{llvm}{processor_mark()}"

    def __str__(self) -> str:
        return f"renderer: Mitsuba {self.variant} ({self.reason})"


@cache
def processor_mark() -> str:
    """Suffix for names of results that depend on the kind of processor, such as "-x86_64_v3".

    The kind is the instruction set by which compilers and numerical libraries choose their code: microarchitectures of
    one level round alike. The suffix is empty for `UNNAMED_PROCESSOR`.
    """
    import archspec.cpu  # imported late: it takes a twentieth of a second, and is needed only here

    kind = archspec.cpu.host().generic.name
    return "" if kind == UNNAMED_PROCESSOR else f"-{kind}"


def llvm_version(library: str | Path) -> int:
    """Major version of a libLLVM, 0 if it is older than 16, -1 if it does not load; queried in a separate process."""
    finished = subprocess.run(
        [sys.executable, "-c", VERSION_SCRIPT, str(library)], capture_output=True, text=True, check=False, timeout=60
    )
    return int(finished.stdout) if finished.returncode == 0 and finished.stdout.strip() else -1


def packaged_libllvm() -> Path | None:
    """The libLLVM of the installed LLVM package; None if that package is not installed."""
    try:
        files = importlib.metadata.files(PACKAGED_LLVM) or []
    except importlib.metadata.PackageNotFoundError:
        return None
    found = [Path(str(file.locate())).resolve() for file in files if file.name == "libLLVM.so"]
    return next((path for path in found if path.exists()), None)


def _candidates() -> Iterator[tuple[str, str]]:
    """Libraries to try with their origins, the user's choice first.

    Evaluated lazily: searching for a system library starts a compiler.
    """
    if chosen := os.environ.get("DRJIT_LIBLLVM_PATH"):
        yield chosen, "DRJIT_LIBLLVM_PATH"
    if packaged := packaged_libllvm():
        yield str(packaged), "packaged"
    names = ["LLVM", *(f"LLVM-{major}" for major in range(30, OLDEST_LLVM - 1, -1))]
    if sys.platform == "darwin":
        homes = ("/opt/homebrew/opt/llvm/lib", "/usr/local/opt/llvm/lib")
        yield from ((f"{home}/libLLVM.dylib", "system") for home in homes if Path(home, "libLLVM.dylib").exists())
    yield from ((library, "system") for name in names if (library := ctypes.util.find_library(name)))


def choose(variant: str | None = None) -> Backend:
    """Choose the backend: `variant` if given, else LLVM with the first libLLVM that is new enough, else scalar.

    Raises:
        RangeError: an unknown variant.
        MissingLibraryError: `variant` needs a library that is not installed.
    """
    if variant is not None and variant not in VARIANTS:
        raise RangeError(f"--variant {variant!r}; allowed: {', '.join(VARIANTS)}")
    if variant == "scalar_rgb":
        return Backend(variant, "", 0, "as requested; about ten times slower than LLVM")
    if variant == "cuda_ad_mono":
        if not ctypes.util.find_library("cuda"):
            raise MissingLibraryError("--variant 'cuda_ad_mono' needs NVIDIA's driver (libcuda), which is not there")
        return Backend(variant, "", 0, "as requested")
    unfit: list[str] = []
    for library, origin in _candidates():
        version = llvm_version(library)
        if version >= OLDEST_LLVM:
            return Backend("llvm_ad_mono", library, version, "; ".join([f"{origin} libLLVM {version}", *unfit]))
        unfit.append(f"{origin} {library} " + ("does not load" if version < 0 else f"is older than {OLDEST_LLVM}"))
    why = "; ".join(unfit) or f"no libLLVM ≥ {OLDEST_LLVM} found"
    if variant == "llvm_ad_mono":
        raise MissingLibraryError(f"--variant 'llvm_ad_mono' needs libLLVM ≥ {OLDEST_LLVM}: {why}")
    return Backend("scalar_rgb", "", 0, f"{why}; about ten times slower than LLVM")


@cache
def _start(backend: Backend) -> Any:
    if "drjit" in sys.modules and os.environ.get("DRJIT_LIBLLVM_PATH") != backend.libllvm:
        raise MissingLibraryError("drjit was imported before its libLLVM was chosen; import render.backend first")
    if backend.libllvm:
        os.environ["DRJIT_LIBLLVM_PATH"] = backend.libllvm
    import mitsuba as mi

    mi.set_variant(backend.variant)
    mi.set_log_level(mi.LogLevel.Error)
    return mi


def start(backend: Backend | None = None) -> Any:
    """Mitsuba with its variant set, as a module, so that it is never imported before the library is chosen.

    Raises:
        MissingLibraryError: Dr.Jit is already loaded, with an unchecked libLLVM (it can load only one).
    """
    return _start(backend or choose())


def set_threads(backend: Backend, threads: int) -> None:
    """Render with this many threads, in a process that has a share of the cores; the pixels are the same.

    Raises:
        MissingLibraryError: as `start`.
    """
    start(backend)
    import drjit as dr

    # The rendering thread is one of them. The threads of Mitsuba's scalar variant belong to the same pool.
    dr.set_thread_count(threads)
