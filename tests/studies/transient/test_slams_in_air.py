"""Lips that slam in air, which is compressed, with contact of their inner faces."""

from __future__ import annotations

import numpy as np
import pytest

import dbvfiv
from dbvfiv.flow.energy import GAS_BOOKS
from dbvfiv.studies.case import thesis_case

AIR = {
    "mesh.around": 8,
    "mesh.along": 14,
    "drive.pressure": 6e3,
    "fluid.density": 1.2,
    "fluid.continuity": "storage",
    "fluid.sound_speed": 343,
    "damping.alpha": 0.0,
    "supports.contact": "faces",
    "supports.contact_stiffness": "1000 MPa/mm",
    "transient.step": "0.5 ms",
}


@pytest.mark.slow
def test_areas_stay_open_and_pressures_above_vacuum():
    """Two slams after a pressure applied at once to the valve at rest; the books of wall and gas close."""
    run = dbvfiv.load(thesis_case(), AIR).transient("0.12 s")
    history = run.history
    assert history["time"][-1] == pytest.approx(0.12) and not run.failures
    shut = history["smallest_area"] < 1e-4
    assert np.sum(shut[1:] & ~shut[:-1]) >= 2 and history["contact_force"].max() > 0
    # 0.5 cm2 at rest
    assert history["smallest_area"].min() > -1e-6
    assert -101325 < history["station_pressure"].min() < 0 < history["station_pressure"].max() < 2e5
    assert np.abs(history["balance"]).max() < 1e-3 * history["pressure_work"][-1]
    assert not history["numerical_loss"].any()  # though the gas is drawn in now and then
    gained = history["gas_energy"] - history["gas_energy"][0] - history["gas_supply"]
    gone = sum(history[name] for name in GAS_BOOKS[1:])
    assert np.abs(gained + gone).max() < 1e-9 * history["gas_supply"][-1]
    for name in ("gas_step_loss", "gas_mesh_loss"):
        assert np.abs(history[name]).max() < 0.02 * history["gas_supply"][-1]
