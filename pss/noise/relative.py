"""Factors of blur and size relative to the target's module, for calibrations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pss.cameras.views import Views
from pss.errors import RangeError
from pss.hints import Floats
from pss.noise.covariance import PixelCovariance
from pss.noise.photometric import module_sides

__all__ = ["ModuleSize", "RelativeDefocus"]


@dataclass(frozen=True)
class RelativeDefocus:
    """(Circle of confusion / module)², as px²: the degradation of a code whose modules blur into each other."""

    name: str = "relative-defocus"

    def covariance(self, views: Views) -> PixelCovariance:
        """px², isotropic.

        Raises:
            RangeError: `views` has no appearance.
        """
        return PixelCovariance.isotropic(views.circle_of_confusion_px**2 / _module_area_px2(self.name, views))


@dataclass(frozen=True)
class ModuleSize:
    """(1 px / module)², as px²: for small and foreshortened codes."""

    name: str = "module-size"

    def covariance(self, views: Views) -> PixelCovariance:
        """px², isotropic.

        Raises:
            RangeError: `views` has no appearance.
        """
        return PixelCovariance.isotropic(1 / _module_area_px2(self.name, views))


def _module_area_px2(name: str, views: Views) -> Floats:
    """px², (C, N), area of a module in the image."""
    if views.appearance is None:
        raise RangeError(f"noise factor {name!r} has no appearance; allowed: evaluate(…, appearance=…)")
    across, down = module_sides(views.appearance, views)
    return np.asarray(np.abs(across[:, 0] * down[:, 1] - across[:, 1] * down[:, 0]))
