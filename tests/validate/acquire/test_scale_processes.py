"""Views made by several processes: real ones, which die, are interrupted, or belong to a scheduler."""

from __future__ import annotations

import contextlib
import json
import os
import pickle
import signal
import subprocess
import sys
import time

import psutil
import pytest
from dask.system import CPU_COUNT

import scenes
import validate.acquire.dask_workers as dask_workers
from render import backend
from render.keys import light_key
from render.lens.sampling import Sampling
from render.store.folder import Store
from render.store.light import baked
from tests.helpers.closet import ALONE, DETERMINED, SCENE, SELECTION, SWEEP, command, run
from tests.helpers.processes import environment
from tests.helpers.scaled import PLACE, SECONDS_AT_MOST, SECONDS_TO_STOP, Heard, some_views, well
from validate.acquire.acquire import acquire
from validate.acquire.dask_workers import workers_of
from validate.acquire.options import HERE, Scale
from validate.acquire.request import Acquired, views_of
from validate.acquire.run_jobs import hand_out

# ---- real processes --------------------------------------------------------------------------------------------------


def deadly_call(job, state):
    """In the place of the real one: cameras named "0-2" kill their worker, the others render nothing."""
    job = pickle.loads(job)
    if job.camera is not None and job.camera.name == "0-2":
        os.kill(os.getpid(), signal.SIGKILL)
    return well("", job)


def _ignores_interrupts():
    """Of a worker: whether Ctrl-C does nothing, and was held back before anything was imported."""
    blocked = signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])
    return blocked and signal.getsignal(signal.SIGINT) == signal.SIG_IGN


def children(process):
    """Processes of Dask below one; those that only watch over shared memory end with it by themselves."""
    with contextlib.suppress(psutil.NoSuchProcess):
        found = psutil.Process(process).children(recursive=True)
        return [each for each in found if each.is_running() and "resource_tracker" not in " ".join(cmdline(each))]
    return []


def cmdline(process):
    """Of a process that may be gone."""
    try:
        return process.cmdline()
    except psutil.Error:
        return []


