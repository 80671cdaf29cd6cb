"""A closet with four cameras and twelve large markers, its sweeps, and the command that runs them."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
SCENE = """
[room]
width_m = 3.0
length_m = 3.0
height_m = 2.4
wall_albedo = 0.6
floor_albedo = 0.3
ceiling_albedo = 0.7

[light]
radiance_w_per_m2_sr = 2.0
panels = [{ centre_m = [0.0, 0.5], size_m = [0.6, 0.6] }]

[sensor]
resolution_px = [320, 240]
pixel_pitch_um = 18.6
wavelength_nm = 550.0
quantum_efficiency = 0.5
exposure_ms = 2.0
full_well_e = 20000.0
read_noise_e = 6.0
bits = 12
black_level_dn = 64

[lens]
f_number = 4.0
widest_fov_deg = 90.0
max_zoom = 8.0

[[cameras]]
name = "west"
position_m = [-1.2, 1.2, 2.0]
aim_m = [0.0, -1.0, 1.2]
zoom = 2.0
focus_distance_m = 2.5

[[cameras]]
name = "middle"
position_m = [0.0, 1.3, 2.0]
aim_m = [0.0, -1.0, 1.2]
zoom = 2.0
focus_distance_m = 2.4

[[cameras]]
name = "east"
position_m = [1.2, 1.2, 2.0]
aim_m = [0.0, -1.0, 1.2]
zoom = 2.0
focus_distance_m = 2.5

[[cameras]]
name = "away"
position_m = [1.2, 0.0, 2.0]
aim_m = [0.0, 1.4, 1.0]
zoom = 2.0
focus_distance_m = 2.0

[markers]
dictionary = "DICT_4X4_50"
quiet_zone_modules = 1.0
white_albedo = 0.85
black_albedo = 0.04

[[objects]]
name = "board"
kind = "rectangle"
centre_m = [0.0, -1.0, 1.2]
width_m = 1.6
height_m = 1.2
facing_deg = 0.0
albedo = 0.5
markers = { columns = 4, rows = 3, module_mm = 35.0, first_id = 0 }

[process]
model = "random-walk"
step_std_mm = 1.0

[noise]
models = ["as-printed", "corrected"]
switched_off = []
px2_per_m2 = 1.0
"""
SWEEP = """
scene = "closet.toml"
title = "Zoom of two cameras"
trials = 4
seed = 3
active = ["west", "middle", "east"]

[vary]
cameras = ["west", "east"]
parameter = "zoom"
values = [1.5, 2.0, 3.0]
"""
SELECTION = """
scene = "closet.toml"
title = "A second camera"
trials = 4
seed = 3

[vary]
parameter = "selection"
with = ["middle"]
values = ["west", "east", "away"]
"""
ALONE = """
scene = "closet.toml"
title = "One camera alone"
trials = 2
seed = 3

[vary]
parameter = "selection"
values = ["west", "middle"]
"""
FACTOR = """
scene = "closet.toml"
title = "Exposure, and a darker board"
trials = 4
seed = 3
active = ["west", "east"]

[vary]
parameter = "scene"
axis = "exposure_ms"
values = [0.5, 2.0]

[vary.set]
"sensor.exposure_ms" = [0.5, 2.0]
"objects.board.albedo" = [0.3, 0.5]
"""
DETERMINED = (
    *("configurations.csv", "points.csv", "views.csv", "correlation.csv", "detection.csv", "claims.csv"),
    "slopes.csv",
)


def command(folder, *arguments):
    """The command line as a list; without a report, where none is asked for: most tests look at the tables alone."""
    own = ["--store", str(folder / "store"), "--no-report"]
    return [sys.executable, str(ROOT / "validate" / "run_sweep.py"), *own, *arguments]


def run(folder, *arguments):
    """Run the command to its end."""
    return subprocess.run(
        command(folder, *map(str, arguments)), capture_output=True, text=True, timeout=400, check=False, cwd=folder
    )


def rows(path):
    """A CSV file as a list of dictionaries."""
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


def whole_views(folder):
    """Stored views, those still being written under a temporary name left out."""
    return [path for path in (folder / "store" / "views").rglob("*.exr") if not path.name.startswith(".")]


RISING = SWEEP.replace("trials = 4", "trials = 12").replace(
    'cameras = ["west", "east"]', 'cameras = ["west", "middle", "east"]'
)
RISING = RISING.replace("[1.5, 2.0, 3.0]", "[1.0, 1.5, 2.0]")
