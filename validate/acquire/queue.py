"""Calls that wait for worker processes; a process that is killed takes no other call's result with it.

If one worker dies (out of memory, say), `concurrent.futures` declares the whole pool broken, and it is unknown whose
call it was. So a new pool is started, and each call that was under way is made again, alone: only one that breaks the
pool by itself, and more than once, has failed.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from types import TracebackType
from typing import Any, Generic, TypeVar

from validate.acquire.pool import WorkerPool

__all__ = ["WorkerQueue"]

Item = TypeVar("Item")
Result = TypeVar("Result")
# A call is made alone so often before it has failed: memory may have been short for a moment, and of a worker that dies
# while it starts, its call is unaffected.
MOST_TIMES_ALONE = 3

Call = tuple[Callable[..., Any], tuple[object, ...]]


class WorkerQueue(Generic[Item, Result]):
    """A context in which calls are made in worker processes, each on behalf of an item.

    What comes of a call is handed to `done(item, result, error)`, in this process and in `submit` or `drain`; of result
    and error, one is None. At most `most_waiting` calls are under way after `submit`. If the context ends with an
    exception, busy workers are stopped too.
    """

    def __init__(
        self, workers: int, most_waiting: int, done: Callable[[Item, Result | None, BaseException | None], None]
    ) -> None:
        self._workers, self._most_waiting, self._done = workers, most_waiting, done
        self._pool = WorkerPool(workers)
        self._waiting: dict[Future[Result], tuple[Item, Call]] = {}

    def __enter__(self) -> WorkerQueue[Item, Result]:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        if kind is None:
            self._pool.shutdown()
        else:
            self._pool.stop()

    def submit(self, item: Item, function: Callable[..., Result], *arguments: object) -> None:
        """Make a call; waits while too many are under way."""
        call = function, arguments
        self._waiting[self._start(call)] = item, call
        while len(self._waiting) > self._most_waiting:
            self._collect()

    def drain(self, between: Callable[[], None] = lambda: None) -> None:
        """Wait for all calls; `between` is called before each wait."""
        while self._waiting:
            between()
            self._collect()

    def _start(self, call: Call) -> Future[Result]:
        function, arguments = call
        try:
            return self._pool.submit(function, *arguments)
        except BrokenProcessPool as error:
            # A worker died since the last look: the calls under way find out in `_collect`.
            future: Future[Result] = Future()
            future.set_exception(error)
            return future

    def _collect(self) -> None:
        finished, _ = wait(self._waiting, return_when=FIRST_COMPLETED)
        if any(isinstance(future.exception(), BrokenProcessPool) for future in finished):
            self._make_again()
            return
        for future in finished:
            item, _ = self._waiting.pop(future)
            self._hand_over(item, future)

    def _make_again(self) -> None:
        """All calls under way once more, one at a time, in pools that are whole."""
        # A broken pool fails every call that it has.
        wait(self._waiting)
        under_way, self._waiting = self._waiting, {}
        self._renew()
        for future, (item, call) in under_way.items():
            self._hand_over(item, self._alone(call) if isinstance(future.exception(), BrokenProcessPool) else future)

    def _alone(self, call: Call) -> Future[Any]:
        """What comes of a call while no other is under way; the pool is whole afterwards."""
        for _ in range(MOST_TIMES_ALONE):
            future = self._start(call)
            if not isinstance(future.exception(), BrokenProcessPool):
                break
            self._renew()
        return future

    def _renew(self) -> None:
        self._pool.stop()
        self._pool = WorkerPool(self._workers)

    def _hand_over(self, item: Item, future: Future[Result]) -> None:
        error = future.exception()
        self._done(item, None if error else future.result(), error)
