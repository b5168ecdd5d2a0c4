"""Runs in time with contact of the inner faces: a valve that shuts, its books, its file."""

import numpy as np
import pytest

import dbvfiv
from dbvfiv.case.parameters import Mu
from dbvfiv.model.dynamics import linearise
from dbvfiv.motion.equations import ValveMotion
from dbvfiv.motion.scheme import scheme
from dbvfiv.motion.start import steady_positions
from dbvfiv.motion.stepper import StepOptions, Stepper, consistent_state
from dbvfiv.studies.session import load_result
from dbvfiv.studies.transient.figures import energies
from tests.observers import Stop

from .runs import transient

#: Water drawn back through a valve that stands open, from the first instant on.
SHUTTING = {
    "supports.contact": "faces",
    "downstream.pressure": 10e3,
    "fluid.continuity": "storage",
    "transient.start": "steady",
    "transient.numerical_damping": 0.2,
    "transient.restart_every": 7,
}


@pytest.fixture
def shutting(tmp_path, valve):
    """A model whose drive turns from +10 to -10 kPa in 20 ms."""
    table = tmp_path / "turn.csv"
    table.write_text("time [s], pressure [kPa]\n0, 20\n0.02, 0\n")

    def make(**changes):
        return valve(SHUTTING | {"transient.drive_table": str(table)} | changes)

    return make


@pytest.mark.slow
def test_a_valve_that_shuts_has_no_negative_area_and_its_energy_is_accounted_for(shutting):
    run = transient(shutting(**{"transient.duration": 0.12}))
    h = run.history
    assert not run.failures and h["stops"].max() > 3 and h["contact_force"].max() > 10
    assert h["smallest_area"].min() > 0 and h["penetration"].max() < 5e-5
    assert np.diff(h["contact_loss"]).min() > -1e-6 and h["contact_loss"][-1] > 0
    stored = sum(h[name] - h[name][0] for name in ("kinetic_energy", "strain_energy", "stop_energy"))
    balance = stored - h["pressure_work"] + h["dissipation"] + h["contact_loss"] + h["numerical_loss"]
    assert h["balance"] == pytest.approx(balance, abs=1e-9 * np.abs(stored).max())
    assert np.abs(h["balance"]).max() < 0.01 * np.abs(np.diff(h["pressure_work"])).sum()
    assert set(run.dissipated()) == {"Rayleigh damping", "contact of the faces"}


@pytest.mark.slow
def test_columns_of_the_contact_are_there_where_it_is(tmp_path, valve, all_restart_points):
    """And a run that was stopped goes on with the same digits."""
    pressed = {"drive.kind": "uniform", "drive.side": "outside", "drive.pressure": 2e3, "downstream.pressure": 0.0}
    times = {
        "transient.start": "rest",
        "transient.duration": 0.004,
        "transient.step": 5e-4,
        "transient.restart_every": 6,
    }
    model = valve(SHUTTING | pressed | times)
    whole = transient(model, output=tmp_path / "whole.h5")
    assert whole.history["contact_loss"][-1] > 0 and whole.history["stops"].max() > 3
    kept = load_result(tmp_path / "whole.h5")
    assert np.array_equal(kept.mesh.face_nodes, model.contact.nodes)
    assert energies(whole).axes
    transient(model, output=tmp_path / "parts.h5", observer=Stop(7))
    resumed = dbvfiv.resume(tmp_path / "parts.h5")
    for name in whole.history:
        assert np.array_equal(resumed.history[name], whole.history[name]), name


@pytest.mark.slow
def test_a_small_motion_of_pressed_lips_follows_its_mode(valve):
    """Growth rate and frequency in time are those of the pencil, stiffness damping acting on the wall alone."""
    changes = {"drive.kind": "uniform", "drive.side": "outside", "drive.pressure": 500.0, "damping.alpha": 0.0}
    model = valve({"supports.contact": "faces", "damping.beta": 1e-4} | changes)
    q = steady_positions(model, 500.0)
    assert model.touching(q) > 3
    pencil = linearise(model, q, 500.0).pencil(Mu.of(model.case), fluid=False)
    mass, damping, stiffness = (np.asarray(part.todense()) for part in (pencil.M, pencil.C, pencil.K))
    n, zero = model.size, np.zeros((model.size, model.size))
    inverse = np.linalg.inv(mass)
    values, vectors = np.linalg.eig(np.block([[zero, np.eye(n)], [-inverse @ stiffness, -inverse @ damping]]))
    chosen = np.argmin(np.where(values.imag > 1.0, np.abs(values), np.inf))
    value, shape = values[chosen], vectors[:n, chosen]
    shape = 1e-9 * shape / np.abs(shape).max()
    motion = ValveMotion(model)
    state = consistent_state(motion, 0.0, q + shape.real, (value * shape).real, 500.0)
    options = StepOptions(tolerance=1e-9, floor=1e-15)
    errors = []
    for steps in (40, 80):
        h, now = 2 * np.pi / value.imag / steps, state
        stepper = Stepper(motion, scheme("generalised-alpha", 0.0), lambda t: 500.0, options)
        for _ in range(steps // 2):
            now = stepper.step(now, h).state
        exact = (shape * np.exp(value * now.time)).real
        errors.append(np.abs(now.q - q - exact).max() / np.abs(shape).max())
    assert errors[1] < 5e-3 and errors[0] / errors[1] > 3.0
