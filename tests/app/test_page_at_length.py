"""The page through a working day: runs, maps, reloads, two tabs, a killed worker, and how quick it answers."""

from __future__ import annotations

import os
import random
import re
import signal
import time

import numpy as np
import pytest

pytest.importorskip("nicegui", reason="NiceGUI is not installed; `pip install 'dbvfiv[app]'` brings it")
import dbvfiv
from dbvfiv.studies.case import load_case
from tests.app.server import COARSE, Served, Tab, served
from tests.browser import browser

pytestmark = pytest.mark.slow
WIDE, NARROW = (1440, 1000), (390, 844)


def children(pid: int) -> list[int]:
    """Numbers of the processes below one, and of those the commands of workers."""
    psutil = pytest.importorskip("psutil")
    return [p.pid for p in psutil.Process(pid).children(recursive=True) if "dbvfiv.app.worker" in " ".join(p.cmdline())]


def memory(pid: int) -> float:
    """Memory of a process and those below it, MB."""
    psutil = pytest.importorskip("psutil")
    process = psutil.Process(pid)
    return sum(p.memory_info().rss for p in (process, *process.children(recursive=True))) / 1e6


def shoot(driver, name: str) -> None:
    """Keep a picture of the page where ``DBVFIV_SHOTS`` names a folder."""
    folder = os.environ.get("DBVFIV_SHOTS")
    if folder:
        driver.save_screenshot(f"{folder}/{name}.png")


def test_a_day_with_the_page(tmp_path):
    downloads = tmp_path / "downloads"
    driver = browser(*WIDE, downloads=downloads)
    try:
        with served(tmp_path) as server:
            tab = Tab(driver, server.address)
            tab.fill("valve.lip_half_width", "64 mm")
            tab.wait(lambda: "bill 140 mm wide" in tab.text)
            shoot(driver, "describe")
            tab.go("Ask")
            tab.wait(tab.is_confirmed)
            tab.fill("set pressure", "1\n")
            for name, share in (("density", 0.2), ("beta", 0.05), ("pressure", 0.4)):
                tab.slide(name, share)
            tab.wait(lambda: not tab.is_confirmed(), 5)
            tab.wait(tab.is_confirmed)
            shoot(driver, "ask")
            tab.go("See")
            tab.click("Stability map")
            tab.wait(lambda: "done in" in tab.text, 300)
            tab.click("Open")
            tab.wait(lambda: driver.find_elements("css selector", ".js-plotly-plot .heatmaplayer image"))
            time.sleep(1.0)
            shoot(driver, "map")
            click_cell(driver)
            tab.wait(lambda: "Ask" in driver.find_element("css selector", ".q-tab--active").text.title())
            at = lambda name: float(tab.at(f"slide {name}").get_attribute("aria-valuenow"))  # noqa: E731
            tab.wait(lambda: abs(at("pressure") - 0.1 * 1.5 * 18e3 / 9806.65) < 0.02)  # the cell at the lower left
            assert at("beta") == pytest.approx(0.00075, abs=3e-5)
            tab.go("Run")
            tab.click("Add to the queue")
            tab.wait(lambda: re.search(r"running: .*left", tab.text), 120)
            shoot(driver, "run")
            tab.click("Cancel")
            tab.wait(lambda: "cancelled" in tab.text)
            tab.wait(lambda: "RESUME" in tab.text.upper(), 30)
            driver.refresh()
            tab.wait(lambda: tab.at("fits").text == "It fits.")
            assert tab.at("valve.lip_half_width").get_attribute("value") == "64 mm"
            tab.go("Run")
            tab.wait(lambda: "cancelled" in tab.text and "done in" in tab.text)
            tab.go("Describe")
            tab.click("Save")
            saved = tab.wait(lambda: next(downloads.glob("*.toml"), None))
            assert load_case(saved).valve.lip_half_width == pytest.approx(0.064)
            assert not tab.errors()
        # the same user finds all again when the server is started anew
        again = Served(tmp_path / "kept")
        try:
            tab = Tab(driver, again.address)
            assert tab.at("valve.lip_half_width").get_attribute("value") == "64 mm"
            tab.go("Run")
            tab.click("Resume")
            tab.wait(lambda: re.search(r"report of dbv6\n(done in|running|waiting)", tab.text))
            tab.wait(lambda: re.search(r"report of dbv6\ndone in", tab.text), 600)
            tab.click("Open")
            tab.wait(lambda: "Open the report" in tab.text)
        finally:
            again.end()
    finally:
        driver.quit()


def click_cell(driver) -> None:
    """Click the cell at the lower left of a map."""
    from selenium.webdriver.common.action_chains import ActionChains

    image = driver.find_element("css selector", ".js-plotly-plot .draglayer .nsewdrag")
    driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", image)
    x, y = -image.size["width"] // 2 + 6, image.size["height"] // 2 - 6
    ActionChains(driver).move_to_element_with_offset(image, x, y).pause(0.4).click().perform()


