"""What a detector is: an object that finds the centres of targets in a capture, and is passed nothing else."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from pss import ImageSensor
from pss.hints import Floats, Integers
from render.world.marker_print import predefined_dictionary

__all__ = ["SQUARE_TAGS", "Detections", "Detector", "Targets"]

SQUARE_TAGS = "square-tags"
"""The kind of target that scenes have: square tags of an OpenCV dictionary."""


@dataclass(frozen=True)
class Targets:
    """What is printed on the targets of a scene; not where they are.

    Attributes:
        dictionary: name of the OpenCV dictionary, such as "DICT_4X4_100".
        ids: numbers of the scene's markers in the dictionary.
    """

    dictionary: str
    ids: tuple[int, ...]

    @property
    def modules(self) -> int:
        """Black or white modules across a marker, its black border included."""
        return int(predefined_dictionary(self.dictionary).markerSize) + 2


@dataclass(frozen=True, eq=False)
class Detections:
    """K markers found in one capture.

    Attributes:
        ids: (K,), their numbers in the dictionary.
        centres_px: px, (K, 2), centres x and y; the centre of the top left pixel is (0, 0).
        covariance_px2: px², (K, 2, 2), of each centre, estimated from the image; None: the detector estimates none, and
            all its detections have the same weight.
        unexpected_ids: number of further detections, of markers that the scene does not have.
    """

    ids: Integers
    centres_px: Floats
    covariance_px2: Floats | None = None
    unexpected_ids: int = 0

    def __len__(self) -> int:
        return len(self.ids)


@runtime_checkable
class Detector(Protocol):
    """Finds targets in a capture. It is passed neither poses nor positions, so that nothing of the truth can leak."""

    @property
    def name(self) -> str:
        """In tables, on the command line and in the names of stored measurements."""
        ...

    @property
    def targets(self) -> tuple[str, ...]:
        """Kinds of targets that it reads, such as `SQUARE_TAGS`."""
        ...

    def detect(self, image: NDArray[np.uint16], sensor: ImageSensor, targets: Targets) -> Detections:
        """Find targets in a capture.

        Args:
            image: digital numbers, (height, width).
            sensor: that took it: black level, gain, noise.
            targets: what is printed on them.
        """
        ...
