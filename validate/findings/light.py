"""The ranking in more and in less light, from banks with other exposures."""

from __future__ import annotations

from collections.abc import Mapping

from validate.runs.csv_rows import Tables, number, one_of

__all__ = ["light_findings"]

CONTENDERS = ("calibrated", "physical, whole markers", "physical", "corrected", "as-printed", "identity")


def light_findings(banks: Mapping[str, Tables]) -> str:
    """A table: contenders by light, Spearman of single-frame PSS within four cameras."""
    heads = ("contender", *banks)
    lines = ["| " + " | ".join(heads) + " |", "|" + "---|" * len(heads)]
    for name in CONTENDERS:
        cells = []
        for tables in banks.values():
            row = one_of(
                tables["leaderboard"],
                cameras="4",
                measure="measured_pss_single_frame",
                metric="pss-single-frame",
                noise_model=name,
            )
            cells.append(number(row, "spearman"))
        lines.append("| " + " | ".join((name, *cells)) + " |")
    return "\n".join(lines)