def test_narrow_pages_scroll_one_way(tmp_path):
    driver = browser(*NARROW)
    try:
        device = {"width": NARROW[0], "height": NARROW[1], "deviceScaleFactor": 1, "mobile": True}
        driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", device)
        with served(tmp_path) as server:
            tab = Tab(driver, server.address)
            for name in ("Describe", "Ask", "See", "Run"):
                tab.go(name)
                time.sleep(1.0)
                shoot(driver, f"{name}-{NARROW[0]}")
                assert driver.execute_script("return document.documentElement.scrollWidth") <= NARROW[0], name
    finally:
        driver.quit()


def test_two_tabs_and_a_killed_worker(tmp_path):
    driver = browser(*WIDE)
    try:
        with served(tmp_path) as server:
            one = Tab(driver, server.address)
            one.go("Ask")
            one.wait(one.is_confirmed)
            driver.switch_to.new_window("tab")
            two = Tab(driver, server.root)
            two.go("Ask")
            two.wait(two.is_confirmed)
            two.fill("set density", "700\n")
            two.wait(lambda: not two.is_confirmed(), 5)
            two.wait(two.is_confirmed)
            flow = two.number("volume_flow")
            for pid in children(server.process.pid):
                os.kill(pid, signal.SIGKILL)
            two.fill("set density", "900\n")
            two.wait(lambda: two.number("volume_flow") < flow, 90)
            two.wait(two.is_confirmed, 90)
            driver.switch_to.window(driver.window_handles[0])
            assert one.number("volume_flow") < two_third(flow)  # the first tab stands where it stood
            one.go("Describe")
            one.at("valve.scale").send_keys("nonsense")
            one.wait(lambda: "valve.scale" in one.at("wrong").text)
            assert server.process.poll() is None
    finally:
        driver.quit()


def two_third(flow: float) -> float:
    """Flow at 1000 kg/m3 from that at 700 kg/m3, with a little room."""
    return flow * (700 / 1000) ** 0.5 * 1.01


@pytest.mark.parametrize("moves", [200])
def test_many_moves_are_all_answered_in_bounded_memory(tmp_path, moves):
    """Random moves on the 6-inch valve at its own mesh of 28 x 48."""
    text = COARSE.replace("around = 6", "around = 28").replace("along = 8", "along = 48")
    text = text.replace('model = "rayleigh"\nbeta = 0.003', 'model = "loss factor"')
    driver, chance = browser(*WIDE), random.Random(8)
    try:
        with served(tmp_path, text) as server:
            tab = Tab(driver, server.address)
            tab.go("Ask")
            tab.wait(tab.is_confirmed, 240)
            tab.fill("set pressure", "1\n")
            tab.wait(lambda: not tab.is_confirmed(), 10)
            tab.wait(tab.is_confirmed, 120)
            status = lambda name: float(tab.at("status").get_attribute(f"data-{name}"))  # noqa: E731
            found = {"density loss_factor": [], "pressure": []}
            sizes = []
            for number in range(moves + 300):
                kind = "pressure" if number % 10 == 9 else "density loss_factor"
                before = status("answers")
                tab.slide(chance.choice(kind.split()), chance.uniform(0.02, 0.98))
                tab.wait(lambda: status("answers") > before or tab.errors(), 60)
                if number < moves:
                    found[kind].append(status("seconds"))
                if number in (20, moves, moves + 299):
                    sizes.append(memory(server.process.pid))
            quick, slow = (np.percentile(found[name], (50, 95)) for name in found)
            print(f"\nstate stays: median {quick[0]:.3f} s, 95 % {quick[1]:.3f} s")
            print(f"state moves: median {slow[0]:.2f} s, 95 % {slow[1]:.2f} s; memory {sizes} MB")
            assert sizes[-1] < 1.25 * sizes[0] + 200
    finally:
        driver.quit()


def test_a_result_is_opened_for_a_user_who_left_another_valve(tmp_path):
    """The server names its user by a cookie; the browser comes back with it, once it has left a valve behind."""
    case = tmp_path / "six.toml"
    case.write_text(COARSE)
    result = tmp_path / "six.h5"
    dbvfiv.load(case, {"valve.duckbill_length": "104 mm"}).steady(pressure=5e3, output=result)
    driver = browser(*WIDE)
    try:
        for start, length in ((case, "280 mm long"), (result, "279 mm long")):
            server = Served(tmp_path / "page", start)
            try:
                tab = Tab(driver, server.address)
                tab.wait(lambda length=length: length in tab.text)
                tab.fill("valve.duckbill_length", "100 mm")
                tab.wait(lambda: "275 mm long" in tab.text)
                driver.refresh()
                tab.wait(lambda: "275 mm long" in tab.text)
            finally:
                server.end()
    finally:
        driver.quit()
