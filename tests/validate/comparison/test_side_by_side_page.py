"""The page of `run_sweep.py compare`: its numbers are those of the matched rows, and its words go no further."""

from __future__ import annotations

import csv
import html
import json
import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import plotly.graph_objects as go
import plotly.offline
import pytest

from render.store.folder import StoreError
from tests.helpers.compared_runs import LONG, MODELS, a_run
from tests.helpers.pages import Page
from validate.commands import command_line
from validate.comparison import page
from validate.comparison.axes import ratio_ticks
from validate.comparison.folded_tables import left_out, settings_by_group
from validate.comparison.matching import QUANTITIES, matched
from validate.comparison.sentences import (
    Finding,
    headline,
    measured_findings,
    moved_finding,
    pooled,
    ranked_findings,
)
from validate.comparison.series import OWN, groups_of
from validate.comparison.sides import sides_of
from validate.pages.figure import combinations, filled
from validate.runs.tables import write_csv

REFERENCE = Path(__file__).parents[3] / "results" / "reference"
# Numbers of a figure have four digits, those of made-up tables seven.
DRAWN_DIGITS = 1e-3
# 2000 draws: a share of 0.95 has a standard error of 0.005; three of them.
COVERAGE_WITHIN = 0.015


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Three runs, one of them with a long name, and their page."""
    folder = tmp_path_factory.mktemp("compared")
    folders = [
        a_run(folder / "plain"),
        a_run(folder / "dim", 0.5, 0.52, rho=0.5, exposure_ms=1.0),
        a_run(folder / LONG, 1.02, 1.0),
    ]
    sides = sides_of(folders)
    text = page.html_of(sides)
    names = page.names_of([side.label for side in sides])
    return SimpleNamespace(
        folder=folder, folders=folders, sides=sides, names=names, text=text, page=Page(text), groups=groups_of(sides)
    )


def script(text):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', text, re.DOTALL)[1])


# ---- numbers ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["measured", "predicted", "correlation"])
def test_the_folded_tables_have_every_matched_number(made, name):
    """Cells read off the page, against rows matched anew: values, intervals, ratios, and stars."""
    for quantity in QUANTITIES[name]:
        rows = matched(made.sides, quantity)
        parts = made.text.split("<details><summary>")
        [part] = [p for p in parts if re.match(rf"[^<]*: {quantity.value}[ ,]", p)]
        body = part.split("<tbody>")[1].split("</tbody>")[0]
        lines = [
            [html.unescape(re.sub("<.*?>", "", c)) for c in re.findall(r"<t[hd].*?</t[hd]>", r)]
            for r in body.split("<tr>")[1:]
        ]
        assert len(lines) == len(rows)
        what = "ratio" if quantity.as_ratio else "difference"
        columns = [made.sides[0].label]
        for side in made.sides[1:]:
            columns += [side.label, f"{side.label}_{what}"]
        for line, row in zip(lines, rows, strict=True):
            for output, column in zip(line[-len(columns) :], columns, strict=True):
                requested = [row[f"{column}{end}"] for end in ("", "_ci_low", "_ci_high") if f"{column}{end}" in row]
                numbers = [float(n) for n in re.findall(r"-?\d+\.?\d*(?:e[+-]\d+)?", output)]
                assert numbers == [float(f"{value:.3g}") for value in requested if not math.isnan(value)]
                star = column.endswith(what) and row.get(f"{column.removesuffix(f'_{what}')}_apart") == "yes"
                assert output.endswith(" *") is star


def test_the_curves_have_the_matched_ratios(made):
    """Measured with their intervals, and predicted, read off the page's data."""
    (curves,) = [f for f in script(made.text)["sections"][0]["figures"] if f["id"] == "curves"]
    for number, side in enumerate(made.sides[1:], start=1):
        rows = matched(made.sides, QUANTITIES["measured"][0])
        ratio = np.array([row[f"{side.label}_ratio"] for row in rows])
        high = np.array([row[f"{side.label}_ratio_ci_high"] for row in rows])
        columns = curves["columns"]
        np.testing.assert_allclose(columns[f"ratio{number}|measured|single"], ratio, rtol=DRAWN_DIGITS)
        np.testing.assert_allclose(columns[f"ratio{number}|measured_above|single"], high - ratio, rtol=2 * DRAWN_DIGITS)
        rows = [r for r in matched(made.sides, QUANTITIES["predicted"][0]) if r["noise_model"] == "physical"]
        ratio = [row[f"{side.label}_ratio"] for row in rows]
        np.testing.assert_allclose(columns[f"ratio{number}|predicted|single|physical"], ratio, rtol=DRAWN_DIGITS)


