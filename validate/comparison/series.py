"""What was measured and predicted at the steps that all sides have: values, intervals, ratios to the first side."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pss.hints import Floats, ReadOnlyRow
from validate.comparison.matching import QUANTITIES, STEP, matched
from validate.comparison.sides import Side

__all__ = ["OWN", "PAIRS", "Group", "Pair", "Series", "groups_of", "leading", "same_measurement"]

StepOf = Callable[[ReadOnlyRow], str]

OWN = "each side’s own"
"""Stands for the noise model where the sides were given one each."""
# The noise model that fits nothing; verdicts are on it, where a run has it.
LEADING_MODEL = "physical"
# Columns by which one run's predictions differ and its measurements do not.
OF_PREDICTIONS = {"noise_model", "metric"}


@dataclass(frozen=True)
class Pair:
    """A measured quantity and its prediction: columns of configurations.csv, and `statistic`s of strategies.csv."""

    name: str
    words: str
    measured: str
    predicted: str
    of_strategies: str = ""


PAIRS = (
    Pair("single", "PSS, single frame", "measured_pss_single_frame", "pss_single_frame", "PSS, single frame"),
    Pair("filter", "PSS, filter", "measured_pss_filter", "pss", "PSS, filter"),
    Pair("rms", "RMS error", "measured_rms_m", "predicted_rms_m"),
)


@dataclass(frozen=True, eq=False)
class Series:
    """One pair over S steps of K sides; nan where a table has no number.

    Attributes:
        measured: (K, S, 3), value and both ends of its interval; PSS in 1/m, RMS in m.
        measured_ratio: (K - 1, S, 3), to the first side; nan where both sides are one measurement.
        predicted: (K, S) by noise model.
        predicted_ratio: (K - 1, S) by noise model.
    """

    pair: Pair
    measured: Floats
    measured_ratio: Floats
    predicted: Mapping[str, Floats]
    predicted_ratio: Mapping[str, Floats]


@dataclass(frozen=True, eq=False)
class Group:
    """Steps that are compared with each other: those of a sweep, or a hallway's strategies."""

    name: str
    parameter: str
    steps: tuple[str, ...]
    series: tuple[Series, ...]

    @property
    def models(self) -> tuple[str, ...]:
        """Noise models, the leading one first."""
        return tuple(dict.fromkeys(model for series in self.series for model in series.predicted))

    @property
    def numbers(self) -> list[float] | None:
        """The steps as numbers; None if they are names."""
        try:
            return [float(step) for step in self.steps]
        except ValueError:
            return None


def leading(models: Sequence[str]) -> str:
    """The noise model that verdicts are on: "physical" where it is, else the first."""
    return LEADING_MODEL if LEADING_MODEL in models or not models else models[0]


def same_measurement(first: Side, other: Side) -> bool:
    """Whether two sides are rows of one run that differ in what was predicted only."""
    columns = {name for name in {*first.chosen, *other.chosen} if first.chosen.get(name) != other.chosen.get(name)}
    return first.folder.resolve() == other.folder.resolve() and columns <= OF_PREDICTIONS


def groups_of(sides: Sequence[Side]) -> list[Group]:
    """The sweeps that all sides have, and the strategies of a hallway; none where nothing is alike."""
    return [*_sweeps(sides), *_strategies(sides)]


def _sweeps(sides: Sequence[Side]) -> list[Group]:
    by_column = {q.value: matched(sides, q) for name in ("measured", "predicted") for q in QUANTITIES[name]}
    rows: list[tuple[Pair, str, ReadOnlyRow]] = [
        (pair, column, row)
        for pair in PAIRS
        for column in (pair.measured, pair.predicted)
        for row in by_column.get(column, [])
    ]
    return _grouped(sides, rows, _name_of, lambda row: str(row.get("value", row.get("step", ""))))


def _name_of(row: ReadOnlyRow) -> str:
    return ", ".join(str(row[key]) for key in STEP if key not in ("step", "value", "parameter") and row.get(key))


def _strategies(sides: Sequence[Side]) -> list[Group]:
    (quantity,) = QUANTITIES["strategies"]
    only = dict(quantity.only or {})
    rows: list[tuple[Pair, str, ReadOnlyRow]] = []
    for row in matched(sides, quantity):
        if any(row.get(key, allowed[0]) not in allowed for key, allowed in only.items()):
            continue
        for pair in PAIRS:
            for side, column in (("measured", pair.measured), ("predicted", pair.predicted)):
                if pair.of_strategies and row.get("statistic") == f"{side} {pair.of_strategies}":
                    rows.append((pair, column, {**row, "parameter": "strategy"}))
    return _grouped(sides, rows, lambda row: "strategies", lambda row: str(row.get("strategy", "")))


def _grouped(
    sides: Sequence[Side],
    rows: Sequence[tuple[Pair, str, ReadOnlyRow]],
    group_of: Callable[[ReadOnlyRow], str],
    step_of: StepOf,
) -> list[Group]:
    """Rows (pair, its column, matched row) as arrays."""
    found = []
    for name in dict.fromkeys(group_of(row) for _, _, row in rows):
        own = [each for each in rows if group_of(each[2]) == name]
        steps = tuple(dict.fromkeys(step_of(row) for _, _, row in own))
        series = []
        for pair in PAIRS:
            of_pair = [(column, row) for each, column, row in own if each == pair]
            measured = [row for column, row in of_pair if column == pair.measured]
            predicted = [row for column, row in of_pair if column == pair.predicted]
            if not measured and not predicted:
                continue
            models = list(dict.fromkeys(str(row.get("noise_model", OWN)) for row in predicted))
            models.sort(key=lambda model: model != leading(models))
            values, ratio = _arrays(sides, measured, steps, step_of)
            for number, side in enumerate(sides[1:]):
                if same_measurement(sides[0], side):
                    ratio[number] = math.nan
            by_model = {
                model: _arrays(sides, [r for r in predicted if r.get("noise_model", OWN) == model], steps, step_of)
                for model in models
            }
            series.append(
                Series(
                    pair,
                    values,
                    ratio,
                    {model: arrays[0][..., 0] for model, arrays in by_model.items()},
                    {model: arrays[1][..., 0] for model, arrays in by_model.items()},
                )
            )
        parameter = next((str(row["parameter"]) for _, _, row in own if row.get("parameter")), "step")
        found.append(Group(name, parameter, steps, tuple(series)))
    return found


def _arrays(
    sides: Sequence[Side], rows: Sequence[ReadOnlyRow], steps: Sequence[str], step_of: StepOf
) -> tuple[Floats, Floats]:
    """(K, S, 3) of the sides and (K - 1, S, 3) of their ratios to the first."""
    values = np.full((len(sides), len(steps), 3), math.nan)
    ratios = np.full((len(sides) - 1, len(steps), 3), math.nan)
    place = {step: number for number, step in enumerate(steps)}
    for row in rows:
        step = place[step_of(row)]
        for number, side in enumerate(sides):
            values[number, step] = _limits(row, side.label)
            if number:
                ratios[number - 1, step] = _limits(row, f"{side.label}_ratio")
    return values, ratios


def _limits(row: ReadOnlyRow, name: str) -> list[float]:
    return [float(str(row.get(key, math.nan))) for key in (name, f"{name}_ci_low", f"{name}_ci_high")]
