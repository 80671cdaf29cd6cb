"""The drawing of `check`: each word is in the figure and on no other, whatever the cameras and their names."""

from __future__ import annotations

import dataclasses
import warnings
from pathlib import Path

import matplotlib.font_manager
import numpy as np
import pytest
from matplotlib.text import Annotation, Text

import scenes
from tests.helpers.layout_of_words import assert_words_are_legible, drawable, extents
from validate.plots.camera_table import MOST_BESIDE
from validate.plots.glyphs import glyph_runs
from validate.plots.names_beside import shortened, width_of
from validate.plots.plan import plan_figure, write_plan
from validate.prediction.foresight import foresee

ROOM = Path(__file__).parents[3] / "scenes" / "room.toml"
# Letters that many machines have no font for; and a name of them, or of others that any has.
WIDE = "北側カメラ"
NORTH = drawable(WIDE, "Север")
NO_FONT = "\U000e0041"  # a letter that is in no font


def around(count, name=lambda number: str(number + 1)):
    """The room with so many cameras around it, and a few of its markers."""
    scene = scenes.load(ROOM)
    state = dataclasses.replace(scene.state, markers=scene.state.markers[::6])
    cameras = []
    for number in range(count):
        turn = 2 * np.pi * number / count
        place = (2.8 * float(np.cos(turn)), 2.8 * float(np.sin(turn)), 2.8 if number % 2 else 1.8)
        camera = dataclasses.replace(scene.cameras[0], name=name(number), position_m=place)
        cameras.append(camera.aimed_at((0.0, -0.3, 1.3)))
    return scene.replace(state=state, cameras=tuple(cameras))


def beside_each_other():
    """Seven cameras, each nearer to the next than its sign is large."""
    scene = around(7)
    cameras = tuple(
        dataclasses.replace(camera, position_m=(-2.8 + 0.08 * number, 2.5 - 0.05 * number, 2.8))
        for number, camera in enumerate(scene.cameras)
    )
    return scene.replace(cameras=cameras)


SCENES = {
    "seven": lambda: around(7),
    "beside each other": beside_each_other,
    "fourteen": lambda: around(MOST_BESIDE, lambda number: f"north-wall-upper-{number:02d}"),
    "sixty": lambda: around(60),
    "another script": lambda: around(12, lambda number: f"{NORTH}{number}"),
}


@pytest.mark.parametrize("name", sorted(SCENES))
def test_words_cover_no_words_and_stay_in_the_figure(name):
    """Titles, numbers, names, table and key; and names cover no camera's sign."""
    seen = foresee(SCENES[name]())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = plan_figure(seen)
        figure.draw_without_rendering()
    assert_words_are_legible(figure)
    texts = [text for text in figure.findobj(Annotation) if text.get_visible()]
    plan = [text for text in texts if text.axes.get_title() == "plan"]
    assert len(plan) == len(seen.scene.cameras)
    for text in texts:
        signs = [other.axes.transData.transform(other.xy) for other in texts if other.axes is text.axes]
        (box,) = extents([text])
        assert not any((box[:2] < sign).all() and (sign < box[2:]).all() for sign in signs), text.get_text()


def test_each_camera_has_its_line_in_the_table():
    """Beside the plan or, of many, below it: as many names as cameras, with as many counts of markers seen."""
    for count in (MOST_BESIDE, 60):
        seen = foresee(around(count))
        figure = plan_figure(seen)
        words = [text.get_text() for text in figure.findobj(Text)]
        assert all(words.count(camera.name) >= 1 for camera in seen.scene.cameras)
        assert sum(word == str(int(seen.visible[0].sum())) for word in words) >= 1
        assert figure.get_figheight() == pytest.approx(9.0 if count == MOST_BESIDE else 9.0 + 23 * 0.19)


def test_a_letter_that_no_font_has_is_written_as_its_number(tmp_path, monkeypatch, caplog):
    """Without a font for it, two names stay two; nothing is reported for either, and the file is written."""
    scene = around(2, lambda number: f"{WIDE[number]}{NO_FONT}")
    default = [font for font in matplotlib.font_manager.fontManager.ttflist if font.name.startswith("DejaVu")]
    monkeypatch.setattr(matplotlib.font_manager.fontManager, "ttflist", default)
    from validate.plots import glyphs

    glyphs._families_with.cache_clear()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        figure = plan_figure(foresee(scene))
        write_plan(tmp_path / "plan.svg", foresee(scene))
    words = {text.get_text() for text in figure.findobj(Annotation)}
    glyphs._families_with.cache_clear()
    assert words >= {f"U+{ord(WIDE[0]):04X}U+E0041", f"U+{ord(WIDE[1]):04X}U+E0041"}
    assert not [record for record in caplog.records if record.levelname == "WARNING"]


def test_parts_of_a_text_have_fonts_with_their_letters():
    """Joined they are the text; each part's font has all of its letters."""
    words = f"{NORTH} zoom=2 Ж"
    runs = glyph_runs(words)
    if "".join(part for _, part in runs) != words:
        pytest.skip("no font here has these letters")
    for file, part in runs:
        letters = matplotlib.font_manager.get_font(file).get_charmap()
        assert all(ord(sign) in letters for sign in part)


@pytest.mark.parametrize(
    ("name", "expected"),
    [("7", "7"), ("north-wall-upper-07", "north-…pper-07"), ("北側カメラ東西南07", "北側カ…西南07"), ("", "")],
)
def test_a_long_name_keeps_both_ends(name, expected):
    """A letter of a wide script counts two."""
    assert shortened(name, 14) == expected
    assert width_of(shortened(name, 14)) <= 14
