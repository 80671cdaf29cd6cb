"""A calibration that was fitted before, for `bank --calibration FILE`: nothing is fitted."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from pss import RangeError
from pss.noise import Calibration
from pss.noise.table import CALIBRATED, SHIPPED_CALIBRATION
from render.store.folder import write_text

__all__ = ["FrozenCalibration", "provenance_of", "read_frozen", "save_calibration", "sha256_of"]

FILE = "calibrated.toml"


@dataclass(frozen=True)
class FrozenCalibration:
    """A calibration out of a file.

    Attributes:
        file: the file's name, without its folder.
        text: what is in it, of which `sha256_of` is a fingerprint.
    """

    calibration: Calibration
    file: str
    text: str


def read_frozen(path: Path) -> FrozenCalibration:
    """Read the file of a calibration that is judged as it is, or the shipped one by its name, "calibrated".

    Contenders and tables have it as "calibrated", whatever the file calls it.

    Raises:
        RangeError: it is missing, no calibration, or has no limits of detection, without which not all can be judged.
    """
    path = SHIPPED_CALIBRATION if str(path) == CALIBRATED else path
    calibration = Calibration.from_file(path)
    if not calibration.limits:
        raise RangeError(f"{path}: no [limits]; allowed with --calibration: one with limits of detection, as bank fits")
    return FrozenCalibration(replace(calibration, name=CALIBRATED), path.name, path.read_bytes().decode("utf-8"))


def save_calibration(frozen: FrozenCalibration, out: Path) -> None:
    """Leave a copy among the results, byte by byte, where a fitted calibration would be."""
    write_text(out / FILE, frozen.text)


def sha256_of(text: str) -> str:
    """SHA-256 of a file's text, in hexadecimal digits, as `sha256sum` prints it."""
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def provenance_of(calibration: Calibration, frozen: FrozenCalibration | None) -> Mapping[str, object]:
    """For run.json: which calibration was judged, whether it was fitted in this run, and what it was fitted to."""
    text = calibration.to_toml() if frozen is None else frozen.text
    return {
        "frozen": frozen is not None,
        "file": FILE if frozen is None else frozen.file,
        "sha256": sha256_of(text),
        "provenance": dict(calibration.provenance),
    }
