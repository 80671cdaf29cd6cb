"""`run_sweep.py new-scene`: a scene and a sweep to start from, in which comments explain every key."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import tyro

from pss import RangeError
from render.store.folder import StoreError, write_text
from scenes.reading.spec import Spec
from scenes.schema.reference import described_keys
from scenes.schema.scene_tables import SceneSpec
from scenes.steps.sweep_file import SweepSpec
from validate.runs.program import named_as_called, program_name

__all__ = ["main", "write_new_scene"]

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
    return f"{body}\n{RULE}\n# All that a {kind} file may say, key by key\n{RULE}\n#\n{described_keys(model)}\n"


def run(
    name: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="NAME")] = "my-room",
    /,
    out: Annotated[Path, tyro.conf.arg(metavar="DIR")] = Path("."),
) -> int:
    """Write a scene and a sweep to start from: NAME.toml and NAME-sweep.toml.

    The scene is a room with five cameras; comments explain every key with its unit. What is there is not overwritten.

    Args:
        name: of the scene.
        out: folder for the two files.
    """
    scene, sweep = write_new_scene(name, out)
    print(f"wrote {scene} and {sweep}; next:")
    print(f"  {program_name()} check {scene}      what each camera will see, without rendering")
    print(f"  {program_name()} {sweep}      render, measure and compare: about a minute")
    return 0


def main(arguments: list[str]) -> int:
    """Parse the subcommand's own arguments and run it."""
    return tyro.cli(run, prog=f"{program_name()} new-scene", args=arguments)
