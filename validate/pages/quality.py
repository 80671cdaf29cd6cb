"""A report's figures of how good the prediction is: how metrics rank the steps, and NEES."""

from __future__ import annotations

from typing import Any

import numpy as np

from pss.hints import Floats
from validate.pages.curves import place, step_axis
from validate.pages.data import SweepTable
from validate.pages.empty_rows import NO_ORDER, Sign, empty_row_words
from validate.pages.figure import Choice, Columns, Figure, plain, ref
from validate.pages.style import LOG_AXIS, layout, line_at, model_style
from validate.runs.numbers import number_of
from validate.runs.palette import BLUE, GREY, INK
from validate.sweeps.correlation import SHARES_UNDER_MM

__all__ = ["leaderboard_figure", "nees_figure"]


# The range between these percentiles of the points is drawn as a bar.
MIDDLE = (10, 90)
# Rows of a leaderboard lie one apart; the noise models of one metric share this much of it.
ROW_SHARE = 0.5
METRIC_NAMES = {
    "pss": "PSS of σ∞ (the paper’s)",
    "pss-single-frame": "PSS of C, single frame",
    "worst-sigma": "worst σ∞ (∞-norm)",
    "visible-share": "share of points in two views",
}
MEASURE_NAMES = {
    "measured_pss_single_frame": "measured PSS, single frame",
    "measured_pss_filter": "measured PSS, filter",
    **{f"share_under_{mm:g}mm": f"share of errors under {mm:g} mm" for mm in SHARES_UNDER_MM},
    "median_rms_m": "median RMS error",
    "measured_rms_m": "RMS error of each point",
    "measured_filter_sigma_m": "σ of the filter at each point",
}


def leaderboard_figure(table: SweepTable) -> Figure:
    """Spearman's ρ of each metric and noise model with a measure, with its interval."""
    columns: Columns = {}
    signs: dict[str, list[Sign]] = {}
    measures = list(dict.fromkeys(row["measure"] for row in table.correlation))
    traces: list[dict[str, Any]] = []
    for number, model in enumerate(table.models):
        colour, symbol, _ = model_style(number)
        offset = ROW_SHARE * (number - (len(table.models) - 1) / 2) / max(len(table.models), 1)
        traces.append(
            {
                "type": "scatter",
                "mode": "markers",
                "name": model,
                "x": ref("rho|{measure}|" + model),
                "y": ref("row|{measure}|" + model),
                "customdata": ref("more|{measure}|" + model),
                "error_x": {
                    "type": "data",
                    "symmetric": False,
                    "array": ref("above|{measure}|" + model),
                    "arrayminus": ref("below|{measure}|" + model),
                    "color": colour,
                    "thickness": 2,
                    "width": 4,
                },
                "marker": {"color": colour, "symbol": symbol, "size": 10},
                "hovertemplate": (
                    "%{customdata[0]}: ρ = %{x:.2f}, Kendall’s τ = %{customdata[1]}, regret %{customdata[2]}"
                ),
            }
        )
        for measure in measures:
            rows = [r for r in table.correlation if r["measure"] == measure and r["noise_model"] == model]
            metrics = _metrics_of(table, measure)
            rho = np.array([number_of(row["spearman"]) for row in rows])
            at = [metrics.index(row["metric"]) for row in rows]
            signs.setdefault(measure, []).extend(
                Sign(model, row, row + offset, float(value)) for row, value in zip(at, rho, strict=True)
            )
            columns |= {
                f"rho|{measure}|{model}": plain(rho),
                f"above|{measure}|{model}": plain(np.array([number_of(r["spearman_ci_high"]) for r in rows]) - rho),
                f"below|{measure}|{model}": plain(rho - np.array([number_of(r["spearman_ci_low"]) for r in rows])),
                f"row|{measure}|{model}": [row + offset for row in at],
                f"more|{measure}|{model}": [
                    [
                        METRIC_NAMES.get(r["metric"], r["metric"]),
                        _short(r["kendall"], ".2f"),
                        _short(r["regret"], ".1%"),
                    ]
                    for r in rows
                ],
                f"rows|{measure}": list(range(len(metrics))),
                f"names|{measure}": [METRIC_NAMES.get(name, name) for name in metrics],
                f"range|{measure}": [len(metrics) - 0.5, -0.5],
            }
    columns |= {f"words|{measure}": empty_row_words(of, NO_ORDER) for measure, of in signs.items()}
    return Figure(
        "leaderboard",
        "Which metric ranks best",
        "Spearman’s ρ of each metric with what was measured, over the steps (or over all points of all steps); bars "
        "are 95 % intervals from resampled trials and points. 1 is the same order, 0 none. Metrics whose bars overlap "
        "are not distinguishable in this sweep; the bank of views (docs/bank.md) has hundreds of configurations "
        "for that.",
        "Dots with intervals: Spearman’s correlation of each metric and noise model with the chosen measure.",
        traces,
        layout(
            {"title": {"text": "Spearman’s ρ"}, "range": [-1.05, 1.05], "zerolinecolor": GREY},
            {
                "tickvals": ref("rows|{measure}"),
                "ticktext": ref("names|{measure}"),
                "range": ref("range|{measure}"),
                "showgrid": False,
            },
            annotations=ref("words|{measure}"),
        ),
        (Choice("measure", "Measure", tuple((name, MEASURE_NAMES.get(name, name)) for name in measures)),),
        columns,
    )