def test_the_dots_have_the_matched_differences(made):
    """Of ρ, by metric, for the noise model that is chosen."""
    (dots,) = [f for s in script(made.text)["sections"] for f in s["figures"] if f["id"] == "correlation"]
    assert dots["columns"]["difference1|physical"] == pytest.approx([-0.3] * 3, rel=DRAWN_DIGITS)
    reach = math.hypot(0.1, 0.1)
    assert dots["columns"]["difference1_above|physical"] == pytest.approx([reach] * 3, rel=DRAWN_DIGITS)


def test_the_plan_has_the_ratio_of_each_points_error(made):
    """Errors of `dim` are twice as large everywhere; of the third side 2 % smaller, which is drawn as no change."""
    (plan,) = [f for f in script(made.text)["sections"][0]["figures"] if f["id"] == "map"]
    assert plan["columns"]["log|1|every step"] == pytest.approx([1.0] * 4, abs=DRAWN_DIGITS)
    assert set(plan["columns"]["symbol|2|every step"]) == {"circle"}
    assert sum(plan["columns"]["count|1|zoom=1"]) == 4


def test_a_mean_of_ratios_covers_the_truth_whatever_the_steps_share():
    """Monte Carlo: errors of the steps all the same (right), or independent (never too narrow)."""
    rng = np.random.default_rng(11)
    sigma, steps, draws = 0.2, 6, 2000
    for shared in (1.0, 0.0):
        common, own = rng.normal(0, sigma, (draws, 1)), rng.normal(0, sigma, (draws, steps))
        logs = math.log(0.7) + math.sqrt(shared) * common + math.sqrt(1 - shared) * own
        limits = np.exp(np.stack([logs, logs - 1.959964 * sigma, logs + 1.959964 * sigma], axis=-1))
        found = np.array([pooled(each) for each in limits])
        covered = ((found[:, 1] <= 0.7) & (found[:, 2] >= 0.7)).mean()
        assert covered == pytest.approx(0.95, abs=COVERAGE_WITHIN) if shared else covered > 0.95


def test_ticks_of_ratios_are_few_and_have_equality():
    for low, high in ((0.9, 1.2), (0.3, 1.0), (1.0, 300.0), (1e-6, 1e6), (1.0, 1.0)):
        ticks = ratio_ticks(np.array([low, high, np.nan]))
        assert 1 in ticks
        assert len(ticks) <= 8


# ---- words -----------------------------------------------------------------------------------------------------------


def findings_of(tmp_path, **second):
    sides = sides_of([a_run(tmp_path / "a"), a_run(tmp_path / "b", **second)])
    return measured_findings(groups_of(sides), sides, ["a", "b"]), ranked_findings(sides, ["a", "b"])


def test_runs_that_are_apart(tmp_path):
    """Half the measured PSS at every step, and a ρ that is lower by more than both intervals."""
    (measured,), (ranked,) = findings_of(tmp_path, factor=0.5, rho=0.3)
    assert measured.state == ranked.state == "yes"
    assert "of b is 0.5 [" in measured.words
    assert "at 3 of 3 steps the interval excludes equality" in measured.words
    assert "RMS error is 2 [" in measured.words
    assert ranked.words.startswith("The prediction of a ranks better than that of b: ρ is +0.30")
    assert "−0.50 [−0.64, −0.36]" in ranked.words
    assert "5.0 % and 5.0 %" in ranked.words
    (tmp_path / "b" / "correlation.csv").write_text(
        (tmp_path / "b" / "correlation.csv").read_text().replace("0.05", "")
    )
    sides = sides_of([str(tmp_path / name) for name in "ab"])
    assert "unknown and 5.0 % of the best" in ranked_findings(sides, ["a", "b"])[0].words


def test_runs_that_are_not_apart(tmp_path):
    """3 % within intervals of 10 %: no more is said than that."""
    (measured,), (ranked,) = findings_of(tmp_path, factor=1.03, rho=0.75)
    assert measured.state == ranked.state == "no"
    assert "b and a are not distinguishable" in measured.words
    assert "0 of 3 steps" in measured.words
    assert ranked.words.startswith("They are not distinguishable")
    assert "better" not in ranked.words


def test_runs_without_an_interval(tmp_path):
    """A number without an interval is given, and nothing is made of it."""
    (measured,), (ranked,) = findings_of(tmp_path, factor=0.5, spread=math.nan, rho=0.3, half_width=math.nan)
    assert measured.state == ranked.state == "open"
    assert "is 0.5 times" in measured.words
    assert "whether they differ is undecided" in measured.words
    assert "which ranks better is undecided" in ranked.words


