"""The page of `run_sweep.py compare`: verdict, figures and tables of two or more runs, as one HTML file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from render.store.folder import write_text
from validate.comparison.axes import side_style
from validate.comparison.curves import curves_figure, moved_figure, pair_choice
from validate.comparison.dots import Dots, dots_figure
from validate.comparison.folded_tables import folded_tables, left_out, settings_by_group
from validate.comparison.maps import map_figure
from validate.comparison.matching import QUANTITIES, matched
from validate.comparison.sentences import (
    Finding,
    headline,
    measured_findings,
    moved_by_model,
    moved_findings,
    ranked_findings,
)
from validate.comparison.series import Group, groups_of, same_measurement
from validate.comparison.sides import Side
from validate.pages.figure import Figure
from validate.pages.html import rendered

__all__ = ["PAGE", "html_of", "names_of", "write_page"]

PAGE = Path("results") / "compare" / "compare.html"
# Characters of a name in figures and heads of tables; longer ones are written in full once, at the top.
LONGEST_NAME, KEPT_OF_LONG = 22, 9
# Findings in a card, and settings in the table at the top; the rest is in the tables below.
MOST_FINDINGS, MOST_SETTINGS = 6, 8
# Characters of a setting's value.
LONGEST_VALUE = 80
# Signs of plotly as they look beside text.
SIGNS = {"circle": "●", "square": "■", "diamond": "◆", "triangle-up": "▲", "cross": "✚", "triangle-down": "▼", "x": "✖"}
LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"


def write_page(path: Path, sides: Sequence[Side]) -> Path:
    """Write the page of a comparison; its path.

    Raises:
        StoreError: a side has no value that was chosen, or the file cannot be written.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    write_text(path, html_of(sides))
    return path


def names_of(labels: Sequence[str]) -> list[str]:
    """What figures call the sides: their labels, the long ones by a letter and both ends."""
    if all(len(label) <= LONGEST_NAME for label in labels):
        return list(labels)
    names = []
    for number, label in enumerate(labels):
        short = label if len(label) <= LONGEST_NAME else f"{label[:KEPT_OF_LONG]}…{label[-KEPT_OF_LONG:]}"
        names.append(f"{LETTERS[number % len(LETTERS)]}{number // len(LETTERS) or ''}: {short}")
    return names


def html_of(sides: Sequence[Side]) -> str:
    """The whole page."""
    names = names_of([side.label for side in sides])
    groups = groups_of(sides)
    sections = [
        {"id": f"group-{number}"} | _group_section(group, sides, names) for number, group in enumerate(groups, start=1)
    ]
    ranking = [figure for figure in _rankings(sides, names) if figure is not None]
    if ranking:
        section = {
            "id": "ranking",
            "title": "How well predictions rank",
            "kicker": "Of each side, and the differences",
            "shared": (),
        }
        sections.append(section | {"lead": RANKING_LEAD, "figures": ranking})
    return rendered(
        "validate.comparison",
        "compare",
        {"sections": [{"figures": [_figure_data(figure) for figure in each["figures"]]} for each in sections]},
        title="PSS comparison: " + ", ".join(names),
        sides=_sides(sides, names),
        names=names,
        settings=_settings(sides),
        most_settings=MOST_SETTINGS,
        unknown=[name for side, name in zip(sides, names, strict=True) if side.settings() is None],
        one_run=len({side.folder.resolve() for side in sides}) == 1,
        cards=_cards(groups, sides, names),
        moved=moved_by_model(groups, sides, names),
        sections=sections,
        tables=folded_tables(sides, names),
        left_out=left_out(sides, names),
    )


RANKING_LEAD = (
    "Spearman’s ρ measures how far a prediction puts configurations in the order in which they were measured: 1 is the "
    "same order, 0 none. Left, each side’s own with its 95 % interval; right, the difference to the first side. Where "
    "a bar crosses the line at 0, the two are not distinguishable."
)


def _sides(sides: Sequence[Side], names: Sequence[str]) -> list[dict[str, Any]]:
    found = []
    for number, (side, name) in enumerate(zip(sides, names, strict=True)):
        colour, symbol, _ = side_style(number)
        chosen = ", ".join(f"{column} = {value}" for column, value in side.chosen.items())
        found.append(
            {
                "name": name,
                "sign": SIGNS[symbol],
                "colour": colour,
                "folder": side.folder.as_posix(),
                "chosen": chosen,
                "role": "what the others are compared with" if number == 0 else "",
            }
        )
    return found


