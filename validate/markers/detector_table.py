"""The detectors by name: the project's own, and those of other packages.

To add one, register an entry point of the group "pss.detectors". It loads a `Detector`; the entry point has the
detector's name.
"""

from __future__ import annotations

import hashlib
import importlib.metadata
import importlib.util
import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from pss import RangeError
from pss.entry_points import EntryPointTable
from validate.markers.aruco_corners import ARUCO
from validate.markers.detector import SQUARE_TAGS, Detector
from validate.markers.registering import Registering

__all__ = ["DEFAULT_DETECTOR", "DETECTORS", "ENTRY_POINTS", "DetectorTable", "detector_called"]

ENTRY_POINTS = "pss.detectors"
# In tables, on the command line and as the name of a folder.
NAME = re.compile(r"[A-Za-z0-9][\w.-]*")
# The name at the beginning of a requirement, such as "numpy>=2".
REQUIRED = re.compile(r"[A-Za-z0-9][\w.-]*")


class DetectorTable(EntryPointTable[Detector]):
    """Detectors by name; the project's, then those of entry points."""

    def __init__(self, detectors: Iterable[Detector]) -> None:
        super().__init__(ENTRY_POINTS, "detector", ((each.name, each) for each in detectors))
        self._contents: dict[str, str] = {}

    def content(self, name: str) -> str:
        """What a detector is made of, as part of the names of its measurements.

        Of the project's detectors the name: their code and OpenCV's version are in the digest of the code that
        measures. Of others also the version of their package, those of the packages that it requires, and a hash of
        its source files, so that an edited detector is never taken for the one before.
        """
        if name in self.own:
            return name
        if name not in self._contents:
            (entry, *_) = importlib.metadata.entry_points(group=ENTRY_POINTS, name=name)
            self._contents[name] = " ".join([name, *_versions(entry), _source(entry)])
        return self._contents[name]

    def reload_entry_points(self) -> None:
        """Load entry points again at the next access, after a package was installed or removed."""
        super().reload_entry_points()
        self._contents.clear()

    def _items_of(self, name: str, loaded: object) -> Iterable[tuple[str, Detector]]:
        if not NAME.fullmatch(name):
            raise RangeError(f"the name {name!r}; allowed: letters, digits, -, _ and .")
        if isinstance(loaded, type) or not isinstance(loaded, Detector):
            raise RangeError(f"{loaded!r}; allowed: an object with name, targets and detect(image, sensor, targets)")
        if loaded.name != name:
            raise RangeError(f"the detector's name {loaded.name!r}; allowed: that of its entry point, {name!r}")
        if SQUARE_TAGS not in loaded.targets:
            raise RangeError(f"targets {loaded.targets!r}; allowed: some that scenes have, ({SQUARE_TAGS!r},)")
        yield name, loaded


def _versions(entry: importlib.metadata.EntryPoint) -> Iterator[str]:
    """The package of an entry point and those that it requires, with their versions."""
    if entry.dist is None:
        return
    yield f"{entry.dist.name}={entry.dist.version}"
    names = {found[0] for required in entry.dist.requires or () if (found := REQUIRED.match(required))}
    for name in sorted(names):
        try:
            yield f"{name}={importlib.metadata.version(name)}"
        except importlib.metadata.PackageNotFoundError:
            yield f"{name}=none"


def _source(entry: importlib.metadata.EntryPoint) -> str:
    """Hash of the source files of an entry point's package, or of its only module."""
    spec = importlib.util.find_spec(entry.module.partition(".")[0])
    if spec is None:
        return ""
    folders = [Path(folder) for folder in spec.submodule_search_locations or ()]
    files = sorted(path for folder in folders for path in folder.rglob("*.py"))
    if not folders and spec.origin is not None:
        files = [Path(spec.origin)]
    content = hashlib.sha256()
    for path in files:
        content.update(path.read_bytes())
    return content.hexdigest()[:16]


DETECTORS = DetectorTable([Registering(), *ARUCO])
DEFAULT_DETECTOR = Registering().name


def detector_called(name: str) -> Detector:
    """The detector of that name.

    Raises:
        RangeError: there is none.
    """
    if name not in DETECTORS:
        raise RangeError(f"detector {name!r}; allowed: {', '.join(DETECTORS)}")
    return DETECTORS[name]
