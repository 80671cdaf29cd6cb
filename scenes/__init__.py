"""Scenes, sweeps and schedules: the format of their TOML files, and the objects built from them.

`load` and `load_sweep` report every problem of a file at once, as one `SceneError` with a line for each.
"""

from scenes.errors import SceneError
from scenes.scene import Scene, load
from scenes.steps.sweep_file import Configuration, SweepFile, known_sweeps, load_sweep

__all__ = ["Configuration", "Scene", "SceneError", "SweepFile", "known_sweeps", "load", "load_sweep"]
