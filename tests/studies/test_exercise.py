"""The exercise of docs/developing.md: a study in one folder and one word, carried out on a copy of the package."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent


@pytest.mark.slow
def test_a_study_is_a_folder_and_a_word(tmp_path):
    for package in ("dbvfiv", "eigen", "continuation"):
        shutil.copytree(ROOT / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    room = tmp_path / "dbvfiv/studies/compliance"
    room.mkdir()
    (room / "__init__.py").write_text('"""An exercise."""\n')
    text = (ROOT / "docs/developing.md").read_text()
    blocks = re.findall(r"```python\n# (\w+\.py)\n(.*?)```", text, flags=re.S)
    assert [name for name, _ in blocks] == ["keys.py", "command.py", "study.py"]
    for name, code in blocks:
        (room / name).write_text(code)
    kinds = tmp_path / "dbvfiv/studies/__init__.py"
    kinds.write_text(kinds.read_text().replace('"steady",', '"steady", "compliance",', 1))

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

    coarse = ("--set", "mesh.around=4", "--set", "mesh.along=8", "--set", "drive.pressure=2 kPa")
    found = json.loads(call("compliance", *coarse, "--json", "-o", "c.h5"))
    assert found["points"][0]["pressure"] == 2000 and found["points"][0]["compliance"] > 0
    assert f"{found['points'][0]['compliance']:.4g} m/Pa at 2000 Pa" in call("info", "c.h5")
    assert "compliance" in call("--help")
