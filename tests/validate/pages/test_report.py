"""The report of a run: its numbers are those of the tables, it needs nothing from elsewhere, all of it has words."""

from __future__ import annotations

import csv
import json
import math
import re
import shutil
from itertools import pairwise
from types import SimpleNamespace

import cv2
import numpy as np
import plotly.graph_objects as go
import plotly.offline
import pytest
import trimesh

from pss import PTZCamera
from render.store.folder import StoreError
from render.world.state import Room
from tests.helpers.closet import RISING, SCENE, SELECTION
from tests.helpers.made_up_run import made_up_run
from tests.helpers.pages import SAME_DIGITS, Page
from validate.markers.view_measurement import ViewMeasurement
from validate.pages.budget import budget_columns
from validate.pages.data import KINDS, read_sweeps
from validate.pages.figure import combinations, filled, only_changes, plain
from validate.pages.gltf import linear
from validate.pages.images import BUDGET_BYTES, chosen_crops, pictures_of
from validate.pages.section import KIND_CHOICE, section_of
from validate.pages.sentences import in_words, verdicts
from validate.pages.space import scene_columns
from validate.pages.steps import sight_of, steps_of_plan
from validate.pages.style import model_style, object_styles
from validate.prediction.frusta import frustum
from validate.results.report import of_results
from validate.results.report_again import remade
from validate.runs.palette import PURPLE_ORANGE, VIRIDIS
from validate.runs.tables import write_csv

# Numbers of a figure have four.
DRAWN_DIGITS = 1e-3
# σ of a standard deviation from many draws is 1/√(2·draws); five of them.
MANY_TRIALS = 4000
MONTE_CARLO = 5 / math.sqrt(2 * MANY_TRIALS)
MOST_BYTES = 15_000_000


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A made-up run of two sweeps with its report."""
    folder = tmp_path_factory.mktemp("report")
    results, acquired, store = made_up_run(folder, SCENE, {"zooming": RISING, "pairs": SELECTION})
    text = (folder / "run" / "report.html").read_text(encoding="utf-8")
    tables = read_sweeps(folder / "run")
    steps = [
        steps_of_plan(sweep.plan, sweep.labels, sweep.predictions, sweep.measured)
        for sweep in of_results(results, acquired.measured)
    ]
    return SimpleNamespace(
        out=folder / "run", results=results, store=store, text=text, page=Page(text), tables=tables, steps=steps
    )


def rows(made, name):
    with (made.out / f"{name}.csv").open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


# ---- the page --------------------------------------------------------------------------------------------------------


def test_the_numbers_of_the_verdict_are_those_of_the_tables(made):
    """Each row of the verdict, read off the page, against correlation.csv and configurations.csv read anew."""
    body = made.text.split('<table id="verdicts">')[1].split("<tbody>")[1].split("</tbody>")[0]
    expected = [
        [re.sub(r"<.*?>", "", cell) for cell in re.findall(r"<t[hd].*?</t[hd]>", row)] for row in body.split("<tr")[1:]
    ]
    assert len(expected) == 2 * 2 * 2
    words = {"single frame": ("pss-single-frame", "pss_single_frame", "measured_pss_single_frame")}
    words["filter"] = ("pss", "pss", "measured_pss_filter")
    for sweep, model, kind, rho, _, chosen, best, regret in expected:
        metric, predicted, measured = words[kind]
        [row] = [
            r
            for r in rows(made, "correlation")
            if (r["sweep"], r["noise_model"], r["metric"], r["measure"], r["level"])
            == (sweep, model, metric, measured, "configuration")
        ]
        of = [r for r in rows(made, "configurations") if (r["sweep"], r["noise_model"]) == (sweep, model)]
        assert chosen == max(of, key=lambda r: float(r[predicted]))["value"]
        highest = max(of, key=lambda r: float(r[measured]))["value"]
        assert best == ("flat" if row["measured_flat"] == "yes" else highest)
        numbers = [float(x) for x in re.findall(r"[+-]\d\.\d\d", rho.replace("−", "-"))]
        requested = [row[name] for name in ("spearman", "spearman_ci_low", "spearman_ci_high")]
        assert numbers == [round(float(x), 2) for x in requested if x]
        if row["regret"]:
            assert regret.startswith(f"{100 * float(row['regret']):.1f} %")
        else:
            assert regret == "–"


def test_the_sentence_says_what_the_table_says(made):
    for table in made.tables:
        sentence = in_words(table)
        [single] = [v for v in verdicts(table) if v.model == "corrected" and v.kind.name == "single"]
        assert f"ρ = {single.rho_text}" in sentence or (table.name == "pairs" and "is flat" in sentence)
        assert sentence in made.text.replace("&#39;", "'")


def test_nothing_is_asked_from_elsewhere(made):
    """No attribute and no style names another file, and the page forbids the browser to fetch any."""
    assert len(made.page.elements) > 100
    for element in made.page.elements:
        for name, value in element.attributes.items():
            if name in ("src", "href", "srcset", "data", "action", "poster", "xlink:href", "background"):
                assert value.startswith(("#", "data:")), (element.tag, name, value[:80])
    [style] = made.page.all("style")
    assert "url(" not in style.text
    assert "@import" not in style.text
    [policy] = [e for e in made.page.all("meta") if e.attributes.get("http-equiv") == "Content-Security-Policy"]
    assert "default-src 'none'" in policy.attributes["content"]
    assert "connect-src 'none'" in policy.attributes["content"]
    assert "http" not in policy.attributes["content"]
    assert made.text.count("plotly.js v") == 1
    # Of what is ours, beside plotly's script, nothing names an address but the name of SVG's elements.
    script = plotly.offline.get_plotlyjs().replace("\r\n", "\n").replace("\r", "\n")
    ours = made.text.replace(script, "")
    assert len(ours) < len(made.text) - len(script) / 2
    assert set(re.findall(r"https?://[\w./]+", ours)) <= {"http://www.w3.org/2000/svg"}


def test_ids_are_the_pages_own_and_every_link_within_it_leads_somewhere(made):
    """No sweep's name is an id: one called "data" or "zooming-title" could meet another."""
    ids = [e.attributes["id"] for e in made.page.elements if "id" in e.attributes]
    assert len(ids) == len(set(ids))
    assert not any(table.name in name for name in ids for table in made.tables)
    links = [e.attributes["href"] for e in made.page.all("a")]
    assert {link.removeprefix("#") for link in links} <= set(ids)
    assert {"sweep-1", "sweep-2"} <= set(ids)


