"""What a view costs by its pixels: seconds on two cores and bytes of memory, from benchmarks/view_size.py.

For views of whose size the store has none yet. Benchmarks are of the room; edges that need more samples than its own
take longer, and flat walls less (of 48 megapixels: 56 s a view by this, 66 s measured).
"""

from __future__ import annotations

import os
from pathlib import Path

from validate.runs.progress import EXPECTED_MEASURE_SECONDS, EXPECTED_SECONDS

__all__ = [
    "USUAL_RATIO",
    "machine_bytes",
    "measure_bytes",
    "measure_seconds",
    "render_bytes",
    "render_seconds",
]

# What EXPECTED_SECONDS and EXPECTED_MEASURE_SECONDS are of.
REFERENCE_PIXELS = 1280 * 960
# CPU seconds a pixel of rendering at the sweeps' own bound on sampling noise, and the cores that share them; of one
# capture (half of the two that were measured).
RENDER_CPU_S_PER_PIXEL, CORES = 2.2e-6, 2
CAPTURE_CPU_S_PER_PIXEL = 0.19e-6
# Peak memory: of a process at rest with its libraries and its scene, and what each pixel adds.
RENDER_BYTES, RENDER_BYTES_PER_PIXEL = 0.36e9, 168
MEASURE_BYTES, MEASURE_BYTES_PER_PIXEL = 0.24e9, 65
# CPU seconds of rendering at a bound r, 2.3 + 0.68 r^-1.14, fitted to those at 1, 0.5, 0.25 and 0.1 (3.0, 3.6, 5.1 and
# 11.6 s, benchmarks/README.md); over those at the sweeps' 0.6.
FLAT_S, EDGES_S, EDGES_POWER, USUAL_RATIO = 2.3, 0.68, 1.14, 0.6

CGROUP_LIMITS = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory/memory.limit_in_bytes"))


def render_seconds(pixels: int, noise_ratio: float = USUAL_RATIO) -> float:
    """s, for a view of so many pixels with a bound on its sampling noise (`render.lens.sampling.Sampling`)."""
    a_pixel = RENDER_CPU_S_PER_PIXEL / CORES
    fixed = EXPECTED_SECONDS - a_pixel * REFERENCE_PIXELS
    return fixed + a_pixel * pixels * _effort(noise_ratio) / _effort(USUAL_RATIO)


def _effort(noise_ratio: float) -> float:
    return float(FLAT_S + EDGES_S * noise_ratio**-EDGES_POWER)


def measure_seconds(pixels: int) -> float:
    """s, for one capture of so many pixels."""
    return EXPECTED_MEASURE_SECONDS + CAPTURE_CPU_S_PER_PIXEL * (pixels - REFERENCE_PIXELS)


def render_bytes(pixels: int) -> float:
    """Bytes, peak memory of a process that renders a view of so many pixels."""
    return RENDER_BYTES + RENDER_BYTES_PER_PIXEL * pixels


def measure_bytes(pixels: int) -> float:
    """Bytes, peak memory of a process that measures one."""
    return MEASURE_BYTES + MEASURE_BYTES_PER_PIXEL * pixels


def machine_bytes() -> int:
    """Bytes of memory that this machine, or the container that this runs in, has; 0 where it cannot be found out."""
    try:
        limits = [os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")]
    except (AttributeError, OSError, ValueError):  # not on every system
        return 0
    for path in CGROUP_LIMITS:
        try:
            limits.append(int(path.read_text(encoding="ascii")))
        except (OSError, ValueError):  # no such file, or "max"
            continue
    return min(limits)