def _metrics_of(table: SweepTable, measure: str) -> list[str]:
    return list(dict.fromkeys(row["metric"] for row in table.correlation if row["measure"] == measure))


def _short(text: str, form: str) -> str:
    return format(float(text), form) if text else "–"


def nees_figure(table: SweepTable) -> Figure:
    """Median NEES/3 over the points of each step with the middle 80 %: of the noise model, and of the detections."""
    columns: Columns = {}
    for name, values in [(m, table.nees_share(m)) for m in table.models] + [("detections", table.nees_share(None))]:
        middle, low, high = _middle(values)
        columns |= {
            f"middle|{name}": plain(middle),
            f"up|{name}": plain(high - middle),
            f"down|{name}": plain(middle - low),
        }
    base = {
        "type": "scatter",
        "mode": "lines+markers",
        "x": place(table),
        "hovertemplate": "%{y:.3g} (middle 80 %: +%{error_y.array:.2g}, −%{error_y.arrayminus:.2g})",
    }
    traces = []
    for name, where, colour, symbol in (
        ("predicted C", "{model}", BLUE, "square"),
        ("the detections’ own covariance", "detections", INK, "circle"),
    ):
        error = {
            "type": "data",
            "symmetric": False,
            "array": ref(f"up|{where}"),
            "arrayminus": ref(f"down|{where}"),
            "thickness": 1.2,
            "width": 3,
            "color": colour,
        }
        marker = {"color": colour, "symbol": symbol, "size": 8}
        traces.append(
            base
            | {
                "name": name,
                "y": ref(f"middle|{where}"),
                "error_y": error,
                "marker": marker,
                "line": {"color": colour, "width": 1.5, "dash": "dash" if symbol == "square" else "solid"},
            }
        )
    right = {"type": "line", "xref": "paper", "x0": 0, "x1": 1, "y0": 1, "y1": 1, "line": {"color": GREY, "width": 1}}
    own = table.nees_share(None)
    return Figure(
        "nees",
        "Is the covariance believable?",
        "NEES/3 (the mean of eᵀC⁻¹e/3) is 1 where the covariance is right, above 1 where errors are larger, "
        "below where they are smaller. Signs are medians over the points, bars hold the middle 80 % of them. "
        "Squares take the covariance that the metric predicts; dots take what each detection claims for itself, and so "
        f"test geometry and triangulation without any model of R: over all steps their median is {_median(own)}.",
        "Median NEES over three at each step, for the chosen noise model and for the detections’ own covariances.",
        traces,
        layout(
            step_axis(table),
            LOG_AXIS | {"title": {"text": "NEES / 3"}},
            shapes=[right, line_at(ref("now"))],
            hovermode="x unified",
        ),
        (),
        columns,
    )


def _median(values: Floats) -> str:
    known = values[np.isfinite(values)]
    return f"{np.median(known):.2f}" if len(known) else "undefined"


def _middle(values: Floats) -> tuple[Floats, Floats, Floats]:
    """Median and percentiles of each step's points; nan where it has none."""
    found = np.full((3, len(values)), np.nan)
    for step, row in enumerate(values):
        known = row[np.isfinite(row)]
        if len(known):
            found[:, step] = np.percentile(known, (50, *MIDDLE))
    return found[0], found[1], found[2]
