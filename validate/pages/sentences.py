"""A run's verdict in words: how well each noise model ranks the steps, what it would choose, and its regret."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pss.hints import CsvRow
from pss.visibility.targets import LEAST_CONTRAST_OVER_NOISE
from validate.pages.data import KINDS, Kind, SweepTable
from validate.runs.numbers import number_of, rho_words
from validate.stats.measured_errors import FEWEST_TRIALS
from validate.stats.optimum import FLAT

__all__ = [
    "FOLLOWS_FROM",
    "Verdict",
    "claims",
    "findings",
    "in_words",
    "remarks",
    "standing_of",
    "verdicts",
]

# An interval of ρ above this is called a ranking that follows.
FOLLOWS_FROM = 0.6
# The standing of a prediction of a measured curve that is flat.
NOTHING_TO_FOLLOW = "has nothing to follow"
# That of a prediction which is itself flat.
PREFERS_NONE = "prefers no step"
# Words for settings of cameras; other varied quantities have the tables' own name.
IN_SENTENCES = {
    "focus_distance_m": "a focus distance of {value} m",
    "pan_deg": "a pan of {value}°",
    "tilt_deg": "a tilt of {value}°",
    "f_number": "f/{value}",
}


@dataclass(frozen=True)
class Verdict:
    """One noise model and kind of PSS over the steps of one sweep, as the tables have it; nan where undefined.

    The optima are the values that the tables have, and the same as a sentence has them.
    """

    sweep: str
    model: str
    kind: Kind
    steps: int
    rho: float
    low: float
    high: float
    predicted_optimum: str
    measured_optimum: str
    chosen_label: str
    best_label: str
    regret: float
    oracle_regret: float

    @property
    def rho_text(self) -> str:
        """+0.98 [+0.90, +0.99]."""
        return rho_words(self.rho, self.low, self.high)

    @property
    def regret_text(self) -> str:
        """7.6 % (0.0 %), or nothing for the filter kind."""
        if math.isnan(self.regret):
            return "–"
        oracle = "" if math.isnan(self.oracle_regret) else f" ({self.oracle_regret:.1%})"
        return f"{self.regret:.1%}{oracle}".replace("%", " %")

    @property
    def standing(self) -> str:
        """The statement that the interval supports."""
        if self.measured_optimum == FLAT:
            return NOTHING_TO_FOLLOW
        return PREFERS_NONE if self.predicted_optimum == FLAT else standing_of(self.rho, self.low, self.high)


def standing_of(rho: float, low: float, high: float) -> str:
    """The statement that the interval of ρ supports."""
    if math.isnan(rho):
        return "cannot be judged"
    if math.isnan(low):
        return "has no interval"
    if low > FOLLOWS_FROM:
        return "follows"
    if low > 0:
        return "tends to follow"
    return "runs against" if high < 0 else "is not shown to follow"


def _minus(text: str) -> str:
    return text.replace("-", "−")


def _quoted(label: str) -> str:
    """A step's label in a sentence."""
    parameter, _, value = label.partition("=")
    words = IN_SENTENCES.get(parameter, "{parameter} = {value}")
    return words.format(parameter=parameter, value=value) if value else label


def verdicts(table: SweepTable) -> list[Verdict]:
    """A verdict for each noise model and kind, in the tables' order."""
    found = []
    for model in table.models:
        for kind in KINDS:
            row = table.correlation_of(model, kind) or {}
            curves = (table.predicted_pss(model, kind), table.measured_pss(kind))
            found.append(
                Verdict(
                    table.name,
                    model,
                    kind,
                    len(table.labels),
                    number_of(row.get("spearman")),
                    number_of(row.get("spearman_ci_low")),
                    number_of(row.get("spearman_ci_high")),
                    *(c.without_best if c.best is None else table.values[c.best] for c in curves),
                    *("no step" if c.best is None else _quoted(table.labels[c.best]) for c in curves),
                    number_of(row.get("regret")),
                    number_of(row.get("oracle_regret")),
                )
            )
    return found


