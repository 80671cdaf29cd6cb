"""The name of a run's report in its folder, and the measurements that one is made of again."""

from __future__ import annotations

from collections.abc import Iterable

from render.store.folder import Store, StoreError
from render.store.views import certificate_of
from validate.acquire.acquire import Acquisition
from validate.acquire.view_names import view_name
from validate.markers.view_measurement import ViewMeasurement, load_measurement

__all__ = ["REPORT", "stored_measurements"]

REPORT = "report.html"


def stored_measurements(requested: Iterable[Acquisition], store: Store) -> dict[Acquisition, ViewMeasurement]:
    """What the store has measured of views.

    Raises:
        StoreError: a view is not there, or not measured there.
    """
    measured: dict[Acquisition, ViewMeasurement] = {}
    for item in dict.fromkeys(requested):
        if certificate_of(store, item.request) is None:
            raise StoreError(f"{view_name(item.request)} is not in the store {store.folder}; run it again")
        task = item.task(store)
        found = load_measurement(task) if store.fetch(task.path) else None
        if found is None:
            raise StoreError(f"{view_name(item.request)} is not measured in the store {store.folder}; run it again")
        measured[item] = found
    return measured
