"""Which files a file may reference: a scene, those in its folder and below; a sweep or schedule, scenes near it."""

from __future__ import annotations

import os
from pathlib import Path

from pss.files import is_inside
from scenes.errors import Location, Problems

__all__ = ["OUTSIDE", "SHIPPED", "may_open", "scene_of"]

SHIPPED = Path(__file__).parents[1]
"""The folder of the scenes that come with the project."""
# As in the project's own folder of scenes: files in a folder of such a name are for scenes in the parent folder.
COLLECTED = ("sweeps", "schedules")
OUTSIDE = "(--allow-outside permits it)"
"""The option that permits it, for the end of an error's line."""


def may_open(file: str, place: Location, folder: Path, allow_outside: bool, problems: Problems) -> bool:
    """Whether a scene in `folder` may reference the file at its key `place`; a problem if not.

    The file has to be in the folder or below, symbolic links resolved, unless `allow_outside`.
    """
    if allow_outside or is_inside(folder / file, [folder]):
        return True
    problems.add(place, f"the path of a file in the folder of this file, or below; this leads outside {OUTSIDE}")
    return False


def scene_of(path: Path, file: str | None, allow_outside: bool, problems: Problems) -> Path:
    """The path of the scene that the sweep or schedule at `path` references; a problem if that is not allowed.

    Scenes have to be in the folder of that file or below (in the parent folder, if its own is called "sweeps" or
    "schedules", as the project's are), or come with the project, unless `allow_outside`.
    """
    if file is None:
        return path
    scene = Path(os.path.normpath(path.parent / file))
    own = path.parent.resolve()
    if not allow_outside and not is_inside(scene, [own.parent if own.name in COLLECTED else own, SHIPPED]):
        problems.add(
            ("scene",),
            f"a scene that comes with the project, or in the folder of this file (above {' or '.join(COLLECTED)}) or "
            f"below; this leads outside {OUTSIDE}",
        )
    elif os.path.exists(scene) and not os.path.isfile(scene):
        # Opening a named pipe would block.
        problems.add(("scene",), "the path of a file")
    return scene
