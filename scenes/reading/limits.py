"""Limits of what a file may request. Files come from others too: a slip of zeros, or worse, must not fill the memory.

Bytes of a TOML file are limited in `pss.files`, mesh files in `pss.surrogates`, backdrops in `render.world.backdrop`
and faces in `scenes.mesh_file`, pixels of an image in `render.images`.
"""

from __future__ import annotations

__all__ = [
    "BRIGHTEST_RING_W_PER_SR",
    "BRIGHTEST_W_PER_M2_SR",
    "LONGEST_EXPOSURE_MS",
    "LONGEST_NAME",
    "LONGEST_ROOM_M",
    "LONGEST_TITLE",
    "MOST_CAMERAS",
    "MOST_FACTORS",
    "MOST_FRAMES",
    "MOST_MODELS",
    "MOST_OBJECTS",
    "MOST_PANELS",
    "MOST_PLACED",
    "MOST_RUNS",
    "MOST_STEPS",
    "MOST_TRIALS",
    "SHORTEST_EXPOSURE_MS",
    "SMALLEST_PITCH_UM",
]

# Large capture studios have two hundred; each is tested against each object.
MOST_CAMERAS = 256
# Each marker's plate is tested against each object, which takes a second for this many.
MOST_OBJECTS = 200
# Ten by ten lamps fill any allowed ceiling.
MOST_PANELS = 100
# Each is tested against each object. Grids may have more: up to the number of ids of their dictionary.
MOST_PLACED = 1000
# Light is solved on patches of half a metre; a hall of this size has as many as the matrix allows.
LONGEST_ROOM_M = 100.0
# The sun's disc above the atmosphere, all wavelengths together: 1361 W/m² (Kopp & Lean 2011) from 6.8e-5 sr. No surface
# in a room is brighter, and the image would only show saturation.
BRIGHTEST_W_PER_M2_SR = 2e7
# A lamp of 0.1 m × 0.1 m as bright as that.
BRIGHTEST_RING_W_PER_SR = 2e5
# From a nanosecond, the shortest gate of intensified cameras, to an hour.
SHORTEST_EXPOSURE_MS, LONGEST_EXPOSURE_MS = 1e-6, 3.6e6
# A quarter of a wavelength of light; a pitch typed in metres or millimetres is below it.
SMALLEST_PITCH_UM = 0.1
# Per marker and camera: a few thousand determine the last digit of a standard deviation.
MOST_TRIALS = 10_000
# Of a sweep or a walk; each renders its own views.
MOST_STEPS = 1000
# Strategies, and limits of the zoom: each pair runs the whole walk.
MOST_RUNS = 50
# Instants at which walking people are tracked: an hour at 30 a second.
MOST_FRAMES = 108_000
# Names are column headings and parts of file names, which are limited to 255 bytes.
LONGEST_NAME = 60
# Each configuration is evaluated under each noise model; tables and figures have room for fewer.
MOST_MODELS = 30
MOST_FACTORS = 100
LONGEST_TITLE = 200
