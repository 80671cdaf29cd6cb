"""The report of a schedule: its numbers are those of the tables, and each step of each run shows what it should."""

from __future__ import annotations

import csv
import itertools
import json
import re

import numpy as np
import plotly.graph_objects as go
import plotly.offline
import pytest

import scenes
from render.store.folder import StoreError
from scenes.steps.schedule_file import load_schedule
from tests.helpers.layout_of_words import assert_words_are_legible
from tests.helpers.made_up_schedule import STEPS, made_up_schedule
from tests.helpers.pages import SAME_DIGITS, Page
from validate.pages.bodies import coarse
from validate.pages.data import KINDS
from validate.pages.figure import combinations, filled
from validate.pages.section import KIND_CHOICE
from validate.plots.glyphs import settle_words
from validate.plots.paper_walk import walk_figure
from validate.plots.print_style import print_style
from validate.results.report_again import remade
from validate.schedule_pages.page import schedule_section
from validate.schedule_pages.sentences import claims_in_brief
from validate.schedule_pages.steps import steps_of_design
from validate.schedule_pages.tables import read_schedule

pytestmark = pytest.mark.slow

# Numbers of a figure have four digits.
DRAWN_DIGITS = 6e-4
# What moves from step to step, and what must stay with the room.
MOVES = ("body|H1_y", "body|H2_y", "plates_y", "centres_y", "edges|H1_y", "now|y")
STAYS = ("room_x", "floor_z", "point_names", "plates_i")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A made-up schedule with its report."""
    found = made_up_schedule(tmp_path_factory.mktemp("schedule"))
    found.text = (found.out / "report.html").read_text(encoding="utf-8")
    found.page, found.table = Page(found.text), read_schedule(found.out)
    [element] = [e for e in found.page.all("script") if e.attributes.get("id") == "data"]
    [found.run] = json.loads(element.text)["sweeps"]
    found.views = json.loads(element.text)["views"]
    return found


def rows(made, name, **requested):
    with (made.out / f"{name}.csv").open(encoding="utf-8") as file:
        return [row for row in csv.DictReader(file) if all(row[key] == value for key, value in requested.items())]


def cells(made, table):
    """The texts of a table on the page, read off it."""
    body = made.text.split(f'<table id="{table}">')[1].split("<tbody>")[1].split("</tbody>")[0]
    return [
        [re.sub(r"<.*?>", "", c) for c in re.findall(r"<t[hd].*?</t[hd]>", r, re.DOTALL)] for r in body.split("<tr")[1:]
    ]


def numbers(text):
    return [float(x) for x in re.findall(r"[+-]?\d+\.\d+", text.replace("−", "-"))]


def column(made, state, name):
    """As the page finds it: of the last step that said it anew."""
    return next(made.run["steps"][n][name] for n in range(state, -1, -1) if name in made.run["steps"][n])


# ---- numbers ---------------------------------------------------------------------------------------------------------


def test_the_verdict_has_the_numbers_of_agreement_csv(made):
    record = cells(made, "verdicts")
    assert len(record) == len(made.both.noise_models) * 2
    for model, kind, pairs, rho, _, ratio, factor in record:
        [row] = rows(made, "agreement", avatar="both", zoom_limit="none", strategy="all", kind=kind, noise_model=model)
        assert pairs == row["n"] == str(2 * STEPS)
        for text, name in ((rho, "spearman"), (ratio, "median_abs_log_ratio")):
            # Of so few steps, ρ = 1 has no interval.
            requested = [float(row[key]) for key in (name, f"{name}_ci_low", f"{name}_ci_high") if row[key]]
            assert numbers(text) == [round(value, 2) for value in requested], (model, kind)
        meant = [
            round(float(np.exp(float(row[f"median_abs_log_ratio{end}"]))), 2) for end in ("", "_ci_low", "_ci_high")
        ]
        assert factor == "no meaning" if model in ("as-printed", "corrected") else numbers(factor) == meant


def test_the_order_of_strategies_is_that_of_ranking_csv(made):
    for model, kind, rho, chosen, best, share, regret in cells(made, "rankings"):
        [row] = rows(
            made,
            "ranking",
            avatar="both",
            zoom_limit="none",
            noise_model=model,
            kind=kind,
            measure=f"measured PSS, {kind}",
        )
        assert (chosen, best) == (row["chosen"], row["best"])
        assert numbers(rho)[0] == round(float(row["spearman"]), 2)
        assert numbers(share) == [round(100 * float(row["chosen_is_best_share"]), 1)]
        assert numbers(regret) == [round(100 * float(row["regret"]), 1)]


def test_the_claims_are_those_of_claims_csv(made):
    assert len(cells(made, "claims")) == len(rows(made, "claims"))
    for brief in claims_in_brief(made.table):
        for cell, (side, model, kind) in zip(
            brief["cells"],
            [(s, m, k) for s, m in (("predicted", "physical"), ("measured", "")) for k in ("single frame", "filter")],
            strict=True,
        ):
            first = next(
                row
                for row in rows(made, "claims", claim=brief["claim"], side=side, noise_model=model, kind=kind)
                if row["value"]
            )
            assert cell["holds"] == first["holds"]
            assert float(cell["value"].split()[0]) == pytest.approx(float(first["value"]), rel=6e-3)


def test_the_curves_are_those_of_configurations_csv(made):
    """In 1/m as they are, with intervals of what was measured of both kinds; and against the result itself."""
    [figure] = [f for f in made.run["figures"] if f["id"] == "walk"]
    for number, (strategy, limit) in enumerate(made.table.runs):
        for kind, name, predicted in (
            ("single", "measured_pss_single_frame", "pss_single_frame"),
            ("filter", "measured_pss_filter", "pss"),
        ):
            for model in made.table.every.models:
                of = rows(made, "configurations", avatar="both", strategy=strategy, zoom_limit=limit, noise_model=model)
                drawn = figure["columns"][f"curve|size|{kind}|{model}|{strategy}|{limit}"]
                np.testing.assert_allclose(drawn, [float(row[predicted]) for row in of], rtol=DRAWN_DIGITS)
            drawn = figure["columns"][f"curve|size|{kind}|measured|{strategy}|{limit}"]
            np.testing.assert_allclose(drawn, [float(row[name]) for row in of], rtol=DRAWN_DIGITS)
            ends = "measured_pss_ci_" if kind == "single" else "measured_pss_filter_ci_"
            band = [float(row[f"{ends}high"]) for row in of] + [float(row[f"{ends}low"]) for row in reversed(of)]
            drawn = figure["columns"][f"band|size|{kind}|{strategy}|{limit}"]
            np.testing.assert_allclose(drawn, band, rtol=DRAWN_DIGITS)
        values, low, high = made.table.measured(KINDS[1])
        assert (low[number] <= values[number]).all()
        assert (values[number] <= high[number]).all()
        np.testing.assert_allclose(values[number], made.both.curves["", "filter"].values[number], rtol=SAME_DIGITS)


# ---- steps -----------------------------------------------------------------------------------------------------------


def test_a_step_of_a_run_shows_its_own_cameras_and_numbers(made):
    """Whatever is chosen, the page finds the views, the settings and the errors of that run at that step."""
    for number, run in enumerate(made.design.runs):
        limit = "none" if run.zoom_limit is None else f"x{run.zoom_limit:g}"
        course = made.run["courses"][f"{run.strategy}|{limit}"]
        assert len(course) == STEPS
        for step, state in enumerate(course):
            requested = [item.request.key for item in made.design.views[number][step]]
            assert [key for _, key, _ in made.run["views"][state]] == requested
            follows = [words for _, _, words in made.run["views"][state]]
            assert follows == [f"follows {name}" for name in run.steered.assignments[step]]
            of = rows(made, "points", strategy=run.strategy, zoom_limit=limit, step=str(step), noise_model="physical")
            sigma = [float(row["single_frame_sigma_m"] or "nan") * 1000 for row in of]
            drawn = column(made, state, "predicted|single|physical")
            np.testing.assert_allclose(np.array(drawn, dtype=float), sigma, rtol=DRAWN_DIGITS)
            for axis, index in zip("xyz", range(3), strict=True):
                centres = [marker.centre_m[index] for marker in made.design.scenes[step].state.markers]
                drawn = column(made, state, f"centres_{axis}")
                np.testing.assert_allclose(drawn, centres, rtol=DRAWN_DIGITS, atol=DRAWN_DIGITS)


def test_a_limit_that_never_binds_costs_nothing(made):
    assert made.run["courses"]["follow|none"] == made.run["courses"]["follow|x8"]
    # The strategies differ at the last step alone.
    assert len(made.run["steps"]) == STEPS + 1


def test_what_moves_moves_and_what_stays_is_sent_once(made):
    course = made.run["courses"]["follow|none"]
    for before, after in itertools.pairwise(course):
        for name in MOVES:
            assert column(made, before, name) != column(made, after, name), name
        for name in STAYS:
            assert name not in made.run["steps"][after], name
    # Runs share their step's bodies.
    first, second = made.run["courses"]["follow|none"][-1], made.run["courses"]["swap-to-closer|none"][-1]
    assert sorted((first, second)) == [STEPS - 1, STEPS]
    assert not any(name.startswith("body|") for name in made.run["steps"][STEPS])
    assert any(name.startswith("edges|") for name in made.run["steps"][STEPS])


def test_the_script_finds_every_column_of_every_figure(made):
    steps = steps_of_design(made.design, made.made.found.places, made.made.predictions, made.made.measured)
    section = schedule_section(made.table, made.made.found, "title", ("H1", "H2"), steps)
    shared = (*section.courses.choices, section.model_choice, KIND_CHOICE)
    for figure in section.figures:
        for number, chosen in enumerate(combinations((*shared, *figure.choices))):
            drawn = filled(figure, section.columns[number % len(section.columns)], chosen)
            assert drawn["data"], figure.id
            if number == 0:
                go.Figure(drawn)


# ---- the page --------------------------------------------------------------------------------------------------------


def test_all_is_labelled_and_nothing_is_asked_from_elsewhere(made):
    for element in made.page.all("input", "select"):
        assert element.in_label or element.attributes.get("aria-label"), element.attributes
    buttons = made.page.all("button")
    assert all(button.attributes.get("aria-label") for button in buttons)
    assert [b.attributes["aria-label"] for b in buttons if "data-play" in b.attributes] == ["Play the steps of hallway"]
    assert len(made.page.all("figcaption")) == len(made.page.all("figure"))
    assert made.text.count("plotly.js v") == 1
    script = plotly.offline.get_plotlyjs().replace("\r\n", "\n").replace("\r", "\n")
    assert set(re.findall(r"https?://[\w./]+", made.text.replace(script, ""))) <= {"http://www.w3.org/2000/svg"}
    assert "default-src 'none'" in made.text
    assert (made.out / "scene.glb").exists()
    assert all(set(view["pictures"]) == {"clean", "noisy", "depth", "blur"} for view in made.views.values())


def test_a_coarse_body_keeps_its_size_and_has_no_holes():
    """A finely divided ball, against its own volume: a hole would show as an edge with one face."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=5, radius=0.4)
    vertices, faces = coarse(np.asarray(ball.vertices), np.asarray(ball.faces), 700)
    found = trimesh.Trimesh(vertices, faces)
    assert 200 < len(faces) <= 700
    # Chords of about a sixth of the radius lie within the ball.
    assert found.volume == pytest.approx(ball.volume, rel=0.1)
    assert found.is_watertight


