"""The page as a browser shows it: figures drawn, no error, values under the pointer."""

from __future__ import annotations

import re
import shutil

import pytest

from tests.report.test_report import LIGHT, SMALL

pytestmark = pytest.mark.slow
NEEDED = ("chromium", "chromedriver")


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """A headless Chromium with the page of a coarse valve in it."""
    missing = [name for name in NEEDED if shutil.which(name) is None]
    if missing:
        pytest.skip(f"{' and '.join(missing)} not found; `apt-get install chromium chromium-driver` brings them")
    webdriver = pytest.importorskip("selenium.webdriver")
    from dbvfiv.cli import run

    page = tmp_path_factory.mktemp("report") / "page.html"
    assert run(["report", *SMALL, *LIGHT, "--cells", "5", "-o", str(page)]) == 0
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for flag in (
        "headless",
        "no-sandbox",
        "disable-gpu",
        "no-first-run",
        "disable-background-networking",
        "enable-unsafe-swiftshader",
    ):
        options.add_argument(f"--{flag}")
    options.add_argument("--window-size=1200,1000")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    service = webdriver.ChromeService(shutil.which("chromedriver"))
    driver = webdriver.Chrome(options=options, service=service)
    driver.set_page_load_timeout(120)
    driver.get(page.as_uri())
    yield driver
    driver.quit()


def test_nothing_is_broken(browser):
    severe = [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    assert not severe, severe
    broken = browser.execute_script("return [...document.images].filter(i => !i.complete || !i.naturalWidth).length")
    assert broken == 0


def test_the_cycle_is_told(browser):
    text = browser.page_source
    assert re.search(r"An? (un)?stable limit cycle of [\d.]+ mm of each lip|limit cycle was followed to", text)
    assert '<section id="cycle">' in text and '<section id="onset">' in text


def test_every_live_figure_is_drawn(browser):
    drawn = browser.execute_script(
        "return [...document.querySelectorAll('.js-plotly-plot')].map(p => [p.id, p.querySelector('svg') !== null])"
    )
    assert dict(drawn).keys() == {"valve-live", "discharge-live", "map-live-0", "map-live-1"}
    assert all(there for _, there in drawn)
    height = "return [...document.querySelectorAll('figure')].map(f => f.getBoundingClientRect().height)"
    assert min(browser.execute_script(height)) > 100


def test_a_cell_of_the_map_answers_to_the_pointer(browser):
    from selenium.webdriver import ActionChains
    from selenium.webdriver.common.by import By
    from selenium.webdriver.support.ui import WebDriverWait

    plot = browser.find_element(By.CSS_SELECTOR, "#map-live-0 .nsewdrag")
    browser.execute_script("arguments[0].scrollIntoView({block: 'center'})", plot)
    ActionChains(browser).move_to_element_with_offset(plot, 40, 40).perform()
    shown = "return document.querySelector('#map-live-0 .hoverlayer')?.textContent"
    text = WebDriverWait(browser, 10).until(lambda driver: driver.execute_script(shown))
    assert "1/s" in text and "Hz" in text


def test_on_paper_the_figures_stand_still(browser):
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    hidden = "return [...document.querySelectorAll('.js-plotly-plot')].every(p => p.offsetParent === null)"
    shown = "return [...document.querySelectorAll('img.paper')].every(i => i.offsetParent !== null)"
    assert browser.execute_script(hidden) and browser.execute_script(shown)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
