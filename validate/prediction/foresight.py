"""The metric's predictions for a scene: visibility of each marker, its size and sharpness, and its precision."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from pss import Evaluation
from pss.cameras.sensor import electrons_per_radiance
from pss.cameras.views import Views
from pss.hints import Bools, Floats, Row
from pss.noise.photometric import sides_e
from pss.visibility.targets import (
    LEAST_CONTRAST_OVER_NOISE,
    WholeTarget,
    blur_modules,
    contrast_over_noise,
    narrow_side_px,
)
from render.light.estimated_light import estimated_appearance
from scenes import Scene
from validate.markers.darkness import white_irradiance
from validate.prediction.contenders import shown_model
from validate.prediction.own_metrics import OwnScores, own_scores
from validate.prediction.predict import exposed, predict
from validate.runs.numbers import written

__all__ = [
    "LARGEST_BLUR_MODULES",
    "SMALLEST_MODULE_PX",
    "Foreseen",
    "camera_rows",
    "foresee",
    "headline",
    "marker_rows",
    "model_rows",
]


# Fitted by `run_sweep.py bank` on what was found and what was not (results/reference/bank/calibrated.toml): beyond
# either limit 8 % of the markers are found, within both 97 %.
SMALLEST_MODULE_PX = 1.9
LARGEST_BLUR_MODULES = 1.35
# An observable point needs the rays of two cameras.
ENOUGH = 2


@dataclass(frozen=True, eq=False)
class Foreseen:
    """A scene's cameras and markers before anything is rendered. Arrays are (C, N): cameras × markers.

    Attributes:
        scene: with an exposure in numbers.
        evaluations: by the name of each of the scene's noise models.
        visible: the metric's own visibility (the scene's [metric]).
        whole: besides, the whole marker is in view.
        module_px: px, a module's narrow side in the image.
        blur_px: px, diameter of the circle of confusion (Eq. 14).
        blur_modules: the same over a module's narrow side, with what motion adds.
        depth_m: m along the camera's axis.
        white_share: of the saturation, what the white of the marker reaches on the axis.
        white_e: electrons of the marker's white, at most what saturates.
        contrast: of white and black over the noise of one capture (`pss.visibility.targets.contrast_over_noise`).
        irradiance_w_per_m2: W/m² on the marker, of the light that the camera sees it in.
    """

    scene: Scene
    evaluations: dict[str, Evaluation]
    visible: Bools
    whole: Bools
    module_px: Floats
    blur_px: Floats
    blur_modules: Floats
    depth_m: Floats
    white_share: Floats
    white_e: Floats
    contrast: Floats
    irradiance_w_per_m2: Floats

    @property
    def too_small(self) -> Bools:
        """(C, N), whole in view, but with modules too small to be resolved."""
        return self.whole & (self.module_px < SMALLEST_MODULE_PX)

    @property
    def too_blurred(self) -> Bools:
        """(C, N), whole in view and large enough, but too far out of focus, or too fast."""
        return self.whole & ~self.too_small & (self.blur_modules > LARGEST_BLUR_MODULES)

    @property
    def too_dark(self) -> Bools:
        """(C, N), whole in view, large and sharp enough, but with too little contrast over the noise of a capture."""
        return self.whole & ~self.too_small & ~self.too_blurred & (self.contrast < LEAST_CONTRAST_OVER_NOISE)

    @property
    def legible(self) -> Bools:
        """(C, N), whole, large, sharp and bright enough to be found most likely."""
        return self.whole & ~self.too_small & ~self.too_blurred & ~self.too_dark

    @cached_property
    def own_scores(self) -> dict[str, OwnScores]:
        """By noise model, the metrics of installed entry points."""
        return {name: own_scores(evaluation) for name, evaluation in self.evaluations.items()}

    @property
    def shown_model(self) -> str:
        """The noise model whose σ is shown marker by marker, as in the figures."""
        return shown_model([model.name for model in self.scene.noise_models])


def foresee(scene: Scene) -> Foreseen:
    """The metric's prediction for all cameras of a scene, in the estimated light."""
    state = scene.state
    appearance = estimated_appearance(state)
    scene = exposed(scene, scene.cameras, appearance)
    evaluations = predict(scene, scene.cameras, appearance)
    visible = next(iter(evaluations.values())).visible
    views = Views(scene.cameras, state.points_m, state.normals, appearance)
    electrons = np.array([[electrons_per_radiance(camera, scene.sensor)] for camera in scene.cameras])
    radiance = np.broadcast_to(appearance.white_w_per_m2_sr, visible.shape)
    if appearance.ring_light:  # the radiances are those at 1 m, face to face
        with np.errstate(invalid="ignore", divide="ignore"):
            radiance = radiance * np.maximum(views.cos_incidence, 0) / views.range_m**2
    return Foreseen(
        scene,
        evaluations,
        visible,
        WholeTarget().passed(views, visible, state.occluders),
        narrow_side_px(views),
        views.circle_of_confusion_px,
        blur_modules(views, scene.sensor),
        views.depth_m,
        (electrons * radiance + scene.sensor.dark_signal_e) / scene.sensor.saturation_e,
        sides_e(views, appearance, scene.sensor)[0],
        contrast_over_noise(views, scene.sensor),
        white_irradiance(views, state),
    )


