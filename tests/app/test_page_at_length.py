"""The page through a working day: runs, maps, reloads, two tabs, a killed worker, and how quick it answers."""

from __future__ import annotations

import http.client
import os
import random
import re
import signal
import socket
import time
from contextlib import suppress

import numpy as np
import pytest

pytest.importorskip("nicegui", reason="NiceGUI is not installed; `pip install 'dbvfiv[app]'` brings it")
import dbvfiv
from dbvfiv.studies.case import load_case
from tests.app.server import COARSE, Served, Tab, served
from tests.browser import browser

pytestmark = pytest.mark.slow
WIDE, NARROW = (1440, 1000), (390, 844)


@pytest.fixture
def driver(tmp_path):
    """A browser that keeps what it loads down in a folder of the test."""
    found = browser(*WIDE, downloads=tmp_path / "downloads")
    yield found
    found.quit()


def children(pid: int) -> list[int]:
    """Numbers of the processes below one, and of those the commands of workers."""
    psutil = pytest.importorskip("psutil")
    return [p.pid for p in psutil.Process(pid).children(recursive=True) if "dbvfiv.app.worker" in " ".join(p.cmdline())]


def memory(pid: int) -> float:
    """Memory of a process and those below it, MB; what they share counts once."""
    psutil = pytest.importorskip("psutil")
    process = psutil.Process(pid)
    return sum(p.memory_full_info().pss for p in (process, *process.children(recursive=True))) / 1e6


def shoot(driver, name: str) -> None:
    """Keep a picture of the page where ``DBVFIV_SHOTS`` names a folder."""
    folder = os.environ.get("DBVFIV_SHOTS")
    if folder:
        driver.save_screenshot(f"{folder}/{name}.png")


def test_a_day_with_the_page(driver, tmp_path):
    downloads = tmp_path / "downloads"
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
    with served(tmp_path, None) as again:
        tab = Tab(driver, again.address)
        assert tab.at("valve.lip_half_width").get_attribute("value") == "64 mm"
        tab.go("Run")
        tab.click("Resume")
        tab.wait(lambda: re.search(r"report of dbv6\n(done in|running|waiting)", tab.text))
        tab.wait(lambda: re.search(r"report of dbv6\ndone in", tab.text), 600)
        tab.click("Open")
        tab.wait(lambda: "Open the report" in tab.text)


def click_cell(driver) -> None:
    """Click the cell at the lower left of a map."""
    from selenium.webdriver.common.action_chains import ActionChains

    image = driver.find_element("css selector", ".js-plotly-plot .draglayer .nsewdrag")
    driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", image)
    x, y = -image.size["width"] // 2 + 6, image.size["height"] // 2 - 6
    ActionChains(driver).move_to_element_with_offset(image, x, y).pause(0.4).click().perform()


def kept(driver, address: str) -> dict[str, bytes]:
    """Files that the page links to, as the browser gets them."""
    script = """const [links, told] = arguments;
        Promise.all(links.map(l => fetch(l).then(r => r.ok ? r.arrayBuffer() : null)).map(p => p.then(b =>
            b && Array.from(new Uint8Array(b.slice(0, 4000)))))).then(told)"""
    links = [e.get_attribute("href") for e in driver.find_elements("css selector", f"a[download][href*='{address}']")]
    found = driver.execute_async_script(script, links)
    assert links and None not in found
    return {link.split("/")[-1].split("?")[0]: bytes(content) for link, content in zip(links, found)}


