"""The studies of oscillation in cases/studies run, keep their runs and find the same numbers again."""

import csv
import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from tests.pages import ROOT

STUDIES = Path(__file__).parents[3] / "cases" / "studies"


def study(name, *arguments):
    done = subprocess.run([sys.executable, str(STUDIES / name), *map(str, arguments)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


def script(path, monkeypatch):
    """A script of the project as a module."""
    monkeypatch.syspath_prepend(STUDIES)
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_what_steps_lose_on_purpose_is_no_energy_unaccounted_for(monkeypatch):
    """The balance of a history holds the numerical loss already."""
    time = np.arange(5) * 0.1
    names = ("lip_displacement", "mass_flow", "smallest_area", "pressure_work", "station_pressure", "kinetic_energy")
    history = {name: np.ones(5) for name in names} | {"time": time, "step": np.full(5, 0.1)}
    history |= {"balance": np.full(5, 1e-3), "numerical_loss": np.full(5, 7.0)}
    run = SimpleNamespace(history=history, verdict={"verdict": "chatters"}, failures=())
    found = script(STUDIES / "slamming.py", monkeypatch).statistics(run, 0.05)
    assert found["balance_J"] == pytest.approx(1e-3)


def test_kept_onsets_of_other_keys_are_refused(monkeypatch, tmp_path):
    """They were handed out as those of the keys asked for."""
    tool, kept = script(ROOT / "tools/onset_numbers.py", monkeypatch), tmp_path / "onsets.json"
    kept.write_text(json.dumps({"keys": ["mesh.around=28"], "onsets": {}}))
    with pytest.raises(SystemExit, match="holds onsets with the keys .*give another file"):
        tool.main(kept, ["mesh.element=MITC4"])


def table(path):
    with path.open() as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_response_to_density(tmp_path):
    arguments = [
        "response_to_density.py",
        tmp_path,
        300,
        100,
        "--mesh",
        "6x8",
        "--pressure",
        "6 kPa",
        "--duration",
        "0.03 s",
        "--step",
        "1 ms",
    ]
    study(*arguments)
    first = table(tmp_path / "response.csv")
    assert [(row["way"], row["density"]) for row in first] == [
        ("down", "300"),
        ("down", "100"),
        ("up", "100"),
        ("up", "300"),
    ]
    assert all(int(row["steps"]) >= 30 for row in first)  # slamming lips may halve some
    times = {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("*.h5")}
    study(*arguments)
    assert {path.name: path.stat().st_mtime_ns for path in tmp_path.glob("*.h5")} == times  # read, not run again
    assert table(tmp_path / "response.csv") == first
    assert (tmp_path / "response.png").stat().st_size > 10_000


@pytest.mark.slow
def test_cycle_convergence_and_slamming(tmp_path):
    out = study(
        "cycle_convergence.py",
        tmp_path / "a",
        "--mesh",
        "6x8",
        "--steps",
        2,
        1,
        0.5,
        "--duration",
        "0.04 s",
        "--mesh-duration",
        "0.04 s",
    )
    assert out.count("order of") == 5 and "verdict" in out and len(table(tmp_path / "a" / "convergence.csv")) == 3
    study(
        "slamming.py",
        tmp_path / "b",
        "base:",
        "soft:supports.lip_stop_stiffness=1e6",
        "--mesh",
        "6x8",
        "--duration",
        "0.08 s",
    )
    base, soft = table(tmp_path / "b" / "slamming.csv")
    assert (base["variant"], soft["variant"]) == ("base", "soft") and float(base["time"]) == pytest.approx(0.08)
