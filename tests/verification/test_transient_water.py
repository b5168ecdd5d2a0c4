"""Water, pressure applied at once: the run ends in the steady state, as fast as the slowest mode there allows."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import dbvfiv
from dbvfiv.studies.case import thesis_case
from dbvfiv.studies.transient.run import Runner

STUDY = Path(__file__).parents[2] / "cases" / "studies" / "sudden_pressure.py"


def approach(pressure: float, mesh, duration: float, step: float):
    """Relative distances of the mass flow to the steady one, their decay rate (1/s) over the last part, and the slowest
    eigenvalue (1/s).
    """
    changes = {
        "mesh.around": mesh[0],
        "mesh.along": mesh[1],
        "drive.pressure": pressure,
        "transient.duration": duration,
        "transient.step": step,
    }
    valve = dbvfiv.load(thesis_case(), changes)
    history = Runner(valve.model).start().history
    off = history["mass_flow"] / valve.steady(pressure).mass_flow - 1.0
    time = history["time"]
    late = (np.abs(off) < 1e-2) & (np.abs(off) > 1e-5)
    rate = np.polyfit(time[late], np.log(np.abs(off[late])), 1)[0]
    return off, float(rate), valve.modes(count=2).modes[0].growth_rate


@pytest.mark.slow
@pytest.mark.parametrize(
    "pressure, mesh, step", [(18e3, (6, 8), 4e-3), pytest.param(36e3, (8, 12), 2e-3, marks=pytest.mark.slow)]
)
def test_water_settles_as_the_slowest_mode_allows(pressure, mesh, step):
    off, rate, slowest = approach(pressure, mesh, 0.6, step)
    print(
        f"\n{pressure:g}: off at the end {off[-1]:.2e}, largest {off.max():.1e}, rate {rate:.3f}, slowest "
        f"mode {slowest:.3f}"
    )
    assert abs(off[-1]) < 1e-4
    assert off.max() < 1e-4
    assert rate == pytest.approx(slowest, rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("pressure, duration, settled", [(2e3, 0.8, 1e-4), (18e3, 0.5, 1e-4), (50e3, 0.5, 2e-6)])
def test_water_on_the_valve(pressure, duration, settled):
    off, rate, slowest = approach(pressure, (28, 48), duration, 1e-3)
    print(f"\n{pressure:g}: off after {duration} s {off[-1]:.2e}, rate {rate:.3f}, slowest mode {slowest:.3f}")
    assert abs(off[-1]) < settled
    assert off.max() < 1e-6
    assert rate == pytest.approx(slowest, rel=0.02)


@pytest.mark.slow
def test_study_of_suddenly_applied_pressure(tmp_path):
    arguments = [sys.executable, str(STUDY), str(tmp_path), "--mesh", "6x8", "--only", "numerical", "alpha"]
    done = subprocess.run(arguments, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    with (tmp_path / "sensitivity.csv").open() as file:
        flows = [float(row["mass_flow"]) for row in csv.DictReader(file)]
    assert len(flows) == 7 and np.ptp(flows) < 1e-4 * flows[0]
    assert (tmp_path / "sudden-sensitivity.png").stat().st_size > 10_000
