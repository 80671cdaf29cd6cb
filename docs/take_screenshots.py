"""Take the pictures of docs/report.md: `make screenshots`, after `make sweep`, with a chromium installed.

Pages are driven as a reader would: the step by the slider's keys, the rest by their controls. `make screenshots` also
makes the run that the sweeps are compared with.
"""

from __future__ import annotations

import base64
import io
import shutil
import sys
from pathlib import Path

from PIL import Image
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import Select, WebDriverWait

from render.store.folder import atomic_path

FIGURES = Path(__file__).resolve().parent / "figures"
REPORT = Path("results/zoom-focus-selection/report.html")
HALLWAY = Path("results/hallway/report.html")
COMPARISON = Path("results/compare/compare.html")
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
FLAGS = ("--headless=new", "--no-sandbox", "--disable-gpu", "--enable-unsafe-swiftshader", "--hide-scrollbars")
# Of the window; a page's text is 1,200 wide.
WIDTH_PX, HEIGHT_PX = 1240, 1700
# A screenshot's text and lines have few colours.
COLOURS = 256
PATIENCE_S = 60
SHOWN = "#sweep-1"


def opened(report: Path) -> webdriver.Chrome:
    """A browser with the report open.

    Raises:
        SystemExit: no report, or no browser.
    """
    browser = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    driver = shutil.which("chromedriver")
    if browser is None or driver is None:
        sys.exit(f"no {' or '.join(BROWSERS)} with chromedriver is installed")
    if not report.is_file():
        sys.exit(f"{report} is missing; `make sweep` and `make screenshots` leave it")
    options = webdriver.ChromeOptions()
    options.binary_location = browser
    for flag in (*FLAGS, f"--window-size={WIDTH_PX},{HEIGHT_PX}"):
        options.add_argument(flag)
    found = webdriver.Chrome(options=options, service=Service(driver))
    found.get(report.resolve().as_uri())
    return found


def take(browser: webdriver.Chrome, selectors: str, name: str) -> None:
    """Write the picture of all elements that `selectors` names, with what lies between them."""
    elements = browser.find_elements(By.CSS_SELECTOR, selectors)
    for element in elements:
        browser.execute_script("arguments[0].scrollIntoView({block: 'center', behavior: 'instant'})", element)
        for plot in element.find_elements(By.CSS_SELECTOR, ".plot"):
            WebDriverWait(browser, PATIENCE_S).until(
                lambda b, plot=plot: b.execute_script("return !!arguments[0].querySelector('.main-svg')", plot)
            )
    # What was drawn just now, on the screen; and nothing that hovers over it.
    browser.execute_async_script(
        "document.querySelectorAll('.bar').forEach((bar) => { bar.style.position = 'static'; });"
        "setTimeout(arguments[0], 4000)"
    )
    boxes = [
        browser.execute_script(
            "const b = arguments[0].getBoundingClientRect();"
            "return [b.left + scrollX, b.top + scrollY, b.right + scrollX, b.bottom + scrollY]",
            element,
        )
        for element in elements
    ]
    left, top = (min(box[side] for box in boxes) for side in (0, 1))
    right, bottom = (max(box[side] for box in boxes) for side in (2, 3))
    clip = {"x": left - 8, "y": top - 8, "width": right - left + 16, "height": bottom - top + 16, "scale": 1}
    shot = browser.execute_cdp_cmd("Page.captureScreenshot", {"clip": clip, "captureBeyondViewport": True})["data"]
    picture = Image.open(io.BytesIO(base64.b64decode(shot))).convert("RGB")
    with atomic_path(FIGURES / f"{name}.png") as temporary:
        picture.quantize(COLOURS, kmeans=4, dither=Image.Dither.NONE).save(temporary, format="png", optimize=True)


def of_comparison() -> None:
    """The verdict of two runs, and whether the metric foresaw what changed."""
    browser = opened(COMPARISON)
    try:
        take(browser, "#verdict .cards", "compare-verdict")
        take(browser, "[data-figure=curves], [data-figure=moved]", "compare-moved")
    finally:
        browser.quit()


def of_hallway() -> None:
    """The scene in the middle of the walk; it is left as it is where there is no run of the hallway."""
    if not HALLWAY.is_file():
        print(f"{HALLWAY} is missing, and its picture is left as it is; `run_sweep.py schedule hallway` leaves it")
        return
    browser = opened(HALLWAY)
    try:
        slider = browser.find_element(By.CSS_SELECTOR, "[data-step]")
        slider.send_keys(Keys.HOME, *[Keys.ARROW_RIGHT] * 8)
        take(browser, "[data-figure=scene]", "report-hallway")
    finally:
        browser.quit()


def of_report() -> None:
    """Every picture of the report, in the page's order."""
    browser = opened(REPORT)
    try:
        take(browser, "#verdict", "report-verdict")
        slider = browser.find_element(By.CSS_SELECTOR, f"{SHOWN} [data-step]")
        slider.send_keys(Keys.HOME, *[Keys.ARROW_RIGHT] * 4)
        figure = f"{SHOWN} [data-figure={{}}]"
        curves = [f"{SHOWN} .bar", figure.format("curves"), figure.format("points")]
        take(browser, ", ".join(curves), "report-curves")
        take(browser, f"{figure.format('leaderboard')}, {figure.format('nees')}", "report-judged")
        take(browser, f"{figure.format('budget')}, {figure.format('visibility')}", "report-budget")
        scene = browser.find_element(By.CSS_SELECTOR, figure.format("scene"))
        Select(scene.find_element(By.CSS_SELECTOR, "[data-marker]")).select_by_index(20)
        take(browser, figure.format("scene"), "report-scene")
        error = browser.find_element(By.CSS_SELECTOR, f"{SHOWN} [data-picture][value=error]")
        browser.execute_script("arguments[0].click()", error)
        take(browser, f"{SHOWN} [data-images]", "report-images")
        take(browser, f"{SHOWN} .crops", "report-crops")
    finally:
        browser.quit()


if __name__ == "__main__":
    of_report()
    of_hallway()
    of_comparison()
