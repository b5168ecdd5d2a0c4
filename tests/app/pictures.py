"""Pictures of the page for the manual: python -m tests.app.pictures FOLDER."""

from __future__ import annotations

import sys
import tempfile
import time
from pathlib import Path

from tests.app.server import COARSE, Tab, served
from tests.browser import browser


def main(folder: Path) -> None:
    """Take them."""
    text = COARSE.replace("around = 6", "around = 14").replace("along = 8", "along = 24")
    text = text.replace("beta = 0.003", "beta = 0.0004\nalpha = 0") + '[fluid]\ncontinuity = "quasi-steady"\n'
    driver = browser(1100, 800)
    try:
        with tempfile.TemporaryDirectory() as kept, served(Path(kept), text) as server:
            tab = Tab(driver, server.address)
            tab.wait(lambda: "280 mm long" in tab.text)
            time.sleep(1.0)
            driver.save_screenshot(str(folder / "describe.png"))
            tab.go("Ask")
            tab.wait(tab.is_confirmed, 300)
            tab.fill("set pressure", "1\n")
            tab.wait(lambda: not tab.is_confirmed(), 10)
            tab.wait(lambda: tab.is_confirmed() and "×" in tab.text, 300)
            driver.set_window_size(1100, 1240)
            tab.click("Show the shape")
            tab.wait(lambda: driver.find_elements("css selector", ".js-plotly-plot canvas"))
            driver.execute_script("window.scrollTo(0, 0)")
            time.sleep(4.0)
            driver.save_screenshot(str(folder / "ask.png"))
            driver.set_window_size(1100, 860)
            tab.go("See")
            tab.click("Stability map")
            tab.wait(lambda: driver.find_elements("css selector", ".js-plotly-plot .heatmaplayer image"), 900)
            time.sleep(2.0)
            driver.save_screenshot(str(folder / "see.png"))
    finally:
        driver.quit()


if __name__ == "__main__":
    main(Path(sys.argv[1]))
