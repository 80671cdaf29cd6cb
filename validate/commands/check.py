"""`run_sweep.py check`: what the cameras of a scene will see, in seconds and before anything is rendered."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from rich.table import Table

import scenes
from pss import RangeError
from pss.hints import Row
from scenes.reading.document import named_file, read_toml
from validate.commands.subcommands import Check
from validate.markers.darkness import light_words
from validate.prediction.foresight import Foreseen, camera_rows, foresee, headline, marker_rows, model_rows
from validate.prediction.own_metrics import OWN_COLUMN, own_metrics
from validate.prediction.warnings import warnings_of
from validate.runs.console import Console
from validate.runs.table_text import table_text

__all__ = ["execute"]

SCENES = Path(__file__).parents[2] / "scenes"
DRAWINGS = (".png", ".pdf", ".svg")
_COUNTS = ("markers_visible", "whole", "too_small", "too_blurred", "too_dark", "likely_found")


def execute(options: Check) -> int:
    """Print what the cameras will see, and draw the plan; the exit code."""
    path = named_file(options.scene, SCENES, "scene")
    if options.out is not None and options.out.suffix.lower() not in DRAWINGS:
        raise RangeError(f"--out {options.out}; allowed: a file that ends in {', '.join(DRAWINGS)}")
    document = read_toml(path)
    drawing = options.out or Path("results") / "check" / f"{path.stem}.png"
    if "vary" in document and "room" not in document:
        raise RangeError(f"{path} is a sweep; allowed: a scene, such as its own: {document.get('scene')}")
    seen = foresee(scenes.load(path, options.files.set, allow_outside=options.files.allow_outside))
    errors = Console(stderr=True)
    if options.table is not None:
        print(
            table_text(
                {"cameras": camera_rows, "markers": marker_rows, "models": model_rows}[options.rows](seen),
                options.table,
            ),
            end="",
        )
    else:
        _show(seen, Console(width=None if os.isatty(1) else 140))
    for line in warnings_of(seen):
        errors.print(line, markup=False, style="yellow", highlight=False, soft_wrap=True)
    # Imported late: slow, and not needed for a file with mistakes.
    from validate.plots.plan import write_plan

    write_plan(drawing, seen)
    errors.print(f"drawn: {drawing}", markup=False, highlight=False, soft_wrap=True)
    return 0


def _show(seen: Foreseen, console: Console) -> None:
    state = seen.scene.state
    room = state.room
    console.print(
        f"{seen.scene.path.name}: room {room.width_m:g} × {room.length_m:g} × {room.height_m:g} m, "
        f"{len(state.markers)} markers, {len(seen.scene.cameras)} cameras, "
        f"exposure {seen.scene.sensor.exposure_ms:g} ms",
        markup=False,
        highlight=False,
    )
    console.print(headline(seen), markup=False, highlight=False, soft_wrap=True)
    seen_light = seen.irradiance_w_per_m2[seen.visible]
    if len(seen_light):
        low, high = (
            light_words(float(value), seen.scene.sensor.wavelength_nm) for value in np.percentile(seen_light, [0, 100])
        )
        console.print(f"light on the markers in view: {low} to {high}", highlight=False)
    console.print(_cameras(camera_rows(seen)))
    console.print(_objects(seen))
    console.print(_models(model_rows(seen)))


def _cameras(rows: Sequence[Row]) -> Table:
    table = Table(title="What each camera sees, and what of it will most likely be found")
    for name in ("camera", "view in deg", "focus in m", "sees", "whole", "small", "blurred", "dark", "found"):
        table.add_column(name, justify="right")
    for name in ("depth in m", "module in px", "blur in px", "white"):
        table.add_column(name, justify="right")
    for row in rows:
        counts = [str(row[key]) for key in _COUNTS]
        spread = [_range(row, "depth", "m"), _range(row, "module", "px"), _range(row, "blur", "px")]
        white = f"{row['brightest_white_share']:.0%}" if row["markers_visible"] else ""
        table.add_row(
            str(row["camera"]), f"{row['fov_deg']:.1f}", f"{row['focus_distance_m']:g}", *counts, *spread, white
        )
    return table


def _range(row: Row, name: str, unit: str) -> str:
    if not row["markers_visible"]:
        return ""
    low, high = row[f"{name}_lowest_{unit}"], row[f"{name}_highest_{unit}"]
    return f"{low:.1f} … {high:.1f}"


def _objects(seen: Foreseen) -> Table:
    """Of the markers of each object: how many cameras see them, and σ of both kinds."""
    table = Table(title=f"Markers by the number of cameras that see them; σ by {seen.shown_model}")
    heads = ("object", "markers", "by none", "by one", "by two and more", "found by two and more")
    for name in (*heads, "σ∞ in mm", "√λmax C in mm"):
        table.add_column(name, justify="left" if name == "object" else "right")
    rows = marker_rows(seen)
    for name in dict.fromkeys(str(row["object"]) for row in rows):
        of = [row for row in rows if row["object"] == name]
        views = [row["visible_to"] for row in of]
        found = sum(row["likely_found_by"] >= 2 for row in of)
        spread = [_extent_mm([row[key] for row in of]) for key in ("sigma_inf_m", "single_frame_sigma_m")]
        two = sum(count >= 2 for count in views)
        table.add_row(name, *(str(n) for n in (len(of), views.count(0), views.count(1), two, found)), *spread)
    return table


def _extent_mm(values_m: Sequence[float]) -> str:
    known = [1000 * value for value in values_m if math.isfinite(value)]
    return f"{min(known):.3g} … {max(known):.3g}" if known else ""


def _models(rows: Sequence[Row]) -> Table:
    table = Table(title="Predicted PSS and σ of the observable markers")
    for name in (
        "noise model",
        "observable",
        "PSS single frame in 1/m",
        "√λmax C in mm, median",
        "PSS of σ∞",
        "σ∞ in mm, median",
        *(metric.name for metric in own_metrics()),
    ):
        table.add_column(name, justify="left" if name == "noise model" else "right")
    for row in rows:
        words = [f"{row['pss_single_frame']:.4g}", f"{1000 * row['single_frame_sigma_median_m']:.3g}"]
        words += [f"{row['pss']:.4g}", f"{1000 * row['sigma_inf_median_m']:.3g}"]
        words += [f"{row[OWN_COLUMN + metric.name]:.4g}" for metric in own_metrics()]
        table.add_row(str(row["noise_model"]), f"{row['observable']} of {row['markers']}", *words)
    return table
