"""How much a file may ask for. Files come from others too: a slip of zeros, or worse, is a line and not a full memory.

Bytes of a TOML file are bounded in `pss.files`, mesh files in `pss.surrogates`, backdrops in `render.world.backdrop`
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

# Large capture studios have two hundred; each is compared with each object.
MOST_CAMERAS = 256
# Each marker's plate is compared with each object, which takes a second for this many.
MOST_OBJECTS = 200
# Ten by ten lamps fill any ceiling that is allowed.
MOST_PANELS = 100
# Each is compared with each object. Grids may have more: as many as their dictionary has ids.
MOST_PLACED = 1000
# Light is solved on patches of half a metre; a hall of this length and breadth has as many as a matrix can be made of.
LONGEST_ROOM_M = 100.0
# The sun's disc above the atmosphere, all wavelengths together: 1361 W/m² (Kopp & Lean 2011) from 6.8e-5 sr. No surface
# in a room is brighter, and nothing shows but saturation.
BRIGHTEST_W_PER_M2_SR = 2e7
# A lamp of 0.1 m × 0.1 m as bright as that.
BRIGHTEST_RING_W_PER_SR = 2e5
# From a nanosecond, the shortest gate of intensified cameras, to an hour.
SHORTEST_EXPOSURE_MS, LONGEST_EXPOSURE_MS = 1e-6, 3.6e6
# A quarter of a wavelength of light; a pitch typed in metres or millimetres lies below it.
SMALLEST_PITCH_UM = 0.1
# Of a marker and camera: the last digit of a deviation is known after some thousand.
MOST_TRIALS = 10_000
# Of a sweep or a walk; each renders views of its own.
MOST_STEPS = 1000
# Strategies, and limits of the zoom: each pair walks the whole way.
MOST_RUNS = 50
# Instants at which people are tracked on their walk: an hour at 30 a second.
MOST_FRAMES = 108_000
# Names head columns and end up in the names of files, of which a folder takes 255 bytes.
LONGEST_NAME = 60
# Each configuration is evaluated under each noise model; tables and figures hold fewer.
MOST_MODELS = 30
MOST_FACTORS = 100
LONGEST_TITLE = 200
