"""Fluids together: a gas behind an elastic line; pump, waves, water outside and friction; water around a half.

A small kick grows as the eigenvalue says, and energies of the run close.
"""

from __future__ import annotations

import numpy as np
import pytest

import dbvfiv
from dbvfiv.case.quantity import GRAVITY
from dbvfiv.flow.energy import GAS_BOOKS, LINE_BOOKS
from dbvfiv.model.equilibria import find_equilibrium
from dbvfiv.studies.case import thesis_case
from tests.verification.test_transient_modes import errors, leading_oscillation, rung_in_time

COARSE = {"mesh.around": 6, "mesh.along": 8, "fluid.continuity": "storage", "damping.alpha": 0.0, "damping.beta": 3e-3}
WAVES = {"upstream.length": 6.0, "upstream.diameter": 0.3, "upstream.loss": 0.5, "upstream.elements": 3}
KINDS = {
    "gas and waves": WAVES
    | {"upstream.wave_speed": 300.0, "fluid.density": 1.2, "fluid.sound_speed": 340.0, "drive.pressure": 2e3},
    "pump, waves, water outside, friction": WAVES
    | {
        "upstream.wave_speed": 300.0,
        "fluid.density": 1000.0,
        "fluid.viscosity": 1e-3,
        "outside.fluid": "same",
        "drive.pressure": 6e3,
    },
    "half in water": {
        "mesh.part": "half",
        "mesh.around": 5,
        "fluid.density": 1000.0,
        "outside.fluid": "same",
        "drive.pressure": 6e3,
        "transient.kick_mode": 2,  # the first moves the lips sideways
    },
}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_kick_grows_as_the_eigenvalue_and_energies_close(kind):
    valve = dbvfiv.load(thesis_case(), COARSE | KINDS[kind])
    if kind.startswith("pump"):
        valve = valve.replace({"upstream.pump": falling_curve(valve)})
    mode = leading_oscillation(valve)
    found, limit = rung_in_time(valve, mode.frequency, (25, 50), examine=lambda run: check_energies(run.history))
    print(f"\n{kind}: eigenvalue {mode.eigenvalue:.5f}, in time {found}, limit {limit:.5f}")
    growth, frequency = errors(limit, mode.eigenvalue)
    assert growth < 0.01 and frequency < 0.005


def falling_curve(valve) -> list[list[float]]:
    """Pump curve through the steady state at drive.pressure."""
    state = find_equilibrium(valve.model, valve.case.drive.pressure)
    flow, head = state.volume_flow, valve.case.drive.pressure / (valve.case.fluid.density * GRAVITY)
    return [[0.0, 1.5 * head], [flow, head], [2.0 * flow, 0.3 * head]]


def check_energies(history):
    """Gain of each part of the fluid: what it took in less what it gave, to rounding; the line hands the flange's
    power over; and the wall's balance is that of its parts.
    """
    if "line_supply" in history:
        held = history["line_kinetic_energy"] + history["line_elastic_energy"]
        supply, *gone = (history[name] for name in LINE_BOOKS)
        assert np.abs(held - held[0] - supply + sum(gone)).max() < 1e-9 * max(held.max(), np.abs(supply).max())
    if "gas_supply" in history:
        supply, *gone = (history[name] for name in GAS_BOOKS)
        gained = history["gas_energy"] - history["gas_energy"][0]
        assert np.abs(gained - supply + sum(gone)).max() < 1e-9 * supply.max()
        assert history["line_work"][-1] == pytest.approx(supply[-1], rel=1e-8)
    # a kick of this size moves less energy than rounding leaves of what the strained wall holds
    assert np.abs(history["balance"]).max() < 1e-10 * history["strain_energy"].max()
