"""Views made by worker processes: the same numbers from any number of them, whatever dies on the way."""

from __future__ import annotations

import contextlib
import dataclasses
import json
import os
import pickle
import signal
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest
from dask.system import CPU_COUNT
from rich.console import Console

import scenes
import validate.acquire.dask_workers as dask_workers
from pss import MissingLibraryError, PSSError, RangeError
from render import backend
from render.keys import light_key, state_key
from render.lens.sampling import Sampling
from render.renderer import Certificate
from render.store.folder import Store, StoreError
from render.store.light import baked
from tests.helpers.closet import ALONE, DETERMINED, SCENE, SELECTION, SWEEP, command, run
from tests.helpers.processes import environment
from tests.helpers.stored_views import MARKER, REQUEST
from validate.acquire import options
from validate.acquire.acquire import acquire
from validate.acquire.checks import WorkerReport, misfit, report
from validate.acquire.dask_workers import WorkerGoneError, workers_of
from validate.acquire.handout import MOST_DEATHS
from validate.acquire.job import Made, Place
from validate.acquire.options import HERE, Scale
from validate.acquire.request import Acquired, Acquisition, views_of
from validate.acquire.run_jobs import hand_out
from validate.run_sweep import main
from validate.runs.progress import ViewProgress

PLACE = Place("store", "llvm_ad_mono", REQUEST.renderer, 1)
CERTIFICATE = Certificate(0.1, 0.1, 0.1, 0.1, 0.1, 1, 0.0)
# s, for processes to be gone: what a user who has pressed Ctrl-C waits.
SECONDS_TO_STOP = 20
# s, of all that runs in processes of its own, on a machine that has other things to do.
SECONDS_AT_MOST = 400


def some_views(states=2, views=3, trials=(2,)):
    """Views of several scene states, each measured with each number of trials."""
    found = []
    for number in range(states):
        state = dataclasses.replace(REQUEST.state, markers=(dataclasses.replace(MARKER, id=number),))
        for zoom in range(1, views + 1):
            camera = dataclasses.replace(REQUEST.camera, name=f"{number}-{zoom}", zoom=1 + zoom / 10)
            request = dataclasses.replace(REQUEST, state=state, camera=camera)
            found += [Acquisition(request, 1, count) for count in trials]
    return found


class Heard(ViewProgress):
    """Keeps what it is told."""

    def __init__(self, total):
        super().__init__(total, Console(quiet=True))
        self.advanced, self.notes = [], []

    def advance(self, what):
        """One more."""
        super().advance(what)
        self.advanced.append(what)

    def note(self, what):
        """What is going on."""
        self.notes.append(what)


class WorkersOfNobody:
    """Workers that are names: what becomes of their jobs is drawn, or decided by `fate(address, job, state)`."""

    def __init__(self, number, fate, rng):
        self.addresses = {f"worker {n}" for n in range(number)}
        self.fate, self.rng = fate, rng
        self.under_way, self.has, self.jobs = {}, {}, []
        self.born = number

    def live(self):
        """Those that have not died."""
        return set(self.addresses)

    def busy(self):
        """Those with a job."""
        return set(self.under_way)

    def start(self, address, job, state):
        """One job at a time, and never one of a state that the worker was not sent."""
        assert address in self.addresses
        assert address not in self.under_way
        if state is not None:
            assert state_key(pickle.loads(state)) == job.state
            self.has[address] = job.state
        assert self.has[address] == job.state
        self.jobs.append(job)
        self.under_way[address] = job

    def finished(self, timeout_s):
        """In any order; a worker that dies is replaced by one of another name."""
        for address in self.rng.permutation(sorted(self.under_way)).tolist()[: 1 + self.rng.integers(2)]:
            job = self.under_way.pop(address)
            made = self.fate(address, job)
            if isinstance(made, WorkerGoneError):
                self.addresses.remove(address)
                self.addresses.add(f"worker {self.born}")
                self.born += 1
            if isinstance(made, Made) and made.lacks_state:
                del self.has[address]
            yield address, job, made


def well(address, job):
    """What comes of a job in which nothing goes wrong."""
    return Made("", CERTIFICATE, 0.5, (0.25,) * len(job.measurings)) if job.camera else Made()


def handed_out(requested, number, fate, tmp_path, seed=0):
    """Hand out the jobs of `requested` to workers of nobody; what came of it, what was heard, and the workers."""
    acquired, heard = Acquired(), Heard(len(requested))
    workers = WorkersOfNobody(number, fate, np.random.default_rng(seed))
    hand_out(requested, PLACE, workers, Store(tmp_path), heard, acquired)
    assert len(heard.advanced) == len(requested)
    return acquired, heard, workers


