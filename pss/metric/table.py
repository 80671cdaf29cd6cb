"""The table of metrics: PSS, its variants and its rivals, each a number for a configuration.

To add a metric, register an entry point of the group "pss.metrics" that names a `Metric` (or a sequence of them).
"""

from __future__ import annotations

import importlib.metadata
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from numpy.typing import ArrayLike

from pss.cameras.camera import PTZCamera
from pss.errors import RangeError
from pss.hints import Floats
from pss.metric.evaluate import evaluate
from pss.metric.evaluation import Evaluation

__all__ = ["ENTRY_POINTS", "Metric", "MetricTable"]

ENTRY_POINTS = "pss.metrics"

Status = Literal["paper", "read", "checked", "after", "ours"]
STATUS_MEANING: dict[Status, str] = {
    "paper": "a formula of the paper that this project tests",
    "read": "the formula was read in its source",
    "checked": "the formula was read in its source and checked numerically",
    "after": "only the source's abstract was read: the formula is our reading",
    "ours": "a reference measure or an ablation of this project",
}


@dataclass(frozen=True)
class Metric:
    """A number for a configuration.

    Attributes:
        name: its name in tables.
        score: function from a configuration's evaluation to the number.
        higher_is_better: the direction of improvement.
        reference: source of the formula.
        status: how far the formula is verified, a key of `STATUS_MEANING`.
        unobservable: how points that are not observable count.
        terms: for a score that is a mean over the points, their contributions, (N,); else None.
    """

    name: str
    score: Callable[[Evaluation], float]
    higher_is_better: bool
    reference: str
    status: Status = "ours"
    unobservable: str = ""
    terms: Callable[[Evaluation], Floats] | None = None

    @classmethod
    def over_points(
        cls,
        name: str,
        terms: Callable[[Evaluation], Floats],
        higher_is_better: bool,
        reference: str,
        status: Status = "ours",
        unobservable: str = "",
    ) -> Metric:
        """A metric that is the mean over the points of `terms`, (N,)."""

        def mean(evaluation: Evaluation) -> float:
            found = terms(evaluation)
            return float(found.mean()) if len(found) else float("nan")

        return cls(name, mean, higher_is_better, reference, status, unobservable, terms)

    def __call__(self, cameras: Sequence[PTZCamera], points_m: ArrayLike, normals: ArrayLike, **models: Any) -> float:
        """The number for a configuration; arguments and errors are those of `pss.evaluate`."""
        return float(self.score(evaluate(cameras, points_m, normals, **models)))


class MetricTable(Mapping[str, Metric]):
    """Metrics by name: the project's, then those of installed entry points, which are loaded when needed."""

    def __init__(self, metrics: Sequence[Metric]) -> None:
        self._metrics = {metric.name: metric for metric in metrics}
        if len(self._metrics) != len(metrics):
            raise RangeError("two metrics have one name; allowed: names that differ")
        self._own = len(metrics)
        self._complete = False

    def __getitem__(self, name: str) -> Metric:
        if name not in self._metrics:
            self._load()
        if name not in self._metrics:
            raise KeyError(f"metric {name!r}; allowed: {', '.join(self._metrics)}")
        return self._metrics[name]

    def __iter__(self) -> Iterator[str]:
        self._load()
        return iter(self._metrics)

    def __len__(self) -> int:
        self._load()
        return len(self._metrics)

    def of_entry_points(self) -> tuple[Metric, ...]:
        """The metrics of installed entry points, in their order."""
        self._load()
        return tuple(self._metrics.values())[self._own :]

    def better(self, name: str, one: float, other: float) -> bool:
        """Whether `one` is the better value of the metric."""
        return one > other if self[name].higher_is_better else one < other

    def _load(self) -> None:
        if self._complete:
            return
        self._complete = True
        for entry in importlib.metadata.entry_points(group=ENTRY_POINTS):
            try:
                loaded = entry.load()
                found = [loaded] if isinstance(loaded, Metric) else list(loaded)
                for metric in found:
                    self._add(metric)
            except Exception as error:  # third-party code: a broken one must not disable the other metrics
                warnings.warn(f"metrics of entry point {entry.name!r} ({entry.value}): {error}", stacklevel=2)

    def _add(self, metric: Metric) -> None:
        if not isinstance(metric, Metric):
            raise RangeError(f"{metric!r}; allowed: a pss.Metric, or a sequence of them")
        if metric.name in self._metrics:
            raise RangeError(f"metric {metric.name!r} is there already; allowed: another name")
        self._metrics[metric.name] = metric
