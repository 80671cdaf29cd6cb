"""docs/findings.md, whole, from the tables in results/reference."""

from __future__ import annotations

from pathlib import Path

from validate.findings.bank import bank_tables
from validate.findings.budget import budget_findings
from validate.findings.calibration_error import calibration_error_findings
from validate.findings.factors import factor_findings
from validate.findings.figures import drawings_of
from validate.findings.hallway import hallway_findings
from validate.findings.places import places_of_reference
from validate.findings.sentences import with_population
from validate.findings.summary import summary_table
from validate.runs.csv_file import read_tables
from validate.runs.table_text import folded

__all__ = ["findings_page"]

HEAD = """# Findings

Does the PSS metric predict measured 3D error? Five sentences, then [figures](#figures), then [tables](#tables). ρ is
Spearman's rank correlation between configurations of four cameras, predicted against measured; brackets hold 95 %
intervals. A case is a room in a light.
"""
SUMMARY = """The same in each case (four cameras; σ∞ with a random walk; regret in the mean of choices of 20; a scalar
times R changes no single-frame ρ):
"""
WORDS = """**What the words mean.** *Registered markers*: printed square markers, found by one detector and localised by
registration of their ideal image. *Dim light*: white has 100 to 130 electrons on the room's board, 1 % of full well, up
to 300 on its ball, 80 to 430 in the atrium and 40 to 520 in the studio; at ¼ light 25 to 30 on the board. *Perfect
calibration*: cameras are where the prediction puts them. *A closed world*: predictor, estimator and renderer share
print, light, sensor and lens. `as-printed` and `corrected` are the paper's Eqs. 11–15 with our constants, `identity` is
R = I, "scaled" is one scalar times it, fitted on training views; `physical` is the marker's Cramér–Rao bound from
sensor and lens. All of these take a marker as visible if its centre is, as the paper does; "whole markers" requires
all of it. `calibrated R` has its R fitted on other views, `calibrated, limits` hard limits of detection too, and
`calibrated` a smooth probability of detection in place of the limits. [What it is not](limits.md) is a page of its own.
"""
TABLES = """## Tables

From [results/reference](../results/reference), where `run_sweep.py bank` ([how](bank.md)), `run_sweep.py
calibration-error`, the factor sweeps and `run_sweep.py schedule hallway` wrote them. This page and its figures are made
from them by

```sh
.venv/bin/python -m validate.findings --write
```

(`--pdf DIR` writes the figures for print.) What a column means: [the bank's tables](bank.md).
"""
FACTORS = """### One factor at a time

Slopes of ln RMS over ln factor on the points that all steps have in common; 1 is "in proportion", 95 % intervals over
trials and points:
"""
BUDGET = """### Where the sweeps' errors are from

Measured over predicted single-frame PSS (`physical`), as a product of four factors, lowest and highest over the steps
([what each exchanges](report.md#the-error-budget)):
"""
CALIBRATION_ERROR = """### If the calibration is wrong

Pan, tilt, focal length and place of each camera off by an unknown error of the given σ
([how](bank.md#errors-of-calibration)):
"""
HALLWAY = """### Two people pass each other

The paper's dynamic scene, with four cameras under five strategies ([how](hallway.md)); 95 % intervals of ρ over the
steps of the walk, of all else over trials and markers. The filter over people who are held is a linearised simulation
that rendered residuals drive; that of the real walk is a real one. (The real walk, frame by frame, was measured with an
earlier search for markers and an earlier registration.)
"""


def findings_page(reference: Path) -> str:
    """The page's text, in Markdown; what has no tables is left out."""
    places = places_of_reference(reference)
    top = read_tables(reference)
    errors = top.get("calibration_error", [])
    parts = [HEAD, with_population(places, errors) + "\n"]
    if summary := summary_table(places):
        parts.append(f"{SUMMARY}\n{summary}\n")
    parts.append(WORDS)
    if figures := drawings_of(places):
        shown = "\n\n".join(f"![{each.alt}](figures/{each.file})\n\n{each.caption}" for each in figures)
        parts.append(f"## Figures\n\n{shown}\n")
    parts += [TABLES, bank_tables(places) + "\n"]
    if slopes := read_tables(reference / "factors").get("slopes"):
        parts.append(FACTORS + "\n" + factor_findings(list(slopes)) + "\n")
    if configurations := top.get("configurations"):
        parts.append(BUDGET + "\n" + budget_findings(configurations) + "\n")
    if errors:
        parts.append(CALIBRATION_ERROR + "\n" + calibration_error_findings(list(errors)) + "\n")
    hallway = read_tables(reference / "hallway")
    if {"agreement", "claims", "strategies", "ranking"} <= set(hallway):
        parts.append(HALLWAY + "\n" + folded("Strategies, claims and walk", hallway_findings(hallway)) + "\n")
    return "\n".join(parts)
