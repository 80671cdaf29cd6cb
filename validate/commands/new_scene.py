"""`run_sweep.py new-scene`: a scene and a sweep to start from, in which comments explain every key."""

from __future__ import annotations

import re
from pathlib import Path

from pss import RangeError
from render.store.folder import StoreError, write_text
from scenes.reading.spec import Spec
from scenes.schema.reference import described_keys
from scenes.schema.scene_tables import SceneSpec
from scenes.steps.sweep_file import SweepSpec
from validate.commands.subcommands import NewScene
from validate.runs.program import named_as_called, program_name

__all__ = ["execute", "write_new_scene"]

TEMPLATES = Path(__file__).parents[2] / "scenes" / "templates"
# Stands for the scene's name in the templates.
PLACEHOLDER = "NAME"
# A file's name on any system, and no path.
ALLOWED_NAME = re.compile(r"\w[\w-]{0,59}", re.ASCII)
RULE = "# " + "-" * 116


def write_new_scene(name: str, folder: Path) -> tuple[Path, Path]:
    """Write NAME.toml and NAME-sweep.toml into `folder` and return their paths.

    Raises:
        RangeError: a name that is no file's name.
        StoreError: one of the files is there already; nothing is written then.
    """
    if not ALLOWED_NAME.fullmatch(name):
        raise RangeError(f"name {name!r}; allowed: letters, digits, - and _, 60 at most")
    scene, sweep = folder / f"{name}.toml", folder / f"{name}-sweep.toml"
    for path in (scene, sweep):
        if path.exists() or path.is_symlink():
            raise StoreError(
                f"{path} is there already; allowed: a name of which there is no file yet, or another --out"
            )
    write_text(scene, _text("scene", name, SceneSpec))
    write_text(sweep, _text("sweep", name, SweepSpec))
    return scene, sweep


def _text(kind: str, name: str, model: type[Spec]) -> str:
    body = (TEMPLATES / f"{kind}.toml").read_text(encoding="utf-8").replace(PLACEHOLDER, name)
    body = named_as_called(body)
    return f"{body}\n{RULE}\n# All keys of a {kind} file\n{RULE}\n#\n{described_keys(model)}\n"


def execute(options: NewScene) -> int:
    """Write the two files and print what comes next; the exit code."""
    scene, sweep = write_new_scene(options.name, options.out)
    print(f"wrote {scene} and {sweep}; next:")
    print(f"  {program_name()} check {scene}      what each camera will see, without rendering")
    print(f"  {program_name()} {sweep}      render, measure and compare: about a minute")
    return 0
