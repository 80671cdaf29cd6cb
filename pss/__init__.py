"""The PSS metric of Ilie, Welch and Macenko: how well can a camera network resolve 3D points?

numpy and scipy only (trimesh for meshes): no renderer, no computer vision. See `docs/conventions.md` for axes, pixels
and units, and `docs/metric.md` for the paper equation by equation.
"""

from pss.aggregation import Aggregation
from pss.camera import PTZCamera
from pss.detection import DetectionModel, detection_model
from pss.errors import GeometryError, MissingLibraryError, PSSError, RangeError, RiccatiError, ShapeError
from pss.evaluation import Evaluation, Evaluations
from pss.legibility import Legible, WholeTarget, visibility_tests
from pss.metric import evaluate, evaluate_many
from pss.metric_table import Metric
from pss.metrics import METRICS
from pss.noise import NOISE_MODELS, NoiseModel, noise_model
from pss.own_process import LinearProcess, NonlinearProcess, PerPoint
from pss.own_sensor import FunctionSensor
from pss.photometry import Appearance, ImageSensor
from pss.process import ConstantAcceleration, ConstantVelocity, RandomWalk
from pss.riccati import steady_state_covariance
from pss.sensors import Bearing, DepthCamera, PositionFix, RangeBeacon
from pss.surrogates import Box, Rectangle, Shape, Sphere
from pss.visibility import FieldOfView, Occlusion, SelfOcclusion

__all__ = [
    "METRICS",
    "NOISE_MODELS",
    "Aggregation",
    "Appearance",
    "Bearing",
    "Box",
    "ConstantAcceleration",
    "ConstantVelocity",
    "DepthCamera",
    "DetectionModel",
    "Evaluation",
    "Evaluations",
    "FieldOfView",
    "FunctionSensor",
    "GeometryError",
    "ImageSensor",
    "Legible",
    "LinearProcess",
    "Metric",
    "MissingLibraryError",
    "NoiseModel",
    "NonlinearProcess",
    "Occlusion",
    "PSSError",
    "PTZCamera",
    "PerPoint",
    "PositionFix",
    "RandomWalk",
    "RangeBeacon",
    "RangeError",
    "Rectangle",
    "RiccatiError",
    "SelfOcclusion",
    "Shape",
    "ShapeError",
    "Sphere",
    "WholeTarget",
    "detection_model",
    "evaluate",
    "evaluate_many",
    "noise_model",
    "steady_state_covariance",
    "visibility_tests",
]