@pytest.mark.slow
def test_processes_that_die_are_started_again_and_none_is_left(monkeypatch, tmp_path):
    """The view that kills three workers fails alone; the others are made, and afterwards no process is there."""
    monkeypatch.setattr(dask_workers, "call", deadly_call)
    requested = some_views(states=2, views=3)
    acquired, heard = Acquired(), Heard(len(requested))
    before = {each.pid for each in children(os.getpid())}
    with workers_of(Scale(workers=2)) as workers:
        assert workers.cores == max(1, CPU_COUNT // 2)
        started = {each.pid for each in children(os.getpid())} - before
        assert len(started) == 2
        (held,) = set(workers.client.run(_ignores_interrupts).values())
        assert held
        hand_out(requested, PLACE, workers, Store(tmp_path), heard, acquired)
    assert acquired.failed == {requested[1].request.key: "3 workers died while they made it"}
    assert acquired.measured_items == {item for item in requested if item.request.camera.name != "0-2"}
    assert {each.pid for each in children(os.getpid())} <= before


@pytest.mark.render
def test_two_workers_measure_what_one_process_does(tmp_path):
    """To the last bit: what was measured, and what the views say of themselves."""
    (tmp_path / "closet.toml").write_text(SCENE)
    scene = scenes.load(tmp_path / "closet.toml")
    chosen = backend.choose()
    requested = views_of(scene, scene.cameras[:2], Sampling(noise_ratio=0.6), chosen.identity, 3, 2)
    light = Store(tmp_path / "one").light(light_key(scene.state))
    baked(scene.state, Store(tmp_path / "one"), chosen)
    Store(tmp_path / "two").save(
        tmp_path / "two" / light.relative_to(tmp_path / "one"), Store(tmp_path / "one").load(light)
    )
    found = {
        name: acquire(requested, Store(tmp_path / name), chosen, Heard, scale)
        for name, scale in {"one": HERE, "two": Scale(workers=2)}.items()
    }
    for acquired in found.values():
        assert acquired.failed == {}
        assert acquired.rendered == len(acquired.measured_items) == len(requested)
        assert list(acquired.measured) == list(requested)
    one, two = found["one"], found["two"]
    assert any(measured.detected.any() for measured in one.measured.values())
    for item in requested:
        assert one.measured[item].pixels.tobytes() == two.measured[item].pixels.tobytes()
        assert one.measured[item].covariance.tobytes() == two.measured[item].covariance.tobytes()
    assert repr(one.certificates) == repr({key: two.certificates[key] for key in one.certificates})


# ---- whole runs ------------------------------------------------------------------------------------------------------

acceptance = pytest.mark.acceptance
SWEEPS = ("zooming.toml", "pairs.toml", "alone.toml")


@pytest.fixture(scope="module")
def closet(tmp_path_factory):
    """A folder with three sweeps, and what they give in one process."""
    folder = tmp_path_factory.mktemp("scale")
    for name, text in (("closet", SCENE), ("zooming", SWEEP), ("pairs", SELECTION), ("alone", ALONE)):
        (folder / f"{name}.toml").write_text(text)
    result = run(folder, *SWEEPS, "--out", "first")
    assert result.returncode == 0, result.stderr
    return folder


def same_tables(closet, folder):
    """Every table that is determined has the bytes of the run in one process."""
    for table in DETERMINED:
        assert (closet / "first" / table).read_bytes() == (closet / folder / table).read_bytes(), table


@contextlib.contextmanager
def running(folder, *arguments):
    """A process of its own session, which is ended with all its processes."""
    process = subprocess.Popen(
        arguments,
        cwd=folder,
        env=environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        yield process
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def wait_until(what, process):
    """Wait for something to become true while a process runs."""
    deadline = time.monotonic() + SECONDS_AT_MOST
    while not (found := what()) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.05)
    assert found, process.communicate(timeout=SECONDS_TO_STOP)[1] if process.poll() is not None else "too late"
    return found


def scaled(closet, name, *arguments):
    """The command line of a run with a store of its own."""
    line = command(closet, *SWEEPS, "--out", f"out-{name}", *map(str, arguments))
    line[line.index("--store") + 1] = str(closet / f"store-{name}")
    return line


@acceptance
@pytest.mark.render
@pytest.mark.parametrize("number", [1, 2, 4])
def test_any_number_of_workers_leaves_the_same_tables(closet, number):
    name = f"{number}-workers"
    with running(closet, *scaled(closet, name, "--workers", number)) as process:
        output, errors = process.communicate(timeout=SECONDS_AT_MOST)
    assert process.returncode == 0, errors
    assert "8 views (8 rendered, 10 measured now)" in output
    assert "views 10/10" in errors
    same_tables(closet, f"out-{name}")


@acceptance
@pytest.mark.render
def test_workers_killed_during_the_run_change_nothing(closet):
    """One process is killed as soon as views are made, and another when some are there."""
    with running(closet, *scaled(closet, "killed", "--workers", 2)) as process:
        for views in (1, 3):
            wait_until(lambda views=views: len(list((closet / "store-killed").rglob("*.exr"))) >= views, process)
            victim = wait_until(lambda: children(process.pid), process)[0]
            victim.kill()
        output, errors = process.communicate(timeout=SECONDS_AT_MOST)
    assert process.returncode == 0, errors
    assert "Traceback" not in errors
    assert "failed" not in errors
    assert "8 views (" in output
    same_tables(closet, "out-killed")


@acceptance
@pytest.mark.render
@pytest.mark.parametrize("after", ["workers", "views"])
def test_an_interrupt_ends_all_processes_and_leaves_no_unfinished_file(closet, after):
    """Ctrl-C, which reaches the whole group, while workers start or render; the next run goes on from there."""
    name = f"cut-{after}"
    with running(closet, *scaled(closet, name, "--workers", 2)) as process:
        if after == "views":
            wait_until(lambda: whole_views_of(closet / f"store-{name}"), process)
        started = wait_until(lambda: children(process.pid), process)
        os.killpg(process.pid, signal.SIGINT)
        _, errors = process.communicate(timeout=SECONDS_TO_STOP)
        assert process.returncode == 130, errors
        assert "Traceback" not in errors
        gone, left = psutil.wait_procs(started, timeout=1)
        # What nobody has asked for yet has ended all the same.
        assert not [each for each in left if each.status() != psutil.STATUS_ZOMBIE], gone
    assert not [path for path in (closet / f"store-{name}").rglob(".*") if path.is_file()]
    kept = len(whole_views_of(closet / f"store-{name}"))
    with running(closet, *scaled(closet, name, "--workers", 2)) as process:
        output, errors = process.communicate(timeout=SECONDS_AT_MOST)
    assert process.returncode == 0, errors
    assert f"({8 - kept} rendered" in output
    same_tables(closet, f"out-{name}")


def whole_views_of(store):
    """Stored views."""
    return [path for path in (store / "views").rglob("*.exr") if not path.name.startswith(".")]


@contextlib.contextmanager
def cluster_on_loopback(folder, number):
    """A scheduler and its workers, each a process group of its own; with the scheduler's address."""
    dask = [sys.executable, "-m", "distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
    file = folder / f"scheduler-{number}.json"
    with contextlib.ExitStack() as stack:
        scheduler = stack.enter_context(running(folder, *dask, "--no-dashboard", "--scheduler-file", str(file)))
        wait_until(file.exists, scheduler)
        worker = [sys.executable, "-m", "distributed.cli.dask_worker", "--scheduler-file", str(file)]
        worker += ["--host", "127.0.0.1", "--nthreads", "1", "--no-dashboard", "--resources", "cores=1"]
        workers = [stack.enter_context(running(folder, *worker)) for _ in range(number)]
        yield json.loads(file.read_text())["address"], scheduler, workers


@acceptance
@pytest.mark.render
def test_a_scheduler_that_runs_already_gives_the_same_tables(closet):
    """A scheduler and two workers on loopback; one of them is killed during the run, and its nanny starts another."""
    with cluster_on_loopback(closet, 2) as (address, scheduler, workers):
        with running(closet, *scaled(closet, "cluster", "--cluster", address)) as process:
            wait_until(lambda: whole_views_of(closet / "store-cluster"), process)
            victim = wait_until(lambda: children(workers[0].pid), process)[0]
            victim.kill()
            output, errors = process.communicate(timeout=SECONDS_AT_MOST)
        assert process.returncode == 0, errors
        assert "8 views (" in output
        assert all(each.poll() is None for each in [scheduler, *workers])
    same_tables(closet, "out-cluster")


@acceptance
@pytest.mark.render
def test_a_scheduler_that_goes_away_ends_the_run_in_one_line(closet):
    """What is made so far is stored, and a run in one process goes on from there."""
    with (
        cluster_on_loopback(closet, 1) as (address, scheduler, _),
        running(closet, *scaled(closet, "alone", "--cluster", address)) as process,
    ):
        wait_until(lambda: whole_views_of(closet / "store-alone"), process)
        os.killpg(scheduler.pid, signal.SIGKILL)
        _, errors = process.communicate(timeout=SECONDS_AT_MOST)
    assert process.returncode == 2, errors
    assert "Traceback" not in errors
    assert "does not answer any more; what is made so far is stored" in errors.splitlines()[-1]
    with running(closet, *scaled(closet, "alone")) as process:
        output, errors = process.communicate(timeout=SECONDS_AT_MOST)
    assert process.returncode == 0, errors
    assert "(8 rendered" not in output
    same_tables(closet, "out-alone")
