"""A report's error budget: the factors by which measured PSS departs from the predicted one, and their figure."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pss.hints import Floats
from validate.pages.data import KINDS, SweepTable
from validate.pages.figure import Columns, Figure, plain, ref
from validate.pages.steps import Step
from validate.pages.style import layout
from validate.runs.palette import BLUE, GREY, INK, VERMILION

__all__ = ["Budget", "budget_columns", "budget_figure", "budget_terms", "visibility_columns", "visibility_figure"]

Budget = dict[str, Floats]

# Of a logarithmic axis of factors.
TICKS = (1e-4, 1e-3, 0.01, 0.1, 0.2, 0.5, 1, 2, 5, 10, 100, 1000, 10000)
TERMS = {
    "visibility": "visibility",
    "noise_model": "noise model",
    "detector": "detector",
    "geometry": "geometry",
    "total": "measured / predicted",
}


def budget_terms(table: SweepTable, model: str) -> Budget:
    """Factors, (S,) each, whose product is measured over predicted single-frame PSS (`total`)."""
    steps = table.steps[model]
    with np.errstate(divide="ignore", invalid="ignore"):
        total = steps[KINDS[0].measured_pss] / steps[KINDS[0].pss]
    return {**{term: steps[f"budget_{term}"] for term in TERMS if term != "total"}, "total": total}


def budget_columns(table: SweepTable) -> list[Columns]:
    """The budget's factors at each step, as stems from 1."""
    filled: list[Columns] = [{} for _ in table.labels]
    for model in table.models:
        budget = budget_terms(table, model)
        for step, columns in enumerate(filled):
            factors = [float(budget[term][step]) for term in TERMS]
            usable = [factor if math.isfinite(factor) and factor > 0 else None for factor in factors]
            columns[f"factors|{model}"] = [None if f is None else float(f"{f:.3g}") for f in usable]
            columns[f"factor_texts|{model}"] = ["undefined" if f is None else f"× {f:.3g}" for f in usable]
            columns[f"stems|{model}"] = [x for f in usable for x in (1, 1 if f is None else float(f"{f:.3g}"), None)]
    return filled


def budget_figure(table: SweepTable) -> Figure:
    """Stems from 1 to each factor of the error budget, at the slider's step."""
    names = list(TERMS.values())
    rows = [y for n in range(len(names)) for y in (n, n, None)]
    columns: Columns = {}
    for model in table.models:
        budget = budget_terms(table, model)
        every = np.concatenate([v[np.isfinite(v) & (v > 0)] for v in budget.values()])
        low, high = (float(every.min()), float(every.max())) if len(every) else (0.5, 2.0)
        columns[f"budget_ticks|{model}"] = [tick for tick in TICKS if min(low, 0.5) / 1.6 <= tick <= max(high, 2) * 1.6]
        columns[f"budget_range|{model}"] = plain(np.log10([min(low, 0.5) / 1.6, max(high, 2) * 1.6]))
    traces = [
        {
            "type": "scatter",
            "mode": "lines",
            "x": ref("stems|{model}"),
            "y": rows,
            "line": {"color": GREY, "width": 3},
            "hoverinfo": "skip",
            "showlegend": False,
        },
        {
            "type": "scatter",
            "mode": "markers+text",
            "x": ref("factors|{model}"),
            "y": list(range(len(names))),
            "text": ref("factor_texts|{model}"),
            "textposition": "top center",
            "showlegend": False,
            "cliponaxis": False,
            "marker": {
                "color": [BLUE] * (len(names) - 1) + [INK],
                "size": 12,
                "symbol": ["circle"] * (len(names) - 1) + ["diamond"],
            },
            "hovertemplate": "× %{x:.3g}<extra></extra>",
        },
    ]
    one = {"type": "line", "yref": "paper", "x0": 1, "x1": 1, "y0": 0, "y1": 1, "line": {"color": INK, "width": 1}}
    return Figure(
        "budget",
        "Where the prediction departs from the measurement",
        "Four factors multiply to measured over predicted single-frame PSS at the slider’s step; 1 is no departure. "
        "“Visibility”: points and views that should see them, and did not find them in every trial. “Noise model”: the "
        "predicted R against the covariance that each detection gets from its own image. “Detector”: that covariance "
        "against how far detections really are off, with the bias that every trial repeats. “Geometry”: what "
        "triangulation makes of them against the prediction by H. With the paper’s R the second factor has no meaning, "
        "since that R mixes units.",
        "Five factors on a logarithmic axis: visibility, noise model, detector, geometry, and their product.",
        traces,
        layout(
            {
                "type": "log",
                "title": {"text": "factor on PSS"},
                "range": ref("budget_range|{model}"),
                "tickvals": ref("budget_ticks|{model}"),
                "ticktext": ref("budget_ticks|{model}"),
            },
            {
                "tickvals": list(range(len(names))),
                "ticktext": names,
                "range": [len(names) - 0.4, -0.75],
                "showgrid": False,
            },
            shapes=[one],
        ),
        (),
        columns,
    )


def visibility_columns(steps: Sequence[Step]) -> list[Columns]:
    """How many markers each camera should see and found, or missed, or found unforeseen, at each step."""
    filled = []
    for step in steps:
        found = np.array([sight.found for sight in step.sights])
        filled.append(
            {
                "seen_cameras": [f"camera {camera.name}" for camera in step.cameras],
                "seen_found": (step.visible & found).sum(axis=1).tolist(),
                "seen_missed": (step.visible & ~found).sum(axis=1).tolist(),
                "unseen_found": (~step.visible & found).sum(axis=1).tolist(),
            }
        )
    return filled


def visibility_figure(table: SweepTable) -> Figure:
    """Bars of markers by camera: predicted visible and found, or missed."""
    seen, missed = table.detection["visible_detected"], table.detection["visible_missed"]
    bar = {"type": "bar", "orientation": "h", "y": ref("seen_cameras")}
    traces = [
        bar | {"x": ref("seen_found"), "name": "should be seen, found", "marker": {"color": BLUE}},
        bar
        | {
            "x": ref("seen_missed"),
            "name": "should be seen, missed",
            "marker": {
                "color": "white",
                "line": {"color": VERMILION, "width": 1.5},
                "pattern": {"shape": "/", "fgcolor": VERMILION, "size": 6},
            },
        },
        bar | {"x": ref("unseen_found"), "name": "found unforeseen", "marker": {"color": GREY}},
    ]
    return Figure(
        "visibility",
        "What the cameras should see, and find",
        "Markers whose centre each camera should see at the slider’s step: found in half of the trials or more, or "
        f"missed. Over all views of the sweep {seen} were found and {missed} missed. Missed markers are the part of "
        "the departure that no noise model explains: the metric requires a centre in view, the detector needs "
        "the whole marker, large and sharp enough.",
        "Bars of markers found and missed for each camera at the slider’s step.",
        traces,
        layout({"title": {"text": "markers"}}, {"autorange": "reversed"}, barmode="stack"),
    )