# ---- mistakes --------------------------------------------------------------------------------------------------------


def test_a_schedule_that_has_changed_since_is_refused(tmp_path):
    options = {
        "schedule": "hallway",
        "scene": "None",
        "store": str(tmp_path / "store"),
        "overrides": "[]",
        "strategy": "()",
        "allow_outside": "False",
    }
    (tmp_path / "run.json").write_text(json.dumps({"schedule": {}, "scene": {}, "options": options}))
    with pytest.raises(StoreError, match="has changed since"):
        remade(tmp_path)


def test_a_strangers_folder_runs_no_file(tmp_path):
    """What its run.json names is run only if the command names it too."""
    (tmp_path / "theirs.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w')\ndef mine(state): ...\n")
    theirs = f"{tmp_path / 'theirs.py'}:mine"
    schedule = load_schedule("hallway")
    scene = scenes.load(schedule.scene_path)
    options = {"schedule": "hallway", "scene": "None", "store": str(tmp_path), "overrides": "[]", "variant": "None"}
    options |= {"strategy": str((theirs,)), "allow_outside": "True"}
    record = {"schedule": schedule.resolved(), "scene": scene.resolved(), "options": options, "failed": {}}
    (tmp_path / "run.json").write_text(json.dumps(record))
    with pytest.raises(StoreError, match=r"was made with --strategy .*theirs\.py:mine; allowed: the same again"):
        remade(tmp_path)
    assert not (tmp_path / "ran").exists()


def test_tables_of_other_runs_are_refused(made, tmp_path):
    with pytest.raises(StoreError, match=r"configurations\.csv"):
        read_schedule(tmp_path)


def test_the_printed_figure_has_both_moments(made):
    """Where the first person is at each, four cameras and two people named in both, and no word on another."""
    with print_style():
        figure = walk_figure(made.both)
        settle_words(figure)
        figure.draw_without_rendering()
        assert_words_are_legible(figure)
    above = [axes for axes in figure.axes if axes.get_title().startswith("strategy (1)")]
    assert [axes.get_title() for axes in above] == [f"strategy (1), y of H1 = {y} m" for y in ("−2.0", "2.0")]
    for axes in above:
        names = {text.get_text() for text in axes.texts if text.get_text()}
        assert names == {"1", "2", "3", "4", "H1", "H2"}
