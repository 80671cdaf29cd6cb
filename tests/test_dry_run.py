"""What a dry run says, against what is in the store and what a run then does."""

from __future__ import annotations

import dataclasses
import io
import json
import re

import pytest
from rich.console import Console

from render import backend
from tests.test_store_views import REQUEST, VIEW, ZOOMS, no_progress, wanted  # noqa: F401 (a fixture)
from tests.test_sweep_run import ALONE, SCENE
from validate import dry_run
from validate.acquire import acquire
from validate.dry_run import LEAST_KNOWN, announce, forecast
from validate.progress import EXPECTED_LIGHT_SECONDS, EXPECTED_MEASURE_SECONDS, EXPECTED_SECONDS
from validate.run_messages import RunMessages
from validate.run_sweep import main
from validate.store import Store
from validate.stored_views import save_view
from validate.sums import sum_path

WORKERS = 2
# Between bytes or seconds that were foreseen at documented rates and those of a run: the closet's views are a sixteenth
# as large as those that the rates are of, and a small scene's light is solved in no time.
FORESEEN_BYTES, FORESEEN_SECONDS = 2.0, 15.0


def test_counts_are_those_of_the_store(wanted, tmp_path):  # noqa: F811
    """Before a run, after one, and with an image and a measurement gone; nothing is written."""
    store, renderer = Store(tmp_path / "store"), wanted[0].request.renderer
    before = forecast([*wanted, wanted[0]], store, renderer, WORKERS)
    assert (before.views, before.to_render, before.to_measure, before.to_light) == (3, 3, 3, 1)
    assert not store.folder.exists()
    assert before.asked == 0
    trials = wanted[0].trials
    assert before.seconds == pytest.approx(EXPECTED_LIGHT_SECONDS + len(ZOOMS) * EXPECTED_SECONDS)
    acquire(wanted, store, None, no_progress)
    after = forecast(wanted, store, renderer, WORKERS)
    assert (after.rendered, after.measured, after.to_render, after.to_measure, after.to_light) == (3, 3, 0, 0, 0)
    assert (after.seconds, after.needed_bytes) == (0, 0)
    store.view(wanted[0].request.key).unlink()
    wanted[1].task(store).path.unlink()
    gone = forecast(wanted, store, renderer, WORKERS)
    assert (gone.to_render, gone.to_measure, gone.to_light) == (1, 1, 0)
    assert gone.seconds == pytest.approx(EXPECTED_SECONDS + trials * EXPECTED_MEASURE_SECONDS / WORKERS)


def test_rates_are_those_of_the_stores_own_views(wanted, tmp_path):  # noqa: F811
    """Of the same renderer and as many pixels, and of no others."""
    store, renderer, size = Store(tmp_path / "store"), REQUEST.renderer, VIEW.radiance.size
    for number in range(LEAST_KNOWN):
        request = dataclasses.replace(REQUEST, camera=dataclasses.replace(REQUEST.camera, zoom=4 + 0.1 * number))
        save_view(store, dataclasses.replace(VIEW, key=request.key, camera=request.camera), request, 40.0 + number)
    assert VIEW.radiance.size == REQUEST.camera.resolution[0] * REQUEST.camera.resolution[1] == size
    sizes = [path.stat().st_size for path in store.folder.rglob("*.exr")]
    said = forecast(wanted, store, renderer, WORKERS)
    assert said.asked == LEAST_KNOWN
    assert said.seconds == pytest.approx(EXPECTED_LIGHT_SECONDS + 3 * 42.0)
    images = said.needed_bytes - dry_run.LIGHT_BYTES - 3 * dry_run.MEASUREMENT_BYTES
    assert images == pytest.approx(3 * sum(sizes) / len(sizes), abs=1)
    assert forecast(wanted, store, "another renderer", WORKERS).asked == 0
    sum_path(next(store.folder.rglob("*.exr"))).unlink()
    assert forecast(wanted, store, renderer, WORKERS).asked == 0


def test_a_disk_that_is_too_small_is_said(wanted, tmp_path, monkeypatch):  # noqa: F811
    """On standard error, with both numbers."""
    chosen = backend.Backend("scalar_rgb", "", 0, "as asked")
    messages = RunMessages()
    messages.console, messages.errors = Console(file=io.StringIO(), width=200), Console(file=io.StringIO(), width=200)
    for free, warned in ((10**12, False), (10_000, True)):
        monkeypatch.setattr(dry_run, "free_bytes", lambda path, free=free: free)
        announce(["two configurations"], wanted, Store(tmp_path), str(tmp_path), chosen, tmp_path / "out", messages)
        assert ("too small" in messages.errors.file.getvalue()) == warned
    said = messages.console.file.getvalue()
    for words in ("two configurations", "3 to render (0 stored)", "light of 1 scene states", "scalar_rgb", "0 MB free"):
        assert words in said


@pytest.mark.render
@pytest.mark.acceptance
def test_a_run_does_what_the_dry_run_said(tmp_path, capsys):
    """A sweep of two views, from nothing."""
    for name, text in (("closet", SCENE), ("alone", ALONE)):
        (tmp_path / f"{name}.toml").write_text(text)
    arguments = [str(tmp_path / "alone.toml"), "--store", str(tmp_path / "store"), "--out", str(tmp_path / "out")]
    assert main([*arguments, "--dry-run"]) == 0
    said = capsys.readouterr().out
    assert not (tmp_path / "store").exists()
    assert not (tmp_path / "out").exists()
    renders, measures = re.search(r"(\d+) to render .*, (\d+) to measure", said).groups()
    minutes, seconds, megabytes = map(float, re.search(r"about (\d+):(\d+) and ([\d,]+) MB", said).groups())
    assert main(arguments) == 0
    run = json.loads((tmp_path / "out" / "run.json").read_text())
    assert (run["rendered"], run["measured"]) == (int(renders), int(measures))
    bytes_now = sum(path.stat().st_size for path in (tmp_path / "store").rglob("*") if path.is_file())
    assert bytes_now / FORESEEN_BYTES < 1e6 * (megabytes + 0.5)
    assert 1e6 * (megabytes - 0.5) < bytes_now * FORESEEN_BYTES
    foreseen = 60 * minutes + seconds
    assert run["seconds"]["views"] / FORESEEN_SECONDS < foreseen < run["seconds"]["views"] * FORESEEN_SECONDS
    assert main([*arguments, "--dry-run"]) == 0
    assert "nothing to do" in capsys.readouterr().out
