"""The report of a schedule in a real browser: played, paused, by keyboard and on a phone, without a network."""

from __future__ import annotations

import pytest

from tests.helpers.made_up_schedule import STEPS, made_up_schedule

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

MOST_BYTES = 15_000_000
FIGURES = ("walk", "ranking", "agreement", "points", "budget", "scene")
SCENE = "[data-figure=scene] .plot"
# Where the first avatar's body is drawn, and what the scene is said to show.
BODY = "return JSON.stringify(arguments[0].data.filter((t) => t.type === 'mesh3d').map((t) => [...t.y]))"
SAID = "return arguments[0].getAttribute('aria-label')"


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    """The report of a made-up schedule."""
    return made_up_schedule(tmp_path_factory.mktemp("browser")).out / "report.html"


@pytest.fixture(scope="module")
def browser(report):
    """Chromium with the report open, for a reader who wants no motion."""
    with opened(report, "--force-prefers-reduced-motion") as driver:
        yield driver


def label(browser):
    return browser.find_element(By.CSS_SELECTOR, "[data-label]").text


def at_start(browser):
    """The slider at the first step, nothing playing, the scene in view; the scene."""
    button = browser.find_element(By.CSS_SELECTOR, "[data-play]")
    if "Pause" in button.text:
        button.click()
    shown(browser, "[data-step]").send_keys(Keys.HOME)
    scene = drawn(browser, SCENE)
    until(browser, lambda d: "y = −2 m" in d.execute_script(SAID, scene))
    return scene


def test_it_opens_soon_is_small_and_draws_all_without_an_error_or_the_network(browser, report):
    ready = ready_ms(browser)
    size = report.stat().st_size
    print(f"\nreport of {size:,} bytes, interactive after {ready / 1000:.1f} s on this machine as busy as it is")
    assert size <= MOST_BYTES
    assert ready > 0
    for name in FIGURES:
        drawn(browser, f"[data-figure={name}] .plot")
    assert not errors(browser)
    assert not asked_elsewhere(browser, report)


def test_it_does_not_play_by_itself(browser):
    button = browser.find_element(By.CSS_SELECTOR, "[data-play]")
    before = label(browser)
    browser.execute_async_script("setTimeout(arguments[0], 1500)")
    assert label(browser) == before
    assert button.get_attribute("aria-label") == "Play the steps of hallway"


@pytest.mark.parametrize("key", [Keys.SPACE, Keys.ENTER])
def test_play_moves_the_people_and_stops_by_keyboard(browser, key):
    """Bodies, cameras, pictures and figures go together, round and round, until the button is pressed again."""
    scene = at_start(browser)
    before, start = browser.execute_script(BODY, scene), label(browser)
    button = browser.find_element(By.CSS_SELECTOR, "[data-play]")
    browser.execute_script("arguments[0].focus({preventScroll: true})", button)
    browser.switch_to.active_element.send_keys(key)
    assert button.get_attribute("aria-label") == "Pause the steps of hallway"
    until(browser, lambda d: d.execute_script(BODY, scene) != before)
    seen = {start}
    until(browser, lambda d: seen.add(label(d)) or len(seen) == STEPS)
    until(browser, lambda d: label(d) == start)
    browser.switch_to.active_element.send_keys(key)
    assert button.get_attribute("aria-label") == "Play the steps of hallway"
    stopped = label(browser)
    browser.execute_async_script("setTimeout(arguments[0], 1500)")
    assert label(browser) == stopped
    until(browser, lambda d: stopped in d.execute_script(SAID, scene))


def test_the_speed_is_the_readers_and_the_slider_stops_it(browser):
    at_start(browser)
    Select(browser.find_element(By.CSS_SELECTOR, "[data-speed]")).select_by_value("8")
    button = browser.find_element(By.CSS_SELECTOR, "[data-play]")
    button.click()
    until(browser, lambda d: label(d) != "y = −2 m, 0.0 s")
    # Nothing is read out while it plays.
    assert browser.find_element(By.CSS_SELECTOR, "[data-label]").get_attribute("aria-live") == "off"
    # Also by a key that moves nothing, as the slider may be at its end already.
    browser.find_element(By.CSS_SELECTOR, "[data-step]").send_keys(Keys.END)
    until(browser, lambda d: "Play" in button.text)
    assert label(browser).startswith("y = 2 m")
    assert browser.find_element(By.CSS_SELECTOR, "[data-label]").get_attribute("aria-live") == "polite"


def test_the_strategy_changes_everything_together(browser):
    """At the last step the strategies part: other cameras follow H1, and other pictures are seen."""
    shown(browser, "[data-step]").send_keys(Keys.END)
    reported = {}
    for strategy in ("follow", "swap-to-closer"):
        Select(browser.find_element(By.CSS_SELECTOR, "[data-choice=strategy]")).select_by_value(strategy)
        scene = drawn(browser, SCENE)
        until(browser, lambda d, strategy=strategy, scene=scene: strategy in d.execute_script(SAID, scene))
        of_first = browser.execute_script(
            "const { color } = arguments[0].data.find((t) => t.name === 'follows H1').marker;"
            "return arguments[0].layout.scene.annotations.filter((a) => a.font.color === color).map((a) => a.text)",
            scene,
        )
        shown(browser, "[data-images]")
        words = [element.text for element in browser.find_elements(By.CSS_SELECTOR, "[data-of]")]
        pictures = [e.get_attribute("src") for e in browser.find_elements(By.CSS_SELECTOR, "[data-img]")]
        reported[strategy] = of_first, words, pictures
        assert len(words) == 4
        curves = drawn(browser, "[data-figure=walk] .plot")
        until(browser, lambda d, strategy=strategy, curves=curves: strategy in d.execute_script(SAID, curves))
    assert reported["follow"][0] == ["1", "2"]
    assert reported["swap-to-closer"][0] == ["3", "4"]
    for before, after in zip(*(words for _, words, _ in reported.values()), strict=True):
        assert ("follows H1" in before) != ("follows H1" in after)


def test_a_marker_that_is_not_observable_says_so(browser):
    scene = at_start(browser)
    signs = browser.execute_script("return arguments[0].data.find((t) => t.meta && t.meta.pick).marker.symbol", scene)
    output = browser.find_element(By.CSS_SELECTOR, "[data-description]")
    for sign, words in (("x", "there is no ellipsoid"), ("circle", "95 % ellipsoid is drawn")):
        Select(browser.find_element(By.CSS_SELECTOR, "[data-marker]")).select_by_value(str(signs.index(sign)))
        until(browser, lambda d, words=words: words in output.text)
    Select(browser.find_element(By.CSS_SELECTOR, "[data-marker]")).select_by_value("")


def test_it_fits_a_narrow_screen(browser):
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", PHONE)
    try:
        for name in ("walk", "scene"):
            plot = drawn(browser, f"[data-figure={name}] .plot")
            until(browser, lambda d, plot=plot: plot.size["width"] <= PHONE["width"])
        wide, inner = browser.execute_script("return [document.documentElement.scrollWidth, window.innerWidth]")
        assert wide <= inner == PHONE["width"]
        # The bar that stays in view leaves most of the screen to what it moves.
        bar = browser.find_element(By.CSS_SELECTOR, ".bar")
        assert bar.size["height"] < 0.25 * PHONE["height"]
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
