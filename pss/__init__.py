"""The PSS metric of Ilie, Welch and Macenko: how well can a camera network resolve 3D points?

numpy and scipy only: no renderer, no computer vision. See `docs/conventions.md` for axes, pixels and units.
"""

from pss.camera import PTZCamera
from pss.errors import GeometryError, MissingLibraryError, PSSError, RangeError, RiccatiError, ShapeError
from pss.metric import METRICS, Evaluation, Metric, evaluate
from pss.noise import NOISE_MODELS, NoiseModel, noise_model
from pss.process import ConstantAcceleration, ConstantVelocity, RandomWalk
from pss.riccati import steady_state_covariance
from pss.surrogates import Box, Rectangle, Shape, Sphere

__all__ = [
    "METRICS",
    "NOISE_MODELS",
    "Box",
    "ConstantAcceleration",
    "ConstantVelocity",
    "Evaluation",
    "GeometryError",
    "Metric",
    "MissingLibraryError",
    "NoiseModel",
    "PSSError",
    "PTZCamera",
    "RandomWalk",
    "RangeError",
    "Rectangle",
    "RiccatiError",
    "Shape",
    "ShapeError",
    "Sphere",
    "evaluate",
    "noise_model",
    "steady_state_covariance",
]
