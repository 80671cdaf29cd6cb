"""The PSS metric of Ilie, Welch and Macenko: how well can a camera network resolve 3D points?

numpy and scipy only (trimesh for meshes): no renderer, no computer vision. See `docs/conventions.md` for axes, pixels
and units, and `docs/metric.md` for the paper equation by equation.
"""

from pss.cameras.appearance import Appearance
from pss.cameras.camera import PTZCamera
from pss.cameras.sensor import ImageSensor
from pss.errors import GeometryError, MissingLibraryError, PSSError, RangeError, RiccatiError, ShapeError
from pss.metric.aggregation import Aggregation
from pss.metric.evaluate import evaluate, evaluate_many
from pss.metric.evaluation import Evaluation, Evaluations
from pss.metric.table import Metric
from pss.metrics import METRICS
from pss.modalities.own_sensor import FunctionSensor
from pss.modalities.sensors import Bearing, DepthCamera, PositionFix, RangeBeacon
from pss.noise import NOISE_MODELS, NoiseModel, NoiseSettings, noise_model
from pss.processes.own_process import LinearProcess, NonlinearProcess, PerPoint
from pss.processes.process import ConstantAcceleration, ConstantVelocity, RandomWalk
from pss.riccati.solve import steady_state_covariance
from pss.surrogates import Box, Rectangle, Shape, Sphere
from pss.visibility.detection import DetectionModel, detection_model
from pss.visibility.points import FieldOfView, Occlusion, SelfOcclusion
from pss.visibility.targets import Legible, WholeTarget, visibility_tests

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
    "NoiseSettings",
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
