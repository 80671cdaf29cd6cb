"""A report of many sweeps in a browser with few WebGL contexts: each figure in space is drawn, and few are alive."""

from __future__ import annotations

import io

import numpy as np
import pytest
from PIL import Image

from tests.helpers.closet import SCENE, SWEEP
from tests.helpers.made_up_run import made_up_run

pytest.importorskip("selenium", reason="selenium is not installed")

from tests.helpers.browsing import NEEDS_BROWSER, PATIENCE_S, PHONE, drawn, errors, opened, shown, until

pytestmark = NEEDS_BROWSER

SWEEPS = 9
# As many as some browsers have; `MOST_SCENES` of figures.js.
CONTEXTS, MOST_SCENES = 8, 4
# Of 255: a blank figure has no two pixels that differ so.
CONTRAST = 60
# Characters: a picture of nothing takes a tenth of it.
EMPTY_PICTURE = 20_000
COUNTING = """
window.contexts = [];
const original = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
  const context = original.call(this, kind, ...rest);
  if (context && /webgl/.test(kind) && !window.contexts.includes(context)) window.contexts.push(context);
  return context;
};
"""
ALIVE = "return window.contexts.filter((context) => !context.isContextLost()).length"
CANVAS = "return arguments[0].querySelector('.gl-container canvas, .gl-container img')"


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The report of a made-up run of many sweeps."""
    folder = tmp_path_factory.mktemp("many")
    made_up_run(folder, SCENE, {f"zooming{number}": SWEEP for number in range(SWEEPS)})
    return folder / "run" / "report.html"


@pytest.fixture
def browser(report):
    """Chromium with few contexts, which counts those that a page has."""
    with opened(report, f"--max-active-webgl-contexts={CONTEXTS}") as driver:
        driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": COUNTING})
        driver.get(report.as_uri())
        yield driver


def in_space(browser, section):
    """The figure in space of a section, once it is drawn."""
    return drawn(browser, f"{section} [data-figure=scene] .plot")


def contrast(browser, plot):
    """The range of greys of what is seen in the middle of a figure."""
    browser.execute_script("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", plot)
    picture = np.asarray(Image.open(io.BytesIO(plot.screenshot_as_png)).convert("L")).astype(int)
    height, width = picture.shape
    return np.ptp(picture[height // 4 : -height // 4, width // 4 : -width // 4])


def sections(browser):
    """Selectors of the page's sweeps."""
    return [
        f"[data-sweep='{number}']"
        for number in range(browser.execute_script("return document.querySelectorAll('[data-sweep]').length"))
    ]


def test_each_scene_is_drawn_and_few_contexts_are_alive(browser):
    """Down the page and up again; never more contexts than stated, none lost to another, no figure blank."""
    every = sections(browser)
    assert len(every) == SWEEPS > CONTEXTS
    for section in (*every, *reversed(every)):
        plot = in_space(browser, section)
        until(browser, lambda d, plot=plot: contrast(d, plot) > CONTRAST)
        assert browser.execute_script(ALIVE) <= MOST_SCENES
    assert not errors(browser)


def test_a_scene_comes_back_as_the_reader_turned_it(browser):
    """The eye stays where it was when the figure goes out of view and comes back."""
    first, *_, last = sections(browser)
    plot = in_space(browser, first)
    eye = {"eye": {"x": 1.5, "y": -0.5, "z": 0.25}}
    browser.execute_script("Plotly.relayout(arguments[0], {'scene.camera': arguments[1]})", plot, eye)
    in_space(browser, last)
    until(browser, lambda d: not d.execute_script("return arguments[0].querySelector('.main-svg')", plot))
    in_space(browser, first)
    assert browser.execute_script("return arguments[0].layout.scene.camera.eye", plot) == eye["eye"]
    # A marker can be chosen in it by clicking, as before.
    clicks = "return arguments[0]._ev.listenerCount ? arguments[0]._ev.listenerCount('plotly_click') : 1"
    assert browser.execute_script(clicks, plot) == 1


def test_scenes_side_by_side_beyond_the_limit_become_pictures(browser):
    """A window as high as the page: none is blank, and one that is pointed at is alive again."""
    window = {"width": 1200, "height": 60_000, "deviceScaleFactor": 0.1, "mobile": False}
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", window)
    every = "return document.querySelectorAll('[data-figure=scene] .main-svg:first-child').length"
    until(browser, lambda d: d.execute_script(every) == SWEEPS)
    assert browser.execute_script(ALIVE) <= MOST_SCENES
    frozen = "return [...document.querySelectorAll('.gl-container img')].length"
    assert browser.execute_script(frozen) == SWEEPS - MOST_SCENES
    picture = browser.execute_script("return document.querySelector('.gl-container img').closest('.plot-container')")
    browser.execute_script("arguments[0].dispatchEvent(new Event('pointerenter'))", picture)
    assert browser.execute_script(frozen) == SWEEPS - MOST_SCENES
    assert browser.execute_script(ALIVE) <= MOST_SCENES
    assert not errors(browser)


def test_paper_has_all_scenes(browser):
    """As the browser prints: each figure in space is a picture or alive, and none was lost."""
    browser.set_script_timeout(PATIENCE_S)
    browser.execute_script("window.dispatchEvent(new Event('beforeprint'))")
    shown_ones = browser.execute_script(
        "return [...document.querySelectorAll('[data-figure=scene] .gl-container')].map((box) => {"
        " const image = box.querySelector('img'), canvas = box.querySelector('canvas');"
        " return image ? image.src.length : canvas && !canvas.getContext('webgl').isContextLost(); })"
    )
    assert shown_ones.count(True) == MOST_SCENES
    pictures = [length for length in shown_ones if length is not True]
    assert len(pictures) == SWEEPS - MOST_SCENES
    assert min(pictures) > EMPTY_PICTURE
    assert browser.execute_script(ALIVE) <= MOST_SCENES
    assert not errors(browser)


def test_captions_are_no_wider_than_a_narrow_screen(browser):
    """Each caption begins and ends in the window, wherever its table is scrolled to."""
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", PHONE)
    shown(browser, "#verdict caption")
    boxes = browser.execute_script(
        "return [...document.querySelectorAll('caption')].filter((c) => c.offsetParent).flatMap((caption) => {"
        " const scroller = caption.closest('.scroll'), found = [];"
        " for (const left of [0, 10000]) { scroller.scrollLeft = left;"
        " const box = caption.getBoundingClientRect(); found.push([box.left, box.right]); }"
        " return found; })"
    )
    assert boxes
    for left, right in boxes:
        assert left >= 0
        assert right <= PHONE["width"]
