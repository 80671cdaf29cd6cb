"""How the bank's studies start their processes: a server that has imported once what each of them needs.

A study starts a pool for every step. Forked from a server with numpy in it, a worker is there at once; started afresh,
it imports for two seconds. (Forked from the main process, it would inherit the renderer's locked threads.)
"""

from __future__ import annotations

from multiprocessing import get_context
from multiprocessing.context import BaseContext

__all__ = ["workers_context"]

NEEDED = ["validate.bank.filtered", "validate.bank.measured", "validate.bank.predicted"]


def workers_context() -> BaseContext:
    """The context for `ProcessPoolExecutor`."""
    context = get_context("forkserver")
    context.set_forkserver_preload(NEEDED)
    return context
