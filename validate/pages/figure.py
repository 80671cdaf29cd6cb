"""The common form of a report's figures: traces that name columns, and columns that a slider's step fills.

A figure is made once; what changes from step to step, or with a choice that the reader makes, is named by `ref`, such
as ref("predicted|{kind}|{model}"). The page puts in what the step's columns hold under that name, and draws.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["Choice", "Columns", "Figure", "combinations", "filled", "only_changes", "plain", "ref"]

Columns = dict[str, Any]

# Significant digits of what is drawn: a screen has four at most.
DIGITS = 4


@dataclass(frozen=True)
class Choice:
    """A control: `name` is what `ref` calls it, `label` and `options` (value, words) are for the reader."""

    name: str
    label: str
    options: tuple[tuple[str, str], ...]
    first: str = ""


@dataclass(frozen=True)
class Figure:
    """A figure of the page.

    Attributes:
        id: unique in its section.
        title, caption: what is seen, and what follows from it.
        alt: for who does not see it; may hold {step} and the names of choices.
        traces, layout: plotly's, with `ref` where a column goes; a trace's "when" names the choices it is for.
        choices: the figure's own controls.
        wide: over the page's whole width.
        height_px: of the drawing.
    """

    id: str
    title: str
    caption: str
    alt: str
    traces: Sequence[Mapping[str, Any]]
    layout: Mapping[str, Any]
    choices: tuple[Choice, ...] = ()
    columns: Columns = field(default_factory=dict)
    wide: bool = False
    height_px: int = 400


def ref(name: str) -> dict[str, str]:
    """The place of a column; {…} in its name is the reader's choice."""
    return {"$": name}


def plain(values: ArrayLike, digits: int = DIGITS) -> list[Any]:
    """Numbers as JSON has them: rounded to significant digits, None for nan and infinities, nested as given."""
    array = np.asarray(values)
    if array.dtype == bool or np.issubdtype(array.dtype, np.integer):
        return array.astype(int).tolist()
    flat = [float(f"{value:.{digits}g}") if np.isfinite(value) else None for value in array.ravel().astype(float)]
    if array.ndim == 1:
        return flat
    nested = np.array(flat, dtype=object).reshape(array.shape)
    return nested.tolist()


def only_changes(steps: Sequence[Columns]) -> list[Columns]:
    """The same columns without those that are what the step before had: the page looks back for them."""
    kept, before = [], {}
    for columns in steps:
        kept.append({name: value for name, value in columns.items() if before.get(name, _Nothing) != value})
        before = before | columns
    return kept


class _Nothing:
    """Equal to no column."""


def filled(figure: Figure, columns: Mapping[str, Any], chosen: Mapping[str, str]) -> dict[str, Any]:
    """Plotly's figure at one step: `data` and `layout`, as the page makes it.

    Raises:
        KeyError: a column that the figure names is not there.
    """
    have = {**figure.columns, **columns}
    traces = [t for t in figure.traces if all(chosen.get(k) == v for k, v in t.get("when", {}).items())]
    bare = [{key: value for key, value in trace.items() if key != "when"} for trace in traces]
    return {
        "data": [_put(trace, have.__getitem__, chosen) for trace in bare],
        "layout": _put(figure.layout, have.__getitem__, chosen),
    }


def _put(value: Any, column: Callable[[str], Any], chosen: Mapping[str, str]) -> Any:
    if isinstance(value, Mapping):
        if set(value) == {"$"}:
            return column(value["$"].format(**chosen))
        return {key: _put(item, column, chosen) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_put(item, column, chosen) for item in value]
    return value


def combinations(choices: Iterable[Choice]) -> list[dict[str, str]]:
    """Every way to set some choices."""
    listed = list(choices)
    return [
        dict(zip([c.name for c in listed], values, strict=True))
        for values in product(*([value for value, _ in c.options] for c in listed))
    ]
