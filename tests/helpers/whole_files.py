"""What a store and a run's folder hold after a run that was killed."""

from __future__ import annotations

import time

from render.store.folder import Store
from tests.helpers.closet import ALONE, DETERMINED, SCENE
from validate.commands.store_upkeep import check, stored_files


def with_sweep(folder):
    """The folder, with the closet and its smallest sweep in it."""
    folder.mkdir(exist_ok=True)
    for name, text in (("closet", SCENE), ("alone", ALONE)):
        (folder / f"{name}.toml").write_text(text)
    return folder


def tables(folder):
    """The tables that a run left, but for its seconds."""
    return {name: (folder / name).read_bytes() for name in DETERMINED if (folder / name).exists()}


def temporary_files(folder):
    """What is begun and not finished, in store and results."""
    return [path for path in folder.rglob(".*") if path.is_file()]


def uninterrupted(runs, folder, workers):
    """The tables of a run that nobody kills, its seconds and the number of its steps with files."""
    begin = time.monotonic()
    code, output = runs.run(with_sweep(folder), workers=workers)
    assert code == 0, output
    assert not temporary_files(folder)
    return tables(folder / "out"), time.monotonic() - begin, int((folder / "steps").read_text())


def check_all_whole(folder, expected):
    """Whatever a killed run left under its own name is whole."""
    for name, content in tables(folder / "out").items():
        assert content == expected[name], name
    store = Store(folder / "store")
    for stored in stored_files(store.folder):
        assert check(store, stored), stored.path
    assert not (store.folder / "damaged").exists()
