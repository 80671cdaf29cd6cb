"""A run's figures as pictures: what is drawn in space, which steps, and that nothing covers what it should not."""

from __future__ import annotations

import dataclasses
import re
import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
from matplotlib.collections import PolyCollection
from matplotlib.text import Annotation
from matplotlib.transforms import Bbox

import scenes
from pss import Box
from tests.helpers.layout_of_words import assert_words_are_legible, drawable
from tests.helpers.predicted_result import predicted_result
from validate.plots.glyphs import settle_words
from validate.plots.projected import Eye, patches_of
from validate.plots.room3d import SOLIDS, draw_state
from validate.plots.sweep import draw_curves, shown_steps, sweep_figure, write_round_numbers
from validate.stats.stars import star_heights

pytestmark = pytest.mark.slow

SCENES = Path(__file__).parents[3] / "scenes"
# px: what rounding to whole pixels may add to an extent.
ROUNDING_PX = 1.0
# Levels of 255: a difference that an eye sees.
VISIBLE_LEVELS = 12
# Cosine under which a plate is narrower than a few pixels, and its border is all that is drawn.
EDGE_ON = 0.3
# Levels of 255 between neighbours' colours, less what mixing with a border leaves.
SAME_LEVELS = 2
AT_A_RIM = 1


@pytest.fixture(scope="module")
def result():
    """Four steps of the zoom sweep, of which the third was measured best and the first worst."""
    return predicted_result("zoom", measured=(1.0, 2.0, 4.0, 3.0))


@pytest.fixture(scope="module")
def figure(result):
    """Its figure, drawn once."""
    made = sweep_figure(result)
    made.canvas.draw()
    yield made
    plt.close(made)


def pieces(axes) -> list[np.ndarray]:
    """Corners on paper of what was drawn of objects and markers, the farthest first."""
    (solids,) = (c for c in axes.collections if isinstance(c, PolyCollection) and c.get_zorder() == SOLIDS)
    return [path.vertices for path in solids.get_paths()]


def drawn_state(state, eye, colours=None):
    """Axes with a state in them, every marker red unless `colours` (N, 4) are given."""
    axes = plt.figure(figsize=(8, 6), dpi=150).add_axes((0, 0, 1, 1))
    red = np.tile([1.0, 0.0, 0.0, 1.0], (len(state.markers), 1))
    draw_state(axes, state, eye, red if colours is None else colours)
    axes.figure.canvas.draw()
    return axes


def test_boxes_are_drawn(result):
    """The room's plinth has patches, and its front is seen: darker than the wall behind it."""
    state = scenes.load("scenes/room.toml").state
    eye = Eye(state.room, 20.0, 62.0)
    plinth = next(item for item in state.objects if isinstance(item.shape, Box))
    without = dataclasses.replace(state, objects=tuple(item for item in state.objects if item is not plinth))
    pictures, counts = [], []
    for each in (state, without):
        axes = drawn_state(each, eye)
        counts.append(len(pieces(axes)))
        front = np.array([plinth.shape.highest_m[0], plinth.shape.highest_m[1], 0.3])
        x, y = axes.transData.transform(eye.flat(front - (0.05, 0.0, 0.0)))
        picture = np.asarray(axes.figure.canvas.buffer_rgba())
        pictures.append(picture[int(picture.shape[0] - y), int(x), :3].astype(int))
        plt.close(axes.figure)
    assert counts[0] - counts[1] == len(patches_of(plinth.shape).corners_m) > 6
    assert (pictures[1] - pictures[0]).min() > VISIBLE_LEVELS


# From the lower eyes a dozen markers that face them are behind objects.
@pytest.mark.parametrize(
    ("elevation_deg", "azimuth_deg"),
    [(38.0, 62.0), (38.0, 150.0), (38.0, 242.0), (38.0, 330.0), (15.0, 62.0), (15.0, 285.0)],
)
def test_a_marker_is_seen_where_the_eye_has_a_line_of_sight(elevation_deg, azimuth_deg):
    """Its middle has its own colour exactly if no object is before it: by the shapes' own test of lines of sight."""
    state = scenes.load("scenes/room.toml").state
    eye = Eye(state.room, elevation_deg, azimuth_deg)
    own = np.zeros((len(state.markers), 4))
    own[:, 0], own[:, 1], own[:, 3] = 1.0, np.arange(len(own)) / len(own), 1.0
    axes = drawn_state(state, eye, own)
    picture = np.asarray(axes.figure.canvas.buffer_rgba()).astype(int)
    places = axes.transData.transform(eye.flat(state.points_m))
    plt.close(axes.figure)
    to_eye = eye.place_m - state.points_m
    cosine = (to_eye * state.normals).sum(axis=1) / np.linalg.norm(to_eye, axis=1)
    judged, wrong = 0, []
    for number, (x, y) in enumerate(places):
        if 0 <= cosine[number] < EDGE_ON:
            continue
        lifted = state.points_m[number] + 1e-3 * state.normals[number]
        free = cosine[number] > 0 and not any(
            item.shape.blocks(lifted[None], eye.place_m[None])[0] for item in state.objects
        )
        colour = picture[int(picture.shape[0] - y), int(x), :3]
        judged += 1
        if bool(free) != (np.abs(colour - 255 * own[number, :3]).max() < SAME_LEVELS):
            wrong.append((state.markers[number].id, bool(free), colour.tolist(), (255 * own[number, :3]).tolist()))
    assert judged > 0.8 * len(places)
    # At the rim of what hides it a marker's middle may be either.
    assert len(wrong) <= AT_A_RIM, wrong