def test_every_input_has_a_label_and_every_picture_its_words(made):
    for element in made.page.all("input", "select"):
        assert element.in_label or element.attributes.get("aria-label"), element.attributes
    for element in made.page.all("button"):
        assert element.attributes.get("aria-label")
    for element in made.page.all("img"):
        # That of the views is given its words by the script.
        assert "data-img" in element.attributes or len(element.attributes["alt"]) > 20
    plots = [e for e in made.page.all("div") if e.attributes.get("class") == "plot"]
    assert len(plots) == 2 * 7
    assert all(len(plot.attributes["aria-label"]) > 20 for plot in plots)
    assert len(made.page.all("figcaption")) == len(made.page.all("figure"))
    assert made.page.all("html")[0].attributes["lang"] == "en"


def test_the_page_is_small_enough_and_its_data_can_be_read(made):
    assert len(made.text.encode()) < MOST_BYTES
    [element] = [e for e in made.page.all("script") if e.attributes.get("id") == "data"]
    data = json.loads(element.text)
    assert [sweep["name"] for sweep in data["sweeps"]] == ["zooming", "pairs"]
    keys = {key for sweep in data["sweeps"] for step in sweep["views"] for _, key in step}
    assert keys == {row["view"] for row in rows(made, "views")} == set(data["views"])
    assert all(set(view["pictures"]) == {"clean", "noisy", "depth", "blur"} for view in data["views"].values())


