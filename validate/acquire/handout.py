"""Which job a free worker gets next, and what becomes of the jobs of workers that died. Independent of Dask.

A worker has one job at a time, so that a death is counted against the job that the worker had, and against no other.
"""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Callable, Iterable

from validate.acquire.job import Job

__all__ = ["MOST_DEATHS", "Handout"]

# Workers that may die of a job before it has failed: memory may have been short for a moment, and of a worker that dies
# while it starts, its job is unaffected. As many as a call has in `validate.acquire.queue`.
MOST_DEATHS = 3


class Handout:
    """The jobs of a run: views, each after the light of its scene state.

    Few states are begun at a time: a worker stays with one as long as it has unassigned views, then begins the
    next state (the light of several states is solved at once), and helps others when no state is left to begin.

    Args:
        views: jobs with a camera, those of one state together.
        lit: whether the light of a state, by its hash, is stored already.
    """

    def __init__(self, views: Iterable[Job], lit: Callable[[str], bool]) -> None:
        self._lit = lit
        self._not_begun: dict[str, deque[Job]] = {}
        for view in views:
            self._not_begun.setdefault(view.state, deque()).append(view)
        self._unlit: dict[str, deque[Job]] = {}
        self._ready: dict[str, deque[Job]] = {}
        # Jobs that come back from workers that died.
        self._lights: deque[Job] = deque()
        self._deaths: Counter[tuple[str, str]] = Counter()

    def __bool__(self) -> bool:
        """Whether a job waits, or will once the light that is being solved is there."""
        return bool(self._not_begun or self._unlit or self._ready or self._lights)

    def next_for(self, state: str | None) -> Job | None:
        """A job for a worker that had `state` last; None where all that is left waits for light."""
        if state in self._ready:
            return self._take(state)
        if self._lights:
            return self._lights.popleft()
        if self._not_begun:
            begun = next(iter(self._not_begun))
            views = self._not_begun.pop(begun)
            if self._lit(begun):
                self._ready[begun] = views
                return self._take(begun)
            self._unlit[begun] = views
            return Job(views[0].place, begun)
        if self._ready:
            return self._take(max(self._ready, key=lambda key: len(self._ready[key])))
        return None

    def light_is_there(self, job: Job) -> None:
        """The views of a state wait no longer."""
        self._ready[job.state] = self._unlit.pop(job.state)

    def light_has_failed(self, job: Job) -> list[Job]:
        """The views that cannot be made for it; they wait no longer."""
        return list(self._unlit.pop(job.state))

    def died(self, job: Job) -> bool:
        """The worker that had a job died: whether another is to do it, behind all others of its state."""
        self._deaths[job.state, job.view] += 1
        if self._deaths[job.state, job.view] >= MOST_DEATHS:
            return False
        if job.camera is None:
            self._lights.append(job)
        else:
            self._ready.setdefault(job.state, deque()).append(job)
        return True

    def put_back(self, job: Job) -> None:
        """A job that was not done, by no fault of its own."""
        if job.camera is None:
            self._lights.appendleft(job)
        else:
            self._ready.setdefault(job.state, deque()).appendleft(job)

    def _take(self, state: str) -> Job:
        job = self._ready[state].popleft()
        if not self._ready[state]:
            del self._ready[state]
        return job