@pytest.mark.parametrize("number", [1, 2, 3, 7, 40])
@pytest.mark.parametrize("seed", range(5))
def test_any_number_of_workers_makes_every_view_once_and_every_light_before_its_views(number, seed, tmp_path):
    requested = some_views(states=4, views=5, trials=(2, 3))
    acquired, heard, workers = handed_out(requested, number, well, tmp_path, seed)
    assert acquired.failed == {}
    assert acquired.measured_items == set(requested)
    assert acquired.rendered == len(acquired.certificates) == len(acquired.render_seconds) == 20
    views = [job.view for job in workers.jobs if job.camera]
    assert sorted(views) == sorted({item.request.key for item in requested})
    lights = [job.state for job in workers.jobs if job.camera is None]
    assert len(lights) == len(set(lights)) == 4
    for number, job in enumerate(workers.jobs):
        if job.camera:
            assert any(earlier.state == job.state for earlier in workers.jobs[:number] if earlier.camera is None)
    assert set(heard.advanced) == {f"measured camera {item.request.camera.name}" for item in requested}
    assert "solving the scene's light" in heard.notes


def test_stored_light_is_not_solved_again(tmp_path):
    requested = some_views(states=2)
    store = Store(tmp_path)
    store.save(store.light(light_key(requested[0].request.state)), {"x": np.zeros(1)})
    _, _, workers = handed_out(requested, 2, well, tmp_path)
    assert [job.state for job in workers.jobs if job.camera is None] == [state_key(requested[-1].request.state)]


def test_a_worker_stays_with_a_scene_state_while_it_has_views(tmp_path):
    """Two workers, two states: each is sent one state only, until it helps the other with what is left."""
    requested = some_views(states=2, views=10)
    _, _, workers = handed_out(requested, 2, well, tmp_path, seed=3)
    first = [job.state for job in workers.jobs[:8]]
    assert len(set(first)) == 2
    assert len(set(workers.has)) == 2


@pytest.mark.parametrize("seed", range(20))
def test_workers_that_die_by_chance_cost_no_view(seed, tmp_path):
    """As long as none has a job that is done by nobody, one dies at every fourth job."""
    rng, deaths = np.random.default_rng(seed), {}

    def fate(address, job):
        known = deaths.setdefault((job.state, job.view), [])
        if len(known) < MOST_DEATHS - 1 and rng.random() < 0.25:
            known.append(address)
            return WorkerGoneError(address)
        return well(address, job)

    requested = some_views(states=3, views=4)
    acquired, _, workers = handed_out(requested, 3, fate, tmp_path, seed)
    assert acquired.failed == {}
    assert acquired.measured_items == set(requested)
    assert len(workers.jobs) == 3 * 5 + sum(map(len, deaths.values()))


def test_a_view_that_kills_its_worker_three_times_has_failed_and_no_other(tmp_path):
    requested = some_views(states=2, views=4)
    deadly = requested[1].request.key

    def fate(address, job):
        return WorkerGoneError(address) if job.view == deadly else well(address, job)

    acquired, heard, workers = handed_out(requested, 3, fate, tmp_path)
    assert acquired.failed == {deadly: "3 workers died while they made it"}
    assert [job.view for job in workers.jobs].count(deadly) == MOST_DEATHS == 3
    assert len(acquired.measured_items) == len(requested) - 1
    assert heard.advanced.count("failed") == 1


@pytest.mark.parametrize("kills", [False, True])
def test_light_that_cannot_be_solved_fails_the_views_of_its_state_alone(kills, tmp_path):
    requested = some_views(states=3, views=2)
    dark = state_key(requested[2].request.state)

    def fate(address, job):
        if job.camera or job.state != dark:
            return well(address, job)
        return WorkerGoneError(address) if kills else Made(failed="MemoryError: no room")

    acquired, _, workers = handed_out(requested, 2, fate, tmp_path)
    cause = "3 workers died while they made it" if kills else "MemoryError: no room"
    assert set(acquired.failed) == {item.request.key for item in requested[2:4]}
    assert set(acquired.failed.values()) == {f"the scene's light cannot be solved: {cause}"}
    assert [job.state for job in workers.jobs if job.camera is None].count(dark) == (3 if kills else 1)


