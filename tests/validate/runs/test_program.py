"""The program goes by the name it was called by, states its versions, ends quietly, and is whole in its wheel."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import site
import subprocess
import sys
import tomllib
import venv
import zipfile
from importlib.metadata import version
from pathlib import Path

import pytest

from validate.commands.subcommands import SUBCOMMANDS
from validate.run_sweep import main
from validate.runs.exit_codes import EXIT_CLOSED_PIPE, EXIT_CODES

ROOT = Path(__file__).parents[3]
SCRIPT = ROOT / "validate" / "run_sweep.py"
# Folders of packages, and what of the project is not among its modules but read by its commands.
PACKAGES = ("pss", "render", "scenes", "validate")
CALIBRATION = "pss/noise/calibrated.toml"


# ---- its name ----------------------------------------------------------------------------------------------------


def test_the_installed_program_names_itself(tmp_path, monkeypatch, capsys):
    """Usage, help, errors and what comes next, of every command."""
    monkeypatch.setattr(sys, "argv", ["/somewhere/bin/pss-testbed"])
    monkeypatch.chdir(tmp_path)
    for arguments in (["--help"], ["zoom", "--help"], ["zoon"], ["chekc"], ["report", "."], ["new-scene"]):
        with contextlib.suppress(SystemExit):
            main(arguments)
        output = capsys.readouterr()
        assert "pss-testbed" in output.out + output.err, arguments
        assert "run_sweep" not in output.out + output.err, arguments
    for command in SUBCOMMANDS:
        with pytest.raises(SystemExit):
            main([command, "--help"])
        output = capsys.readouterr().out
        assert f"usage: pss-testbed {command}" in output
        assert "run_sweep" not in output, command
    for file in tmp_path.iterdir():
        assert "run_sweep" not in file.read_text(encoding="utf-8")


def test_the_version_is_that_of_the_installed_packages(capsys):
    assert main(["--version"]) == 0
    numbers = [version(name) for name in ("pss-testbed", "mitsuba", "opencv-contrib-python-headless")]
    assert capsys.readouterr().out == "pss-testbed {} (Mitsuba {}, OpenCV {})\n".format(*numbers)


# ---- its end -----------------------------------------------------------------------------------------------------


@pytest.mark.skipif(os.name == "nt", reason="Windows has no such pipes")
@pytest.mark.parametrize(
    ("arguments", "stream"),
    [
        (["--help"], "stdout"),
        (["zoom", "--help"], "stdout"),
        (["--version"], "stdout"),
        (["store", "list", "--store", "."], "stdout"),
        (["zoon"], "stderr"),
    ],
)
def test_a_reader_that_has_ended_is_no_error(tmp_path, arguments, stream):
    """As in `run_sweep.py --help | head -1`; the reader has ended before a word is written."""
    reading, writing = os.pipe()
    os.close(reading)
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | {stream: writing}
    ended = subprocess.run([sys.executable, SCRIPT, *arguments], cwd=tmp_path, **streams, check=False)
    os.close(writing)
    assert (ended.returncode, ended.stdout or b"", ended.stderr or b"") == (EXIT_CLOSED_PIPE, b"", b"")
    assert f"{EXIT_CLOSED_PIPE} " in EXIT_CODES
    assert f"| {EXIT_CLOSED_PIPE} |" in (ROOT / "docs" / "runs.md").read_text(encoding="utf-8")


# ---- its wheel ---------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built of the files that are under version control, without any network."""
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    for name in listed.splitlines():
        if name.startswith(tuple(f"{package}/" for package in PACKAGES)) or "/" not in name:
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, source / name)
    build = ["-m", "pip", "wheel", "--no-deps", "--no-build-isolation", "--no-index", "-q", "-w", out, source]
    subprocess.run([sys.executable, *build], check=True, capture_output=True)
    [built] = out.glob("*.whl")
    return built


def test_the_wheel_has_every_file_of_the_packages(wheel):
    """Modules, and the scenes, sweeps, templates, scripts and styles that commands read."""
    listed = subprocess.run(["git", "ls-files", *PACKAGES], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
        entry = next(name for name in names if name.endswith("entry_points.txt"))
        assert "pss-testbed = validate.run_sweep:main" in archive.read(entry).decode()
    assert set(listed.splitlines()) <= names
    assert CALIBRATION in names
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == set(PACKAGES)


def test_the_calibration_that_is_installed_is_the_one_of_the_reference():
    shipped = (ROOT / CALIBRATION).read_bytes()
    assert shipped == (ROOT / "results" / "reference" / "bank" / "calibrated.toml").read_bytes()
    assert tomllib.loads(shipped.decode())["name"] == "calibrated"


@pytest.mark.acceptance
def test_the_wheel_works_in_an_empty_environment(wheel, tmp_path):
    """Its dependencies are those of this environment; the project itself is the wheel's. From an empty folder."""
    home, here = tmp_path / "env", tmp_path / "here"
    here.mkdir()
    venv.create(home, with_pip=False)
    python = home / "bin" / "python"
    install = ["-m", "pip", "--python", python, "install", "--no-index", "--no-deps", "-q", wheel]
    subprocess.run([sys.executable, *install], check=True, capture_output=True)
    [packages] = (home / "lib").glob("python*/site-packages")
    # A path file within these folders, such as that of an editable install, does not count there.
    (packages / "dependencies.pth").write_text("\n".join(site.getsitepackages()))
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}

    def run(*arguments: str) -> str:
        ended = subprocess.run(
            [home / "bin" / "pss-testbed", *arguments],
            cwd=here, env=environment, capture_output=True, text=True, check=False,
        )  # fmt: skip
        assert ended.returncode == 0, ended.stderr
        assert "run_sweep" not in ended.stdout + ended.stderr
        return ended.stdout + ended.stderr

    where = subprocess.run(
        [python, "-c", "import validate; print(validate.__file__)"], cwd=here, env=environment, capture_output=True,
        text=True, check=True,
    )  # fmt: skip
    assert Path(where.stdout.strip()).is_relative_to(packages)
    assert re.fullmatch(r"pss-testbed \d.*\n", run("--version"))
    run("new-scene")
    assert "my-room.toml" in run("check", "my-room.toml")
    assert "views" in run("zoom", "--dry-run")
    assert sorted(path.name for path in here.iterdir()) == ["my-room-sweep.toml", "my-room.toml", "results"]