def test_every_picture_is_drawn_and_saved(driver, tmp_path):
    driver.set_script_timeout(30)
    unstable = COARSE.replace("beta = 0.003", "beta = 0.001\nalpha = 0") + '[fluid]\ncontinuity = "quasi-steady"\n'
    with served(tmp_path, unstable) as server:
        tab = Tab(driver, server.address)
        tab.go("See")
        tab.wait(lambda: "CLOSURE" in tab.text.upper())
        time.sleep(1.5)
        assert "PROBABILITY" not in tab.text.upper()  # the case has no uncertainty
        tab.go("Describe")
        tab.drop("sure.toml", (unstable + "[uncertainty]\nsamples = 16\n").encode())
        tab.wait(lambda: "samples = 16" in tab.at("text").get_attribute("value"))
        tab.go("See")
        tab.wait(lambda: "PROBABILITY" in tab.text.upper())
        for title, kind in (
            ("Head-loss curve", "steady"),
            ("Root locus over head", "sweep"),
            ("Stability map", "map"),
            ("Cycle amplitude", "cycle"),
            ("Closure", "closure"),
            ("Probability of chatter", "uncertainty"),
        ):
            tab.click(title)
            state = lambda kind=kind: tab.at(f"run {kind}").text  # noqa: E731
            tab.wait(lambda state=state: "done in" in state() or "failed" in state(), 900)
            assert "done in" in state(), state()
            run = tab.wait(lambda kind=kind: tab.at(f"run {kind}").find_elements("tag name", "img"))
            time.sleep(0.5)
            shoot(driver, f"see-{kind}")
            files = kept(driver, run[0].get_attribute("src").split("/")[-3])
            figures = [n for n, content in files.items() if content.startswith(b"\x89PNG")]
            tables = [n for n, content in files.items() if n.endswith(".csv") and b"\n" in content]
            assert figures and tables and "result.h5" in files, (kind, files.keys())
            assert len(figures) + len(tables) + 1 == len(files), files.keys()
        assert not tab.errors()


def test_rubbers_records_and_results_are_dropped(driver, tmp_path):
    case = tmp_path / "six.toml"
    ringing = COARSE.replace("beta = 0.003", "beta = 0.0005")
    case.write_text(ringing)
    valve, result = dbvfiv.load(case), tmp_path / "six.h5"
    mode = min((m for m in valve.modes("1 m").modes if m.frequency > 0), key=lambda m: m.damping_ratio)
    assert 0 < mode.damping_ratio < 0.2
    valve.replace({"valve.duckbill_length": "104 mm"}).steady(pressure=5e3, output=result)
    stretch = np.linspace(1.05, 2.0, 12)
    stress = 0.5 * (stretch - stretch**-2)
    test = "stretch,stress [MPa]\n" + "".join(f"{a:.5g},{b:.5g}\n" for a, b in zip(stretch, stress))
    seconds = np.arange(0, 4 * abs(1 / mode.growth_rate) + 40 / mode.frequency, 0.05 / mode.frequency)
    ring = np.exp(mode.growth_rate * seconds) * np.cos(mode.angular_frequency * seconds)
    record = "time [s],lip [mm]\n" + "".join(f"{a:.9g},{b:.9g}\n" for a, b in zip(seconds, ring))
    with served(tmp_path, ringing) as server:
        tab = Tab(driver, server.address)
        tab.drop("soft.csv", test.encode())
        tab.wait(lambda: "soft.csv is kept" in tab.text)
        tab.unfold("Rubbers")
        tab.fill("rubber", "soft")
        tab.at("test").click()
        tab._press(".q-item__label", "soft.csv")
        tab.click("Add")
        tab.wait(lambda: "kind fit" in tab.text and tab.at("fits").text == "It fits.")
        tab.unfold("Layers, inside to outside")
        tab.fill("layers.0.material", "soft")
        tab.wait(lambda: 'material = "soft"' in tab.at("text").get_attribute("value"))
        assert tab.at("fits").text == "It fits."
        tab.drop("dbv6.toml", ringing.encode())  # the rubbers of the case again
        tab.wait(lambda: 'material = "soft"' not in tab.at("text").get_attribute("value"))
        tab.go("Ask")
        tab.wait(tab.is_confirmed)
        tab.fill("set pressure", "1\n")
        tab.wait(lambda: not tab.is_confirmed(), 10)
        tab.wait(tab.is_confirmed)
        tab.go("Run")
        tab.drop("bench.csv", record.encode())
        tab.wait(lambda: "done in" in tab.at("run compare").text, 120)
        tab.click("Open")
        tab.wait(lambda: re.search(rf"lip.*: decayed.*It is mode {mode.number}\.", tab.text, re.DOTALL))
        tab.wait(lambda: tab.at("run compare").find_elements("tag name", "img"))
        shoot(driver, "record")
        tab.drop("nonsense.h5", b"nonsense")
        tab.wait(lambda: "nonsense.h5" in tab.text)
        tab.drop("six.h5", result.read_bytes())
        opened = tab.wait(lambda: tab.at("run steady"))
        next(b for b in opened.find_elements("tag name", "button") if b.text.upper() == "OPEN").click()
        tab.wait(lambda: opened.find_elements("tag name", "img"))
        assert "nonsense.h5" not in opened.text
        next(b for b in opened.find_elements("tag name", "button") if "VALVE" in b.text.upper()).click()
        tab.wait(lambda: "279 mm long" in tab.text)
        assert not tab.errors()
    with served(tmp_path, None) as again:
        tab = Tab(driver, again.address)
        tab.go("Run")
        tab.wait(lambda: tab.at("run steady") and tab.at("run compare"))
        tab.click("Open")
        tab.wait(lambda: tab.at("run steady").find_elements("tag name", "img"))


