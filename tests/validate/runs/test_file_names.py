"""Names of a run's files: what would write over another's is refused before anything is read."""

from __future__ import annotations

import itertools
from pathlib import Path

import pytest

from pss import RangeError
from tests.helpers.few_rows import a_run
from validate.commands.subcommands import SUBCOMMANDS
from validate.comparison.page import html_of
from validate.comparison.sides import sides_of
from validate.run_sweep import main
from validate.runs.file_names import (
    FIGURES,
    RESERVED,
    check_default_folder,
    check_names,
    figure_file,
    model_file,
    sweep_name,
)
from validate.runs.tables import write_csv

ROOT = Path(__file__).parents[3]


@pytest.mark.parametrize(
    ("names", "file"),
    [
        (["a", "a_points"], "figures/a_points.png"),
        (["a_captures", "a"], "figures/a_captures.png"),
        (["Zoom", "zoom"], "figures/Zoom.png"),
        (["straße", "STRASSE"], "figures/straße.png"),
        (["caf\u00e9", "cafe\u0301"], "figures/caf\u00e9.png"),
        (["b", "zoom", "Zoom_points"], "figures/zoom_points.png"),
    ],
)
def test_sweeps_that_would_write_one_file_are_refused(names, file):
    """In one line, which names both and the file."""
    with pytest.raises(RangeError, match="would both write") as caught:
        check_names(names)
    assert file in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "allowed" in str(caught.value)


def test_names_that_are_let_through_have_files_of_their_own():
    """By brute force: all files of all pairs of names, as a file system without capitals compares them."""
    names = ["a", "A", "a_points", "a_captures", "scene", "report", "run", "a_points_points", "b", "scene_a"]
    for pair in itertools.permutations(names, 2):
        files = [
            {f"figures/{figure_file(name, suffix)}".lower() for suffix in FIGURES} | {model_file(name, number).lower()}
            for number, name in enumerate(pair)
        ]
        try:
            check_names(pair)
            refused = False
        except RangeError:
            refused = True
        assert refused == bool(files[0] & files[1]), pair


def test_a_run_of_such_sweeps_ends_before_any_file_is_read(tmp_path, capsys):
    """Exit code 2 and one line; the files need not even be there."""
    assert main(["a.toml", "a_points.toml", "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "'a' and 'a_points'" in line
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", ["Reference", *RESERVED])
def test_results_do_not_go_by_themselves_where_others_are(name, tmp_path, monkeypatch, capsys):
    """A sweep file called store.toml would fill the store with tables."""
    monkeypatch.chdir(tmp_path)
    assert main([f"{name}.toml"]) == 2
    assert f"results/{name}" in capsys.readouterr().err
    assert not (tmp_path / "results").exists()


def test_the_store_is_no_folder_for_results(tmp_path, capsys):
    """Not by --out either."""
    arguments = ["zoom", "--dry-run", "--out", str(tmp_path / "x" / ".." / "s"), "--store", str(tmp_path / "s")]
    (tmp_path / "x").mkdir()
    assert main(arguments) == 2
    assert "is the store" in capsys.readouterr().err


def test_every_folder_that_commands_fill_by_themselves_is_reserved():
    """Of every command's default of --out."""
    defaults = [getattr(options, "out", None) for options in SUBCOMMANDS.values()]
    in_results = [path.parts[1] for path in defaults if isinstance(path, Path) and path.parts[:1] == ("results",)]
    assert len(in_results) == 4
    assert set(in_results) <= {*RESERVED}
    for name in ("results/zoom", "results/mine"):
        check_default_folder(["zoom"], Path(name))


def test_a_sweeps_name_is_that_of_its_rows():
    """A bare name may have a dot in it; a path ends in .toml."""
    assert [sweep_name(word) for word in ("zoom", "dir/my.toml", "zoom.v2", "dir/zoom.v2.toml")] == [
        "zoom",
        "my",
        "zoom.v2",
        "zoom.v2",
    ]


def test_sections_of_a_comparison_have_ids_of_their_own(tmp_path):
    """Sweeps whose names differ in a sign alone."""
    sides = []
    for side in ("one", "two"):
        folder = a_run(tmp_path / side)
        rows = [line.split(",") for line in (folder / "configurations.csv").read_text().splitlines()]
        head, body = rows[0], [dict(zip(rows[0], row, strict=True)) for row in rows[1:]]
        assert head[0] == "sweep"
        write_csv(folder / "configurations.csv", [row | {"sweep": name} for name in ("a b", "a-b") for row in body])
        sides.append(str(folder))
    page = html_of(sides_of(sides))
    assert page.count('id="group-1"') == page.count('id="group-2"') == 1
