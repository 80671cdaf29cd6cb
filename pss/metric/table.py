"""The table of metrics: PSS, its variants and its rivals, each a number for a configuration.

To add a metric, register an entry point of the group "pss.metrics" that names a `Metric` (or a sequence of them).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal, cast

from numpy.typing import ArrayLike

from pss.cameras.camera import PTZCamera
from pss.entry_points import EntryPointTable
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


class MetricTable(EntryPointTable[Metric]):
    """Metrics by name: this project's own, then those of installed entry points, which are loaded when needed."""

    def __init__(self, metrics: Sequence[Metric]) -> None:
        super().__init__(ENTRY_POINTS, "metric", ((metric.name, metric) for metric in metrics))

    def better(self, name: str, one: float, other: float) -> bool:
        """Whether `one` is the better value of the metric."""
        return one > other if self[name].higher_is_better else one < other

    def _items_of(self, name: str, loaded: object) -> Iterable[tuple[str, Metric]]:
        found = [loaded] if isinstance(loaded, Metric) else list(cast(Iterable[object], loaded))
        for metric in found:
            if not isinstance(metric, Metric):
                raise RangeError(f"{metric!r}; allowed: a pss.Metric, or a sequence of them")
            yield metric.name, metric
