"""`bank --calibration FILE`: no training view is needed, nothing is fitted, and the file is what is judged."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import pytest

import scenes
from pss.noise import Calibration
from pss.noise.table import SHIPPED_CALIBRATION
from tests.helpers.drawn_pixels import acquired_of
from validate import run_sweep
from validate.acquire.source import ViewSource
from validate.bank.design import BankDesign, held_out_views
from validate.commands import bank
from validate.runs.csv_file import read_csv

SCENES = Path(__file__).parents[3] / "scenes"
FILE = SHIPPED_CALIBRATION
# Of R: NEES is inverse to it.
FACTOR = 4.0
# Tables have seven digits.
ROUNDING = 1e-6


@pytest.fixture
def judged(tmp_path, monkeypatch):
    """Judge with a calibration's file in the studio, from drawn detections: tables, run.json, and the views wanted."""
    requested_views = []

    def acquire(self, items):
        requested_views.extend(items)
        return acquired_of([(scenes.load(SCENES / "studio.toml"), list(items))])

    monkeypatch.setattr(ViewSource, "acquire", acquire)
    monkeypatch.setattr(bank, "COUNTS", (bank.HEADLINE,))

    def judge(file, *more):
        requested_views.clear()
        out = tmp_path / f"out {file.stem}"
        arguments = ("--settings", "1", "--configurations", "5", "--trials", "4", "--turns", "1", "--quiet")
        places = ("--scene", str(SCENES / "studio.toml"), "--calibration", str(file), "--out", str(out))
        code = run_sweep.main(["bank", *places, "--store", str(tmp_path / "store"), *arguments, *more])
        assert code == 0
        return out, json.loads((out / "run.json").read_text()), list(requested_views)

    return judge


def pixel_nees(out, model):
    rows = read_csv(out / "consistency.csv")
    (row,) = [row for row in rows if (row["level"], row["noise_model"]) == ("pixel", model)]
    return float(row["nees_per_dof"])


@pytest.mark.acceptance  # judges twice
def test_only_what_is_judged_is_wanted_and_the_file_is_what_is_judged(judged, tmp_path):
    """Two files, R and four times R: NEES is a fourth, and nothing else of the pixels is another number."""
    out, run, requested_views = judged(FILE)
    design = BankDesign(settings=1, trials=4, turns=1)
    held_out = held_out_views(scenes.load(SCENES / "studio.toml"), design, requested_views[0].request.renderer)
    assert [item.request.key for item in requested_views] == [item.request.key for item in held_out.requested]
    assert list(run["scenes"]) == ["studio.toml"]
    assert (out / "leaderboard.csv").exists()
    assert not list(out.glob("*-leaderboard.csv"))
    assert run["calibration"]["frozen"] is True
    assert run["calibration"]["file"] == FILE.name
    assert run["calibration"]["sha256"] == hashlib.sha256(FILE.read_bytes()).hexdigest()
    assert run["calibration"]["provenance"]["scene"] == "room.toml"
    assert (out / "calibrated.toml").read_bytes() == FILE.read_bytes()

    given = Calibration.from_file(FILE)
    weights = {name: FACTOR * weight for name, weight in given.weights.items()}
    other = tmp_path / "larger.toml"
    other.write_text(Calibration("by another name", weights, given.provenance, given.limits).to_toml())
    larger, run, _ = judged(other)
    assert run["calibration"]["sha256"] == hashlib.sha256(other.read_bytes()).hexdigest()
    assert pixel_nees(larger, "calibrated") == pytest.approx(pixel_nees(out, "calibrated") / FACTOR, rel=ROUNDING)
    assert pixel_nees(larger, "physical") == pytest.approx(pixel_nees(out, "physical"), rel=ROUNDING)


def test_a_second_room_is_judged_only_if_it_is_named(tmp_path, capsys):
    arguments = ["bank", "--scene", str(SCENES / "studio.toml"), "--dry-run", "--store", str(tmp_path / "store")]
    arguments += ["--out", str(tmp_path / "out"), "--settings", "1"]
    output = []
    for more in ([], ["--calibration", str(FILE)]):
        assert run_sweep.main([*arguments, *more]) == 0
        output.append(capsys.readouterr().out)
    assert run_sweep.main([*arguments, "--calibration", str(FILE), "--second-scene", str(SCENES / "atrium.toml")]) == 0
    output.append(capsys.readouterr().out)
    assert run_sweep.main([*arguments, "--set", "sensor.exposure_ms=2"]) == 0
    output.append(capsys.readouterr().out)
    roles = ("studio, training", "studio, detection", "studio, held out", "atrium, held out")
    assert [[role in text for role in roles] for text in output] == [
        [True, True, True, True],
        [False, False, True, False],
        [False, False, True, True],
        [True, True, True, False],
    ]


def test_a_file_that_cannot_be_judged_is_refused_before_anything_is_rendered(tmp_path, capsys):
    given = Calibration.from_file(FILE)
    (tmp_path / "no limits.toml").write_text(Calibration("c", given.weights, given.provenance).to_toml())
    (tmp_path / "no weights.toml").write_text("[weights]\n")
    out = ("--out", str(tmp_path / "out"), "--store", str(tmp_path / "store"))
    for name, message in (
        ("missing.toml", "missing.toml: there is no such file"),
        ("no limits.toml", "no limits.toml: no [limits]; allowed with --calibration: one with limits of detection"),
        ("no weights.toml", "no weights.toml: weights = {}; allowed: a table of"),
    ):
        assert run_sweep.main(["bank", "--calibration", str(tmp_path / name), *out]) == 2
        assert message in " ".join(capsys.readouterr().err.split())
    assert not (tmp_path / "out").exists()
