"""Console output of a bank: the calibration, the ranking of metrics, ceilings and sizes."""

from __future__ import annotations

import numpy as np
from rich.table import Table

from pss.hints import Row
from pss.noise import Calibration
from validate.bank.tables import HEADLINE
from validate.runs.console import Console

__all__ = ["show"]


def show(tables: dict[str, list[Row]], calibration: Calibration, console: Console, where: str) -> None:
    """Print the verdict."""
    weights = ", ".join(f"{name} {weight:.3g}" for name, weight in calibration.weights.items() if weight > 0)
    limits = ", ".join(f"{name} {value:g}" for name, value in calibration.limits.items())
    console.print(f"calibrated {where}: {weights}; {limits}", markup=False)
    board = [
        row
        for row in tables["leaderboard"]
        if row["cameras"] == HEADLINE and row["measure"] == "measured_pss_single_frame"
    ]
    board.sort(key=lambda row: -float(str(row["spearman"])) if row["spearman"] == row["spearman"] else 2)
    table = Table(title=f"Ranking {board[0]['n']} held-out configurations of {HEADLINE} cameras by measured PSS")
    for name in (
        "rank",
        "metric",
        "noise model",
        "Spearman [95 %]",
        "given the visible share",
        "regret of 20 (median)",
    ):
        table.add_column(name)
    for row in board:
        table.add_row(
            f"{row['rank']} [{row['rank_ci_low']}, {row['rank_ci_high']}]",
            str(row["metric"]),
            str(row["noise_model"]),
            _interval(row, "spearman"),
            _interval(row, "partial_given_visible"),
            f"{100 * float(str(row['regret_of_20_median'])):.1f} %",
        )
    console.print(table)
    for name, rows in tables.items():
        if name.endswith("ceiling"):
            for row in rows:
                if row["cameras"] == HEADLINE:
                    console.print(f"{name}: {row['ceiling']}: {_interval(row, 'spearman')}", markup=False)
        if name.endswith("consistency"):
            console.print(_consistency_table(name, rows))


def _consistency_table(name: str, rows: list[Row]) -> Table:
    table = Table(title=name)
    for column in ("level", "cameras", "noise model", "NEES/dof", "50 %", "90 %", "95 %", "|log ratio|", "ρ of points"):
        table.add_column(column)
    for row in rows:
        if row["cameras"] not in (1, HEADLINE):
            continue
        table.add_row(
            *(str(row[key]) for key in ("level", "cameras", "noise_model")),
            _interval(row, "nees_per_dof"),
            *(f"{100 * float(str(row[f'coverage_{level}'])):.1f}" for level in (50, 90, 95)),
            f"{float(str(row['median_abs_log_ratio'])):.3f}",
            _interval(row, "point_spearman"),
        )
    return table


def _interval(row: Row, name: str) -> str:
    value, low, high = (float(str(row.get(key, "nan"))) for key in (name, f"{name}_ci_low", f"{name}_ci_high"))
    return "" if np.isnan(value) else f"{value:.3g} [{low:.3g}, {high:.3g}]"
