"""A comparison in words: whether precision differs, whether that was foreseen, which prediction ranks better.

A finding goes no further than its interval: where it includes equality, two sides "are not distinguishable".
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pss.hints import Floats
from validate.comparison.matching import QUANTITIES, matched
from validate.comparison.series import Group, Series, leading, same_measurement
from validate.comparison.sides import Side
from validate.runs.numbers import signed_range, value_text

__all__ = [
    "Finding",
    "headline",
    "measured_findings",
    "moved_by_model",
    "moved_finding",
    "moved_findings",
    "pooled",
    "ranked_findings",
]


# A prediction that moves by less has not moved: the tables keep seven digits, a reader three.
UNMOVED = 0.005
STATES = {"yes": "yes", "partly": "in part", "no": "no", "open": "nothing to foresee, or no interval"}
RANKED = ("correlation", "leaderboard", "agreement")


@dataclass(frozen=True)
class Finding:
    """A statement about one side against the first.

    Attributes:
        about: sweep, cameras or strategy, and the other side's name.
        state: "yes", "partly", "no", or "open" where it is undecided; it answers its card's question.
        words: sentences.
    """

    about: str
    state: str
    words: str


def pooled(ratios: Floats) -> tuple[float, float, float]:
    """Geometric mean of (S, 3) ratios with their limits, with an interval; nan where no step has them.

    The interval is the mean of the steps' own, in logarithms: right if their errors are all the same, as those of
    steps that share points nearly are, and too wide otherwise, whatever they have in common.
    """
    known = ratios[np.isfinite(ratios[:, 0]) & (ratios[:, 0] > 0)]
    if not len(known):
        return math.nan, math.nan, math.nan
    limited = bool(np.isfinite(known).all() and (known > 0).all())
    value, low, high = (
        float(np.exp(np.mean(np.log(known[:, n])))) if n == 0 or limited else math.nan for n in range(3)
    )
    return value, low, high


def measured_findings(groups: Sequence[Group], sides: Sequence[Side], names: Sequence[str]) -> list[Finding]:
    """Whether measured PSS differs from the first side's, by group and side."""
    found = []
    for group in groups:
        series = _with_interval(group)
        for number, (side, name) in enumerate(zip(sides[1:], names[1:], strict=True)):
            if same_measurement(sides[0], side):
                words = f"{name} and {names[0]} are rows of one run, which measured one thing."
                found.append(Finding(_about(group, name, names), "open", words))
            else:
                found.append(_measured(group, series, number, name, names))
    return found


def _with_interval(group: Group) -> Series:
    """The series that verdicts are on: single frame, whose measured PSS has intervals."""
    with_it = [series for series in group.series if np.isfinite(series.measured_ratio[..., 1]).any()]
    return (with_it or list(group.series))[0]


def _about(group: Group, name: str, names: Sequence[str]) -> str:
    return f"{group.name}, {name}" if len(names) > 2 else group.name


def _measured(group: Group, series: Series, number: int, name: str, names: Sequence[str]) -> Finding:
    about, ratios = _about(group, name, names), series.measured_ratio[number]
    mean = pooled(ratios)
    if math.isnan(mean[0]):
        return Finding(about, "open", f"No step has a measured {series.pair.words} of both {name} and {names[0]}.")
    sentence = f"Measured {series.pair.words} of {name} is {value_text(mean)} times that of {names[0]}"
    known = int(np.isfinite(ratios[:, 0]).sum())
    if math.isnan(mean[1]):
        words = f"{sentence} in the mean of {_steps(known)}, without an interval: whether they differ is undecided."
        return Finding(about, "open", words)
    above, below = int((ratios[:, 1] > 1).sum()), int((ratios[:, 2] < 1).sum())
    sides = f" ({above} above, {below} below)" if above and below else ""
    count = f"at {above + below} of {_steps(known)} the interval excludes equality{sides}"
    rms = next((each for each in group.series if each.pair.name == "rms"), None)
    rms_words = ""
    if rms is not None and not math.isnan(pooled(rms.measured_ratio[number])[0]):
        rms_words = f" The RMS error is {value_text(pooled(rms.measured_ratio[number]))} times as large."
    if mean[1] <= 1 <= mean[2]:
        start = (
            f"In the mean of the steps, {name} and {names[0]} are not distinguishable: measured {series.pair.words} is "
        )
        words = f"{start}{value_text(mean)} times as large; {count}.{rms_words}"
        return Finding(about, "partly" if above + below else "no", words)
    return Finding(about, "yes", f"{sentence} in the mean of the steps; {count}.{rms_words}")


