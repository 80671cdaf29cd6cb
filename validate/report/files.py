"""The name of a run's report in its folder, and the measurements that one is made of again."""

from __future__ import annotations

from collections.abc import Iterable

from validate.acquire import Acquisition
from validate.measure import ViewMeasurement, load_measurement
from validate.store import Store, StoreError

__all__ = ["REPORT", "stored_measurements"]

REPORT = "report.html"


def stored_measurements(wanted: Iterable[Acquisition], store: Store) -> dict[Acquisition, ViewMeasurement]:
    """What the store has measured of views.

    Raises:
        StoreError: a view is not measured there.
    """
    measured: dict[Acquisition, ViewMeasurement] = {}
    for item in dict.fromkeys(wanted):
        task = item.task(store)
        found = load_measurement(task) if store.fetch(task.path) else None
        if found is None:
            raise StoreError(f"view {item.request.key} is not measured in the store {store.folder}; run it again")
        measured[item] = found
    return measured
