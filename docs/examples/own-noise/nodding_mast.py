"""A noise model of one's own: cameras on masts that nod in the wind."""

from dataclasses import dataclass

import numpy as np

from pss import NOISE_MODELS, NoiseModel, NoiseSettings

# σ of the tilt, in mrad.
TILT_MRAD = 0.1


@dataclass(frozen=True)
class NoddingMast:
    """A camera's tilt varies by `tilt_mrad` (σ): the image moves up and down, the more the longer the lens."""

    tilt_mrad: float = TILT_MRAD
    name: str = "nodding-mast"

    def covariance(self, views):
        """px², matrices (C, 1, 2, 2): the same for all points of a camera, and none of it sideways."""
        matrices = np.zeros((len(views.cameras), 1, 2, 2))
        matrices[..., 1, 1] = (views.arrays.focal_px * self.tilt_mrad * 1e-3) ** 2
        return matrices


def on_a_mast(settings: NoiseSettings) -> NoiseModel:
    """`physical` with the scene's own sensor, and the wind."""
    return NOISE_MODELS["physical"](settings).plus(NoddingMast())