def test_the_script_finds_every_column_of_every_figure(made):
    """Each figure at each step is one that plotly accepts, whatever is chosen."""
    for table, steps in zip(made.tables, made.steps, strict=True):
        section = section_of(table, "title", steps)
        for figure in section.figures:
            every = combinations((section.model_choice, KIND_CHOICE, *figure.choices))
            for step, columns in enumerate(section.columns):
                # plotly's check takes a while: at one step all choices, at the others one.
                for chosen in every if step == 0 else every[:1]:
                    drawn = filled(figure, columns, chosen)
                    assert drawn["data"], figure.id
                    if step == 0 and chosen in every[:: max(1, len(every) // 3)]:
                        go.Figure(drawn)


# ---- numbers ---------------------------------------------------------------------------------------------------------


def test_tables_come_back_as_they_were_written(made):
    for table, result in zip(made.tables, made.results, strict=True):
        for kind, single in zip(KINDS, (True, False), strict=True):
            np.testing.assert_allclose(table.measured_pss(kind).values, result.measured_pss(single), rtol=SAME_DIGITS)
            for model in table.models:
                requested = result.predicted_pss(model, single)
                np.testing.assert_allclose(table.predicted_pss(model, kind).values, requested, rtol=SAME_DIGITS)
        for step, assessment in enumerate(result.assessments):
            requested = assessment.predicted["corrected"].sigma_m * 1000
            np.testing.assert_allclose(table.predicted_mm("corrected", KINDS[1])[step], requested, rtol=SAME_DIGITS)
            np.testing.assert_allclose(
                table.measured_mm(KINDS[0])[step], assessment.measured.errors.sigma_m * 1000, rtol=SAME_DIGITS
            )


def test_the_error_budget_multiplies_to_measured_over_predicted(made):
    """The factors that the page draws, each as its table has it."""
    for table in made.tables:
        of = [r for r in rows(made, "configurations") if (r["sweep"], r["noise_model"]) == (table.name, "corrected")]
        for columns, row in zip(budget_columns(table), of, strict=True):
            *factors, total = columns["factors|corrected"]
            names = ("visibility", "noise_model", "detector", "geometry")
            requested = [float(row[f"budget_{name}"] or "nan") for name in names]
            drawn = [math.nan if factor is None else factor for factor in factors]
            assert drawn == pytest.approx(requested, rel=DRAWN_DIGITS * 10, nan_ok=True)
            if None in factors:
                continue
            measured, predicted = float(row["measured_pss_single_frame"]), float(row["pss_single_frame"])
            assert total == pytest.approx(measured / predicted, rel=DRAWN_DIGITS * 10)
            assert math.prod(factors) == pytest.approx(total, rel=DRAWN_DIGITS * 40)


def test_a_sight_has_the_bias_and_the_scatter_of_its_detections():
    camera = PTZCamera((0, 0, 1), 0, 0)
    points, rng = np.array([[0.0, 3.0, 1.0], [0.4, 4.0, 1.2], [0.0, -2.0, 1.0]]), np.random.default_rng(5)
    axes = np.array([[0.3, 0.0], [0.2, 0.1]])
    pixels = camera.project(points)[0] + (0.05, -0.02) + rng.normal(size=(MANY_TRIALS, 3, 2)) @ axes.T
    pixels[:, 2] = np.nan
    pixels[: MANY_TRIALS // 4, 1] = np.nan
    sight = sight_of(camera, points, "key", ViewMeasurement(pixels, np.zeros((MANY_TRIALS, 3, 2, 2)), 0, 0.0))
    np.testing.assert_allclose(sight.rate, [1, 0.75, 0])
    largest = math.sqrt(np.linalg.eigvalsh(axes @ axes.T)[-1])
    np.testing.assert_allclose(sight.spread_px[:2], largest, rtol=MONTE_CARLO)
    np.testing.assert_allclose(sight.offset_px[:2], [[0.05, -0.02]] * 2, atol=5 * largest / math.sqrt(MANY_TRIALS / 2))
    assert np.isnan(sight.truth_px[2]).all()
    assert np.isnan(sight.offset_px[2]).all()


def test_steps_without_what_stayed_the_same_are_the_same_steps():
    steps = [{"a": 1, "b": [1, None]}, {"a": 1, "b": [2, None]}, {"a": 1, "b": [2, None]}, {"a": 2, "b": [1, None]}]
    kept, seen = only_changes(steps), {}
    assert kept[2] == {}
    for short, whole in zip(kept, steps, strict=True):
        seen |= short
        assert seen == whole


def test_what_json_lacks_is_none():
    assert plain(np.array([1.23456, np.nan, np.inf])) == [1.235, None, None]
    assert plain(np.array([[1.0, 2.0], [np.nan, 4.0]])) == [[1, 2], [None, 4]]
    assert plain(np.array([True, False])) == [1, 0]


# ---- without colour vision -------------------------------------------------------------------------------------------


def lightness(colour):
    """CIE L* of #rrggbb, by OpenCV."""
    rgb = np.array([[[int(colour[n : n + 2], 16) for n in (1, 3, 5)]]], dtype=np.uint8)
    return int(cv2.cvtColor(rgb, cv2.COLOR_RGB2LAB)[0, 0, 0])


def test_a_scale_of_errors_is_read_by_its_lightness_alone():
    values = [lightness(colour) for _, colour in VIRIDIS]
    assert all(one > other for one, other in pairwise(values))
    # The scale of ratios is dark at both ends: there, signs tell the sides apart (below).
    ends, middle = [lightness(PURPLE_ORANGE[n][1]) for n in (0, -1)], lightness(PURPLE_ORANGE[2][1])
    assert max(ends) < middle


def test_curves_are_told_apart_by_dash_and_symbol():
    styles = [model_style(number)[1:] for number in range(6)]
    assert len(set(styles)) == 6
    assert len({symbol for _, symbol in object_styles(("a", "b", "c", "d")).values()}) == 4


# ---- space -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("focus_m", [1.0, 4.0])
def test_a_frustum_ends_at_the_focus_or_at_the_walls_and_in_the_images_corners(focus_m):
    room = Room(6, 6, 3, 0.5, 0.5, 0.5)
    camera = PTZCamera((0.5, -2.0, 2.0), 20, -15, zoom=2, focus_distance_m=focus_m)
    found = frustum(camera, room)
    pixels, depth = camera.project(found.ends)
    width, height = camera.resolution
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]]) - 0.5
    np.testing.assert_allclose(pixels, corners, atol=1e-6)
    reach = np.abs(found.ends / (3, 3, 1.5) - (0, 0, 1)).max(axis=1)
    assert (np.isclose(depth, focus_m) | np.isclose(reach, 1)).all()
    assert (reach <= 1 + 1e-9).all()
    # The plane in focus is cut at the walls, and lies at the focus.
    np.testing.assert_allclose(camera.to_camera_frame(found.plane)[:, 2], focus_m)
    assert (np.abs(found.plane / (3, 3, 1.5) - (0, 0, 1)) <= 1 + 1e-9).all()


