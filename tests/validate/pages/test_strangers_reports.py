"""`report FOLDER` on a folder of a stranger: nothing outside it is opened or contacted without being asked for."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import pss.files
from render.store.folder import StoreError
from scenes import load_sweep
from tests.helpers.closet import SCENE, SWEEP
from validate.commands import command_line
from validate.pages.named import DEFAULT_STORE, Given
from validate.results.report_again import remade

ADDRESS = "s3://somebody/collects/who-opens-this"


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A user's folder with files of one's own, and a stranger's results in it; whatever is opened is noted."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "closet.toml").write_text(SCENE)
    (tmp_path / "zooming.toml").write_text(SWEEP)
    (tmp_path / "theirs").mkdir()
    return tmp_path


@pytest.fixture
def opened(monkeypatch):
    """Files that are opened as TOML, and addresses that are contacted: none may be."""
    found = []

    def read(path, most_bytes, read=pss.files.read_bounded):
        found.append(Path(path).resolve())
        return read(path, most_bytes)

    def contact(address, **options):
        found.append(address)
        raise AssertionError(address)

    monkeypatch.setattr("pss.files.read_bounded", read)
    monkeypatch.setattr("fsspec.core.url_to_fs", contact)
    return found


def leave(folder: Path, **options: str) -> Path:
    """A run.json as a run leaves it, of the project's zoom sweep unless `options` has others."""
    base = {"sweeps": "('zoom',)", "scene": "None", "store": DEFAULT_STORE, "set": "()", "variant": "None"}
    record = {"options": base | {"trials": "None", "seed": "None"} | options, "sweeps": {}, "scenes": {}}
    (folder / "run.json").write_text(json.dumps(record))
    return folder


def leave_schedule(folder: Path, **options: str) -> Path:
    base = {"schedule": "hallway", "scene": "None", "store": DEFAULT_STORE, "overrides": "[]", "variant": "None"}
    record = {"options": base | {"strategy": "()"} | options, "schedule": {}, "scene": {}, "failed": {}}
    (folder / "run.json").write_text(json.dumps(record))
    return folder


OWN_SWEEP = {"sweeps": "('zooming.toml',)"}
REFUSED = [
    (leave, {"store": ADDRESS}, f"the store {ADDRESS}, and no address is contacted", f"--store {ADDRESS}"),
    (leave, {"store": "../elsewhere"}, "the store ../elsewhere, and nothing outside", "--store ../elsewhere"),
    (leave, {"scene": "closet.toml"}, "the scene closet.toml, and nothing outside", "--scene closet.toml"),
    (leave, {"scene": "theirs/../closet.toml"}, "the scene theirs/../closet.toml", "--scene"),
    (leave, OWN_SWEEP, "the sweep zooming.toml, and nothing outside", "--file zooming.toml"),
    (leave, {"sweeps": "('theirs/../zooming.toml',)"}, "the sweep theirs/../zooming.toml", "--file"),
    (leave_schedule, {"store": ADDRESS}, f"the store {ADDRESS}, and no address", f"--store {ADDRESS}"),
    (leave_schedule, {"schedule": "mine.toml"}, "the schedule mine.toml", "--file mine.toml"),
    (leave_schedule, {"scene": "closet.toml"}, "the scene closet.toml", "--scene closet.toml"),
]


@pytest.mark.parametrize(("kind", "named", "words", "option"), REFUSED)
def test_what_lies_elsewhere_is_neither_opened_nor_contacted(home, opened, kind, named, words, option):
    """One line has what run.json names, and the option that opens it."""
    with pytest.raises(StoreError) as caught:
        remade(kind(home / "theirs", **named))
    message = str(caught.value)
    assert "\n" not in message
    assert words in message
    assert option in message
    assert not [path for path in opened if path in (home / "closet.toml", home / "zooming.toml") or path == ADDRESS]


def test_a_sweep_in_the_folder_names_no_scene_outside(home, opened):
    """Not even where the folder is called "sweeps", from which a sweep may name scenes in the folder above."""
    folder = home / "sweeps"
    folder.mkdir()
    (folder / "zooming.toml").write_text(SWEEP.replace("closet.toml", "../closet.toml"))
    leave(folder, sweeps=f"({str(folder / 'zooming.toml')!r},)")
    with pytest.raises(StoreError, match=r"the scene .*closet\.toml, and nothing outside"):
        remade(folder)
    assert home / "closet.toml" not in opened


def test_a_link_in_the_folder_leads_nowhere(home, opened):
    (home / "theirs" / "zooming.toml").symlink_to(home / "zooming.toml")
    with pytest.raises(StoreError, match=r"the sweep theirs/zooming\.toml, and nothing outside"):
        remade(leave(home / "theirs", sweeps="('theirs/zooming.toml',)"))
    assert not opened


def test_what_the_user_gives_is_opened(home, opened):
    """The same files, given on the command line; the run is then refused for what it lacks."""
    folder = leave(home / "theirs", **OWN_SWEEP)
    for given in (Given(files=(Path("zooming.toml"),)), Given(allow_outside=True)):
        opened.clear()
        with pytest.raises(StoreError, match=r"configurations\.csv"):
            remade(folder, given)
        assert home / "zooming.toml" in opened
        assert home / "closet.toml" in opened
    with pytest.raises(StoreError, match=r"configurations\.csv"):
        command_line.run(
            ["report", str(folder), "--file", "zooming.toml", "--scene", "closet.toml", "--store", "elsewhere"]
        )


def test_an_address_that_the_user_gives_is_contacted(home, opened):
    with pytest.raises(StoreError, match=ADDRESS):
        remade(leave(home / "theirs"), Given(store=ADDRESS))
    assert opened == [ADDRESS]


def test_a_run_of_the_projects_sweeps_needs_no_option(home, opened):
    """`report results/zoom` after `run_sweep.py zoom`."""
    with pytest.raises(StoreError, match=r"configurations\.csv"):
        remade(leave(home / "theirs"))
    assert load_sweep("zoom").path in opened


def test_files_in_the_folder_need_no_option(home, opened):
    folder = home / "theirs"
    for name in ("closet.toml", "zooming.toml"):
        (folder / name).write_text((home / name).read_text())
    leave(folder, sweeps="('theirs/zooming.toml',)", scene="theirs/closet.toml", store="theirs/store")
    with pytest.raises(StoreError, match=r"configurations\.csv"):
        remade(folder)
    assert folder / "closet.toml" in opened
