"""Fluid outside a wall in motion: against eigenvalues, in the balance of energy, renewed, and resumed."""

from __future__ import annotations

import numpy as np
import pytest

import dbvfiv
from dbvfiv.motion.equations import ValveMotion
from dbvfiv.motion.options import RunOptions
from dbvfiv.motion.outside import OutsideCorrection
from dbvfiv.motion.start import steady_positions
from dbvfiv.studies.transient.run import Runner
from tests.small_valves import make_valve

WATER = {"outside.fluid": "same", "fluid.density": 1000.0}
SMOOTH = {
    "drive.pressure": 6e3,
    "damping.alpha": 0.0,
    "damping.beta": 0.002,
    "transient.start": "kick",
    "transient.numerical_damping": 0.0,
}


def run(changes):
    model = make_valve(WATER | SMOOTH | changes)
    return Runner(model, RunOptions.of(model.case)).start()


def test_energies_balance_on_a_smooth_run():
    found = run({"transient.kick_opening": 1e-4, "transient.step": 1e-4, "transient.duration": 0.05})
    h = found.history
    turned_over = np.abs(np.diff(h["pressure_work"])).sum()
    assert np.abs(h["balance"]).max() < 1e-6 * turned_over
    assert h["outside_energy"].max() > 2.0 * h["kinetic_energy"].max()  # water weighs more than the wall
    assert not np.any(h["outside_renewed"])


def test_renewals_are_in_the_books():
    """A wall that moves far: the balance holds as before, and what renewals put in is little."""
    changes = {"transient.start": "rest", "transient.step": 2e-4, "transient.duration": 0.12}
    found = run(changes)
    h, outside = found.history, found.model
    assert outside.outside is not None and not found.failures
    turned_over = np.abs(np.diff(h["pressure_work"])).sum()
    assert np.any(h["outside_renewed"])
    assert np.abs(h["balance"]).max() < 0.02 * turned_over
    assert np.abs(h["outside_renewed"]).max() < 0.02 * turned_over


def test_the_correction_solves_the_sum():
    rng = np.random.default_rng(5)
    matrix, columns = rng.standard_normal((9, 9)) + 9 * np.eye(9), rng.standard_normal((7, 3))

    def solve(force, rest):
        found = np.linalg.solve(matrix, np.concatenate([force, np.zeros(2) if rest is None else rest]))
        return found[:7], found[7:]

    whole = matrix.copy()
    whole[:7, :7] += 0.3 * columns @ columns.T
    right = rng.standard_normal(9)
    q, u = OutsideCorrection(solve, columns, 0.3).solve(right[:7], right[7:])
    np.testing.assert_allclose(np.concatenate([q, u]), np.linalg.solve(whole, right))


def test_accelerations_carry_the_fluid():
    """M a + M_a a = f at rest: with water outside, the same push accelerates less, by the pencil's own mass."""
    model = make_valve(WATER | {"drive.kind": "uniform", "drive.pressure": 1.0})
    motion = ValveMotion(model)
    rest = model.rest()
    a, load = motion.accelerations(rest, rest, 0.0, 1.0)
    structure = model.shell.dofs.matrix(model.structure(rest)[1])
    w = model.outside.added_mass(rest, structure).columns
    left = model.shell.dofs.matrix(model.mass(rest)) @ a + 1000.0 * (w @ (w.T @ a)) - load.force
    assert np.linalg.norm(left) < 1e-9 * np.linalg.norm(load.force)


@pytest.mark.parametrize("adaptive", [False, True])
def test_a_resumed_run_gives_the_same_numbers(tmp_path, adaptive, monkeypatch):
    monkeypatch.setattr("dbvfiv.studies.transient.keeping.RESTART_SHARE", float("inf"))
    changes = WATER | SMOOTH | {"mesh.around": 6, "mesh.along": 8, "transient.start": "rest"}
    changes |= {"transient.step": 5e-4, "transient.adaptive": adaptive, "transient.restart_every": 20}
    valve = dbvfiv.load(changes=changes | {"transient.duration": 0.04})
    whole = dbvfiv.load(changes=changes | {"transient.duration": 0.02})
    long = valve.transient(output=tmp_path / "long.h5")
    whole.transient(output=tmp_path / "short.h5")
    resumed = dbvfiv.resume(tmp_path / "short.h5", changes={"transient.duration": 0.04})
    for name in ("lip_displacement", "balance", "outside_energy", "outside_renewed"):
        np.testing.assert_allclose(resumed.history[name], long.history[name], rtol=1e-6, atol=1e-12)


def test_three_routes_give_one_number_with_water_outside():
    from tests.verification.test_transient_modes import three_routes

    steady_positions(make_valve(), 1e3)
    for law, pressure, further in (
        ("quasi-steady", 10e3, {"outside.fluid": "same"}),
        ("storage", 6e3, {"outside.fluid": 800.0, "outside.pipe_diameter": 0.4, "outside.lips": "open"}),
    ):
        found = three_routes(law, pressure, 1000.0, further=further)
        full, limit = found["full"], found["limit"]
        assert abs(found["reduced"] / full - 1.0) < 1e-6
        assert limit.real == pytest.approx(full.real, rel=0.01)
        assert limit.imag == pytest.approx(full.imag, rel=0.005)