def test_the_ellipsoids_are_the_predicted_covariances(made):
    """The roots that the page draws from, multiplied out, against C itself."""
    table, steps = made.tables[0], made.steps[0]
    for columns, assessment in zip(scene_columns(table, steps), made.results[0].assessments, strict=True):
        requested = assessment.predicted["corrected"].single_frame_covariance * 1e6
        for root, covariance in zip(columns["root|single|corrected"], requested, strict=True):
            if root[0] is None:
                assert np.isnan(covariance).any()
                continue
            lower = np.zeros((3, 3))
            lower[np.tril_indices(3)] = root
            scale = np.abs(covariance).max()
            np.testing.assert_allclose(lower @ lower.T / scale, covariance / scale, atol=10 * DRAWN_DIGITS)


def test_the_model_file_has_the_markers_where_they_are(made):
    scene = trimesh.load(made.out / "scene.glb")
    state = made.steps[0][0].state
    for marker in state.markers:
        transform, name = scene.graph[f"marker {marker.id} on {marker.object_name}"]
        centre = trimesh.transform_points(scene.geometry[name].vertices, transform).mean(axis=0)
        x, y, z = np.array(marker.centre_m) + 0.004 * np.array(marker.normal)
        np.testing.assert_allclose(centre, (x, z, -y), atol=1e-5)
        # Reading it back rounds the linear colour to a byte.
        material = scene.geometry[name].visual.material
        colour = np.array(linear(scene.geometry[name].metadata["srgb"]))
        np.testing.assert_allclose(material.baseColorFactor[:3] / 255, colour, atol=0.5 / 255 + 1e-9)
        assert material.metallicFactor == 0
    assert any(name.startswith("field of view") for name in scene.graph.nodes_geometry)
    assert (made.out / "scene_pairs.glb").exists()


