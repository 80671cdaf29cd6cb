"""docs/findings.md, whole, from the tables in results/reference: `python -m validate.findings`."""

from __future__ import annotations

from pathlib import Path

from validate.findings.bank import bank_findings
from validate.findings.budget import budget_findings
from validate.findings.calibration_error import calibration_error_findings
from validate.findings.factors import factor_findings
from validate.findings.hallway import hallway_findings
from validate.findings.light import light_findings
from validate.findings.tables import read_tables

__all__ = ["findings_page"]

HEAD = """# Findings

Does the prediction hold? Each line is one sentence with its number and 95 % interval. The page is made from the
tables in [results/reference](../results/reference) by

```sh
.venv/bin/python -m validate.findings > docs/findings.md
```

and the tables by `run_sweep.py bank` ([how](bank.md)), `run_sweep.py calibration-error` and the factor sweeps. The
bank has held-out views of the room, a calibration fitted on cameras at other places, and a second room. ρ is
Spearman's rank correlation between configurations of one camera count, "points" that of predicted and measured RMS
over all points of all configurations. Noise models: `physical` is the marker's Cramér–Rao bound from sensor and lens;
`as-printed` and `corrected` are the paper's Eqs. 11–15 with our constants; `identity` is R = I. All of these take a
marker as seen if its centre is, as the paper does; "whole markers" asks for all of it, and `calibrated` has R and
limits of detection fitted on other views.

The tables of the banks, the factors, the calibration errors and the hallway were measured with an earlier search for
markers and an earlier registration. The present search finds more of them (of those predicted visible in the room's
zoom sweep 83 % in place of 73 %; `benchmarks/README.md` has other scenes), so that what is reported below of markers
that are missed, and every number that they enter, will change when these tables are made again. The section on the
sweeps is of the present ones.
"""
LIGHT = """## In more and in less light

The exposure decides how many electrons a marker has. Banks of half as many settings and one render of each, with a
quarter and with four times the exposure, calibrated in their own light; ρ of single-frame PSS within four cameras:
"""
FACTORS = """## One factor at a time

Slopes of ln RMS over ln factor on the points that all steps have in common; 1 is "in proportion", 95 % intervals over
trials and points:
"""
BUDGET = """## Where the sweeps' errors are from

Measured over predicted single-frame PSS (`physical`), as a product of four factors, lowest and highest over the steps
([what each exchanges](report.md#the-error-budget)):
"""
CALIBRATION_ERROR = """## If the calibration is wrong

Pan, tilt, focal length and place of each camera off by an unknown error of the given σ, new for every frame
([how](bank.md#errors-of-calibration)):
"""
HALLWAY = """## Two people pass each other

The paper's dynamic scene, with four cameras under five strategies ([how](hallway.md)); 95 % intervals of ρ by blocks
of steps, of all else over trials and markers:
"""


def findings_page(reference: Path) -> str:
    """The page's text, in Markdown."""
    parts = [HEAD, bank_findings(read_tables(reference / "bank"))]
    lights = {"× ¼": "bank-dim", "as it is": "bank", "× 4": "bank-bright"}
    if all((reference / folder).is_dir() for folder in lights.values()):
        parts.append(
            LIGHT + "\n" + light_findings({name: read_tables(reference / f) for name, f in lights.items()}) + "\n"
        )
    if (reference / "factors" / "slopes.csv").exists():
        parts.append(FACTORS + "\n" + factor_findings(list(read_tables(reference / "factors")["slopes"])) + "\n")
    if (reference / "configurations.csv").exists():
        parts.append(BUDGET + "\n" + budget_findings(read_tables(reference)["configurations"]) + "\n")
    if (reference / "calibration_error.csv").exists():
        rows = list(read_tables(reference)["calibration_error"])
        parts.append(CALIBRATION_ERROR + "\n" + calibration_error_findings(rows) + "\n")
    if (reference / "hallway").is_dir():
        parts.append(HALLWAY + "\n" + hallway_findings(read_tables(reference / "hallway")) + "\n")
    return "\n".join(parts)
