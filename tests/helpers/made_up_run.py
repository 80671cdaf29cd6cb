"""A run of a sweep without renderer and detector: pixels are projections with noise of a known size."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np

import scenes
from render.certificate import Certificate
from render.keys import state_key
from render.lens.sampling import Sampling
from render.renderer import RenderedView
from render.store.folder import Store
from render.store.views import save_view
from scenes import load_sweep
from validate.acquire.acquire import Acquired, Acquisition
from validate.markers.view_measurement import ViewMeasurement
from validate.pages.data import read_sweeps
from validate.results.report import of_results, write_report
from validate.runs.tables import write_csv
from validate.sweeps import claims, correlation, optima, single_step
from validate.sweeps import rows as tables
from validate.sweeps.sweep import SweepResult, assess_sweep, plan

__all__ = ["CERTIFICATE", "PIXEL_NOISE_PX", "RENDERER", "made_up_run", "made_up_view"]

# px, σ of the made-up detections in each axis, and their bias along x.
PIXEL_NOISE_PX, BIAS_PX = 0.08, 0.03
RENDERER = "made up"
CERTIFICATE = Certificate(0.1, 0.1, 0.3, 0.1, 0.3, 1000, 0.0)
# The share of the trials in which a visible marker is found.
FOUND = 0.8


def made_up_run(
    folder: Path, scene: str, sweeps: dict[str, str], lit: bool = False
) -> tuple[list[SweepResult], Acquired, Store]:
    """Leave tables, stored views and the report of sweeps in `folder`/run, from the text of scene and sweep files.

    Args:
        lit: whether it is known how the markers look, which some noise models need.
    """
    (folder / "closet.toml").write_text(scene)
    store, results, acquired = Store(folder / "store"), [], Acquired()
    for name, text in sweeps.items():
        (folder / f"{name}.toml").write_text(text)
        sweep = load_sweep(folder / f"{name}.toml")
        made = plan(sweep, scenes.load(sweep.scene_path), RENDERER, Sampling())
        for step in made.configurations:
            acquired.appearances.setdefault(state_key(step.scene.state), step.scene.appearance())
        for requested in made.views:
            for item in requested:
                if item not in acquired.measured:
                    acquired.measured[item] = _detections(item)
                    acquired.certificates[item.request.key] = CERTIFICATE
                    save_view(store, made_up_view(item), item.request)
        if lit:
            for each in made.configurations:
                acquired.appearances[state_key(each.scene.state)] = each.scene.appearance()
        results.append(assess_sweep(made, acquired))
    out = folder / "run"
    for name, rows in (
        ("configurations", [row for r in results for row in tables.configuration_rows(r)]),
        ("points", [row for r in results for row in tables.point_rows(r)]),
        ("views", tables.view_rows(results, acquired)),
        ("detection", tables.detection_rows(results)),
        ("correlation", [row for r in results for row in correlation.correlation_rows(r)]),
        ("claims", [row for r in results for row in claims.claim_rows(r)]),
        ("measurement", [row for r in results for row in single_step.measurement_rows(r)]),
        ("optima", [row for r in results for row in optima.optimum_rows(r)]),
    ):
        write_csv(out / f"{name}.csv", rows)
    write_report(out, read_sweeps(out), of_results(results, acquired.measured), store)
    return results, acquired, store


def _detections(item: Acquisition) -> ViewMeasurement:
    camera, state = item.request.camera, item.request.state
    rng = np.random.default_rng(int(item.request.key[:8], 16))
    pixels, _ = camera.project(state.points_m)
    noisy = pixels + (BIAS_PX, 0.0) + rng.normal(0, PIXEL_NOISE_PX, (item.trials, *pixels.shape))
    facing = camera.in_frustum(state.points_m) & (camera.cos_incidence(state.points_m, state.normals) > 0.2)
    found = facing & (rng.random((item.trials, len(pixels))) < FOUND)
    covariance = np.broadcast_to(PIXEL_NOISE_PX**2 * np.eye(2), (*found.shape, 2, 2))
    return ViewMeasurement(
        np.where(found[..., None], noisy, np.nan), np.where(found[..., None, None], covariance, np.nan), 0, 0.0
    )


def made_up_view(item: Acquisition) -> RenderedView:
    """A picture with a slope of light and of depth."""
    request = item.request
    width, height = request.camera.resolution
    slope = np.linspace(0.2, 1.0, width, dtype=np.float32) * np.ones((height, 1), dtype=np.float32)
    capture = np.asarray(request.sensor.black_level_dn + 900 * slope, dtype=np.uint16)
    normal = np.zeros((height, width, 3), dtype=np.float32)
    normal[..., 2] = 1
    marker = np.full((height, width), -1, dtype=np.int32)
    return RenderedView(
        request.key,
        request.camera,
        request.sensor,
        slope,
        4 * slope,
        normal,
        marker,
        capture,
        dataclasses.replace(CERTIFICATE),
    )
