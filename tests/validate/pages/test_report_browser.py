"""The report in a real browser: it needs no network, draws without an error, and works by keyboard and on a phone."""

from __future__ import annotations

import base64
import re
import time

import cv2
import numpy as np
import pytest

from tests.helpers.closet import SCENE, SELECTION, SWEEP
from tests.helpers.made_up_run import made_up_run

pytest.importorskip("selenium", reason="selenium is not installed")

from selenium.webdriver.common.by import By  # only where it is installed
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select

from tests.helpers.browsing import (
    NEEDS_BROWSER,
    PHONE,
    asked_elsewhere,
    drawn,
    errors,
    opened,
    ready_ms,
    shown,
    until,
)

pytestmark = NEEDS_BROWSER

# Levels of 255 that an eye would see, and the share of a figure's pixels that a thin line covers at least.
VISIBLE_LEVELS, LEAST_CHANGE = 12, 5e-4
# s, for what is drawn to be on the screen.
SETTLED_S = 2.5
MOST_BYTES = 15_000_000


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The report of a made-up run."""
    folder = tmp_path_factory.mktemp("browser")
    made_up_run(folder, SCENE, {"zooming": SWEEP, "pairs": SELECTION})
    return folder / "run" / "report.html"


@pytest.fixture(scope="module")
def screenshots(tmp_path_factory):
    """The folder where the tests leave what they saw; kept for three sessions by pytest."""
    return tmp_path_factory.mktemp("screenshots")


@pytest.fixture(scope="module")
def browser(report):
    """Chromium with the report open."""
    with opened(report) as driver:
        yield driver


def test_it_opens_soon_and_is_small(browser, report):
    ready = ready_ms(browser)
    size = report.stat().st_size
    print(f"\nreport of {size:,} bytes, interactive after {ready / 1000:.1f} s on this machine as busy as it is")
    assert size <= MOST_BYTES
    assert ready > 0


def test_every_figure_is_drawn_without_an_error_and_without_the_network(browser, report):
    figures = browser.find_elements(By.CSS_SELECTOR, "[data-figure]")
    assert len(figures) == 2 * 7
    for section in ("sweep-1", "sweep-2"):
        for name in ("curves", "points", "leaderboard", "nees", "budget", "visibility", "scene"):
            drawn(browser, f"#{section} [data-figure={name}] .plot")
    assert not errors(browser)
    assert not asked_elsewhere(browser, report)


def test_the_slider_moves_all_figures_and_pictures_by_keyboard(browser):
    slider = shown(browser, "#sweep-1 [data-step]")
    slider.send_keys(Keys.HOME)
    label = browser.find_element(By.CSS_SELECTOR, "#sweep-1 [data-label]")
    assert label.text == "zoom=1.5"
    script = "return arguments[0].getAttribute('aria-label')"
    plots = [drawn(browser, f"#sweep-1 [data-figure={name}] .plot") for name in ("points", "budget", "scene")]
    before = [browser.execute_script("return JSON.stringify(arguments[0].data)", plot) for plot in plots]
    picture = shown(browser, "#sweep-1 [data-img]")
    until(browser, lambda d: "zoom=1.5" in picture.get_attribute("alt"))
    slider.send_keys(Keys.ARROW_RIGHT, Keys.ARROW_RIGHT)
    assert label.text == "zoom=3"
    assert slider.get_attribute("aria-valuetext") == "zoom=3"
    for plot, old in zip(plots, before, strict=True):
        browser.execute_script("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", plot)
        until(browser, lambda d, plot=plot: "zoom=3" in d.execute_script(script, plot))
        assert browser.execute_script("return JSON.stringify(arguments[0].data)", plot) != old
    shown(browser, "#sweep-1 [data-images]")
    until(browser, lambda d: "zoom=3" in picture.get_attribute("alt"))


def pixels(browser, element, folder, name):
    """What an element looks like, (height, width, 3); kept as NAME.png in `folder`."""

    def whole(driver):
        """A picture of all of it: what is drawn above it meanwhile moves it out of the window."""
        driver.execute_script("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", element)
        (folder / f"{name}.png").write_bytes(element.screenshot_as_png)
        picture = cv2.imread(str(folder / f"{name}.png"))
        return [picture.astype(int)] if picture.shape[0] == round(element.size["height"]) else []

    return until(browser, whole)[0]


def changed(one, other):
    """Share of the pixels that differ visibly."""
    return (np.abs(one - other).max(axis=-1) > VISIBLE_LEVELS).mean()


def test_what_is_seen_follows_slider_and_layers(browser, screenshots):
    """By screenshots: steps look different, and a layer that is switched off is gone and comes back the same."""
    slider = shown(browser, "#sweep-1 [data-step]")
    slider.send_keys(Keys.HOME)
    plot = drawn(browser, "#sweep-1 [data-figure=scene] .plot")
    label = "return arguments[0].getAttribute('aria-label')"
    until(browser, lambda d: "zoom=1.5" in d.execute_script(label, plot))
    time.sleep(SETTLED_S)
    first = pixels(browser, plot, screenshots, "scene-first-step")
    for layer in ("frusta", "planes", "objects"):
        box = browser.find_element(By.CSS_SELECTOR, f"#sweep-1 [data-layer={layer}]")
        browser.execute_script("arguments[0].click()", box)
        time.sleep(SETTLED_S)
        without = pixels(browser, plot, screenshots, f"scene-without-{layer}")
        assert changed(first, without) > LEAST_CHANGE, layer
        browser.execute_script("arguments[0].click()", box)
        time.sleep(SETTLED_S)
        assert changed(first, pixels(browser, plot, screenshots, "scene-again")) < LEAST_CHANGE, layer
    colour = Select(browser.find_element(By.CSS_SELECTOR, "#sweep-1 [data-figure=scene] [data-choice=colour]"))
    colour.select_by_value("ratio")
    time.sleep(SETTLED_S)
    assert changed(first, pixels(browser, plot, screenshots, "scene-ratio")) > LEAST_CHANGE
    look = "const t = arguments[0].data.find((t) => t.meta && t.meta.pick); return [t.marker.symbol, t.text];"
    for sign, text in zip(*browser.execute_script(look, plot), strict=True):
        words = re.search(r"predicted (unknown|[\d.e+-]+) ?(?:mm)?, measured (unknown|[\d.e+-]+)", text).groups()
        predicted, measured = (None if word == "unknown" else float(word) for word in words)
        smaller = predicted is not None and measured is not None and measured < predicted
        assert sign == ("x" if predicted is None else "circle-open" if smaller else "circle"), text
    colour.select_by_value("predicted")
    slider.send_keys(Keys.END)
    drawn(browser, "#sweep-1 [data-figure=scene] .plot")
    until(browser, lambda d: "zoom=1.5" not in d.execute_script(label, plot))
    time.sleep(SETTLED_S)
    assert changed(first, pixels(browser, plot, screenshots, "scene-last-step")) > LEAST_CHANGE


def test_curves_are_told_apart_without_colour(browser, screenshots):
    """Seen without any colour, no two curves have the same dash and sign."""
    browser.execute_cdp_cmd("Emulation.setEmulatedVisionDeficiency", {"type": "achromatopsia"})
    try:
        plot = drawn(browser, "#sweep-1 [data-figure=curves] .plot")
        picture = pixels(browser, plot, screenshots, "curves-without-colour")
        assert np.ptp(picture, axis=-1).max() <= VISIBLE_LEVELS
    finally:
        browser.execute_cdp_cmd("Emulation.setEmulatedVisionDeficiency", {"type": "none"})
    lines = browser.execute_script(
        "return arguments[0].data.filter((t) => (t.mode || '').includes('lines+markers'))"
        ".map((t) => [t.line.dash || 'solid', t.marker.symbol || 'circle'].join())",
        plot,
    )
    assert len(lines) >= 3
    assert len(set(lines)) == len(lines)


def test_a_marker_has_its_ellipsoid_lines_and_words(browser):
    plot = drawn(browser, "#sweep-1 [data-figure=scene] .plot")
    count = browser.execute_script("return arguments[0].data.length", plot)
    Select(shown(browser, "#sweep-1 [data-marker]")).select_by_value("5")
    until(browser, lambda d: d.execute_script("return arguments[0].data.length", plot) > count)
    words = browser.find_element(By.CSS_SELECTOR, "#sweep-1 [data-description]").text
    assert "marker 5 on board" in words
    assert "ellipsoid" in words
    # The page multiplies the root out itself. The mesh begins and ends with opposite points; the farthest from the
    # middle between them is 2.7955 σ away, enlarged as the page says.
    far, centre = browser.execute_script(
        "const p = arguments[0], e = p.data[p.data.length - 1], m = p.data.find((t) => t.meta && t.meta.pick);"
        "const c = ['x', 'y', 'z'].map((a) => (e[a][0] + e[a][e[a].length - 1]) / 2);"
        "return [Math.max(...e.x.map((x, i) => Math.hypot(x - c[0], e.y[i] - c[1], e.z[i] - c[2]))), m.text[5]];",
        plot,
    )
    times = float(words.split("drawn ")[1].split(" times")[0].replace(",", ""))
    predicted_mm = float(centre.split("predicted ")[1].split(" mm")[0])
    # The mesh has points every 15°: the farthest is within 2 % of the axis.
    assert far * 1000 / times / 2.7955 == pytest.approx(predicted_mm, rel=0.03)


def test_pictures_are_flicked_through_with_the_arrow_keys(browser):
    seen = set()
    radio = shown(browser, "#sweep-1 [data-picture][value=clean]")
    browser.execute_script("arguments[0].click()", radio)
    picture = browser.find_element(By.CSS_SELECTOR, "#sweep-1 [data-img]")
    for layer in ("clean", "noisy", "depth", "blur", "error"):
        active = browser.switch_to.active_element if seen else radio
        assert active.get_attribute("value") == layer
        until(browser, lambda d, layer=layer: f"Picture: {layer}" in picture.get_attribute("alt"))
        seen.add(picture.get_attribute("src"))
        active.send_keys(Keys.ARROW_RIGHT)
    # The error is drawn over the clean image.
    assert len(seen) == 4


def test_everything_is_reached_by_tabulator_and_its_focus_is_seen(browser):
    browser.execute_script("window.scrollTo(0, 0); document.activeElement.blur()")
    requested = {"data-step", "data-marker", "data-camera", "data-over"}
    for _ in range(120):
        browser.switch_to.active_element.send_keys(Keys.TAB)
        element = browser.switch_to.active_element
        requested -= {name for name in requested if element.get_attribute(name) is not None}
        if element.tag_name in ("select", "input", "button", "a"):
            assert browser.execute_script("return getComputedStyle(arguments[0]).outlineStyle", element) != "none"
        if not requested:
            break
    assert not requested


def test_it_fits_a_narrow_screen(browser):
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", PHONE)
    try:
        for name in ("curves", "scene"):
            plot = drawn(browser, f"#sweep-2 [data-figure={name}] .plot")
            until(browser, lambda d, plot=plot: plot.size["width"] <= PHONE["width"])
        wide, inner = browser.execute_script("return [document.documentElement.scrollWidth, window.innerWidth]")
        assert wide <= inner == PHONE["width"]
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_it_is_printed_with_all_its_figures(browser, report, tmp_path):
    """Opened anew, so that nothing was scrolled into view before."""
    browser.get(report.as_uri())
    printed = base64.b64decode(browser.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})["data"])
    (tmp_path / "report.pdf").write_bytes(printed)
    assert printed.startswith(b"%PDF")
    time.sleep(0.5)
    undrawn = browser.execute_script(
        "return [...document.querySelectorAll('.plot')].filter((plot) => !plot.querySelector('.main-svg')).length"
    )
    assert undrawn == 0