# ---- pictures --------------------------------------------------------------------------------------------------------


def test_the_crops_are_the_best_and_the_worst_of_all_views(made):
    steps = made.steps[0]
    crops = chosen_crops(steps)
    every = [
        math.hypot(*sight.offset_px[n], sight.spread_px[n])
        for step in steps
        for row, sight in zip(step.visible, step.sights, strict=True)
        for n in np.flatnonzero(row & sight.found)
        if np.isfinite(sight.spread_px[n])
    ]
    best, worst = ([c.error_px for c in crops if c.kind == kind] for kind in ("best", "worst"))
    assert best[0] == pytest.approx(min(every))
    assert worst[0] == pytest.approx(max(every))
    assert max(best) <= min(worst)


def test_pictures_shrink_to_the_budget(made, monkeypatch):
    steps = made.steps[1]
    large = pictures_of(steps, [], made.store)
    size = sum(len(uri) for view in large.views.values() for uri in view.values())
    assert size < BUDGET_BYTES
    monkeypatch.setattr("validate.pages.images.BUDGET_BYTES", 0.7 * size)
    small = pictures_of(steps, [], made.store)
    assert small.width_px < large.width_px
    assert sum(len(uri) for view in small.views.values() for uri in view.values()) < 0.7 * size


# ---- mistakes --------------------------------------------------------------------------------------------------------


def test_a_folder_that_no_run_has_left_is_refused(made, tmp_path):
    with pytest.raises(StoreError, match=r"run\.json"):
        remade(made.out)
    with pytest.raises(StoreError, match=r"configurations\.csv"):
        read_sweeps(tmp_path)


def test_a_run_of_an_older_version_is_to_be_run_again(made, tmp_path):
    older = shutil.copytree(made.out, tmp_path / "older")
    of = [{k: v for k, v in row.items() if k != "budget_detector"} for row in rows(made, "configurations")]
    write_csv(older / "configurations.csv", of)
    with pytest.raises(StoreError, match="older version, without budget_detector; run it again"):
        read_sweeps(older)


# ---- tables that were changed ----------------------------------------------------------------------------------------

# A few of those that 200 random changes were tried with.
CHANGES = {
    "half of the points": ("points", lambda text: text[: len(text) // 2], r"points\.csv: line \d+ has|points\.csv has"),
    "no points": ("points", lambda text: text.partition("\n")[0] + "\n", r"no row in points\.csv"),
    "a point less": ("points", lambda text: text[: text[:-1].rindex("\n") + 1], r"points\.csv has \d+ rows of"),
    "a word in a number's place": (
        "points",
        lambda text: text.replace(text.split("\n")[3].split(",")[-1], "x", 1),
        r"points\.csv: line \d+: nees_detections = 'x'; allowed: a number",
    ),
    "a word in an interval's place": (
        "correlation",
        lambda text: re.sub(r"(?m)^((?:[^,\n]*,){8})[-0-9.]+", r"\1x", text, count=1),
        r"correlation\.csv: line \d+: spearman_ci_low = 'x'",
    ),
    "another column": (
        "configurations",
        lambda text: text.replace("noise_model", "model", 1),
        r"configurations\.csv: line 2: there is no column 'noise_model'",
    ),
    "no detections": ("detection", lambda text: text.partition("\n")[0] + "\n", r"no row in detection\.csv"),
    "bytes": ("claims", lambda text: "\ud800", "is no text"),
}


@pytest.mark.parametrize("what", CHANGES)
def test_a_table_that_was_changed_is_one_line(made, tmp_path, what):
    """With the file, and where it can be, the line in it; until now some were tracebacks."""
    name, change, message = CHANGES[what]
    for path in made.out.glob("*.csv"):
        text = path.read_text(encoding="utf-8")
        new = change(text) if path.stem == name else text
        (tmp_path / path.name).write_text(new, encoding="utf-8", errors="surrogatepass")

    def report():
        return [section_of(table, "a", steps) for table, steps in zip(read_sweeps(tmp_path), made.steps, strict=True)]

    with pytest.raises(StoreError, match=message):
        report()
