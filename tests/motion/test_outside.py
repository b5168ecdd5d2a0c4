"""Fluid outside a wall in motion: against eigenvalues, in the balance of energy, renewed, and resumed."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import dbvfiv
from dbvfiv.geometry.valve_mesh import valve_mesh
from dbvfiv.model.outside import OutsideFluid
from dbvfiv.motion.control import RunOptions
from dbvfiv.motion.equations import KEPT_WITHIN, MovingOutside, OutsideCorrection, ValveMotion
from dbvfiv.shell import Shell, ShellMesh
from dbvfiv.studies.case import Case
from dbvfiv.studies.transient.run import Runner
from tests.geometry.test_key_points import WIDE, by_points
from tests.observers import Stop
from tests.shell.structures import isotropic_section
from tests.small_valves import make_valve
from tests.studies.transient.runs import transient
from tests.verification.test_transient_modes import three_routes

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


@pytest.mark.slow
def test_energies_balance_on_a_smooth_run():
    found = run({"transient.kick_opening": 1e-4, "transient.step": 1e-4, "transient.duration": 0.02})
    h = found.history
    turned_over = np.abs(np.diff(h["pressure_work"])).sum()
    assert np.abs(h["balance"]).max() < 1e-6 * turned_over
    assert h["outside_energy"].max() > h["kinetic_energy"].max()  # water weighs more than the wall
    assert not np.any(h["outside_renewed"])


@pytest.mark.slow
def test_renewals_are_in_the_books():
    """A wall that opens from rest: the balance is the scheme's alone, and what renewals change is small and known."""
    found = run({"transient.start": "rest", "transient.step": 5e-4, "transient.duration": 0.06})
    h = found.history
    turned_over = np.abs(np.diff(h["pressure_work"])).sum()
    assert not found.failures and np.any(h["outside_renewed"])
    assert np.abs(h["balance"]).max() < 0.01 * turned_over
    assert 1e-3 * turned_over < np.abs(h["outside_renewed"]).max() < 0.1 * turned_over


def test_a_valve_of_key_points_is_measured_by_its_own_size(tmp_path):
    case = Case().replace(WIDE | {"valve.scale": 0.4, "outside.fluid": "same"})
    for each in (case, by_points(case, tmp_path, 9)):
        mesh = valve_mesh(each.valve, each.mesh)
        planes = [(mesh.rows[:, 0], 0), (mesh.rows[:, -1], 1)]
        surface = ShellMesh.build(mesh.nodes, mesh.quads, mesh.thickness, planes=planes)
        shell = Shell(surface, isotropic_section(1e6, 0.4, 4e-3, 1e3))
        assert OutsideFluid(each, mesh, shell).inlet_radius == pytest.approx(0.04, rel=1e-9)
        kept = MovingOutside(SimpleNamespace(case=each), 1000.0, np.max).within
        assert kept == pytest.approx(KEPT_WITHIN * 0.04, rel=1e-9)


def test_the_correction_solves_the_sum():
    rng = np.random.default_rng(5)
    matrix, columns = rng.standard_normal((9, 9)) + 9 * np.eye(9), rng.standard_normal((7, 3))

    def solve(force, rest):
        found = np.linalg.solve(matrix, np.concatenate([force, np.zeros_like(force[:2]) if rest is None else rest]))
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
    a, load = motion.accelerations(rest, rest, 1.0)
    structure = model.shell.dofs.matrix(model.structure(rest)[1])
    w = model.outside.added_mass(rest, structure).columns
    left = model.shell.dofs.matrix(model.mass(rest)) @ a + 1000.0 * (w @ (w.T @ a)) - load.force
    # water weighs a thousand times what the tips of this mesh do, which costs the correction half its digits
    assert np.linalg.norm(left) < 1e-7 * np.linalg.norm(load.force)


@pytest.mark.parametrize("adaptive", [pytest.param(False, marks=pytest.mark.slow), True])
def test_a_resumed_run_gives_the_same_numbers(tmp_path, adaptive, monkeypatch):
    monkeypatch.setattr("dbvfiv.studies.transient.history.RESTART_SHARE", float("inf"))
    changes = WATER | SMOOTH | {"transient.start": "rest", "transient.restart_every": 7, "transient.duration": 0.02}
    model = make_valve(changes | {"transient.step": 5e-4, "transient.adaptive": adaptive})
    whole = transient(model, output=tmp_path / "whole.h5")
    assert np.any(whole.history["outside_renewed"])
    stopped = transient(model, output=tmp_path / "parts.h5", observer=Stop(25))
    assert not stopped.complete
    resumed = dbvfiv.resume(tmp_path / "parts.h5")
    for name in ("lip_displacement", "outside_energy", "outside_renewed"):
        size = np.abs(whole.history[name]).max()
        np.testing.assert_allclose(resumed.history[name], whole.history[name], atol=1e-9 * size, rtol=0)


@pytest.mark.slow
def test_three_routes_give_one_number_with_water_outside():
    for law, pressure, further in (
        ("quasi-steady", 10e3, {"outside.fluid": "same"}),
        ("storage", 6e3, {"outside.fluid": 800.0, "outside.pipe_diameter": 0.4, "outside.lips": "open"}),
    ):
        found = three_routes(law, pressure, 1000.0, further=further)
        full, limit = found["full"], found["limit"]
        assert abs(found["reduced"] / full - 1.0) < 1e-6
        assert limit.real == pytest.approx(full.real, rel=0.01)
        assert limit.imag == pytest.approx(full.imag, rel=0.005)