@pytest.mark.parametrize(
    ("predicted", "measured", "state", "words"),
    [
        ((0.5, 0.5), (0.5, 0.4, 0.6), "yes", "moved as the measurement did"),
        ((0.8, 0.8), (0.5, 0.4, 0.6), "partly", "the right way, and too little"),
        ((0.2, 0.2), (0.5, 0.4, 0.6), "partly", "the right way, and too much"),
        ((1.5, 1.5), (0.5, 0.4, 0.6), "no", "moved the other way"),
        ((1.0, 1.001), (0.5, 0.4, 0.6), "no", "does not see the change"),
        ((2.0, 2.0), (1.0, 0.9, 1.1), "no", "predicted that was not measured"),
        ((1.05, 1.05), (1.0, 0.9, 1.1), "open", "no change was measured beyond its interval"),
        ((0.5, 0.5), (0.5, math.nan, math.nan), "open", "without an interval"),
        ((math.nan, math.nan), (0.5, 0.4, 0.6), "open", "No step"),
    ],
)
def test_whether_a_change_was_foreseen(predicted, measured, state, words):
    found = moved_finding("zoom", np.array(predicted), np.array([measured, measured]))
    assert found.state == state
    assert words in found.words


def test_steps_that_moved_the_right_way_are_counted():
    """Three steps apart, one of which was predicted to move the other way; one step that is not apart."""
    measured = np.array([[0.5, 0.4, 0.6], [0.5, 0.4, 0.6], [2.0, 1.5, 2.5], [1.0, 0.8, 1.2]])
    words = moved_finding("", np.array([0.55, 0.3, 0.9, 1.1]), measured).words
    assert "At 2 of 4 steps the predicted ratio is within" in words
    assert "of the 3 where a change was measured beyond its interval, 2 moved that way" in words


def test_headlines_count_what_could_be_judged():
    def of(*states):
        return headline([Finding("", state, "") for state in states], "None")

    assert of("yes", "yes", "open") == "Yes"
    assert of("no", "no") == "None"
    assert of("open") == of() == "Not decided"
    assert of("yes", "no", "partly", "open") == "Yes in 1 of 3, in part in 1"
    assert of("no", "partly") == "In part in 1 of 2"


# ---- the page --------------------------------------------------------------------------------------------------------


def test_nothing_is_asked_from_elsewhere(made):
    """No element refers to another file, the policy forbids it, and plotly is there once."""
    for element in made.page.elements:
        for name, value in element.attributes.items():
            if name in ("src", "href", "srcset", "data", "action", "poster", "background"):
                assert value.startswith(("#", "data:")), (element.tag, value)
    [policy] = [e for e in made.page.all("meta") if e.attributes.get("http-equiv") == "Content-Security-Policy"]
    assert "default-src 'none'" in policy.attributes["content"]
    plotly_text = plotly.offline.get_plotlyjs()
    assert made.text.count(plotly_text) == 1
    assert not re.findall(r"https?://", made.text.replace(plotly_text, ""))


def test_every_input_has_a_label_and_every_figure_its_words(made):
    inputs = made.page.all("select", "input", "button")
    assert inputs
    assert all(element.in_label or element.attributes.get("aria-label") for element in inputs)
    plots = [e for e in made.page.elements if "plot" in e.attributes.get("class", "").split()]
    assert len(plots) == 4
    assert all(e.attributes["role"] == "img" and len(e.attributes["aria-label"]) > 40 for e in plots)
    ids = [e.attributes["id"] for e in made.page.elements if "id" in e.attributes]
    assert len(ids) == len(set(ids))
    assert all(e.attributes["href"][1:] in ids for e in made.page.all("a"))


@pytest.mark.parametrize("selection", ["", "noise_model", "metric"])
def test_the_script_finds_every_column_of_every_figure(made, selection):
    """Whatever a reader chooses, plotly takes the figure; two sides of one run too."""
    values = {"noise_model": MODELS, "metric": ("pss", "visible-share")}.get(selection, ())
    folders = [f"{made.folders[0]}@{selection}={value}" for value in values] or made.folders
    sides = sides_of(folders)
    names = page.names_of([side.label for side in sides])
    groups = groups_of(sides)
    shown = [f for f in page._rankings(sides, names) if f is not None]
    for group in groups:
        section = page._group_section(group, sides, names)
        for figure in section["figures"]:
            for chosen in combinations([*page.pair_choice(group), *figure.choices]):
                go.Figure(filled(figure, {}, chosen))
    for figure in shown:
        for chosen in combinations(figure.choices):
            go.Figure(filled(figure, {}, chosen))
    assert shown
    assert bool(groups) == (selection != "metric")


