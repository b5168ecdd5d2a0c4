"""The valve behind an elastic line: three routes to one number, balances of line and valve, restart, the rigid limit,
random installations.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import trapezoid
from scipy.interpolate import CubicSpline

import dbvfiv
from dbvfiv.model import Conditions, ValveModel, linearise, select_search
from dbvfiv.model.equilibria import LoadPath
from dbvfiv.motion.options import RunOptions
from dbvfiv.motion.stepper import StepOptions
from dbvfiv.studies.case import Case
from dbvfiv.studies.transient.run import Runner
from eigen import SearchOptions, TransferBasis, certified_spectrum, leading_modes
from tests.verification.test_line_modes import random_installation
from tests.verification.test_transient_modes import QUASI, STORAGE, errors, three_routes

SMALL = {"mesh.around": 8, "mesh.along": 12}
LINE = {"upstream.length": 10.0, "upstream.friction": 0.02, "upstream.loss": 1.5, "upstream.diameter": "300 mm"}
WAVES = LINE | {"upstream.wave_speed": 300.0}


@pytest.mark.parametrize(
    "law, pressure, density, further",
    [
        (QUASI, 2e3, 10.0, WAVES),
        (STORAGE, 6e3, 100.0, WAVES | {"upstream.wave_speed": 400.0, "drive.at": "line"}),
    ],
)
def test_three_routes_behind_an_elastic_line(law, pressure, density, further):
    found = three_routes(law, pressure, density, further=further)
    full = found["full"]
    print(f"\n{law}: full {full:.5f} reduced {found['reduced']:.5f} limit {found['limit']:.5f} {found['in time']}")
    assert abs(found["reduced"] - full) < 1e-6 * abs(full)
    growth, frequency = errors(found["limit"], full)
    assert growth < 0.01 and frequency < 0.005


@pytest.mark.parametrize("law, speed", [(QUASI, 300.0), (STORAGE, 1000.0)])
def test_balances_of_line_and_valve(law, speed):
    """What the reservoir gives is in the line, lost on the way or handed to the valve; that is the work of the flange's
    total pressure; and the wall's own balance.
    """
    step, density = 1e-4, 100.0
    keys = {
        "fluid.continuity": law,
        "fluid.density": density,
        "drive.pressure": 6e3,
        "transient.start": "kick",
        "transient.kick_opening": 1e-4,
        "transient.step": step,
        "transient.duration": 200 * step,
        "upstream.wave_speed": speed,
    }
    model = ValveModel(Case().replace(SMALL | WAVES | keys))
    run = Runner(model, replace(RunOptions.of(model.case), step=StepOptions(tolerance=1e-9, floor=1e-13))).start()
    assert not run.failures
    h = run.history
    stored = h["line_kinetic_energy"] + h["line_elastic_energy"]
    missing = stored - stored[0] - (h["line_supply"] - h["line_dissipation"] - h["line_work"])
    moved = np.abs(np.diff(stored)).sum()
    velocity, flow = h["inlet_velocity"], h["inlet_mass_flow"] / density
    mean, middle = 0.5 * (flow[1:] + flow[:-1]), 0.5 * (velocity[1:] + velocity[:-1])
    handed = np.cumsum(step * mean * (h["station_pressure"][1:, -1] + 0.5 * density * middle**2))
    passed = np.abs(handed - h["line_work"][1:]).max() / np.abs(h["line_work"]).max()
    entered, left = (CubicSpline(h["time"], h[name]).antiderivative() for name in ("inlet_mass_flow", "mass_flow"))
    gained = entered(h["time"]) - left(h["time"])
    volume = 4 * trapezoid(h["station_area"].astype(float), model.mesh.z, axis=1)
    held = density * (volume - volume[0]) if law == STORAGE else 0.0
    mass = np.abs(gained - held).max() / entered(h["time"])[-1]
    own = np.abs(h["balance"]).max() / np.abs(np.diff(h["pressure_work"])).sum()
    off = np.abs(missing).max() / moved, passed, mass, own
    print(f"\n{law}: line {off[0]:.1e}, flange {off[1]:.1e}, mass {off[2]:.1e}, wall {off[3]:.1e}")
    assert max(off) < 1e-6
