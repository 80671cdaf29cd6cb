"""What failed views take from a bank and from a schedule: that alone, and it is said."""

from __future__ import annotations

import json

import pytest

import scenes
from scenes.steps.schedule_file import load_schedule
from tests.conftest import ROOM_FILE
from tests.helpers.drawn_pixels import acquired_of
from validate.acquire.acquire import Acquired
from validate.acquire.messages import RunMessages
from validate.acquire.source import ViewSource
from validate.bank.acquire import acquire_banks, enough
from validate.bank.design import BankDesign, held_out_views, training_views
from validate.commands import schedule
from validate.commands.options import StepOptions
from validate.commands.subcommands import Schedule
from validate.runs.exit_codes import EXIT_DONE, EXIT_FAILED
from validate.tracked_walk import path

CAUSE = "ValueError: made to fail"
# One strategy under two limits, few steps, and the trials that are drawn: what is asked is which runs are left.
FEW = ("sweep.walk.steps=3", 'sweep.strategies=["follow"]', 'sweep.zoom_limits=["none", 2.0]', "sweep.trials=12")


def test_a_bank_leaves_the_failed_view_out_with_both_its_renders(monkeypatch, capsys):
    """The other views stay; where too few cameras are left, nothing can be judged."""
    scene, design = scenes.load(ROOM_FILE), BankDesign(settings=2, turns=2)
    training, held_out = training_views(scene, design, "r"), held_out_views(scene, design, "r")
    lost = held_out.views[3]
    acquired = Acquired(failed={lost.renders[1].request.key: CAUSE})
    monkeypatch.setattr(ViewSource, "acquire", lambda source, requested: acquired)
    messages = RunMessages(quiet=True)
    found, (kept_training, kept) = acquire_banks([training, held_out], ViewSource(None, "", None, messages))
    assert found is acquired
    assert kept_training.views == training.views
    assert kept.views == held_out.views[:3] + held_out.views[4:]
    assert enough(kept_training, kept, 4, messages)
    output = capsys.readouterr().err
    assert CAUSE in output
    assert "room, held out: 1 of 14 views left out" in output
    assert not enough(training, held_out, len(scene.cameras) + 1, messages)
    assert not enough(training.without([v.renders[0].request.key for v in training.views]), held_out, 4, messages)
    assert "no tables of room" in capsys.readouterr().err


class _Scene:
    """As much of a scene as drawing detections takes."""

    def __init__(self, scene, state):
        self.state, self.noise_models = state, scene.noise_models


def _acquired(requested_views, failed):
    scene = scenes.load(load_schedule("hallway").scene_path)
    found = acquired_of([(_Scene(scene, item.request.state), [item]) for item in requested_views])
    found.failed = dict.fromkeys(failed, CAUSE)
    found.measured = {i: m for i, m in found.measured.items() if i.request.key not in found.failed}
    return found


@pytest.mark.acceptance
@pytest.mark.parametrize("which", ["none", "of one run", "of every run"])
def test_a_schedule_leaves_out_the_runs_that_need_a_failed_view(tmp_path, monkeypatch, capsys, which):
    """The other run's tables are there, and the exit code tells; a view that all need leaves none, and that is said."""
    designs, design_of = [], path.design_of

    def remembered(*arguments):
        designs.append(design_of(*arguments))
        return designs[-1]

    def acquire(source, requested_views):
        (design,) = designs
        free, held_back = ({item.request.key for views in of_run for item in views} for of_run in design.views)
        chosen_keys = {"none": set(), "of one run": held_back - free, "of every run": held_back & free}[which]
        assert which == "none" or chosen_keys
        return _acquired(requested_views, sorted(chosen_keys)[:1])

    monkeypatch.setattr(path, "design_of", remembered)
    monkeypatch.setattr(ViewSource, "acquire", acquire)
    monkeypatch.setattr(schedule, "view_rows", lambda *_: [])  # asks for certificates, which no drawn view has
    monkeypatch.setattr(schedule, "_draw", lambda *_: None)
    of_run = StepOptions(store=str(tmp_path / "store"), set=FEW, quiet=True)
    code = schedule.execute(Schedule(out=tmp_path / "out", real_walk=False, report=False, run=of_run))
    printed = capsys.readouterr()
    output = json.loads((tmp_path / "out" / "run.json").read_text())
    assert code == (EXIT_DONE if which == "none" else EXIT_FAILED)
    assert printed.out.count("\n") == 1
    assert str(tmp_path / "out") in printed.out
    assert bool(printed.err) == (which != "none")
    assert list(output["failed"].values()) == [CAUSE] * (which != "none")
    labels = {"none": ["follow none", "follow x2"], "of one run": ["follow none"], "of every run": []}[which]
    if not labels:
        assert "no tables" in printed.err
        assert output["tables"] == []
        assert not (tmp_path / "out" / "runs.csv").exists()
        return
    table = (tmp_path / "out" / "configurations.csv").read_text()
    assert [label for label in ("follow none", "follow x2") if f"{label} step" in table] == labels
    assert ("run 'follow x2': left out" in printed.err) == (which == "of one run")
