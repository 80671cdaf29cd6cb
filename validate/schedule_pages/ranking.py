"""A schedule report's figures of strategies: their ranks, and how well PSS follows the measurement in each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from pss.hints import CsvRow
from validate.pages.empty_rows import Sign, empty_row_words
from validate.pages.figure import Choice, Columns, Figure, plain, ref
from validate.pages.style import layout, model_style
from validate.runs.csv_file import all_of
from validate.runs.numbers import number_of
from validate.runs.palette import BLUE, GREY, INK
from validate.schedule_pages.tables import KIND_NAMES, ScheduleTable

__all__ = ["agreement_figure", "ranking_figure"]

# "{kind}" is the tables' name of the chosen kind.
MEASURES = {
    "pss": ("measured PSS", "measured PSS, {kind}"),
    "fine": ("share under 0.1 mm", "share under 0.1 mm"),
    "coarse": ("share under 5 mm", "share under 5 mm"),
    "rms": ("median RMS", "median RMS"),
}
# Two signs of a row lie so far apart, and those of several noise models share this much of it.
APART, ROW_SHARE = 0.16, 0.56
ALL = "all"


def ranking_figure(table: ScheduleTable) -> Figure:
    """Rank of each strategy by predicted PSS and by a measure, with intervals."""
    names = table.strategy_names
    columns: Columns = {}
    for limit in table.limits:
        rows = all_of(table.strategies, zoom_limit=limit)
        for kind, kind_name in KIND_NAMES.items():
            for key, (_, figure) in MEASURES.items():
                own = all_of(rows, statistic=figure.format(kind=kind_name), noise_model="")
                _add(columns, f"{limit}|{kind}|{key}", names, own, "rank", "rank_ci")
            for model in table.every.models:
                own = all_of(rows, statistic=f"predicted PSS, {kind_name}", noise_model=model)
                _add(columns, f"{limit}|{kind}|{model}", names, own, "rank", "rank_ci")
                for key in MEASURES:
                    stem = f"{limit}|{kind}"
                    series = {"predicted": (model, -APART), "measured": (key, APART)}
                    columns[f"words|{stem}|{model}|{key}"] = _words(columns, stem, series)
    traces = [
        _dots("predicted", "{zoom_limit}|{kind}|{model}", names, -APART, (BLUE, "square"), "rank %{x:.2g}"),
        _dots("measured", "{zoom_limit}|{kind}|{measure}", names, APART, (INK, "circle"), "rank %{x:.2g}"),
    ]
    return Figure(
        "ranking",
        "Which strategy is best",
        "Each strategy’s rank over the whole walk, 1 the best, among those of the chosen zoom limit: by predicted PSS "
        "and by what was measured. Bars are 95 % intervals of resampled trials and markers, in ranks. Strategies whose "
        "bars overlap are not distinguishable on this walk. A strategy that is chosen wrongly costs what the verdict "
        "calls regret, which may be little.",
        "Dots with intervals: the rank of each strategy, predicted and measured.",
        traces,
        layout(
            {"title": {"text": "rank, 1 the best"}, "range": [0.6, len(names) + 0.4], "dtick": 1},
            _rows_axis(names),
            annotations=ref("words|{zoom_limit}|{kind}|{model}|{measure}"),
        ),
        (Choice("measure", "Measured by", tuple((key, words) for key, (words, _) in MEASURES.items())),),
        columns,
    )


def agreement_figure(table: ScheduleTable) -> Figure:
    """Spearman's ρ over the steps, or the median |log ratio|, of each strategy and of all together, with intervals."""
    names, columns = (ALL, *table.strategy_names), {}
    traces: list[dict[str, Any]] = []
    offsets: dict[str, tuple[str, float]] = {}
    for count, model in enumerate(table.every.models):
        colour, symbol, _ = model_style(count)
        offset = ROW_SHARE * (count - (len(table.every.models) - 1) / 2) / len(table.every.models)
        for limit in table.limits:
            for kind, kind_name in KIND_NAMES.items():
                rows = all_of(table.agreement, zoom_limit=limit, kind=kind_name, noise_model=model)
                for quantity in ("spearman", "median_abs_log_ratio"):
                    _add(columns, f"{quantity}|{limit}|{kind}|{model}", names, rows, quantity, f"{quantity}_ci")
        offsets[model] = (model, offset)
        where = "{quantity}|{zoom_limit}|{kind}|" + model
        traces.append(_dots(model, where, names, offset, (colour, symbol), "%{x:.3g}"))
    # In the order of the columns, so that the page of a run is the same file each time.
    stems = [name.removeprefix("at|").rpartition("|")[0] for name in columns if name.startswith("at|")]
    for stem in dict.fromkeys(stems):
        columns[f"words|{stem}"] = _words(columns, stem, offsets)
    columns |= {
        "x_title|spearman": "Spearman’s ρ over the steps",
        "x_title|median_abs_log_ratio": "median |ln(predicted / measured)|",
        "x_range|spearman": [-1.05, 1.05],
        "x_range|median_abs_log_ratio": _range(columns),
    }
    return Figure(
        "agreement",
        "How well PSS follows, strategy by strategy",
        "Spearman’s ρ between predicted and measured PSS over the steps of the walk (1 is the same order, 0 none), or "
        "the median size of the logarithm of their ratio (0 is the same, 0.69 a factor of 2). Bars are 95 % intervals "
        "over the steps, which are few and alike from one to the next. One strategy has a step for each place of the "
        "walk, “all” has those of all strategies. The ratio has no meaning with the paper’s two readings of R, which "
        "mix units.",
        "Dots with intervals: how well each noise model’s PSS follows the measured one, for each strategy.",
        traces,
        layout(
            {"title": {"text": ref("x_title|{quantity}")}, "range": ref("x_range|{quantity}"), "zerolinecolor": GREY},
            _rows_axis(names),
            annotations=ref("words|{quantity}|{zoom_limit}|{kind}"),
        ),
        (Choice("quantity", "Quantity", (("spearman", "ρ"), ("median_abs_log_ratio", "log ratio"))),),
        columns,
    )


