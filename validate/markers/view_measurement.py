"""Measure one view: many noisy captures of one render, the markers found and localised in each.

Runs in worker processes, which load neither Mitsuba nor the scene's geometry: a worker gets the image and the list of
the markers' numbers, and nothing of where they are.
"""

from __future__ import annotations

import hashlib
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pss import ImageSensor, RangeError
from pss.hints import Floats
from render.captures import captures
from render.code_digest import Code, code_of
from render.store.arrays import check_arrays
from render.store.folder import Store
from render.store.views import stored_view
from render.world.marker_print import predefined_dictionary
from validate.markers.detector import Detections, Targets
from validate.markers.detector_table import DEFAULT_DETECTOR, DETECTORS, detector_called

__all__ = [
    "EQUAL_SIGMA_PX",
    "EXCLUDED",
    "MeasureTask",
    "ViewMeasurement",
    "detections_in",
    "load_measurement",
    "measure",
    "measure_capture",
    "measure_code",
]


EXCLUDED = {
    "render.backend": "chooses the renderer, which the view's name holds",
    "render.code_digest": "makes names; what it finds is the name",
    "render.store.arrays": "checks that what is read is a measurement",
    "render.store.folder": "keeps what is measured, and checks that it is what was written",
    "render.store.views": "reads views, whose code their own names hold",
    "pss.surrogates._mesh_files": "reads a mesh from its file, and the view's name holds the mesh itself",
}
"""Modules that the code of a measurement does not count, with the reason."""

EQUAL_SIGMA_PX = 0.3
"""px, σ per axis that stands for the covariance of detectors that state none, the same for all their detections.

Only ratios of covariances are weights; the constant sets how far apart views may be before one is rejected (7 px of two
views). It comes from no noise model: a weight from the R under test would favour that R.
"""


@dataclass(frozen=True, eq=False)
class ViewMeasurement:
    """Detections of one view over T trials and the scene's N markers.

    Attributes:
        pixels: px, OpenCV's, (T, N, 2); nan where a marker was not found or not localised.
        covariance: px², each detection's own, or `EQUAL_SIGMA_PX`² for all, (T, N, 2, 2); nan likewise.
        unexpected_ids: detections of markers that the scene does not have.
        seconds: s, spent on captures, search and localisation.
    """

    pixels: Floats
    covariance: Floats
    unexpected_ids: int
    seconds: float

    @property
    def detected(self) -> NDArray[np.bool_]:
        """(T, N), found and localised."""
        return np.isfinite(self.pixels[..., 0])


def measure_code() -> Code:
    """The code that takes captures of a view, and finds and localises the markers in them."""
    return code_of("validate.markers.view_measurement", excluded=tuple(EXCLUDED))


@cache
def _words_of(dictionary: str) -> str:
    """Hash of all markers of a dictionary: how many errors are mended, and which unknown numbers are found."""
    known = predefined_dictionary(dictionary)
    content = f"{known.markerSize} {known.maxCorrectionBits} {known.bytesList.shape} ".encode()
    return hashlib.sha256(content + known.bytesList.tobytes()).hexdigest()[:16]


@dataclass(frozen=True)
class MeasureTask:
    """What a worker needs to measure a view; `code` is the digest of the code that measures."""

    store: Path
    view_key: str
    dictionary: str
    marker_ids: tuple[int, ...]
    seed: int
    trials: int
    detector: str = DEFAULT_DETECTOR
    code: str = field(default_factory=lambda: measure_code().digest)

    @property
    def path(self) -> Path:
        """Where the measurement is stored."""
        detector = f"{self.code}/{_words_of(self.dictionary)}/{','.join(map(str, self.marker_ids))}"
        if self.detector != DEFAULT_DETECTOR:  # files of the default are those from before there were others
            detector += f"/{DETECTORS.content(self.detector)}"
        return Store(self.store).measurement(self.view_key, detector, self.seed, self.trials)


def detections_in(image: NDArray[np.uint16], targets: Targets, sensor: ImageSensor, detector: str) -> Detections:
    """What a detector finds of `targets` in a capture, in their order; the rest counts as unexpected.

    A number that is found at two places names at least one wrong place: both are left out.

    Raises:
        RangeError: no such detector; it raised an exception; or its detections are not what `Detections` states.
    """
    found = _checked(_found(image, targets, sensor, detector), detector)
    ids = found.ids.tolist()
    places = {number: at for at, number in enumerate(ids) if ids.count(number) == 1}
    kept = [places[number] for number in targets.ids if number in places]
    unexpected_ids = found.unexpected_ids + len(set(ids) - set(targets.ids))
    covariance = None if found.covariance_px2 is None else found.covariance_px2[kept]
    return Detections(found.ids[kept], found.centres_px[kept], covariance, unexpected_ids)


