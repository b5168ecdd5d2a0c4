"""The page as its user sees it, in a browser, on a mesh that answers at once."""

from __future__ import annotations

import json

import pytest

pytest.importorskip("nicegui", reason="NiceGUI is not installed; `pip install 'dbvfiv[app]'` brings it")
from dbvfiv.cli import run
from tests.app.server import COARSE, Tab, served
from tests.browser import browser


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    driver = browser()
    with served(tmp_path_factory.mktemp("page")) as server:
        yield server, driver
    driver.quit()


def test_a_valve_is_described_and_asked(site, tmp_path, capsys):
    server, driver = site
    assert server.seconds < 15  # with room for a machine that is shared
    tab = Tab(driver, server.address)
    tab.fill("valve.duckbill_length", "-3 mm")
    tab.wait(lambda: "greater than 0" in tab.at("wrong").text)
    tab.fill("valve.duckbill_length", "105 mm")
    tab.wait(lambda: tab.at("fits").text == "It fits.")
    tab.wait(lambda: "280 mm long" in tab.text)
    tab.go("Ask")
    tab.wait(lambda: tab.is_confirmed())
    tab.fill("set pressure", "1\n")
    tab.slide("density", 0.3)
    tab.slide("beta", 0.1)
    tab.wait(lambda: not tab.is_confirmed(), 5)
    tab.wait(lambda: tab.is_confirmed() and "× damping" in tab.text)
    values = {name: float(tab.at(f"slide {name}").get_attribute("aria-valuenow")) for name in ("density", "beta")}
    (tmp_path / "dbv6.toml").write_text(COARSE)
    sets = [f"--set=fluid.density={values['density']}", f"--set=damping.beta={values['beta']}"]
    capsys.readouterr()
    assert run(["modes", str(tmp_path / "dbv6.toml"), "-p", "9806.65 Pa", *sets, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    for name in ("lip_opening", "volume_flow", "outlet_area"):
        assert tab.number(name) == pytest.approx(found["state"][name], rel=1e-6), name
    assert f"{found['modes'][0]['growth_rate']:.4g}"[:5] in tab.text
    assert not tab.errors()