def test_the_room_and_all_words_are_in_the_figure(figure):
    """Every corner of the room, every title, label, number and legend."""
    whole = figure.get_window_extent().padded(ROUNDING_PX)
    for axes in figure.axes[:2]:
        box = axes.get_window_extent().padded(ROUNDING_PX)
        for lines in axes.collections:
            for path in lines.get_paths():
                assert all(box.contains(*corner) for corner in axes.transData.transform(path.vertices))
    for axes in figure.axes:
        for text in (axes.title, *axes.texts, axes.xaxis.label, axes.yaxis.label, *axes.get_xticklabels()):
            if text.get_text() and text.get_visible() and axes.axison:
                extent = text.get_window_extent()
                assert whole.contains(*extent.min), text.get_text()
                assert whole.contains(*extent.max), text.get_text()


def test_names_cover_neither_names_nor_cameras(figure):
    """In both drawings each camera is named, over all that is drawn, and no name lies on another or on a sign."""
    for axes in figure.axes[:2]:
        names = [text for text in axes.texts if isinstance(text, Annotation)]
        assert sorted(text.get_text() for text in names) == list("1234567")
        assert all(text.get_visible() for text in names)
        assert min(text.get_zorder() for text in names) > max(c.get_zorder() for c in (*axes.collections, *axes.lines))
        boxes = [super(Annotation, text).get_window_extent() for text in names]
        signs = [axes.transData.transform(text.xy) for text in names]
        for number, box in enumerate(boxes):
            assert not any(box.overlaps(other) for other in boxes[number + 1 :])
            assert not any(box.contains(*sign) for sign in signs)


def test_the_best_and_the_worst_step_are_shown(figure, result):
    """Of four steps the third and the first, in the sweep's order; where nothing was measured, by the prediction."""
    assert shown_steps(result) == {0: "worst measured", 2: "best measured"}
    titles = [axes.get_title().partition(chr(10))[0] for axes in figure.axes[:2]]
    assert titles == ["worst measured: zoom=1", "best measured: zoom=2"]
    middle = predicted_result("zoom", measured=(3.0, 4.0, 1.0, 2.0))
    assert shown_steps(middle) == {1: "best measured", 2: "worst measured"}
    nothing = predicted_result("zoom", measured=(0.0, 0.0))
    assert sorted(shown_steps(nothing).values()) == ["best predicted", "worst predicted"]
    flat = predicted_result("zoom", measured=(1.0, 1.1, 1.05))
    flat.exchanged_ranges = np.ones(100)
    assert shown_steps(flat) == {0: "lowest measured", 1: "highest measured"}
    alone = predicted_result("zoom", measured=(2.0,))
    assert shown_steps(alone) == {0: "the only step"}
    assert len(sweep_figure(alone).axes) == 4
    plt.close("all")


def test_stars_do_not_cover_each_other():
    """Four curves with their optimum at the same step have four stars above each other, in the order of the legend."""
    assert star_heights([2.0, 2.0, None, 2.1, 5.0], 8.0) == [1.0, 1.075, None, 1.15, 1.0]
    result = predicted_result("zoom", measured=(1.0, 2.0, 4.0, 3.0))
    result.predicted_pss = lambda model, single_frame=True: result.measured_pss(single_frame)
    made = plt.figure(figsize=(6, 5), layout="constrained")
    axes = made.add_subplot()
    draw_curves(axes, result, single_frame=True)
    made.canvas.draw()
    stars = [line for line in axes.lines if line.get_marker() == "*"]
    assert len(stars) == 1 + len(result.noise_models)
    half_px = stars[0].get_markersize() / 2 * made.dpi / 72
    places = [axes.transData.transform((star.get_xdata()[1], star.get_ydata()[1])) for star in stars]
    boxes = [Bbox([place - half_px, place + half_px]) for place in places]
    legend = axes.get_legend().get_window_extent()
    assert not any(box.overlaps(legend) for box in boxes)
    for number, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[number + 1 :])
        assert axes.get_window_extent().contains(*box.max)
    plt.close(made)


@pytest.mark.parametrize("name", [drawable("北側カメラ{}", "Север{}"), "north-wall-upper-{}", "{}"])
def test_words_are_legible_whatever_cameras_are_called(tmp_path, name):
    """Of a selection, whose steps are called after cameras; without a warning of letters that are missing."""
    for file in ("room.toml", "sweeps/selection.toml"):
        text = (SCENES / file).read_text(encoding="utf-8").replace("../room.toml", "room.toml")
        renamed = re.sub(r'"(\d)"', lambda found: '"' + name.format(found[1]) + '"', text)
        (tmp_path / Path(file).name).write_text(renamed, encoding="utf-8")
    result = predicted_result(str(tmp_path / "selection.toml"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = sweep_figure(result)
        settle_words(figure)
        figure.draw_without_rendering()
    assert_words_are_legible(figure)
    plt.close(figure)


@pytest.mark.parametrize("ends", [(0.21, 0.26), (0.3, 0.45), (0.02, 0.8), (1e-4, 300.0)])
def test_a_logarithmic_axis_has_a_few_whole_numbers(ends):
    """Two at the least, however little of a decade it spans; no more than can be read of many decades."""
    axes = plt.figure(figsize=(5.6, 5.2), layout="constrained").add_subplot(xscale="log")
    axes.plot(ends, ends)
    write_round_numbers(axes.xaxis, np.array(ends))
    axes.figure.draw_without_rendering()
    texts = [text.get_text() for text in axes.get_xticklabels()]
    assert 2 <= len(texts) <= 7
    np.testing.assert_allclose([float(text) for text in texts], axes.get_xticks(), rtol=1e-9)
    assert_words_are_legible(axes.figure)
    plt.close(axes.figure)