def _found(image: NDArray[np.uint16], targets: Targets, sensor: ImageSensor, name: str) -> object:
    chosen = detector_called(name)
    if name in DETECTORS.own:
        return chosen.detect(image, sensor, targets)
    try:
        return chosen.detect(image, sensor, targets)
    except Exception as error:  # third-party code: the message needs the detector's name
        raise RangeError(f"detector {name!r} raised {type(error).__name__}: {error}") from error


def _checked(found: object, name: str) -> Detections:
    if not isinstance(found, Detections):
        raise RangeError(f"detector {name!r} returned {found!r:.60}; allowed: validate.Detections")
    ids, centres = np.asarray(found.ids), np.asarray(found.centres_px, dtype=float)
    covariance = None if found.covariance_px2 is None else np.asarray(found.covariance_px2, dtype=float)
    if ids.ndim != 1 or (ids.size and ids.dtype.kind not in "iu"):
        raise RangeError(f"detector {name!r}: ids {ids.shape} of {ids.dtype}; allowed: whole numbers, (K,)")
    if centres.shape != (len(ids), 2) or not np.isfinite(centres).all():
        raise RangeError(f"detector {name!r}: centres_px {centres.shape}; allowed: finite, ({len(ids)}, 2)")
    if covariance is not None:
        if covariance.shape != (len(ids), 2, 2):
            raise RangeError(f"detector {name!r}: covariance_px2 {covariance.shape}; allowed: ({len(ids)}, 2, 2)")
        definite = np.isfinite(covariance).all() and (
            (covariance[:, 0, 0] > 0) & (np.linalg.det(covariance) > 0) & (covariance[:, 0, 1] == covariance[:, 1, 0])
        )
        if not np.all(definite):
            raise RangeError(f"detector {name!r}: a covariance_px2 that is none; allowed: symmetric, positive definite")
    return Detections(ids.astype(np.int64), centres, covariance, found.unexpected_ids)


def measure_capture(
    capture_dn: NDArray[np.uint16],
    targets: Targets,
    sensor: ImageSensor,
    detector: str = DEFAULT_DETECTOR,
) -> tuple[Floats, Floats, int]:
    """Find and localise markers in one capture: pixels (N, 2), covariance (N, 2, 2), number of unexpected ids."""
    pixels = np.full((len(targets.ids), 2), np.nan)
    covariance = np.full((len(targets.ids), 2, 2), np.nan)
    found = detections_in(capture_dn, targets, sensor, detector)
    index = {marker: number for number, marker in enumerate(targets.ids)}
    places = [index[number] for number in found.ids.tolist()]
    pixels[places] = found.centres_px
    covariance[places] = EQUAL_SIGMA_PX**2 * np.eye(2) if found.covariance_px2 is None else found.covariance_px2
    return pixels, covariance, found.unexpected_ids


def measure(task: MeasureTask) -> Path:
    """Measure a stored view over its trials and store the result.

    Raises:
        DamagedViewError: the view is not there, or was found damaged and set aside.
        StoreError: the store cannot be written, or the disk is full.
    """
    begin = time.perf_counter()
    store = Store(task.store)
    view = stored_view(store, task.view_key)
    trials = [
        measure_capture(numbers, Targets(task.dictionary, task.marker_ids), view.sensor, task.detector)
        for numbers in captures(view, task.seed, range(task.trials))
    ]
    pixels, covariances, unexpected_ids = zip(*trials, strict=True)
    seconds = time.perf_counter() - begin
    store.save(
        task.path,
        {
            "pixels": np.array(pixels),
            "covariance": np.array(covariances),
            "strangers": np.array(sum(unexpected_ids)),
            "seconds": np.array(seconds),
        },
        task.code,
        {"seconds": seconds, "trials": task.trials, "pixels": int(view.radiance.size)},
    )
    return task.path


def _check(arrays: Mapping[str, NDArray[np.generic]], task: MeasureTask) -> None:
    """That a stored measurement has what `measure` writes.

    Raises:
        ValueError: other keys, shapes or kinds of numbers; a covariance without a pixel, or a pixel without one.
    """
    trials, markers = task.trials, len(task.marker_ids)
    check_arrays(
        arrays,
        {"pixels": (trials, markers, 2), "covariance": (trials, markers, 2, 2), "strangers": (), "seconds": ()},
    )
    known = np.isfinite(arrays["pixels"]).all(axis=-1)
    if (known != np.isfinite(arrays["covariance"]).all(axis=(-2, -1))).any():
        raise ValueError("detections and covariances do not fit each other")
    if not (np.isfinite(arrays["seconds"]) and arrays["strangers"] >= 0):
        raise ValueError("its seconds or its number of unexpected ids are none")


def load_measurement(task: MeasureTask) -> ViewMeasurement | None:
    """The stored measurement of a view, or None."""
    arrays = Store(task.store).load(task.path, lambda arrays: _check(arrays, task))
    if arrays is None:
        return None
    return ViewMeasurement(
        arrays["pixels"].astype(float),
        arrays["covariance"].astype(float),
        int(arrays["strangers"]),
        float(arrays["seconds"]),
    )