def camera_rows(seen: Foreseen) -> list[Row]:
    """A row for each camera; figures of markers are of those that it sees."""
    rows: list[Row] = []
    for number, camera in enumerate(seen.scene.cameras):
        of = seen.visible[number]
        rows.append(
            {
                "camera": camera.name,
                "fov_deg": camera.horizontal_fov_deg,
                "focus_distance_m": camera.focus_distance_m,
                "markers_visible": int(of.sum()),
                "whole": int(seen.whole[number].sum()),
                "too_small": int(seen.too_small[number].sum()),
                "too_blurred": int(seen.too_blurred[number].sum()),
                "too_dark": int(seen.too_dark[number].sum()),
                "likely_found": int(seen.legible[number].sum()),
                **_spread("depth", "m", seen.depth_m[number][of]),
                **_spread("module", "px", seen.module_px[number][of]),
                **_spread("blur", "px", seen.blur_px[number][of]),
                "brightest_white_share": float(seen.white_share[number][of].max(initial=0.0)),
                "brightest_white_e": float(seen.white_e[number][of].max(initial=0.0)),
                **_spread("contrast", "over_noise", seen.contrast[number][of]),
            }
        )
    return rows


def _spread(name: str, unit: str, values: Floats) -> Row:
    """Smallest, median and largest of some values; nan of none."""
    low, middle, high = np.percentile(values, [0, 50, 100]) if len(values) else (np.nan,) * 3
    return {f"{name}_lowest_{unit}": low, f"{name}_median_{unit}": middle, f"{name}_highest_{unit}": high}


def marker_rows(seen: Foreseen) -> list[Row]:
    """A row for each marker, with σ∞ by the noise model that is shown."""
    evaluation = seen.evaluations[seen.shown_model]
    names = np.array([camera.name for camera in seen.scene.cameras])
    rows: list[Row] = []
    for number, marker in enumerate(seen.scene.state.markers):
        of = seen.visible[:, number]
        x, y, z = marker.centre_m
        rows.append(
            {
                "marker": marker.id,
                "object": marker.object_name,
                "x_m": x,
                "y_m": y,
                "z_m": z,
                "cameras": " ".join(names[of]),
                "visible_to": int(of.sum()),
                "likely_found_by": int(seen.legible[:, number].sum()),
                "largest_module_px": seen.module_px[of, number].max(initial=0.0),
                "least_blur_modules": seen.blur_modules[of, number].min() if of.any() else np.nan,
                "noise_model": seen.shown_model,
                "sigma_inf_m": evaluation.sigma_m[number],
                "single_frame_sigma_m": evaluation.single_frame_sigma_m[number],
            }
        )
    return rows


def model_rows(seen: Foreseen) -> list[Row]:
    """A row for each noise model: PSS of both kinds, σ over the observable markers, the user's own metrics."""
    rows: list[Row] = []
    for name, evaluation in seen.evaluations.items():
        rows.append(
            {
                "noise_model": name,
                "markers": len(evaluation.observable),
                "observable": int(evaluation.observable.sum()),
                "pss_single_frame": evaluation.pss_single_frame,
                **_spread("single_frame_sigma", "m", evaluation.single_frame_sigma_m[evaluation.observable]),
                "pss": evaluation.pss,
                **_spread("sigma_inf", "m", evaluation.sigma_m[evaluation.observable]),
                **seen.own_scores[name].columns,
            }
        )
    return rows


def headline(seen: Foreseen) -> str:
    """The scene in one line: single-frame PSS (1/m), median error (mm) and the markers that two cameras will find.

    Of the single frame, since σ∞ cannot fall below the step of the process: with 1 mm a frame, an error of 0.1 mm and
    one of 0.01 mm have nearly the same PSS. The median is of √λmax of C over the observable markers.
    """
    evaluation = seen.evaluations[seen.shown_model]
    sigma = evaluation.single_frame_sigma_m[evaluation.observable]
    error = f"median error {1000 * np.median(sigma):.2g} mm" if len(sigma) else "no marker is observable"
    found = int((seen.legible.sum(axis=0) >= ENOUGH).sum())
    return (
        f"single-frame PSS {written(evaluation.pss_single_frame, 3)} /m, {error} ({seen.shown_model}); "
        f"found by two cameras and more: {found} of {len(seen.scene.state.markers)} markers"
    )
