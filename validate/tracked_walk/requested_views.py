"""All views that a schedule needs, and what remains of them when views have failed."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from validate.acquire.acquire import Acquisition
from validate.acquire.messages import RunMessages
from validate.schedule.design import Design
from validate.schedule.runs import Run
from validate.schedule.training import Training
from validate.tracked_walk.frames import RealWalk

__all__ = ["RequestedViews"]


@dataclass(frozen=True, eq=False)
class RequestedViews:
    """The views to calibrate on, the held steps, and the real walk (None: not requested)."""

    training: list[Training]
    design: Design
    real: RealWalk | None

    @property
    def views(self) -> list[Acquisition]:
        """All of them."""
        found = [item for place in self.training for item in place.requested] + self.design.requested
        return found if self.real is None else found + self.real.requested

    def without(self, failed: Collection[str], messages: RunMessages) -> RequestedViews | None:
        """The parts that need none of these views, given by their hashes; prints what is omitted.

        Places to calibrate on and runs go one by one. The real walk goes as a whole: its filter runs through all
        frames, and one without a camera that the prediction has is no fair comparison.

        Returns:
            None where no run, or nothing to calibrate on, is left.
        """
        if not failed:
            return self
        training = [place for place in self.training if _whole(place.requested, failed)]
        if lost := len(self.training) - len(training):
            messages.left_out(
                f"{lost} of {len(self.training)} places to calibrate on left out, as a view of each failed"
            )
        design = self.design.without(failed)
        for run in self.design.runs:
            if run not in design.runs:
                messages.left_out(f"{_label(run)}: left out, as a view of it failed")
        real = self.real
        if real is not None and not _whole(real.requested, failed):
            lost = len({item.request.key for item in real.requested} & set(failed))
            messages.left_out(f"the real walk: left out, as {lost} of its views failed")
            real = None
        if training and design.runs:
            return RequestedViews(training, design, real)
        messages.left_out(
            "no tables: a view that every run needs, or every place to calibrate on, failed; all other views are in "
            "the store, and another run takes the failed ones only"
        )
        return None


def _whole(requested: Collection[Acquisition], failed: Collection[str]) -> bool:
    return not any(item.request.key in failed for item in requested)


def _label(run: Run) -> str:
    return f"run {run.label!r}"
