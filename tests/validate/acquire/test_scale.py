"""Views made by worker processes: the same numbers from any number of them, whatever dies on the way."""

from __future__ import annotations

import dataclasses
import pickle
import subprocess
import sys

import numpy as np
import pytest

import validate.acquire.dask_workers as dask_workers
from pss import MissingLibraryError, PSSError, RangeError
from render import backend
from render.keys import light_key, state_key
from render.store.folder import Store, StoreError
from tests.helpers.processes import environment
from tests.helpers.scaled import PLACE, Heard, some_views, well
from validate.acquire import options
from validate.acquire.checks import WorkerReport, misfit, report
from validate.acquire.dask_workers import WorkerGoneError, workers_of
from validate.acquire.handout import MOST_DEATHS
from validate.acquire.job import Made
from validate.acquire.options import HERE, Scale
from validate.acquire.request import Acquired
from validate.acquire.run_jobs import hand_out
from validate.run_sweep import main


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
