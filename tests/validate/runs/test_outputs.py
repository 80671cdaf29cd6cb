"""Files that stand where a run writes its own are found before it renders, in one line that names them."""

from __future__ import annotations

import pytest

from render.store.folder import Store, StoreError, write_text
from validate.acquire.messages import RunMessages
from validate.acquire.source import ViewSource
from validate.commands.run_and_save import execute
from validate.results.run_request import RunRequest
from validate.run_sweep import main
from validate.runs.outputs import FOLDERS, check_folders, check_outputs, linked_views

# All that `run_sweep.py zoom` writes into its folder.
FILES = [
    *(f"{name}.csv" for name in (
        "configurations", "points", "views", "timings", "detection", "correlation", "claims", "slopes"
    )),
    "run.json", "report.html", "scene.glb", "figures/zoom.png", "figures/zoom_points.png", "figures/zoom_captures.png",
]  # fmt: skip


@pytest.mark.parametrize("name", FOLDERS)
def test_a_file_where_a_folder_goes(tmp_path, name):
    (tmp_path / name).write_text("mine")
    with pytest.raises(StoreError, match=rf"{name} is a file; allowed is a folder in its place, nothing, or another"):
        check_folders(tmp_path, str(tmp_path / "store"))
    assert (tmp_path / name).read_text() == "mine"


@pytest.mark.parametrize("name", FILES)
def test_a_folder_where_a_file_goes(tmp_path, name):
    (tmp_path / name).mkdir(parents=True)
    with pytest.raises(StoreError, match=rf"{name} is a folder; allowed is a file in its place, nothing, or another"):
        check_folders(tmp_path, str(tmp_path / "store"))


def test_files_of_an_earlier_run_are_in_nobodys_way(tmp_path):
    for name in FILES:
        write_text(tmp_path / name, "")
    (tmp_path / "views").mkdir()
    (tmp_path / "mine").mkdir()
    check_outputs(tmp_path)
    check_outputs(tmp_path / "none")


def test_a_run_ends_before_it_renders(tmp_path, monkeypatch):
    monkeypatch.setattr(ViewSource, "acquire", lambda *all_of_it: pytest.fail("rendered"))
    (tmp_path / "report.html").mkdir()
    with pytest.raises(StoreError, match=r"report\.html is a folder"), RunMessages(quiet=True) as messages:
        execute(RunRequest(("zoom",), out=tmp_path, store=str(tmp_path / "store")), messages)
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


@pytest.mark.parametrize("command", [["bank"], ["schedule", "hallway"], ["calibration-error"], ["pixel-noise"]])
def test_other_commands_do_the_same(tmp_path, capsys, command):
    (tmp_path / "run.json").mkdir()
    assert main([*command, "--out", str(tmp_path), "--store", str(tmp_path / "store")]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert "run.json is a folder; allowed" in line


def test_a_folder_with_the_name_of_any_file_is_one_line(tmp_path):
    """Also where nothing was checked before: the writers of files and of links."""
    (tmp_path / "a.txt").mkdir()
    with pytest.raises(StoreError, match=r"a\.txt is a folder; allowed is a file in its place, or nothing"):
        write_text(tmp_path / "a.txt", "")
    (tmp_path / "views" / "ab.exr").mkdir(parents=True)
    with pytest.raises(StoreError, match=r"ab\.exr is a folder; allowed is a file in its place, or nothing"):
        linked_views(tmp_path, ["ab"], Store(tmp_path / "store"))