def test_malformed_cases_are_told(driver, tmp_path):
    with served(tmp_path) as server:
        tab = Tab(driver, server.address)
        tab.unfold("Layers, inside to outside")
        for text, said, third_row in (
            ("valve = [", "TOML", False),
            ("x = " + "[" * 5000, "recursion", False),
            ("layers = [1, 2]", "layers.0 is given as 1", True),
            ('layers = [{ material = "CR" }, 7]', "layers.0.thickness is missing", True),
            ('layers = "many"', "layers is given as", False),
            ('valve = "round"', "valve is given as", False),
            ('[valve]\nkey_points = "../../../etc/passwd"', "without their folder", False),
        ):
            tab.drop("bad.toml", text.encode())
            tab.wait(lambda said=said: said in tab.at("wrong").text, 20)
            tab.click("Add a row")
            if third_row:
                tab.wait(lambda: tab.at("layers.2.material").is_displayed(), 20)
                assert said in tab.at("wrong").text
            elif "many" in text:  # the usual rows stand there, and one more
                tab.wait(lambda: tab.at("fits").text == "It fits.", 20)
        tab.drop("dbv6.toml", COARSE.encode())
        tab.wait(lambda: tab.at("fits").text == "It fits.", 20)
        tab.drop("picture.exe", b"MZ")
        tab.wait(lambda: "is not taken" in tab.text, 20)
        tab.wait(lambda: not driver.find_elements("css selector", ".q-uploader__file"), 20)
        tab.drop("huge.toml", b"#" * (6 << 20))
        time.sleep(1.0)
        assert tab.at("fits").text == "It fits." and server.process.poll() is None


def test_others_come_in_by_a_password_and_see_their_own(tmp_path, monkeypatch):
    monkeypatch.setenv("DBVFIV_APP_PASSWORD", "open sesame")
    drivers = [browser(*WIDE), browser(*WIDE)]
    try:
        with served(tmp_path, COARSE, "--host", "0.0.0.0") as server:
            assert "token" not in server.address
            address = server.address.replace("0.0.0.0", "127.0.0.1")
            tabs = []
            for driver, length in zip(drivers, ("100 mm", "104 mm")):
                driver.get(address)
                for typed in ("open says me", "open sesame"):
                    box = driver.find_element("name", "password")
                    box.send_keys(typed + "\n")
                    time.sleep(2.0)
                tab = Tab(driver, address)
                tab.fill("valve.duckbill_length", length)
                tab.wait(lambda tab=tab: tab.at("fits").text == "It fits.")
                tab.go("Run")
                tab.click("Add to the queue")
                tab.wait(lambda tab=tab: tab.at("run report"))
                tabs.append(tab)
            for tab, length in zip(tabs, ("100 mm", "104 mm")):
                tab.driver.refresh()
                tab.wait(lambda tab=tab: tab.at("fits").text == "It fits.")
                assert tab.at("valve.duckbill_length").get_attribute("value") == length
                tab.go("Run")
                tab.wait(lambda tab=tab: tab.at("run report"))
                assert len(tab.driver.find_elements("css selector", '[data-at="run report"]')) == 1
    finally:
        for driver in drivers:
            driver.quit()


