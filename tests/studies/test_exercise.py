"""The exercises of docs/developing.md, carried out on a copy of the package: a study in one folder and one word, and a
parameter of a flow term by one row.
"""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.small_valves import THESIS_SET, load_small

ROOT = Path(__file__).parent.parent.parent
pytestmark = pytest.mark.slow


@pytest.fixture
def copy(tmp_path):
    """Call of the command line of a copy of the package, in whose folder it runs."""
    for package in ("dbvfiv", "eigen", "continuation"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))

    def call(*arguments):
        done = subprocess.run(
            [sys.executable, "-m", "dbvfiv", *arguments],
            cwd=tmp_path,
            env=os.environ | {"PYTHONPATH": str(tmp_path)},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    return call


def test_a_study_is_a_folder_and_a_word(copy, tmp_path):
    room = tmp_path / "dbvfiv/studies/compliance"
    room.mkdir()
    text = (ROOT / "docs/developing.md").read_text()
    blocks = re.findall(r"```python\n# (\w+\.py)\n(.*?)```", text, flags=re.S)
    assert [name for name, _ in blocks] == ["__init__.py", "study.py"]
    for name, code in blocks:
        (room / name).write_text(code)
    kinds = tmp_path / "dbvfiv/studies/__init__.py"
    kinds.write_text(kinds.read_text().replace('"steady",', '"steady", "compliance",', 1))

    coarse = ("--set", "mesh.around=4", "--set", "mesh.along=8", "--set", "drive.pressure=2 kPa")
    found = json.loads(copy("compliance", *coarse, "--json", "-o", "c.h5"))
    assert found["points"][0]["pressure"] == 2000 and found["points"][0]["compliance"] > 0
    assert f"{found['points'][0]['compliance']:.4g} m/Pa at 2000 Pa" in copy("info", "c.h5")
    assert "compliance" in copy("--help")


def test_a_parameter_of_a_flow_term_is_a_row(copy, tmp_path):
    """Two files are all it takes for the program to know the key, and the jet is slower; swept, and located where the
    valve falls quiet, as single cases with that key have it.
    """
    term, key = re.findall(r"```python\n(.*?)```", (ROOT / "docs/adding-a-flow-law.md").read_text(), re.S)[:2]
    row = re.search(
        r"```python\n# dbvfiv/case/parameters.py\n(.*?)```", (ROOT / "docs/developing.md").read_text(), re.S
    )

    def put(name, place, line):
        file = tmp_path / f"dbvfiv/case/{name}.py"
        assert place in file.read_text()
        file.write_text(file.read_text().replace(place, line + place, 1))

    (tmp_path / "dbvfiv/flow/terms/lip_loss.py").write_text(term)
    put("physics", "    unsteady: StrictBool = key(", key.split("\n", 1)[1])
    coarse = *THESIS_SET, "--set=mesh.around=6", "--set=mesh.along=8", "--set=fluid.density=10", "-p", "6 kPa", "--json"
    free, lossy = (json.loads(copy("steady", f"--set=fluid.lip_loss={k}", *coarse))["points"][0] for k in (0.0, 0.5))
    small = load_small({"fluid.density": 10.0}).steady(pressure=6e3)
    assert free["mass_flow"] == pytest.approx(small.mass_flow, rel=1e-9)
    # more pressure is held against the wall, so the lips open wider; the inlet's velocity head counts for 1 %
    assert lossy["outlet_area"] > free["outlet_area"]
    jets = [point["mass_flow"] / point["outlet_area"] for point in (free, lossy)]
    assert jets[1] == pytest.approx(1.5**-0.5 * jets[0], rel=0.01)
    put("parameters", '    Parameter("thickness",', row[1])
    swept = json.loads(copy("sweep", "--over", "lip_loss=0:1:3", *coarse))
    alone = json.loads(copy("modes", "--set=fluid.lip_loss=0.5", *coarse))
    assert swept["parameter"] == "lip_loss" and swept["values"] == [0.0, 0.5, 1.0]
    rates = [branch["growth_rate"][1] for branch in swept["branches"]]
    assert max(rates) == pytest.approx(alone["modes"][0]["growth_rate"], rel=1e-6)
    onset = json.loads(copy("onset", "--over", "lip_loss=0:4:5", *coarse))["points"][0]
    there = json.loads(copy("modes", f"--set=fluid.lip_loss={onset['value']!r}", *coarse))["modes"][0]
    assert abs(there["growth_rate"]) < 1e-4 * 2 * 3.14 * there["frequency"]
