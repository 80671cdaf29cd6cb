"""What a dry run says, against what is in the store and what a run then does."""

from __future__ import annotations

import dataclasses
import io
import json
import re

import pytest
from rich.console import Console

from render import backend
from render.lens.sampling import Sampling
from render.store.checksums import sum_path
from render.store.folder import Store
from render.store.views import save_view
from tests.helpers.closet import ALONE, SCENE
from tests.helpers.stored_views import REQUEST, VIEW, ZOOMS, no_progress
from validate.acquire import forecast as dry_run
from validate.acquire.acquire import acquire
from validate.acquire.forecast import LEAST_KNOWN, announce, forecast
from validate.acquire.messages import RunMessages
from validate.acquire.options import HERE, Scale
from validate.acquire.source import ViewSource
from validate.acquire.view_costs import USUAL_RATIO, measure_seconds, render_seconds
from validate.run_sweep import main
from validate.runs.progress import EXPECTED_LIGHT_SECONDS, EXPECTED_MEASURE_SECONDS, EXPECTED_SECONDS

WORKERS = 2
# Between bytes or seconds that were foreseen at documented rates and those of a run: the closet's views are a sixteenth
# as large as those that the rates are of, and a small scene's light is solved in no time.
FORESEEN_BYTES, FORESEEN_SECONDS = 2.0, 15.0
# Of a view of 48 megapixels, measured on two cores; another scene's edges take up to twice as long, or half.
MEASURED_S, MEASURED_BYTES, WITHIN = 66.0, 7.0e9, 2.0
# CPU seconds at the sweeps' bound by the fit, and how far the fit lies off the four that it is of.
CPU_S_AT_USUAL, FITTED = 3.52, 0.1


def test_counts_are_those_of_the_store(requested, tmp_path):
    """Before a run, after one, and with an image and a measurement gone; nothing is written."""
    store, renderer = Store(tmp_path / "store"), requested[0].request.renderer
    before = forecast([*requested, requested[0]], store, renderer, WORKERS)
    assert (before.views, before.to_render, before.to_measure, before.to_light) == (3, 3, 3, 1)
    assert not store.folder.exists()
    assert before.past_views == 0
    trials = requested[0].trials
    view_s, capture_s = (
        render_seconds(VIEW.radiance.size, REQUEST.sampling.noise_ratio),
        measure_seconds(VIEW.radiance.size),
    )
    assert before.seconds == pytest.approx(EXPECTED_LIGHT_SECONDS + len(ZOOMS) * view_s)
    acquire(requested, store, None, no_progress)
    after = forecast(requested, store, renderer, WORKERS)
    assert (after.rendered, after.measured, after.to_render, after.to_measure, after.to_light) == (3, 3, 0, 0, 0)
    assert (after.seconds, after.needed_bytes) == (0, 0)
    store.view(requested[0].request.key).unlink()
    requested[1].task(store).path.unlink()
    gone = forecast(requested, store, renderer, WORKERS)
    assert (gone.to_render, gone.to_measure, gone.to_light) == (1, 1, 0)
    assert gone.seconds == pytest.approx(view_s + trials * capture_s / WORKERS)


def test_rates_are_those_of_the_stores_own_views(requested, tmp_path):
    """Of the same renderer and as many pixels, and of no others."""
    store, renderer, size = Store(tmp_path / "store"), REQUEST.renderer, VIEW.radiance.size
    for number in range(LEAST_KNOWN):
        request = dataclasses.replace(REQUEST, camera=dataclasses.replace(REQUEST.camera, zoom=4 + 0.1 * number))
        save_view(store, dataclasses.replace(VIEW, key=request.key, camera=request.camera), request, 40.0 + number)
    assert VIEW.radiance.size == REQUEST.camera.resolution[0] * REQUEST.camera.resolution[1] == size
    sizes = [path.stat().st_size for path in store.folder.rglob("*.exr")]
    output = forecast(requested, store, renderer, WORKERS)
    assert output.past_views == LEAST_KNOWN
    assert output.seconds == pytest.approx(EXPECTED_LIGHT_SECONDS + 3 * 42.0)
    images = output.needed_bytes - dry_run.LIGHT_BYTES - 3 * dry_run.MEASUREMENT_BYTES
    assert images == pytest.approx(3 * sum(sizes) / len(sizes), abs=1)
    assert forecast(requested, store, "another renderer", WORKERS).past_views == 0
    sum_path(next(store.folder.rglob("*.exr"))).unlink()
    assert forecast(requested, store, renderer, WORKERS).past_views == 0


