"""A real browser for tests of pages."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

NEEDED = ("chromium", "chromedriver")


def browser(width: int = 1440, height: int = 1000, downloads: Path | None = None):
    """A headless Chromium; the test is skipped where there is none."""
    missing = [name for name in NEEDED if shutil.which(name) is None]
    if missing:
        pytest.skip(f"{' and '.join(missing)} not found; `apt-get install chromium chromium-driver` brings them")
    webdriver = pytest.importorskip("selenium.webdriver")
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for flag in ("headless", "no-sandbox", "disable-gpu", "no-first-run", "enable-unsafe-swiftshader"):
        options.add_argument(f"--{flag}")
    options.add_argument(f"--window-size={width},{height}")
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    if downloads is not None:
        options.add_experimental_option("prefs", {"download.default_directory": str(downloads)})
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))
