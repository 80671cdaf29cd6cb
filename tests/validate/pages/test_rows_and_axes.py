"""Figures of pages: a logarithmic axis has whole numbers, and a row without a dot has words in its place."""

from __future__ import annotations

import json
import math
import re

import numpy as np
import pytest

from pss import PTZCamera
from render.world.state import Room
from tests.helpers.closet import SCENE, SELECTION, SWEEP
from tests.helpers.compared_runs import a_run
from tests.helpers.made_up_run import made_up_run
from tests.helpers.made_up_schedule import made_up_schedule
from validate.pages.empty_rows import NO_ORDER, Sign, empty_row_words
from validate.pages.scene3d import EYE, fitted_camera
from validate.run_sweep import main

pytestmark = pytest.mark.slow


def figures_of(page):
    """The figures of a page's data, with the section that each is in."""
    data = json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)[1])
    return [(part, figure) for part in data.get("sweeps", data.get("sections")) for figure in part["figures"]]


@pytest.fixture(scope="module")
def pages(tmp_path_factory):
    """The pages of a made-up run, of a schedule, and of a comparison of two runs, one of which has no ρ."""
    folder = tmp_path_factory.mktemp("pages")
    for name in ("sweeps", "schedule"):
        (folder / name).mkdir()
    made_up_run(folder / "sweeps", SCENE, {"zooming": SWEEP, "pairs": SELECTION})
    a_run(folder / "one"), a_run(folder / "two", factor=2.0, rho=math.nan)
    assert main(["compare", str(folder / "one"), str(folder / "two"), "--out", str(folder / "compare.html")]) == 0
    schedule = made_up_schedule(folder / "schedule")
    return {
        "report": (folder / "sweeps" / "run" / "report.html").read_text(encoding="utf-8"),
        "hallway": (schedule.out / "report.html").read_text(encoding="utf-8"),
        "compare": (folder / "compare.html").read_text(encoding="utf-8"),
    }


def is_logarithmic(axis, figure):
    """Whether an axis is, or becomes so by a choice of the reader."""
    kind = axis.get("type", "linear")
    if isinstance(kind, dict):
        stem = kind["$"].partition("{")[0]
        return any(value == "log" for name, value in figure["columns"].items() if name.startswith(stem))
    return kind == "log"


@pytest.mark.parametrize(("name", "fewest"), [("report", 2), ("hallway", 1), ("compare", 1)])
def test_a_logarithmic_axis_writes_its_numbers_out(pages, name, fewest):
    """Plotly by itself writes 2 for 0.02 and for 20; with a format, or with texts of its own, it does not."""
    found = set()
    for _, figure in figures_of(pages[name]):
        for key, axis in figure["layout"].items():
            if re.match("[xy]axis", key) and is_logarithmic(axis, figure):
                found.add((figure["id"], key))
                assert axis.get("tickformat") == ".6~g" or "ticktext" in axis, (figure["id"], key)
    assert len(found) >= fewest


def worded_rows(figure):
    """For each setting of a figure's choices, the rows that have words."""
    for name, words in figure["columns"].items():
        if name.startswith("words|"):
            yield name.removeprefix("words|"), {round(each["y"]) for each in words if each["yref"] == "y"}


def test_each_row_of_the_leaderboard_has_a_dot_or_words(pages):
    """Some metric is the same at every step of a sweep, and has no order."""
    judged = without = 0
    for _, figure in figures_of(pages["report"]):
        if figure["id"] != "leaderboard":
            continue
        columns = figure["columns"]
        for stem, worded in worded_rows(figure):
            rows, dotted = set(range(len(columns[f"rows|{stem}"]))), set()
            for key, values in columns.items():
                if key.startswith(f"rho|{stem}|"):
                    at = columns[key.replace("rho|", "row|", 1)]
                    dotted |= {round(place) for place, value in zip(at, values, strict=True) if value is not None}
            assert rows <= dotted | worded
            judged += len(rows)
            without += len(rows - dotted)
    assert judged > 10
    assert without > 0


@pytest.mark.parametrize("identity", ["ranking", "agreement"])
def test_each_row_of_a_schedules_figures_has_a_dot_or_words(pages, identity):
    """Of every setting of its choices."""
    ((_, figure),) = [found for found in figures_of(pages["hallway"]) if found[1]["id"] == identity]
    columns = figure["columns"]
    for stem, worded in worded_rows(figure):
        if identity == "ranking":
            limit, kind, model, measure = stem.split("|")
            ends = [f"{limit}|{kind}|{model}", f"{limit}|{kind}|{measure}"]
        else:
            ends = [name.removeprefix("at|") for name in columns if name.startswith(f"at|{stem}|")]
        values = [columns[f"at|{end}"] for end in ends]
        assert values
        for row in range(len(values[0])):
            assert row in worded or any(each[row] is not None for each in values), (stem, row)


def test_a_side_without_a_number_is_named_in_a_comparison(pages):
    """Where one side's ρ is undefined its row names it, and the row of differences says that there is none."""
    (figure,) = [figure for _, figure in figures_of(pages["compare"]) if figure["id"] == "correlation"]
    words = next(value for name, value in figure["columns"].items() if name.startswith("words|"))
    assert {each["text"] for each in words if each["yref"] == "y"} == {"two: undefined"}
    assert {each["text"] for each in words if each["yref"] == "y2"} == {"no difference"}


def test_words_of_rows():
    """One for a row that is empty, and one at the place of each dot that others have."""
    nothing, row = math.nan, (0, 1)
    signs = [Sign("a", row[0], -0.1, nothing), Sign("b", row[0], 0.1, nothing)]
    signs += [Sign("a", row[1], 0.9, 0.5), Sign("b", row[1], 1.1, nothing)]
    words = empty_row_words(signs, NO_ORDER)
    assert [(each["text"], each["y"]) for each in words] == [(NO_ORDER, 0.0), ("b: undefined", 1.1)]


@pytest.mark.parametrize("sides_m", [(6, 6, 3), (3, 60, 4), (2, 2, 20)])
@pytest.mark.parametrize("aspect", [1.75, 0.9])
def test_a_room_fits_into_the_scene_in_space(sides_m, aspect):
    """Its eight corners are within a pinhole's image of 45° in height; some corner is near the border of it."""
    room = Room(*sides_m, 0.5, 0.5, 0.5)
    eye, centre = (np.array(list(place.values())) for place in fitted_camera(room, EYE, aspect).values())
    sides = np.array(sides_m)
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * sides / 2
    unit_m = np.prod(sides) ** (1 / 3)
    camera = PTZCamera(tuple(eye * unit_m), 0.0, 0.0, 1.0, resolution=(round(1000 * aspect), 1000))
    camera = camera.aimed_at(tuple(centre * unit_m))
    pixels, depth_m = camera.project(corners)
    half_px = np.abs(pixels - camera.principal_point_px) / camera.focal_px / math.tan(math.radians(22.5)) / (aspect, 1)
    assert (depth_m > 0).all()
    assert 0.98 < half_px.max() < 1.001
