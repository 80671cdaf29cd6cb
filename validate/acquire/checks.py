"""Checks before any view is handed out: all workers see the store and run the same code with the same renderer.

A worker that joins later is caught by its first job: it names the view that it was given, and refuses if it would name
it otherwise.
"""

from __future__ import annotations

import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from render import backend
from render.code_digest import code_of
from render.store.folder import Store, StoreError, write_text
from render.store.remote import RemoteStore, open_store
from validate.acquire.dask_workers import ScaleError, Workers
from validate.runs.versions import versions

__all__ = ["WorkerReport", "check_workers", "misfit", "report", "store_name"]


@dataclass(frozen=True)
class WorkerReport:
    """A process's report: what it reads in the store's small file, and what it runs."""

    read: str
    writable: bool
    renderer: str
    code: str
    versions: dict[str, str]


def worker_code() -> str:
    """Digest of the code that workers run."""
    return code_of("validate.acquire.job").digest


def store_name(store: Store) -> str:
    """The name of a store for workers: its address, or its folder's absolute path."""
    return store.address if isinstance(store, RemoteStore) else str(store.folder.resolve())


def check_workers(workers: Workers, store: Store, chosen: backend.Backend) -> None:
    """Check each connected worker; one that cannot be used is named in one line.

    Raises:
        ScaleError: a worker does not see the store, runs other code or another renderer, or several threads.
        StoreError: the store cannot be written.
    """
    workers.wait_for_one()
    several = {address: threads for address, threads in workers.client.nthreads().items() if threads != 1}
    for address, threads in several.items():
        raise ScaleError(f"worker {address} has {threads} threads; allowed is 1 (dask worker --nthreads 1)")
    small = f".seen-{uuid.uuid4().hex}"
    content = uuid.uuid4().hex
    _write_token(store, small, content)
    try:
        found = workers.client.run(report, store_name(store), small, chosen.variant, on_error="return")
    except Exception as error:  # whatever a worker without this project makes of the question
        raise ScaleError(_without_project("a worker", error)) from error
    finally:
        _remove(store, small)
    own = WorkerReport(content, True, chosen.identity, worker_code(), versions())
    for address, answer in sorted(found.items()):
        if why := misfit(address, answer, own, store_name(store)):
            raise ScaleError(why)


def report(store: str, small: str, variant: str) -> WorkerReport:
    """Run on a worker: what it reads in the small file of the store, and what it runs."""
    opened = open_store(store)
    try:
        if isinstance(opened, RemoteStore):
            read = opened.files.cat_file(f"{opened.root}/{small}").decode()
        else:
            read = (opened.folder / small).read_text(encoding="utf-8")
    except OSError as error:
        read = f"{type(error).__name__}"
    try:
        renderer = backend.choose(variant).identity
    except ImportError as error:
        renderer = f"none ({error})"
    return WorkerReport(read, opened.writable, renderer, worker_code(), versions())


def misfit(address: str, answer: WorkerReport | BaseException, own: WorkerReport, store: str) -> str:
    """Why a worker cannot be used, in one line; "" if it can."""
    if not isinstance(answer, WorkerReport):
        return _without_project(f"worker {address}", answer)
    if answer.read != own.read:
        return (
            f"worker {address} does not see the store {store} ({answer.read}); allowed is a folder that it reaches "
            "under the same path, or an address"
        )
    if not answer.writable:
        return f"worker {address} cannot write the store {store}; allowed is one that all workers may write to"
    if answer.renderer != own.renderer:
        return f"worker {address} renders with {answer.renderer}, this run with {own.renderer}; allowed: the same"
    if differing := _differing(answer.versions, own.versions):
        return f"worker {address} has {differing}; allowed: the same versions"
    if answer.code != own.code:
        return f"worker {address} runs other code of this project ({answer.code}, here {own.code}); allowed: the same"
    return ""


def _differing(there: Mapping[str, str], here: Mapping[str, str]) -> str:
    # The code itself is compared: it need not be installed to run.
    return ", ".join(
        f"{name} {there.get(name, 'none')} (here {version})"
        for name, version in here.items()
        if there.get(name) != version and name != "pss-testbed"
    )


def _without_project(who: str, error: BaseException) -> str:
    return (
        f"{who} does not answer ({type(error).__name__}: {error}); allowed are workers that have this project installed"
    )


def _write_token(store: Store, small: str, content: str) -> None:
    if isinstance(store, RemoteStore):
        try:
            store.files.makedirs(store.root, exist_ok=True)
            store.files.pipe_file(f"{store.root}/{small}", content.encode())
        except Exception as error:  # each kind of address has its own
            raise StoreError(f"{store.address}: {error}; allowed is a store that can be reached") from error
        return
    write_text(Path(store.folder / small), content)


def _remove(store: Store, small: str) -> None:
    try:
        if isinstance(store, RemoteStore):
            store.files.rm_file(f"{store.root}/{small}")
        else:
            (store.folder / small).unlink(missing_ok=True)
    except Exception as error:
        raise StoreError(f"{small} cannot be removed from the store: {error}") from error