def test_a_disk_that_is_too_small_is_said(requested, tmp_path, monkeypatch):
    """On standard error, with both numbers."""
    chosen = backend.Backend("scalar_rgb", "", 0, "as requested")
    messages = RunMessages()
    messages.console, messages.errors = Console(file=io.StringIO(), width=200), Console(file=io.StringIO(), width=200)
    for free, warned in ((10**12, False), (10_000, True)):
        monkeypatch.setattr(dry_run, "free_bytes", lambda path, free=free: free)
        source = ViewSource(Store(tmp_path), str(tmp_path), chosen, messages)
        announce(["two configurations"], requested, source, tmp_path / "out")
        assert ("too small" in messages.errors.file.getvalue()) == warned
    output = messages.console.file.getvalue()
    for words in ("two configurations", "3 to render (0 stored)", "light of 1 scene states", "scalar_rgb", "0 MB free"):
        assert words in output


def of_size(requested, width, height):
    """The same views by cameras of so many pixels, with the sweeps' bound on sampling noise."""
    found = []
    for item in requested:
        camera = dataclasses.replace(item.request.camera, resolution=(width, height))
        request = dataclasses.replace(item.request, camera=camera, sampling=Sampling(noise_ratio=USUAL_RATIO))
        found.append(dataclasses.replace(item, request=request))
    return found


def test_time_and_memory_grow_with_the_pixels(requested, tmp_path):
    """48 megapixels were 'about 0:22' for five views, as any size was; measured are 66 s and 7.0 GB a view."""
    store = Store(tmp_path / "store")
    small, large = (forecast(of_size(requested, *size), store, "none", WORKERS) for size in ((1280, 960), (8000, 6000)))
    a_view = (large.seconds - EXPECTED_LIGHT_SECONDS) / len(requested)
    assert MEASURED_S / WITHIN < a_view < MEASURED_S * WITHIN
    assert MEASURED_BYTES / WITHIN < large.render_bytes < MEASURED_BYTES * WITHIN
    assert small.seconds < large.seconds / 5
    assert large.measure_bytes > 5 * small.measure_bytes
    assert render_seconds(1280 * 960) == pytest.approx(EXPECTED_SECONDS)
    assert measure_seconds(1280 * 960) == pytest.approx(EXPECTED_MEASURE_SECONDS)


@pytest.mark.parametrize(("ratio", "cpu_s"), [(1, 3.0), (0.5, 3.6), (0.25, 5.1), (0.1, 11.6)])
def test_time_grows_with_the_samples_as_the_benchmarks_do(ratio, cpu_s):
    """CPU seconds of benchmarks/README.md, of which the part that pixels share is reckoned with."""
    pixels = 1280 * 960
    shared = (
        CPU_S_AT_USUAL
        * (render_seconds(pixels, ratio) - render_seconds(0))
        / (render_seconds(pixels) - render_seconds(0))
    )
    assert shared == pytest.approx(cpu_s, rel=FITTED)


@pytest.mark.parametrize("scale", [HERE, Scale(workers=2)])
def test_memory_that_is_too_small_is_said(requested, tmp_path, monkeypatch, scale):
    """The dry run states what is needed and what there is, and warns if that is less."""
    chosen = backend.Backend("scalar_rgb", "", 0, "as requested")
    messages = RunMessages()
    messages.console, messages.errors = Console(file=io.StringIO(), width=200), Console(file=io.StringIO(), width=200)
    large = of_size(requested, 8000, 6000)
    for machine, warned in ((10**12, False), (0, False), (6 * 10**9, True)):
        monkeypatch.setattr(dry_run, "machine_bytes", lambda machine=machine: machine)
        source = ViewSource(Store(tmp_path), str(tmp_path), chosen, messages, scale)
        announce(["two"], large, source, tmp_path / "out")
        assert ("memory is too small" in messages.errors.file.getvalue()) == warned
    output = messages.console.file.getvalue()
    assert "memory: about 8.4 GB " in output
    assert "this machine has 6.0 GB" in output
    assert ("measuring processes" in output) == (scale == HERE)


@pytest.mark.render
@pytest.mark.acceptance
def test_a_run_does_what_the_dry_run_said(tmp_path, capsys):
    """A sweep of two views, from nothing."""
    for name, text in (("closet", SCENE), ("alone", ALONE)):
        (tmp_path / f"{name}.toml").write_text(text)
    arguments = [str(tmp_path / "alone.toml"), "--store", str(tmp_path / "store"), "--out", str(tmp_path / "out")]
    assert main([*arguments, "--dry-run"]) == 0
    output = capsys.readouterr().out
    assert not (tmp_path / "store").exists()
    assert not (tmp_path / "out").exists()
    renders, measures = re.search(r"(\d+) to render .*, (\d+) to measure", output).groups()
    minutes, seconds, megabytes = map(float, re.search(r"about (\d+):(\d+) and ([\d,]+) MB", output).groups())
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
