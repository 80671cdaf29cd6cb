"""The command line: the user's mistakes end in one clear line and exit code 2, before anything is rendered."""

from __future__ import annotations

import contextlib
import io
import os
import re
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from pss import RangeError
from validate.commands.command_line import parsed
from validate.commands.subcommands import SUBCOMMANDS, Sweep
from validate.run_sweep import main

ROOT = Path(__file__).parents[3]
SCRIPT = ROOT / "validate" / "run_sweep.py"


def run(*arguments):
    """Run the command in this process: its exit code, and what it printed."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main([str(argument) for argument in arguments])
        except SystemExit as end:
            code = end.code
    return SimpleNamespace(returncode=code, stdout=out.getvalue(), stderr=err.getvalue())


def run_script(*arguments, cwd=ROOT, timeout=120):
    """Run the script as a user does, in a process of its own."""
    return subprocess.run(
        [sys.executable, str(SCRIPT), *map(str, arguments)],
        cwd=cwd,
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


def refused(result, *words):
    """Exit code 2, nothing but our own message, and each of `words` in it."""
    assert result.returncode == 2, result.stderr
    assert "Traceback" not in result.stderr
    for word in words:
        assert word in result.stderr, result.stderr


def test_a_sweep_that_does_not_exist_names_the_nearest(tmp_path):
    """A misspelt name gets a suggestion."""
    result = run("zoon", "--out", tmp_path / "out")
    refused(result, "zoon", "zoom")
    assert len(result.stderr.strip().splitlines()) == 1


def test_a_sweep_file_that_does_not_exist(tmp_path):
    """A path is named as it was given."""
    refused(run(tmp_path / "none.toml", "--out", tmp_path / "out"), "none.toml")


def test_toml_that_does_not_parse_names_line_and_column(tmp_path):
    """A syntax error tells where it is."""
    bad = tmp_path / "bad.toml"
    bad.write_text('scene = "room.toml"\ntitle = \n')
    refused(run(bad, "--out", tmp_path / "out"), "bad.toml", "line 2")


def test_zero_trials(tmp_path):
    """Trials below two are refused, with the value."""
    refused(run("zoom", "--trials", 0, "--out", tmp_path / "out"), "--trials 0", "allowed")


def test_output_folder_that_is_a_file(tmp_path):
    """A file in the place of the results folder is named."""
    (tmp_path / "out").write_text("mine")
    refused(run("zoom", "--out", tmp_path / "out"), "out", "is a file")
    assert (tmp_path / "out").read_text() == "mine"


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_output_folder_that_is_not_writable(tmp_path):
    """A folder without write permission is named."""
    closed = tmp_path / "closed"
    closed.mkdir(mode=0o500)
    refused(run("zoom", "--out", closed / "out"), "closed", "write")


def test_all_mistakes_of_sweep_and_overrides_at_once(tmp_path):
    """Two bad overrides are two lines."""
    out = tmp_path / "out"
    result = run("zoom", "--out", out, "--set", "cameras.2.zoom=0.5", "--set", "sensor.exposure_ns=2")
    refused(result, "zoom", "0.5", "exposure_ns")
    assert not out.exists()


def test_an_unknown_variant_lists_those_allowed(tmp_path):
    """A misspelt variant is refused by the parser."""
    result = run("zoom", "--variant", "llvm_rgb", "--out", tmp_path / "out")
    assert result.returncode == 2
    assert "llvm_ad_mono" in result.stderr + result.stdout


def test_a_sweep_given_twice(tmp_path):
    """Rows are told apart by the sweep's name."""
    refused(run("zoom", "zoom", "--out", tmp_path / "out"), "twice")


def test_no_sweep_at_all():
    """At least one sweep has to be named."""
    assert run().returncode == 2


def test_a_misspelt_command_names_the_nearest():
    """One line, with the right word; a misspelt sweep is told of sweeps."""
    result = run("figurs")
    refused(result, "figurs", 'did you mean "figures"')
    assert len(result.stderr.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("word", "meant"),
    [
        ("chek", "check"),
        ("new_scene", "new-scene"),
        ("compar", "compare"),
        ("zoon", None),
        ("room.toml", None),
        ("a/b", None),
    ],
)
def test_a_first_word_that_is_no_command(word, meant):
    """What is nearer to a sweep, or a path, is left to those who read sweeps."""
    if meant is None:
        assert parsed([word, "focus", "--dry-run"]).sweeps == (word, "focus")
    else:
        with pytest.raises(RangeError, match=f'did you mean "{meant}"'):
            parsed([word, "--dry-run"])