def _settings(sides: Sequence[Side]) -> list[dict[str, Any]]:
    return [
        {
            "group": words,
            "rows": [(setting.key, [_shortened(value) for value in setting.values]) for setting in settings],
        }
        for words, settings in settings_by_group(sides).items()
    ]


def _shortened(value: str) -> str:
    return value if len(value) <= LONGEST_VALUE else value[: LONGEST_VALUE - 1] + "…"


def _cards(groups: Sequence[Group], sides: Sequence[Side], names: Sequence[str]) -> list[dict[str, Any]]:
    """The three questions with their answers."""
    one_run = all(same_measurement(sides[0], side) for side in sides[1:])
    if one_run:
        one = "All sides are rows of one run, which measured one thing: only what was predicted can differ."
        measured = moved = [Finding("", "open", one)]
    else:
        none = Finding("", "open", "The sides have no common steps with measurements in their tables.")
        measured = measured_findings(groups, sides, names) or [none]
        moved = moved_findings(groups, sides, names) or [none]
    ranked = ranked_findings(sides, names) or [Finding("", "open", "The sides have no correlations alike.")]
    cards = [
        _card("Is the measured precision different?", measured, "Not that it shows"),
        _card("Does the metric foresee the change?", moved, "No"),
        _card("Does one prediction rank better?", ranked, "Not that it shows"),
    ]
    if one_run:
        cards[0]["answer"] = cards[1]["answer"] = "It is one run"
    return sorted(cards, key=lambda card: all(f.state == "open" for f in card["findings"]))


def _card(question: str, findings: Sequence[Finding], none_shown: str) -> dict[str, Any]:
    return {
        "question": question,
        "answer": headline(findings, none_shown),
        "findings": findings[:MOST_FINDINGS],
        "more": findings[MOST_FINDINGS:],
    }


def _group_section(group: Group, sides: Sequence[Side], names: Sequence[str]) -> dict[str, Any]:
    figures = [curves_figure(group, names), moved_figure(group, names), map_figure(group.name, sides, names)]
    steps = f"{len(group.steps)} step" + ("" if len(group.steps) == 1 else "s")
    what = "strategies" if group.parameter == "strategy" else f"steps of {group.name}"
    return {
        "title": "Strategies of the hallway" if group.parameter == "strategy" else f"Sweep {group.name}",
        "kicker": f"{steps} that all sides have" if group.parameter != "strategy" else "the whole hallway",
        "lead": f"What was measured and predicted at the {what}, and how both changed from {names[0]}.",
        "shared": tuple(choice for choice in pair_choice(group) if len(choice.options) > 1),
        "fixed": {choice.name: choice.first for choice in pair_choice(group)},
        "figures": [figure for figure in figures if figure is not None],
    }


def _rankings(sides: Sequence[Side], names: Sequence[str]) -> list[Figure | None]:
    chosen = {column for side in sides for column in side.chosen}
    labels = [side.label for side in sides]
    found = []
    for table, title, downs in (
        ("correlation", "Each metric over the steps of a sweep", ("metric", "noise_model", "sweep")),
        ("leaderboard", "Each metric over the configurations of the bank", ("metric", "noise_model", "cameras")),
        ("agreement", "Each strategy over the moments of the walk", ("strategy", "noise_model")),
    ):
        rows: Sequence[Mapping[str, object]] = matched(sides, QUANTITIES[table][0])
        rows = [row for row in rows if row.get("level", "configuration") == "configuration"]
        rows = [{key: value for key, value in row.items() if key != "level"} for row in rows]
        down = next((column for column in downs if column not in chosen and rows and column in rows[0]), "")
        if down:
            caption = CAPTIONS[table]
            found.append(dots_figure(Dots(table, title, caption, "Spearman’s ρ", rows, down, False), labels, names))
    return found


CAPTIONS = {
    "correlation": "Intervals are from resampled trials and points of each run. A few steps hardly separate metrics: "
    "read the bars, not the dots.",
    "leaderboard": "Sorted by the first side. A metric that is at the top of both sides is good under both conditions; "
    "one whose difference is clear of the line at 0 depends on what was changed. Metrics without a noise model stand "
    "beside each; not every metric was taken with every noise model.",
    "agreement": "Over the moments of the walk, predicted against measured PSS by strategy: where the bars on the "
    "right are clear of 0, the prediction follows one run better than the other.",
}


def _figure_data(figure: Figure) -> dict[str, Any]:
    return {
        "id": figure.id,
        "traces": figure.traces,
        "layout": figure.layout,
        "columns": figure.columns,
        "height": figure.height_px,
        "alt": figure.alt,
    }