def in_words(table: SweepTable) -> str:
    """The sentences on the noise model that the report begins with, single frame first."""
    single, filtered = (
        next(v for v in verdicts(table) if v.model == table.leading_model and v.kind is k) for k in KINDS
    )
    measured = table.measured_pss(KINDS[0]).values
    if not measured.any():
        once = table.steps[table.models[0]]["detected"].any()
        condition = f"in {FEWEST_TRIALS} trials or more, as a measured σ takes, " if once else ""
        return f"No point was triangulated {condition}at any step: there is nothing to compare the prediction with."
    if single.measured_optimum == FLAT:
        words = f"Measured single-frame PSS is {table.finding(KINDS[0])}: there is no order to predict. "
        words += f"Predicted (noise model {single.model}): {table.finding(KINDS[0], single.model)}."
    elif single.predicted_optimum == FLAT:
        words = f"Predicted single-frame PSS (noise model {single.model}) is {table.finding(KINDS[0], single.model)}. "
        words += f"Measured: {table.finding(KINDS[0])}."
    else:
        words = (
            f"Predicted single-frame PSS (noise model {single.model}) {single.standing} the measured one over the "
            f"{single.steps} steps: Spearman’s ρ = {single.rho_text}. "
        )
        words += f"It would choose {single.chosen_label}; the best measured is {single.best_label}"
        if not math.isnan(single.regret):
            words += f"; choosing by it loses {single.regret:.1%} of the measured PSS".replace("%", " %")
            if not math.isnan(single.oracle_regret):
                words += f" (choosing by one half of the trials: {single.oracle_regret:.1%})".replace("%", " %")
        words += "."
    if filtered.measured_optimum == FLAT:
        return f"{words} The filter’s PSS is {table.finding(KINDS[1])}."
    if filtered.predicted_optimum == FLAT:
        return f"{words} The paper’s own PSS, of σ∞, prefers no step, and {filtered.best_label} is best for the filter."
    return (
        f"{words} The paper’s own PSS, of σ∞, {filtered.standing} the filter’s: ρ = {filtered.rho_text}; it would "
        f"choose {filtered.chosen_label}, and {filtered.best_label} is best."
    )


def findings(table: SweepTable) -> list[dict[str, str]]:
    """Rows of optima.csv in words: `kind`, `side`, `finding`."""
    return [
        {
            "kind": row["kind"],
            "side": " ".join(filter(None, (row["side"], row["noise_model"]))),
            "finding": row["finding"],
        }
        for row in table.optima
    ]


def remarks(table: SweepTable) -> list[str]:
    """Caveats of the verdict; each sentence only where the tables support it."""
    found = []
    steps = len(table.labels)
    if 1 < steps < 20:
        found.append(
            f"{steps} steps of one sweep are few: read the interval, not the number. It comes from resampled trials "
            "and points, and does not cover other rooms or cameras."
        )
    wide = [v for v in verdicts(table) if steps > 1 and not math.isnan(v.low) and v.low <= 0 <= v.high]
    if wide:
        names = ", ".join(f"{v.model} ({v.kind.words})" for v in wide)
        found.append(f"The interval of ρ includes 0 for {names}: no order of the steps is shown there.")
    sigma = table.points[table.leading_model]["sigma_inf_m"]
    known = sigma[np.isfinite(sigma)]
    if len(known) and np.percentile(known, 95) < 1.1 * np.percentile(known, 5):
        found.append(
            f"σ∞ of nearly every observable point is {np.median(known) * 1000:.2g} mm, the step of the process: the "
            "filter kind of PSS then counts points, and hardly depends on how well each is seen."
        )
    missed, seen = (
        table.detection["visible_missed"],
        table.detection["visible_missed"] + table.detection["visible_detected"],
    )
    if seen:
        dark = _of_the_dark(missed, table.detection.get("visible_missed_too_dark", 0))
        found.append(
            f"Of {seen} markers whose centre a camera should see (views × markers), {missed} ({missed / seen:.0%}) "
            f"were not found{dark}. The paper’s metric requires a centre in view; a detector needs the whole marker, "
            "large, sharp and bright enough.".replace("%", " %")
        )
    return found


def _of_the_dark(missed: int, too_dark: int) -> str:
    """How many of the missed markers were too dark, where any was."""
    if too_dark == 0:
        return ""
    dark = f"too dark, with a contrast below {LEAST_CONTRAST_OVER_NOISE:g} times the noise of a capture"
    return f": {dark}" if too_dark == missed else f", {too_dark} of them {dark}"


def claims(rows: Sequence[CsvRow]) -> list[dict[str, str]]:
    """Rows of claims.csv in words: `claim`, `side`, `kind` and `at` (if there are such), `holds`, `figure`, `value`."""
    found = []
    for row in rows:
        value = f"{float(row['value']):.3g}" if row["value"] else "undefined"
        if row["value"] and row["ci_low"]:
            value += f" [{float(row['ci_low']):.3g}, {float(row['ci_high']):.3g}]"
        side = " ".join(filter(None, (row["side"], row["noise_model"])))
        found.append(
            {
                "claim": row["claim"],
                "side": side,
                "holds": row["holds"],
                "figure": row["statistic"],
                "value": _minus(value),
                "kind": row.get("kind", ""),
                "at": _minus(row.get("where", "")),
            }
        )
    return found
