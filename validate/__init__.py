"""Comparison of prediction and measurement: detection, triangulation, tracking, statistics, and the command.

The functions below are the way in from Python; each module is loaded at the first use of what it has.
"""

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from validate.markers.detections import detect
    from validate.markers.detector import Detections, Detector, Targets
    from validate.points.from_detections import Points, triangulate
    from validate.prediction.predict import predict
    from validate.results.compute import sweep
    from validate.results.run_result import RunResult
    from validate.runs.saved import SavedRun, load
    from validate.sweeps.measure_and_compare import Comparison, FailedViewError, Measurement, compare, measure

__all__ = [
    "Comparison",
    "Detections",
    "Detector",
    "FailedViewError",
    "Measurement",
    "Points",
    "RunResult",
    "SavedRun",
    "Targets",
    "compare",
    "detect",
    "load",
    "measure",
    "predict",
    "sweep",
    "triangulate",
]


def __getattr__(name: str) -> object:
    """Load a public name at its first use: together they take seconds, which `--help` does not wait for."""
    modules = {
        "validate.markers.detections": ("detect",),
        "validate.markers.detector": ("Detections", "Detector", "Targets"),
        "validate.points.from_detections": ("Points", "triangulate"),
        "validate.prediction.predict": ("predict",),
        "validate.results.run_result": ("RunResult",),
        "validate.results.compute": ("sweep",),
        "validate.runs.saved": ("SavedRun", "load"),
        "validate.sweeps.measure_and_compare": ("Comparison", "FailedViewError", "Measurement", "compare", "measure"),
    }
    for module, names in modules.items():
        if name in names:
            return getattr(importlib.import_module(module), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return [*globals(), *__all__]