def _words(columns: Columns, stem: str, series: Mapping[str, tuple[str, float]]) -> list[dict[str, Any]]:
    """What stands in rows without dots; `series` has the end of each one's column and its offset from the row."""
    signs = [
        Sign(name, row, row + offset, np.nan if value is None else value)
        for name, (end, offset) in series.items()
        for row, value in enumerate(columns[f"at|{stem}|{end}"])
    ]
    return empty_row_words(signs, "undefined, or not in the tables of the run")


def _range(columns: Mapping[str, Any]) -> list[float]:
    """From 0 to the largest value, without intervals: those of one strategy may have no end."""
    every = [v for key, values in columns.items() if key.startswith("at|median") for v in values if v is not None]
    return [-0.05, 1.15 * max(every, default=1.0)]


def _add(columns: Columns, name: str, names: Iterable[str], rows: list[CsvRow], value: str, interval: str) -> None:
    """Values and lengths of bars, in the order of `names`; None where a strategy has no row."""
    of = {row["strategy"]: row for row in rows}
    at, low, high = (
        np.array([number_of(of[n].get(key)) if n in of else np.nan for n in names])
        for key in (value, f"{interval}_low", f"{interval}_high")
    )
    at, low, high = (np.where(np.isfinite(values), values, np.nan) for values in (at, low, high))
    columns |= {f"at|{name}": plain(at), f"above|{name}": plain(high - at), f"below|{name}": plain(at - low)}


def _dots(
    name: str, where: str, rows: tuple[str, ...], offset: float, sign: tuple[str, str], template: str
) -> dict[str, Any]:
    """A trace of dots, one on each row or a little beside it; `sign` is colour and symbol."""
    colour, symbol = sign
    return {
        "type": "scatter",
        "mode": "markers",
        "name": name,
        "x": ref(f"at|{where}"),
        "y": [place + offset for place in range(len(rows))],
        "error_x": {
            "type": "data",
            "symmetric": False,
            "array": ref(f"above|{where}"),
            "arrayminus": ref(f"below|{where}"),
            "color": colour,
            "thickness": 2,
            "width": 4,
        },
        "marker": {"color": colour, "symbol": symbol, "size": 10},
        "hovertemplate": template + "<extra>%{fullData.name}</extra>",
    }


def _rows_axis(names: tuple[str, ...]) -> dict[str, Any]:
    return {
        "tickvals": list(range(len(names))),
        "ticktext": list(names),
        "range": [len(names) - 0.5, -0.5],
        "showgrid": False,
    }