def test_two_sides_of_one_run_measured_one_thing(made):
    """No ratio of a measurement to itself, and the three cards say so."""
    sides = sides_of([f"{made.folders[0]}@noise_model={model}" for model in MODELS])
    (group,) = groups_of(sides)
    assert group.models == (OWN,)
    assert np.isnan(group.series[0].measured_ratio).all()
    text = page.html_of(sides)
    assert "which measured one thing" in text
    assert "All sides are rows of one run" in text


def test_what_only_some_sides_have_is_said(made, tmp_path):
    """Another sweep, and a bank, whose tables have no like."""
    other = a_run(tmp_path / "other", sweep="focus")
    sides = sides_of([made.folders[0], other])
    assert not groups_of(sides)
    assert any("Sweep focus of other" in words for words in left_out(sides, ["plain", "other"]))
    mixed = sides_of([made.folders[0], str(REFERENCE / "bank")])
    words = left_out(mixed, ["plain", "bank"])
    assert "leaderboard.csv: bank left one, plain did not." in words
    assert "no rows alike" in page.html_of(mixed)


def test_banks_and_hallways_have_their_figures():
    """Of the tables that come with the project."""
    banks = sides_of([str(REFERENCE / "bank"), str(REFERENCE / "bank-dim")])
    sections = script(page.html_of(banks))["sections"]
    assert [f["id"] for f in sections[0]["figures"]] == ["leaderboard"]
    kinds = sides_of([f"{REFERENCE / 'hallway'}@kind={kind}" for kind in ("filter", "single frame")])
    sections = script(page.html_of(kinds))["sections"]
    assert [f["id"] for f in sections[0]["figures"]] == ["agreement"]


def test_strategies_of_a_hallway_are_steps(tmp_path):
    """Measured half as large, and predicted so: their ratios are in the figure of steps."""
    head = {"avatar": "both", "zoom_limit": "none"}
    for name, factor in (("a", 1.0), ("b", 0.5)):
        rows = [
            {**head, "statistic": f"{side} PSS, filter", "noise_model": model, "strategy": strategy,
             "value": value * factor, "ci_low": 0.9 * value * factor, "ci_high": 1.1 * value * factor}
            for side, model in (("measured", ""), ("predicted", "physical"))
            for strategy, value in (("follow", 30.0), ("random", 10.0))
        ]  # fmt: skip
        write_csv(tmp_path / name / "strategies.csv", rows)
    sides = sides_of([str(tmp_path / "a"), str(tmp_path / "b")])
    (group,) = groups_of(sides)
    assert group.steps == ("follow", "random")
    np.testing.assert_allclose(group.series[0].measured_ratio[0, :, 0], 0.5)
    np.testing.assert_allclose(group.series[0].predicted_ratio["physical"], [[0.5, 0.5]])
    assert "The prediction moved as the measurement did" in page.html_of(sides)


def test_settings_are_grouped(made):
    assert settings_by_group(made.sides[:2])["Sensor"][0].key == "exposure_ms"
    assert settings_by_group(made.sides[:2])["Sensor"][0].values == ("4.0", "1.0")
    assert set(settings_by_group(made.sides[:2])) == {"Sensor"}


def test_long_names_are_shortened_and_said_whole_once(made):
    assert made.names[:2] == ["A: plain", "B: dim"]
    assert len(made.names[2]) <= 25
    assert page.names_of(["a", "b"]) == ["a", "b"]
    assert LONG in made.text


def test_compare_leaves_the_page(made, tmp_path, monkeypatch, capsys):
    """At its place, at another, or not; beside a printed table only where it is asked for."""
    monkeypatch.chdir(tmp_path)
    two = made.folders[:2]
    assert (
        command_line.run(["compare", *two, "--no-report"])
        == command_line.run(["compare", *two, "--table", "csv"])
        == command_line.run(["compare", *two, "--rows", "measured"])
        == 0
    )
    assert not (tmp_path / "results").exists()
    capsys.readouterr()
    assert command_line.run(["compare", *two]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == "results/compare/compare.html"
    assert (tmp_path / "results" / "compare" / "compare.html").stat().st_size > 1_000_000
    assert command_line.run(["compare", *two, "--table", "csv", "--out", "other.html"]) == 0
    assert len(list(csv.reader(capsys.readouterr().out.splitlines()))) > 3
    assert (tmp_path / "other.html").exists()
    with pytest.raises(StoreError, match=r"ends in \.html"):
        command_line.run(["compare", *two, "--out", "other.pdf"])
