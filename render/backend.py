"""Which Mitsuba variant runs, and with which libLLVM. Import Mitsuba only through `start`.

Dr.Jit looks for libLLVM at its first import, and a libLLVM older than 16 can abort the whole process ("Cannot select …
fmaximum"), where no handler helps. So a library is chosen before that import and asked for its version in a process of
its own.
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

# One channel is all that a monochrome sensor needs; Mitsuba's wheel has no scalar variant with one channel.
VARIANTS = ("llvm_ad_mono", "cuda_ad_mono", "scalar_rgb")
OLDEST_LLVM = 16
# The kind of processor that names nothing: what was stored before the kind was part of a name was made on this one.
UNNAMED_PROCESSOR = "x86_64_v4"
PACKAGED_LLVM = "karellen-llvm-core"

# LLVMGetVersion came with LLVM 16, so a library without it is too old.
ASK_VERSION = """
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
    """What renders: Mitsuba's `variant`, the `libllvm` it compiles with ("" if none), and the line that says so."""

    variant: str
    libllvm: str
    llvm_major: int
    reason: str

    @property
    def identity(self) -> str:
        """Variant, libLLVM and kind of processor in one word.

        Across them pixels agree only within rounding, so views are kept apart.
        """
        llvm = f"-llvm{self.llvm_major}" if self.libllvm else ""
        return f"mitsuba-{importlib.metadata.version('mitsuba')}-{self.variant}{llvm}{processor_mark()}"

    def __str__(self) -> str:
        return f"renderer: Mitsuba {self.variant} ({self.reason})"


@cache
def processor_mark() -> str:
    """What is added to the name of results that hang on the kind of processor, such as "-x86_64_v3".

    The kind is the set of instructions that compilers and numerical libraries choose their code by: microarchitectures
    of one level round alike. Nothing is added for `UNNAMED_PROCESSOR`.
    """
    import archspec.cpu  # late: nobody else asks, and it takes a twentieth of a second

    kind = archspec.cpu.host().generic.name
    return "" if kind == UNNAMED_PROCESSOR else f"-{kind}"


def llvm_version(library: str | Path) -> int:
    """Major version of a libLLVM, 0 if it is older than 16, -1 if it does not load. Asked in a process of its own."""
    answer = subprocess.run(
        [sys.executable, "-c", ASK_VERSION, str(library)], capture_output=True, text=True, check=False, timeout=60
    )
    return int(answer.stdout) if answer.returncode == 0 and answer.stdout.strip() else -1


def packaged_libllvm() -> Path | None:
    """The libLLVM that comes with the packaged LLVM, or None where that package is not installed."""
    try:
        files = importlib.metadata.files(PACKAGED_LLVM) or []
    except importlib.metadata.PackageNotFoundError:
        return None
    found = [Path(str(file.locate())).resolve() for file in files if file.name == "libLLVM.so"]
    return next((path for path in found if path.exists()), None)


def _candidates() -> Iterator[tuple[str, str]]:
    """Libraries to try, each with where it comes from, the user's own choice first.

    One after the other, as they are asked for: to look for a library of the system starts a compiler.
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
    """Choose how to render: `variant` if given, else LLVM with the first libLLVM that is new enough, else scalar.

    Raises:
        RangeError: an unknown variant.
        MissingLibraryError: `variant` needs a library that is not there.
    """
    if variant is not None and variant not in VARIANTS:
        raise RangeError(f"--variant {variant!r}; allowed: {', '.join(VARIANTS)}")
    if variant == "scalar_rgb":
        return Backend(variant, "", 0, "as asked; about ten times slower than LLVM")
    if variant == "cuda_ad_mono":
        if not ctypes.util.find_library("cuda"):
            raise MissingLibraryError("--variant 'cuda_ad_mono' needs NVIDIA's driver (libcuda), which is not there")
        return Backend(variant, "", 0, "as asked")
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
    """Mitsuba with its variant set; the module is returned so that nobody imports it before the library is chosen.

    Raises:
        MissingLibraryError: Dr.Jit is loaded already, with a libLLVM that nobody checked (it can load one only).
    """
    return _start(backend or choose())


def set_threads(backend: Backend, threads: int) -> None:
    """Render with this many threads, for a process that has a share of the cores; the pixels are the same.

    Raises:
        MissingLibraryError: as `start`.
    """
    start(backend)
    import drjit as dr

    # The thread that renders is one of them. Mitsuba's own threads, of the scalar variant, are of the same pool.
    dr.set_thread_count(threads)
