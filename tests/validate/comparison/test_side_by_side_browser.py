"""The page of a comparison in a real browser: no network, no error, by keyboard, on a phone, and choices draw anew."""

from __future__ import annotations

import base64
import time

import pytest

from tests.helpers.compared_runs import LONG, a_run
from validate.comparison.page import write_page
from validate.comparison.sides import sides_of

pytest.importorskip("selenium", reason="selenium is not installed")

from selenium.webdriver.common.keys import Keys  # only where it is installed
from selenium.webdriver.support.ui import Select

from tests.helpers.browsing import NEEDS_BROWSER, PHONE, asked_elsewhere, drawn, errors, opened, shown, until

pytestmark = NEEDS_BROWSER

SECTION = "#group-1"


@pytest.fixture(scope="module")
def compared(tmp_path_factory):
    """The page of three made-up runs, one with a name that no line holds."""
    folder = tmp_path_factory.mktemp("compared")
    folders = [a_run(folder / "plain"), a_run(folder / "dim", 0.5, 0.52, rho=0.5), a_run(folder / LONG, 1.02)]
    return write_page(folder / "out" / "compare.html", sides_of(folders))


@pytest.fixture(scope="module")
def browser(compared):
    """Chromium with the page open."""
    with opened(compared) as driver:
        yield driver


def test_every_figure_is_drawn_without_an_error_and_without_the_network(browser, compared):
    for selector in (
        f"{SECTION} [data-figure=curves]",
        f"{SECTION} [data-figure=moved]",
        f"{SECTION} [data-figure=map]",
    ):
        drawn(browser, f"{selector} .plot")
    drawn(browser, "#ranking [data-figure=correlation] .plot")
    assert not errors(browser)
    assert not asked_elsewhere(browser, compared)


@pytest.mark.parametrize(
    ("select", "value", "figures"),
    [
        (f"{SECTION} [data-choice=pair]", "rms", (f"{SECTION} [data-figure=curves]", f"{SECTION} [data-figure=moved]")),
        (f"{SECTION} [data-choice=model]", "as-printed", (f"{SECTION} [data-figure=moved]",)),
        (f"{SECTION} [data-choice=other]", "1", (f"{SECTION} [data-figure=map]",)),
        ("#ranking [data-choice=by_noise_model]", "as-printed", ("#ranking [data-figure=correlation]",)),
    ],
)
def test_choices_draw_the_figures_anew(browser, select, value, figures):
    """And the words for who does not see them name the choice."""
    control = Select(shown(browser, select))
    other = next(o.get_attribute("value") for o in control.options if o.get_attribute("value") != value)
    control.select_by_value(other)
    plots = [drawn(browser, f"{figure} .plot") for figure in figures]
    labels = {plot: plot.get_attribute("aria-label") for plot in plots}
    shown(browser, select)
    control.select_by_value(value)
    words = control.first_selected_option.text
    for plot in plots:
        browser.execute_script("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", plot)
        until(browser, lambda d, plot=plot: plot.get_attribute("aria-label") != labels[plot])
        assert words in plot.get_attribute("aria-label")


def test_a_noise_model_that_does_not_see_the_change_stands_at_one(browser):
    """What is drawn, read back: the paper's R predicts a ratio of 1, `physical` one of 0.52."""
    control = Select(shown(browser, f"{SECTION} [data-choice=model]"))
    Select(shown(browser, f"{SECTION} [data-choice=pair]")).select_by_value("single")
    for model, ratio in (("as-printed", 1.0), ("physical", 0.52)):
        control.select_by_value(model)
        plot = drawn(browser, f"{SECTION} [data-figure=moved] .plot")
        until(browser, lambda d, m=model, plot=plot: m in plot.get_attribute("aria-label"))
        x = browser.execute_script("return Array.from(arguments[0].data[1].x)", plot)
        assert x == pytest.approx([ratio] * 3, rel=1e-3)


def test_everything_is_reached_by_keyboard_and_shows_where_it_is(browser):
    browser.execute_script("window.scrollTo(0, 0); document.activeElement.blur();")
    requested, seen = {"pair", "model", "other", "step", "by_noise_model"}, set()
    for _ in range(80):
        browser.switch_to.active_element.send_keys(Keys.TAB)
        element = browser.switch_to.active_element
        seen.add(element.get_attribute("data-choice"))
        if element.tag_name in ("select", "summary", "a"):
            assert browser.execute_script("return getComputedStyle(arguments[0]).outlineStyle", element) != "none"
        if requested <= seen and element.tag_name == "summary":
            element.send_keys(Keys.ENTER)
            assert browser.execute_script("return arguments[0].parentElement.open", element)
            return
    raise AssertionError(requested - seen)


def test_it_fits_a_narrow_screen(browser, compared):
    """Even with a name that no line holds, and with all tables unfolded."""
    browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", PHONE)
    try:
        browser.get(compared.as_uri())
        browser.execute_script("document.querySelectorAll('details').forEach((each) => { each.open = true; })")
        for selector in (f"{SECTION} [data-figure=curves]", "#ranking [data-figure=correlation]"):
            plot = drawn(browser, f"{selector} .plot")
            until(browser, lambda d, plot=plot: plot.size["width"] <= PHONE["width"])
        wide, inner = browser.execute_script("return [document.documentElement.scrollWidth, window.innerWidth]")
        assert wide <= inner == PHONE["width"]
    finally:
        browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})


def test_it_is_printed_with_all_its_figures_and_tables(browser, compared):
    """Opened anew, so that nothing was scrolled into view before."""
    browser.get(compared.as_uri())
    printed = base64.b64decode(browser.execute_cdp_cmd("Page.printToPDF", {"printBackground": True})["data"])
    assert printed.startswith(b"%PDF")
    time.sleep(0.5)
    undrawn, folded = browser.execute_script(
        "return [[...document.querySelectorAll('.plot')].filter((plot) => !plot.querySelector('.main-svg')).length,"
        " [...document.querySelectorAll('details')].filter((each) => !each.open).length]"
    )
    assert (undrawn, folded) == (0, 0)


def test_figures_draw_names_as_they_are(tmp_path):
    """Plotly would make bold what stands between tags, and drop the tags that it does not know."""
    folders = [a_run(tmp_path / "<b>plain"), a_run(tmp_path / "<i>dim<br>&amp;", 0.5, 0.52, rho=0.5)]
    page = write_page(tmp_path / "out" / "compare.html", sides_of(folders))
    with opened(page) as driver:
        plot = drawn(driver, f"{SECTION} [data-figure=curves] .plot")
        words = driver.execute_script(
            "return [...arguments[0].querySelectorAll('text')].map((text) => text.textContent)", plot
        )
        assert "÷ <b>plain" in words
        assert "<i>dim<br>&amp;, measured" in words
        assert not errors(driver)