def _steps(count: int) -> str:
    return f"{count} step" + ("" if count == 1 else "s")


def moved_findings(groups: Sequence[Group], sides: Sequence[Side], names: Sequence[str]) -> list[Finding]:
    """Whether predictions changed as measurements did, by group and side, for the leading noise model."""
    found = []
    for group in groups:
        series = _with_interval(group)
        for number, (side, name) in enumerate(zip(sides[1:], names[1:], strict=True)):
            if series.predicted and not same_measurement(sides[0], side):
                model = leading(list(series.predicted))
                found.append(
                    moved_finding(
                        _about(group, name, names),
                        series.predicted_ratio[model if model in series.predicted else next(iter(series.predicted))][
                            number
                        ],
                        series.measured_ratio[number],
                    )
                )
    return found


def moved_finding(about: str, predicted: Floats, measured: Floats) -> Finding:
    """One side's predicted ratios (S,) to the first side against its measured ones (S, 3).

    "yes" where the mean predicted ratio is within the interval of the measured one, "partly" where only its direction
    is right, "no" where that is wrong or a change was foreseen that was not measured.
    """
    known = np.isfinite(predicted) & (predicted > 0) & np.isfinite(measured[:, 0]) & (measured[:, 0] > 0)
    if not known.any():
        return Finding(about, "open", "No step has both ratios.")
    p, m = predicted[known], measured[known]
    foreseen, mean = float(np.exp(np.log(p).mean())), pooled(m)
    sentence = f"predicted ×{foreseen:.3g}, measured ×{value_text(mean)}"
    if math.isnan(mean[1]):
        return Finding(about, "open", f"{_capital(sentence)}, without an interval: whether they agree is undecided.")
    inside = int(((m[:, 1] <= p) & (p <= m[:, 2])).sum())
    apart = (m[:, 1] > 1) | (m[:, 2] < 1)
    right = int((apart & (np.abs(np.log(p)) >= UNMOVED) & (np.sign(np.log(p)) == np.sign(np.log(m[:, 0])))).sum())
    details = f" At {inside} of {_steps(len(p))} the predicted ratio is within the measured one’s interval"
    if apart.any():
        details += (
            f"; of the {int(apart.sum())} where a change was measured beyond its interval, {right} moved that way"
        )
    details += "."
    unmoved, measured_moved = bool((np.abs(np.log(p)) < UNMOVED).all()), not mean[1] <= 1 <= mean[2]
    agrees = mean[1] <= foreseen <= mean[2]
    if measured_moved and unmoved:
        state, words = "no", f"The prediction does not see the change: {sentence}."
    elif measured_moved and agrees:
        state, words = "yes", f"The prediction moved as the measurement did: {sentence}."
    elif measured_moved and (foreseen > 1) == (mean[0] > 1):
        how = "too little" if abs(math.log(foreseen)) < abs(math.log(mean[0])) else "too much"
        state, words = "partly", f"The prediction moved the right way, and {how}: {sentence}."
    elif measured_moved:
        state, words = "no", f"The prediction moved the other way: {sentence}."
    elif agrees:
        state = "open"
        words = f"In the mean, no change was measured beyond its interval, and the prediction agrees: {sentence}."
    else:
        state, words = "no", f"A change was predicted that was not measured: {sentence}."
    return Finding(about, state, words + details)


