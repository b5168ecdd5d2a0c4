"""The wheel, built and installed apart from the sources."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
CASE = """
import dbvfiv
from dbvfiv.studies.case import thesis_case
import continuation, eigen
for package in (dbvfiv, continuation, eigen):
    assert TARGET in package.__file__, package.__file__
print(dbvfiv.load(thesis_case(), {"mesh.around": 4, "mesh.along": 6}).steady(["2 kPa"]).states[0].mass_flow)
"""


def test_extras_that_are_named_are_there():
    """In the manual and in what the program tells to install."""
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    texts = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md"), *(ROOT / "dbvfiv").rglob("*.py")]
    named = [name for path in texts for name in re.findall(r"dbvfiv\[(\w+)\]", path.read_text())]
    named += re.findall(r"`\[(\w+)\]`", texts[0].read_text())
    assert {"report", "app", "fit"} <= set(named) <= set(extras)


@pytest.mark.slow
def test_the_wheel_holds_all_that_a_run_needs(tmp_path):
    pytest.importorskip("build", reason="the package build is not installed")
    target, source = tmp_path / "site", tmp_path / "source"
    # From what is under version control, so that no file of the work tree helps out.
    source.mkdir()
    archive = subprocess.run(["git", "archive", "HEAD"], cwd=ROOT, check=True, capture_output=True).stdout
    subprocess.run(["tar", "-x", "-C", source], input=archive, check=True)
    command = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", tmp_path, source]
    built = subprocess.run(command, capture_output=True, text=True)
    assert built.returncode == 0, built.stdout + built.stderr
    (wheel,) = tmp_path.glob("dbvfiv-*.whl")
    command = [sys.executable, "-m", "pip", "install", "--no-deps", "--no-index", "--target", target, wheel]
    subprocess.run(command, check=True, capture_output=True)
    environment = {**os.environ, "PYTHONPATH": str(target)}
    for arguments in (["-m", "dbvfiv", "doctor"], ["-c", CASE.replace("TARGET", repr(str(target)))]):
        done = subprocess.run(
            [sys.executable, *arguments], cwd=tmp_path, env=environment, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stdout + done.stderr
    assert float(done.stdout.split()[-1]) > 0
    assert all((target / package / "py.typed").exists() for package in ("dbvfiv", "continuation", "eigen"))