def test_a_file_of_a_gigabyte_is_refused_as_it_comes(tmp_path):
    with served(tmp_path) as server:
        host = server.root.split("/")[2]
        line = http.client.HTTPConnection(host, timeout=60)
        line.request("GET", server.address.partition(host)[2])
        told = line.getresponse()
        cookies = "; ".join(c.split(";")[0] for c in told.headers.get_all("set-cookie"))
        told.read()
        line.request("GET", "/", headers={"cookie": cookies})
        place = re.search(r"/_nicegui/client/[\w-]+/upload/\d+", line.getresponse().read().decode())[0]
        before, sent = memory(server.process.pid), 0
        head = f"POST {place} HTTP/1.1\r\nHost: {host}\r\nCookie: {cookies}\r\nTransfer-Encoding: chunked\r\n"
        form = "Content-Type: multipart/form-data; boundary=b\r\n\r\n"
        part = b'--b\r\nContent-Disposition: form-data; name="f"; filename="x.csv"\r\n\r\n'
        with socket.create_connection(host.split(":"), 60) as stream, suppress(OSError):  # the server hangs up
            stream.sendall(f"{head}{form}{len(part):x}\r\n".encode() + part + b"\r\n")
            for _ in range(1024):
                stream.sendall(b"100000\r\n" + bytes(1 << 20) + b"\r\n")
                sent += 1
        assert sent < 100 and memory(server.process.pid) < before + 100
        line.close()
        line.request("GET", "/", headers={"cookie": cookies})
        assert line.getresponse().status == 200


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


def test_two_tabs_and_a_killed_worker(driver, tmp_path):
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
        one.wait(lambda: one.at("valve.scale").is_displayed())
        one.at("valve.scale").send_keys("nonsense")
        one.wait(lambda: "valve.scale" in one.at("wrong").text)
        assert server.process.poll() is None


def two_third(flow: float) -> float:
    """Flow at 1000 kg/m3 from that at 700 kg/m3, with a little room."""
    return flow * (700 / 1000) ** 0.5 * 1.01


@pytest.mark.parametrize("moves", [40, pytest.param(200, marks=pytest.mark.random)])
def test_many_moves_are_all_answered_in_bounded_memory(driver, tmp_path, moves):
    """Random moves on the 6-inch valve at its own mesh of 28 x 48."""
    text = COARSE.replace("around = 6", "around = 28").replace("along = 8", "along = 48")
    text = text.replace('model = "rayleigh"\nbeta = 0.003', 'model = "loss factor"')
    chance = random.Random(8)
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
        for number in range(5 * moves // 2):
            kind = "pressure" if number % 10 == 9 else "density loss_factor"
            before = status("answers")
            tab.slide(chance.choice(kind.split()), chance.uniform(0.02, 0.98))
            tab.wait(lambda: status("answers") > before or tab.errors(), 60)
            if number < moves:
                found[kind].append(status("seconds"))
            if number in (20, moves, 5 * moves // 2 - 1):
                sizes.append(memory(server.process.pid))
        quick, slow = (np.percentile(found[name], (50, 95)) for name in found)
        print(f"\nstate stays: median {quick[0]:.3f} s, 95 % {quick[1]:.3f} s")
        print(f"state moves: median {slow[0]:.2f} s, 95 % {slow[1]:.2f} s; memory {sizes} MB")
        assert sizes[-1] < 1.25 * sizes[0] + 200


def test_a_result_is_opened_for_a_user_who_left_another_valve(driver, tmp_path):
    """The server names its user by a cookie; the browser comes back with it, once it has left a valve behind."""
    case = tmp_path / "six.toml"
    case.write_text(COARSE)
    result = tmp_path / "six.h5"
    dbvfiv.load(case, {"valve.duckbill_length": "104 mm"}).steady(pressure=5e3, output=result)
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
