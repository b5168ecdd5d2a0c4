"""The page as a browser shows and prints it: figures drawn, no error, no cut table, at most ten pages."""

from __future__ import annotations

import re
import shutil

import pytest

from dbvfiv.report import write_pdf
from tests.browser import browser as open_browser
from tests.report.test_report import made as made

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def browser(made):
    """A headless Chromium with the page of a coarse valve in it."""
    driver = open_browser(1280)
    driver.set_page_load_timeout(120)
    driver.get(made[1].as_uri())
    yield driver
    driver.quit()


def test_nothing_is_broken_or_cut(browser):
    severe = [entry for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    assert not severe, severe
    broken = browser.execute_script("return [...document.images].filter(i => !i.complete || !i.naturalWidth).length")
    cut = "return [...document.querySelectorAll('.wide')].filter(w => w.scrollWidth > w.clientWidth + 1).length"
    assert broken == 0 and browser.execute_script(cut) == 0
    drawn = "return [...document.querySelectorAll('.js-plotly-plot')].map(p => p.querySelector('svg') !== null)"
    assert browser.execute_script(drawn) == [True]


def test_on_paper_the_figures_stand_still(browser):
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    hidden = "return [...document.querySelectorAll('.js-plotly-plot')].every(p => p.offsetParent === null)"
    shown = "return [...document.querySelectorAll('img.paper')].every(i => i.offsetParent !== null)"
    assert browser.execute_script(hidden) and browser.execute_script(shown)
    browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})


def test_it_prints_on_at_most_ten_pages(made, tmp_path):
    if shutil.which("chromium") is None:
        pytest.skip("chromium not found; `apt-get install chromium` brings it")
    printed = write_pdf(made[1], tmp_path / "page.pdf").read_bytes()
    assert 1 < len(re.findall(rb"/Type\s*/Page\b(?!s)", printed)) <= 10
