"""Example packages of docs/examples, installed for as long as a test takes."""

from __future__ import annotations

import contextlib
import importlib
import shutil
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

from pss import NOISE_MODELS
from validate.markers.detector_table import DETECTORS

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


@contextlib.contextmanager
def installed(example: str, site: Path) -> Iterator[None]:
    """The package in that folder of docs/examples: its modules and its entry points, in the folder `site`."""
    source = EXAMPLES / example
    modules = [shutil.copy(path, site) for path in source.glob("*.py")]
    project = tomllib.loads((source / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    record = site / f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    record.mkdir()
    required = "".join(f"Requires-Dist: {each}\n" for each in project["dependencies"])
    (record / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n{required}"
    )
    lines = []
    for group, entries in project["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {value}" for name, value in entries.items())]
    (record / "entry_points.txt").write_text("\n".join(lines) + "\n")
    sys.path.insert(0, str(site))
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path.remove(str(site))
        for module in modules:
            sys.modules.pop(Path(module).stem, None)


@contextlib.contextmanager
def own_noise(site: Path) -> Iterator[str]:
    """The name of the noise model that docs/examples/own-noise adds to `pss.NOISE_MODELS`."""
    with installed("own-noise", site):
        NOISE_MODELS.reload_entry_points()
        try:
            yield "on-a-mast"
        finally:
            NOISE_MODELS.reload_entry_points()


@contextlib.contextmanager
def own_detector(site: Path) -> Iterator[str]:
    """The name of the detector that docs/examples/own-detector adds to the table of detectors."""
    with installed("own-detector", site):
        DETECTORS.reload_entry_points()
        try:
            yield "stock-aruco"
        finally:
            DETECTORS.reload_entry_points()
