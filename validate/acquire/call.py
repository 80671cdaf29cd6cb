"""The one function that is passed to Dask. Its arguments are bytes that a worker unpacks, so that the scheduler, which
handles every call, neither imports the renderer nor unpacks a scene.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from validate.acquire.job import Made

__all__ = ["call"]


def call(job: bytes, state: bytes | None) -> Made:
    """Do a job (`validate.acquire.job.work`)."""
    from validate.acquire.job import work

    return work(job, state)