def test_the_word_sweep_may_be_left_out():
    """Sweeps stand in the place of a command."""
    arguments = ["zoom", "focus", "--set", "a=1", "--set", "b=2", "--workers", "3", "--no-report"]
    assert parsed(arguments) == parsed(["sweep", *arguments])
    assert isinstance(parsed(arguments), Sweep)
    assert parsed(arguments).run.set == ("a=1", "b=2")
    assert parsed(arguments).run.scale.workers == 3


@pytest.mark.parametrize("arguments", [["--help"], ["zoom", "--help"], ["bank", "--help"]])
def test_the_help_loads_nothing_slow(arguments):
    """Neither that of the program nor of a command, so that it answers at once."""
    lines = ["import sys, contextlib", "from validate.run_sweep import main", "with contextlib.suppress(SystemExit):"]
    script = "\n".join([*lines, f"    main({arguments!r})", "print([*sys.modules])"])
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert "'tyro'" in done.stdout
    for slow in ("numpy", "pydantic", "mitsuba", "matplotlib"):
        assert f"'{slow}'" not in done.stdout, slow


def test_help_shows_examples_and_names_every_command(capsys):
    """With one sentence on each, and options that there are."""
    with pytest.raises(SystemExit) as caught:
        main(["--help"])
    assert caught.value.code == 0
    printed = capsys.readouterr().out
    assert "Examples" in printed
    assert "KEY=VALUE" in printed
    for name in SUBCOMMANDS:
        assert re.search(rf"• {name} ", printed), name
    assert len(printed.splitlines()) <= 60


def test_every_command_answers_help_with_its_own(capsys):
    """With what it is for and its options; nothing runs. Each has a module that carries it out."""
    for name in SUBCOMMANDS:
        with pytest.raises(SystemExit) as caught:
            main([name, "--help"])
        assert caught.value.code == 0
        assert f"usage: run_sweep.py {name}" in capsys.readouterr().out
        assert (ROOT / "validate" / "commands" / f"{name.replace('-', '_')}.py").exists()


def test_the_installed_command_is_the_script():
    """`pss-testbed` gives the same help but for its name, and the exit code, of `python validate/run_sweep.py`."""
    installed = Path(sys.executable).with_name("pss-testbed")
    # What an installer would write.
    written = [sys.executable, "-c", "import sys; from validate.run_sweep import main; sys.exit(main())"]
    program = [str(installed)] if installed.exists() else written
    for arguments, code in ((["--help"], 0), (["figurs"], 2)):
        there = subprocess.run([*program, *arguments], cwd=ROOT, capture_output=True, text=True, check=False)
        here = run_script(*arguments)
        name = program[0].rpartition("/")[2]
        output = [text.replace("run_sweep.py", name) for text in (here.stdout, here.stderr)]
        if program is written:
            output = [here.stdout, here.stderr]
        assert (there.returncode, there.stdout, there.stderr) == (here.returncode, *output)
        assert here.returncode == code


def test_a_shell_completes_sweeps_commands_and_options(tmp_path):
    """The script that is written, asked by bash itself."""
    script = tmp_path / "completion"
    assert run_script("--tyro-write-completion", "bash", script).returncode == 0
    ask = (
        'source "$0"; ask() { COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); COMPREPLY=(); '
        '"$(complete -p | sed -n "s/.*-F \\([^ ]*\\) .*/\\1/p")"; echo "${COMPREPLY[@]}"; }; '
        "ask run_sweep.py fi; ask run_sweep.py zoom-; ask run_sweep.py zoom --dr; ask run_sweep.py check room --ta"
    )
    done = subprocess.run(["bash", "-c", ask, str(script)], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["figures", "zoom-of-three", "--dry-run", "--table"]


def test_dry_run_renders_nothing(tmp_path):
    """It says how many views there are, and leaves no folder."""
    result = run("zoom", "selection", "--dry-run", "--store", tmp_path / "store", "--out", tmp_path / "out")
    assert result.returncode == 0, result.stderr
    assert "12 configurations" in result.stdout
    assert "6 configurations" in result.stdout
    assert "to render" in result.stdout
    assert not (tmp_path / "store").exists()
    assert not (tmp_path / "out").exists()
