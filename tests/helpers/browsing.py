"""Chromium for the tests of pages that the project leaves: opened, looked at, and asked what went wrong.

Import it after `pytest.importorskip("selenium")`.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.support.ui import WebDriverWait

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
DRIVER = shutil.which("chromedriver")
NEEDS_BROWSER = [
    pytest.mark.acceptance,
    pytest.mark.skipif(
        not BROWSER or not DRIVER, reason="no chromium with chromedriver (apt-get install chromium-driver)"
    ),
]
"""The marks of a file of such tests."""

# s, for a figure to be drawn by a processor that does the graphics card's work, on a busy machine.
PATIENCE_S = 120
PHONE = {"width": 400, "height": 800, "deviceScaleFactor": 1, "mobile": True}
FLAGS = (
    "--headless=new",
    "--no-sandbox",
    "--disable-gpu",
    "--enable-unsafe-swiftshader",
    "--disable-background-networking",
    "--window-size=1300,1000",
)
# Of the browser itself, on graphics without a card.
NO_ERRORS_OF_OURS = ("GPU stall", "willReadFrequently", "swiftshader", "SwiftShader")


@contextmanager
def opened(page: Path, *flags: str) -> Iterator[webdriver.Chrome]:
    """Chromium with a page open, which writes down what goes wrong and what it asks for."""
    options = webdriver.ChromeOptions()
    for flag in (*FLAGS, *flags):
        options.add_argument(flag)
    options.binary_location = BROWSER
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    try:
        driver.get(page.as_uri())
        yield driver
    finally:
        driver.quit()


def until(browser, condition):
    """What `condition` of the browser gives as soon as it is true."""
    return WebDriverWait(browser, PATIENCE_S).until(condition)


def shown(browser, selector):
    """Scroll to an element, as a reader does, and give it."""
    element = browser.find_element(By.CSS_SELECTOR, selector)
    browser.execute_script("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", element)
    return element


def drawn(browser, selector):
    """The same for a figure, once plotly has drawn it."""
    element = shown(browser, selector)
    until(browser, lambda d: d.execute_script("return !!arguments[0].querySelector('.main-svg')", element))
    return element


def ready_ms(browser):
    """When the page's script was done, from the moment it was asked for."""
    return float(until(browser, lambda d: d.execute_script("return document.documentElement.dataset.ready")))


def errors(browser):
    """What the console has said since it was last asked, but for words about a missing graphics card."""
    return [
        entry
        for entry in browser.get_log("browser")
        if entry["level"] in ("SEVERE", "WARNING") and not any(word in entry["message"] for word in NO_ERRORS_OF_OURS)
    ]


def asked_elsewhere(browser, page: Path):
    """Addresses that the browser has asked for since it was last asked, off `page`, which must be among them."""
    events = [json.loads(entry["message"])["message"] for entry in browser.get_log("performance")]
    asked = [e["params"]["request"]["url"] for e in events if e["method"] == "Network.requestWillBeSent"]
    assert page.as_uri() in asked
    return [url for url in asked if not url.startswith((page.as_uri(), "data:", "blob:"))]