def test_a_failing_view_fails_alone_and_a_full_disk_ends_the_run(tmp_path):
    requested = some_views(states=1, views=4)
    key = requested[0].request.key

    def fails(address, job):
        return Made(failed="RuntimeError: no such mesh") if job.view == key else well(address, job)

    acquired, _, _ = handed_out(requested, 2, fails, tmp_path)
    assert acquired.failed == {key: "RuntimeError: no such mesh"}

    def full(address, job):
        return StoreError("the disk is full") if job.view == key else well(address, job)

    with pytest.raises(StoreError, match="the disk is full"):
        handed_out(requested, 2, full, tmp_path)


def test_a_worker_that_another_run_has_sent_a_state_is_sent_it_again(tmp_path):
    """Workers of a cluster keep one state: who was sent another in between says so, and nothing is counted."""
    printed_text = []

    def fate(address, job):
        if len(printed_text) < 5:
            printed_text.append(job)
            return Made(lacks_state=True)
        return well(address, job)

    requested = some_views(states=2, views=3)
    acquired, _, _ = handed_out(requested, 2, fate, tmp_path)
    assert acquired.failed == {}
    assert acquired.measured_items == set(requested)


def test_a_job_carries_no_scene(tmp_path):
    """A job is under 4 kB whatever the scene: the state, up to megabytes of meshes, goes beside it and once."""
    requested = some_views(states=1, views=1)
    _, _, workers = handed_out(requested, 1, well, tmp_path)
    assert max(len(pickle.dumps(job)) for job in workers.jobs) < 4000


# ---- the options -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scale", "words"),
    [
        (Scale(workers=0), "--workers 0; allowed: 1 or more"),
        (Scale(workers=2, cluster="tcp://127.0.0.1:1"), "allowed: one of the two"),
        (Scale(cluster="somewhere"), "--cluster somewhere; allowed: an address such as"),
    ],
)
def test_what_is_not_allowed_is_one_line(scale, words):
    with pytest.raises(RangeError, match=words):
        scale.check()


@pytest.mark.parametrize("scale", [Scale(workers=2), Scale(cluster="tcp://127.0.0.1:1")])
def test_without_dask_one_line_says_what_to_install_and_one_process_needs_none(scale, monkeypatch):
    monkeypatch.setattr(options.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(MissingLibraryError, match=r"pip install 'pss-testbed\[dask\]'"):
        scale.check()
    HERE.check()


def test_the_modules_of_a_run_in_one_process_load_no_dask():
    """It is an extra; asked in a process of its own."""
    script = "import validate.acquire.acquire, validate.acquire.options, sys; print('dask' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", script], env=environment(), capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


@pytest.mark.parametrize("words", [["zoom"], ["bank"], ["schedule"]], ids=lambda words: words[0])
def test_all_commands_share_the_options(words, capsys):
    """Refused by each in the same words, before anything is rendered."""
    assert main([*words, "--workers", "0"]) == 2
    assert "--workers 0; allowed: 1 or more" in capsys.readouterr().err


def test_no_scheduler_at_the_address_is_one_line(monkeypatch):
    monkeypatch.setattr(dask_workers, "SECONDS_TO_ANSWER", 0.2)
    with (
        pytest.raises(PSSError, match="no Dask scheduler answers there"),
        workers_of(Scale(cluster="tcp://127.0.0.1:9")),
    ):
        pass


def test_a_worker_that_does_not_fit_is_named_in_one_line(tmp_path):
    (tmp_path / "small").write_text("seen")
    chosen = backend.choose()
    own = report(str(tmp_path), "small", chosen.variant)
    assert own.renderer == chosen.identity
    assert misfit("tcp://a:1", own, own, "store") == ""
    wrong = {
        "does not see the store": dataclasses.replace(own, read="FileNotFoundError"),
        "cannot write the store": dataclasses.replace(own, writable=False),
        "renders with mitsuba-0": dataclasses.replace(own, renderer="mitsuba-0"),
        r"has numpy 1 \(here": dataclasses.replace(own, versions=own.versions | {"numpy": "1"}),
        "runs other code of this project": dataclasses.replace(own, code="0"),
        "have this project installed": ModuleNotFoundError("No module named 'validate'"),
    }
    import re

    for words, answer in wrong.items():
        line = misfit("tcp://a:1", answer, own, "store")
        assert re.search(words, line), line
        assert line.startswith("worker tcp://a:1")
        assert "\n" not in line
    assert isinstance(own, WorkerReport)
    assert report(str(tmp_path), "other", chosen.variant).read == "FileNotFoundError"


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