def moved_by_model(groups: Sequence[Group], sides: Sequence[Side], names: Sequence[str]) -> list[tuple[str, ...]]:
    """The same of every noise model, as cells: group, side, model, measured, predicted, steps within, state."""
    found = []
    for group in groups:
        series = _with_interval(group)
        for number, (side, name) in enumerate(zip(sides[1:], names[1:], strict=True)):
            for model, ratios in series.predicted_ratio.items():
                if same_measurement(sides[0], side):
                    continue
                predicted, measured = ratios[number], series.measured_ratio[number]
                known = np.isfinite(predicted) & (predicted > 0) & np.isfinite(measured[:, 0]) & (measured[:, 0] > 0)
                if not known.any():
                    continue
                p, m = predicted[known], measured[known]
                inside = int(((m[:, 1] <= p) & (p <= m[:, 2])).sum()) if np.isfinite(m).all() else None
                found.append(
                    (
                        group.name,
                        name,
                        model,
                        value_text(pooled(m)),
                        value_text((float(np.exp(np.log(p).mean())),)),
                        "–" if inside is None else f"{inside} of {len(p)}",
                        STATES[moved_finding("", predicted, measured).state],
                    )
                )
    return found


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def ranked_findings(sides: Sequence[Side], names: Sequence[str]) -> list[Finding]:
    """Whether the prediction of a side ranks better than the first's, by sweep, cameras or strategy."""
    found = []
    for table in RANKED:
        rho, regret = QUANTITIES[table][0], (*QUANTITIES[table][1:], None)[0]
        rows = matched(sides, rho)
        chosen = {column for side in sides for column in side.chosen}
        only = {key: allowed for key, allowed in (rho.only or {}).items() if key not in chosen}
        rows = [row for row in rows if all(row.get(key, allowed[0]) in allowed for key, allowed in only.items())]
        models = list(dict.fromkeys(str(row["noise_model"]) for row in rows if row.get("noise_model")))
        rows = [row for row in rows if row.get("noise_model", "") in ("", leading(models))] if models else rows
        lost = {_key(row): row for row in matched(sides, regret)} if regret else {}
        for row in rows:
            where = ", ".join(
                f"{row[key]} cameras" if key == "cameras" else str(row[key])
                for key in ("sweep", "strategy", "kind", "cameras")
                if row.get(key) and not (key == "cameras" and row.get("sweep"))
            )
            for side, name in zip(sides[1:], names[1:], strict=True):
                about = f"{where}, {name}" if len(names) > 2 else where
                found.append(_ranked(about, row, lost.get(_key(row)), (sides[0], side), (names[0], name)))
    return found


def _key(row: Mapping[str, object]) -> tuple[tuple[str, object], ...]:
    return tuple((key, row[key]) for key in list(row)[: list(row).index("quantity")])


def _ranked(
    about: str,
    row: Mapping[str, object],
    regret: Mapping[str, object] | None,
    pair: tuple[Side, Side],
    names: tuple[str, str],
) -> Finding:
    def limits(name: str) -> tuple[float, float, float]:
        a, b, c = (float(str(row.get(key, math.nan))) for key in (name, f"{name}_ci_low", f"{name}_ci_high"))
        return a, b, c

    first, other = (limits(side.label) for side in pair)
    difference = limits(f"{pair[1].label}_difference")
    sentence = f"ρ is {signed_range(other)} for {names[1]} and {signed_range(first)} for {names[0]}"
    sentence += f", a difference of {signed_range(difference)}"
    losses = ""
    if regret is not None:
        lost = [float(str(regret.get(side.label, math.nan))) for side in reversed(pair)]
        if not all(math.isnan(value) for value in lost):
            of_other, of_first = ("unknown" if math.isnan(value) else f"{value:.1%}" for value in lost)
            losses = f" Regret, in the same order: {of_other} and {of_first} of the best measured.".replace("%", " %")
    if math.isnan(difference[0]):
        return Finding(about, "open", f"ρ of {names[1]} or of {names[0]} is undefined.{losses}")
    if math.isnan(difference[1]):
        return Finding(
            about, "open", f"{_capital(sentence)} without an interval: which ranks better is undecided.{losses}"
        )
    if difference[1] <= 0 <= difference[2]:
        return Finding(about, "no", f"They are not distinguishable: {sentence}.{losses}")
    better, worse = (names[1], names[0]) if difference[0] > 0 else (names[0], names[1])
    return Finding(about, "yes", f"The prediction of {better} ranks better than that of {worse}: {sentence}.{losses}")


def headline(findings: Sequence[Finding], none_shown: str) -> str:
    """The findings in a word or two; `none_shown` if some are decided and all are "no"."""
    judged = [finding for finding in findings if finding.state != "open"]
    if not judged:
        return "Not decided"
    counts = {state: sum(finding.state == state for finding in judged) for state in ("yes", "partly", "no")}
    if len(judged) in counts.values():
        only = next(state for state, count in counts.items() if count == len(judged))
        return {"yes": "Yes", "partly": "In part", "no": none_shown}[only]
    parts = [f"{words} in {counts[state]}" for state, words in (("yes", "yes"), ("partly", "in part")) if counts[state]]
    return _capital(", ".join([f"{parts[0]} of {len(judged)}", *parts[1:]]))
