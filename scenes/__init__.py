"""Scenes and sweeps: what a TOML file may say, and the project's objects made of it.

`load` and `load_sweep` report every problem of a file at once, as one `SceneError` with a line for each.
"""

from scenes.errors import SceneError
from scenes.scene import Scene, load
from scenes.steps.sweep_file import Configuration, SweepFile, known_sweeps, load_sweep

__all__ = ["Configuration", "Scene", "SceneError", "SweepFile", "known_sweeps", "load", "load_sweep"]
