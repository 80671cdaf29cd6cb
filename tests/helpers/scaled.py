"""Views for workers, and the progress that listens to them."""

from __future__ import annotations

import dataclasses

from rich.console import Console

from render.certificate import Certificate
from tests.helpers.stored_views import MARKER, REQUEST
from validate.acquire.job import Made, Place
from validate.acquire.request import Acquisition
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


def well(address, job):
    """What comes of a job in which nothing goes wrong."""
    return Made("", CERTIFICATE, 0.5, (0.25,) * len(job.measurings)) if job.camera else Made()
