"""Which of a store's files this installation's code can still use: names and sums hold what made them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import cache

from render.keys import light_code, view_code
from validate.markers.view_measurement import measure_code
from validate.pixel_noise.measure import pixel_noise_code

__all__ = ["Codes", "codes_here"]


@dataclass(frozen=True)
class Codes:
    """Digests of this installation's code: of views, of solved light, and of the kinds of measurements."""

    views: str
    light: str
    measurements: frozenset[str]

    def can_use(self, kind: str, name: str, version: str) -> bool:
        """Whether a run of this code may request a file.

        Args:
            kind: the folder of the store that holds it.
            name: of the file.
            version: of what made it, by its sum; "" where that is not known.
        """
        parts = re.split(r"[-.]", name)
        if kind in ("views", "pixel-noise"):
            return parts[0].endswith(self.views)
        if kind == "light":
            return parts[1:2] == [self.light]
        if kind == "measurements":
            return parts[0].endswith(self.views) and (not version or version in self.measurements)
        return True


@cache
def codes_here() -> Codes:
    """Of the code that runs now, with the libraries that are installed."""
    return Codes(view_code().digest, light_code().digest, frozenset({measure_code().digest, pixel_noise_code().digest}))
