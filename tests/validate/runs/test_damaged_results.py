"""Folders of results that were cut, damaged or made up: one line with file and line, and exit code 2."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from pss import RangeError
from pss.files import open_plain, read_toml
from pss.surrogates import Mesh
from render.store.folder import StoreError
from tests.helpers.strict_json import strict
from validate.pages.columns import Columns, check_counts, whole_number
from validate.results.run_result import _of_last_run
from validate.run_sweep import main
from validate.runs.csv_file import number_in, read_csv, read_head
from validate.runs.events import EVENTS, EventFile
from validate.runs.run_file import listed, needed, option, read_run

# ---- tables ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"a,b\n1,2\n3\n", "line 3 has 1 fields; allowed: 2"),
        (b"a,b\n1,2\n3,4,5\n", "line 3 has 3 fields; allowed: 2"),
        (b"a,b,a\n1,2,3\n", "line 1 has the column 'a' twice"),
        (b"a,b\n1,2\n\xff\xfe,3\n", "is no text; allowed: a table in UTF-8"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "is no text; allowed: a table in UTF-8"),
        (b'a,b\n"1,2\n', "line 2 has 1 fields; allowed: 2"),
        (b"a,b\n1," + b"9" * 200_000 + b"\n", "line 2 is no line of a CSV file (field larger"),
    ],
)
def test_a_table_that_is_none_is_refused_with_its_line(tmp_path, content, message):
    """Until now a row cut short was filled with nothing, and bytes that are no text were a traceback."""
    path = tmp_path / "points.csv"
    path.write_bytes(content)
    with pytest.raises(StoreError) as caught:
        read_csv(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)
    assert str(caught.value).isprintable()


def test_a_zero_byte_is_a_character(tmp_path):
    (tmp_path / "a.csv").write_bytes(b"a,b\n1,\x00\n")
    assert read_csv(tmp_path / "a.csv") == [{"a": "1", "b": "\x00"}]


def test_an_empty_table_has_no_rows(tmp_path):
    """As a run leaves it that has nothing to put there."""
    (tmp_path / "a.csv").write_text("")
    assert read_csv(tmp_path / "a.csv") == []
    assert read_head(tmp_path / "a.csv") == []


def test_a_row_names_its_place(tmp_path):
    """A column that is missing, and a field that is no number."""
    path = tmp_path / "a.csv"
    path.write_text('a,b,c\n1,"two\nlines",\n1.5,x,7\n')
    first, second = read_csv(path)
    assert (number_in(first, "a"), whole_number(second, "c")) == (1.0, 7)
    assert number_in(first, "c") != number_in(first, "c")  # nan
    with pytest.raises(StoreError, match=r"a\.csv: line 3: there is no column 'd'; allowed: a, b, c"):
        first["d"]
    with pytest.raises(StoreError, match=r"a\.csv: line 4: b = 'x'; allowed: a number"):
        number_in(second, "b")
    with pytest.raises(StoreError, match=r"a\.csv: line 4: a = '1\.5'; allowed: a whole number"):
        whole_number(second, "a")
    columns = Columns([first, second], (2,))
    assert columns["a"].tolist() == [1.0, 1.5]
    with pytest.raises(StoreError, match=r"line 3: b = 'two\\nlines'; allowed: a number"):
        columns["b"]
    with pytest.raises(StoreError, match=r"points\.csv has 3 rows of physical; allowed: 4"):
        check_counts("zoom", {"corrected": 4, "physical": 3}, "points", 4)


# ---- run.json --------------------------------------------------------------------------------------------------------

BROKEN_JSON = {
    "half": (b'{"options": {"store": "x"', "line 1, column 26"),
    "no JSON": (b"options\n= 1", "line 1, column 1"),
    "nothing": (b"", "line 1, column 1"),
    "a list": (b"[1, 2]", "[1, 2]; allowed: an object"),
    "a word": (b'"' + b"x" * 200 + b'"', "…; allowed: an object"),
    "bytes": (b"\xff\xfe\x00", "byte 0 is no UTF-8"),
    "depth": (b"[" * 100_000, ""),
    "digits": (b'{"a": ' + b"9" * 5000 + b"}", "allowed: what a run left"),
}


@pytest.mark.parametrize("what", BROKEN_JSON)
def test_a_run_file_that_is_none_is_one_line(tmp_path, capsys, what):
    """Exit code 2 of `report` and `compare`; a new run into the folder goes on without it."""
    content, message = BROKEN_JSON[what]
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "run.json").write_bytes(content)
        (tmp_path / name / "configurations.csv").write_text("sweep,value\nzoom,1\n")
    with pytest.raises(StoreError) as caught:
        read_run(tmp_path / "a")
    assert str(caught.value).startswith(f"{tmp_path / 'a' / 'run.json'}: ")
    assert message in str(caught.value)
    for arguments in (["report", str(tmp_path / "a")], ["compare", str(tmp_path / "a"), str(tmp_path / "b")]):
        assert main(arguments) == 2
        assert "run.json: " in capsys.readouterr().err
    assert _of_last_run(tmp_path / "a") == {}


def test_no_run_file_is_none(tmp_path):
    assert read_run(tmp_path) is None
    (tmp_path / "run.json").write_text('{"options": {}}')
    assert read_run(tmp_path) == {"options": {}}


@pytest.mark.parametrize(
    "change",
    [
        {"options": []},
        {"options": {}},
        {"options": {"store": 5}},
        {"options": {"store": "results/store", "set": "["}},
        {"options": {"store": "results/store", "set": "()", "sweeps": "[1]"}},
        {"options": {"store": "results/store", "set": "()", "sweeps": "__import__('os')"}},
        {"options": {"store": "results/store", "set": "()", "sweeps": "('zoom',)", "variant": "warp"}},
        {"options": {"store": "results/store", "set": "()", "sweeps": "('zoom',)", "trials": "x; y"}},
        {"sweeps": 3},
        {"scenes": None},
        {"schedule": {}, "scene": 1},
        {"schedule": {}, "scene": {}, "options": {"strategy": 7}},
        {"schedule": {}, "scene": {}, "options": {"strategy": "()", "overrides": "{"}},
    ],
)
def test_a_run_file_of_other_keys_is_one_line(tmp_path, capsys, change):
    """Whatever a stranger puts in the place of what a run writes."""
    content = {"options": {"store": "results/store", "set": "()", "sweeps": "()"}, "sweeps": {}, "scenes": {}}
    (tmp_path / "run.json").write_text(json.dumps(content | change))
    assert main(["report", str(tmp_path)]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "allowed: " in line


def test_options_of_a_run(tmp_path):
    options = {"a": "None", "b": "('x', 'y')", "c": 3}
    assert (option(tmp_path, options, "a"), option(tmp_path, options, "d")) == (None, None)
    assert listed(tmp_path, options, "b") == ["x", "y"]
    for name in ("a", "c", "d"):
        with pytest.raises(StoreError, match=rf"run\.json: options\.{name}"):
            needed(tmp_path, options, name)


# ---- what is no plain file -------------------------------------------------------------------------------------------


def a_pipe(path: Path) -> Path:
    os.mkfifo(path)
    return path


def a_device(path: Path) -> Path:
    path.symlink_to("/dev/zero")
    return path


ODD = pytest.mark.parametrize(("odd", "kind"), [(a_pipe, "a pipe"), (a_device, "a device")])


@ODD
def test_only_plain_files_are_read(tmp_path, odd, kind):
    """A pipe that nobody writes to, and a device without end: refused at once by every reader."""
    message = f"it is {kind}; allowed: a plain file"
    with pytest.raises(RangeError, match=message):
        open_plain(odd(tmp_path / "any"))
    with pytest.raises(RangeError, match=rf"scene\.toml: {message}"):
        read_toml(odd(tmp_path / "scene.toml"))
    with pytest.raises(RangeError, match="is not a file"):
        Mesh.from_file(odd(tmp_path / "mesh.ply"))
    with pytest.raises(StoreError, match=rf"points\.csv: {message}"):
        read_csv(odd(tmp_path / "points.csv"))
    odd(tmp_path / "run.json")
    with pytest.raises(StoreError, match=rf"run\.json: {message}"):
        read_run(tmp_path)


@ODD
def test_a_scene_that_is_no_plain_file_is_the_users_mistake(tmp_path, capsys, odd, kind):
    arguments = ["focus", "--dry-run", "--scene", str(odd(tmp_path / "scene.toml")), "--out", str(tmp_path / "out")]
    assert main(arguments) == 2
    assert f"it is {kind}" in capsys.readouterr().err


def test_links_to_plain_files_are_read(tmp_path):
    (tmp_path / "real.csv").write_text("a\n1\n")
    (tmp_path / "link.csv").symlink_to(tmp_path / "real.csv")
    assert read_csv(tmp_path / "link.csv") == [{"a": "1"}]


@ODD
def test_events_are_not_written_into_what_is_no_plain_file(tmp_path, odd, kind):
    """A pipe would fill and then hold the run up."""
    odd(tmp_path / EVENTS)
    lines: list[str] = []
    file = EventFile(tmp_path, lines.append)
    for _ in range(3):
        file.write("measured", seconds=1.0)
    (line,) = lines
    assert "events are left out" in line
    (tmp_path / EVENTS).unlink()
    file.write("finished")
    assert strict((tmp_path / EVENTS).read_text())["number"] == 3
