"""A scene that names the shipped calibration, one of its own and a model of another package: in the tables of all."""

from __future__ import annotations

import csv
import dataclasses
import json
import shutil
from pathlib import Path

import pytest

import scenes
from pss.noise import shipped_calibration
from tests.helpers.closet import SCENE, SWEEP
from tests.helpers.drawn_pixels import acquired_of
from tests.helpers.installed import own_noise
from tests.helpers.made_up_run import made_up_run
from tests.helpers.made_up_schedule import made_up_schedule
from validate import run_sweep
from validate.acquire.source import ViewSource
from validate.commands import bank
from validate.prediction.contenders import SCALED, judged, listed_contenders, scene_contenders
from validate.runs.csv_file import read_csv

ROOT = Path(__file__).parents[3]
MINE = "on-a-mast"
# Tables whose rows are not of a noise model: of views, runs, markers found, and what no prediction can exceed.
WITHOUT_MODEL = {"views", "runs", "detection", "reliability", "ceiling", "blunders"}


@pytest.fixture
def mine(tmp_path_factory):
    """The name of a model of another package, which is installed."""
    with own_noise(tmp_path_factory.mktemp("site")) as name:
        yield name


def models_in(path):
    with path.open(encoding="utf-8") as file:
        return {row["noise_model"] for row in csv.DictReader(file)}


def tables_of_models(folder):
    """The tables with a column of noise models, by name; all others are known to have none."""
    found = {path.stem: path for path in folder.glob("*.csv") if path.read_text().strip()}
    by_model = {name: path for name, path in found.items() if "noise_model" in path.read_text().splitlines()[0]}
    assert found.keys() - by_model.keys() <= WITHOUT_MODEL
    return by_model


def test_in_all_tables_of_a_sweep(mine, tmp_path):
    (tmp_path / "lab.toml").write_text(shipped_calibration().to_toml())
    text = SCENE.replace(
        'models = ["as-printed", "corrected"]', f'models = ["corrected", "calibrated", "lab.toml", "{mine}"]'
    )
    assert text != SCENE
    results, _, _ = made_up_run(tmp_path, text, {"zooming": SWEEP}, lit=True)
    tables = tables_of_models(tmp_path / "run")
    assert {"configurations", "points", "correlation", "optima"} <= tables.keys()
    for name, path in tables.items():
        assert {"calibrated", "lab.toml", mine} <= models_in(path), name
    told = judged(listed_contenders(results[0].plan.scene))
    weights = {name: weight for name, weight in shipped_calibration().weights.items() if weight > 0}
    assert told["calibrated"]["weights"] == told["lab.toml"]["weights"] == weights
    assert told[mine]["noise"] == ["brightness-contrast", "nodding-mast"]
    page = (tmp_path / "run" / "report.html").read_text(encoding="utf-8")
    assert mine in page


def test_in_all_tables_of_a_bank(mine, tmp_path, monkeypatch):
    """Beside what is compared in any case; "calibrated" is there the calibration that is judged."""
    folder = tmp_path / "studio"
    folder.mkdir()
    shutil.copy(ROOT / "scenes" / "studio.toml", folder)
    shutil.copytree(ROOT / "scenes" / "workshop", folder / "workshop")
    scene = folder / "studio.toml"
    old = 'models = ["as-printed", "corrected", "physical"]'
    assert old in scene.read_text()
    scene.write_text(scene.read_text().replace(old, f'models = ["calibrated", "{mine}", "lab.toml"]'))
    (folder / "lab.toml").write_text(shipped_calibration().to_toml())
    monkeypatch.setattr(
        ViewSource,
        "acquire",
        lambda self, items: acquired_of([(scenes.load(ROOT / "scenes" / "studio.toml"), list(items))]),
    )
    monkeypatch.setattr(bank, "COUNTS", (bank.HEADLINE,))
    arguments = ["--settings", "1", "--configurations", "5", "--trials", "4", "--turns", "1", "--quiet"]
    arguments += ["--scene", str(scene), "--calibration", "calibrated", "--out", str(tmp_path / "out")]
    arguments += ["--store", str(tmp_path / "store"), "--set", "metric.visibility=lab.toml"]
    assert run_sweep.main(["bank", *arguments]) == 0
    tables = tables_of_models(tmp_path / "out")
    in_all = {"leaderboard", "consistency", "differences", "parts", "process", "scale", "sensitivity", "size"}
    assert tables.keys() == in_all
    for name, path in tables.items():
        found = models_in(path)
        assert {mine, "lab.toml"} <= found, name
        assert "calibrated" in found or name in ("scale", "sensitivity"), name
        assert "as-printed" in found, name
    told = json.loads((tmp_path / "out" / "run.json").read_text())["predicted_with"]["studio.toml"]
    assert told[mine]["noise"] == ["brightness-contrast", "nodding-mast"]
    assert told["lab.toml"]["limits"] == dict(shipped_calibration().limits)
    kinds = {row["visibility"] for row in read_csv(tmp_path / "out" / "detection.csv")}
    assert {"points", "fitted limits", "limits of lab.toml"} <= kinds


def test_in_all_tables_of_a_schedule(mine, tmp_path):
    made = made_up_schedule(tmp_path, [f'noise.models=["calibrated", "{mine}", "physical"]'])
    tables = tables_of_models(made.out)
    assert {"configurations", "points", "correlation", "agreement", "strategies", "ranking", "process"} <= tables.keys()
    for name, path in tables.items():
        assert {"calibrated", "as-printed", mine} <= models_in(path), name
    assert mine in (made.out / "report.html").read_text(encoding="utf-8")


def test_a_calibration_may_have_the_name_of_another_model(room):
    """A bank and a schedule judge both: the calibration is "calibrated" there, whatever its file calls it."""
    shipped = shipped_calibration()
    plain = {each.name: each.noise.factors for each in scene_contenders(room, shipped)}
    for name in ("as-printed", "physical", SCALED["identity"]):
        found = scene_contenders(room, dataclasses.replace(shipped, name=name))
        assert {each.name: each.noise.factors for each in found} == plain


def test_what_is_recorded_has_both_weights_of_a_factor():
    """That of the calibration and that of the scene, whose product is in the sum."""
    scene = scenes.load("room", ['noise.models=["calibrated"]', "noise.weights={brightness-contrast=3}"])
    ((name, told),) = judged(listed_contenders(scene)).items()
    assert name == "calibrated weighted"
    assert told["weights"]["brightness-contrast"] == 3 * shipped_calibration().weights["brightness-contrast"]
