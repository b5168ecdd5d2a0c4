"""The valve's equations of periodic motions: their linearisation, and that they are those of runs in time."""

from types import MappingProxyType

import numpy as np
import pytest

from continuation import blocks
from continuation.harmonics import Harmonics
from continuation.periodic import PeriodicMotion
from dbvfiv.errors import SolveError
from dbvfiv.model.residual import ValveResidual
from dbvfiv.motion.periodic import PeriodicValve
from dbvfiv.motion.start import steady_positions
from tests.small_valves import find_open_state, make_valve

MU = MappingProxyType({"inlet": 12e3, "density": 40.0, "alpha": 3.0, "beta": 2e-3, "loss_factor": 0.0})
LOSSY = MappingProxyType({"damping.model": "loss factor", "damping.alpha": 0.0})
LAWS = {
    "quasi-steady": {},
    "storage": {"fluid.continuity": "storage"},
    "steady": {"fluid.unsteady": False},
    "line": {"upstream.length": 2.0, "upstream.diameter": 0.3, "upstream.friction": 0.02},
    "gas": {"fluid.continuity": "storage", "fluid.sound_speed": 340.0},
    "loss factors": LOSSY,
    "averaged mass": {"shell.mass": "averaged"},
}


def motion_of(model, mu, size=1e-3, harmonics=2, seed=0):
    """A motion of a few smooth shapes about a deformed state, with all harmonics in it."""
    q = find_open_state()
    inner = model.flow.steady_inner(model.rows.areas(model.nodal(q)), mu)
    rng, h = np.random.default_rng(seed), Harmonics(harmonics)
    c = np.zeros((h.size, model.size + len(inner)))
    c[0] = np.concatenate([q, inner])
    shapes = np.array([q, q**2 * np.sign(q) / np.abs(q).max()])
    for k in range(1, h.size):
        c[k, : model.size] = size / k**2 * (rng.standard_normal(2) @ shapes) / np.abs(q).max()
        c[k, model.size :] = 0.02 / k**2 * inner * rng.standard_normal(len(inner))
    return PeriodicMotion(h, c, 230.0)


def valve_of(name):
    changes = dict(LAWS[name])
    model = make_valve(changes)
    mu = dict(MU) | ({"loss_factor": 1.0, "alpha": 0.0, "beta": 0.0} if name == "loss factors" else {})
    if name == "line":
        mu["pipe_length"] = 2.0
    return model, mu, PeriodicValve(lambda _: model, mu)


@pytest.mark.parametrize("name", [pytest.param(x, marks=pytest.mark.slow) if x == "loss factors" else x for x in LAWS])
def test_linearisation_is_the_derivative_of_the_residual(name):
    model, mu, system = valve_of(name)
    motion = motion_of(model, mu)
    operator = system.linearise(motion, mu)
    change = motion_of(model, mu, seed=1).coefficients - motion.coefficients
    change[0] = 1e-3 * motion.coefficients[0]
    step = 1e-4

    def residual(sign):
        moved = PeriodicMotion(motion.harmonics, motion.coefficients + sign * step * change, motion.omega)
        return moved.harmonics.project(system.residual(moved, mu))

    difference = (residual(1) - residual(-1)) / (2 * step)
    found = operator.apply(change)
    for part in (slice(0, model.size), slice(model.size, None)):
        error = np.linalg.norm(found[:, part] - difference[:, part])
        assert error < 2e-5 * np.linalg.norm(difference[:, part])


def test_faces_that_touch_in_a_part_of_the_cycle():
    """Their force is in the residual, and its derivative in the linearisation, with no part of stiffness damping."""
    changes = {"supports.contact": "faces", "supports.contact_stiffness": 1e7, "valve.initial_gap": 1e-3}
    model, free = make_valve(changes), make_valve(changes | {"supports.contact": "stops", "supports.lip_stop": False})
    mu = dict(MU)
    system, bare = (PeriodicValve(lambda _, m=m: m, mu) for m in (model, free))
    motion = motion_of(model, mu, size=8e-2)
    coefficients = motion.coefficients.copy()
    coefficients[0, : model.size] = 0.0  # about lips at rest
    # as few samples as phases that the wall's matrices are taken at, so that those of both models are the same
    motion = PeriodicMotion(Harmonics(2, 5), coefficients, motion.omega)
    touching = [model.touching(x[: model.size]) for x in motion.samples]
    assert max(touching) > 3 and min(touching) == 0
    forces = np.array([model.contact.force(x[: model.size]) for x in motion.samples])
    more = system.residual(motion, mu) - bare.residual(motion, mu)
    assert more[:, : model.size] == pytest.approx(forces, abs=1e-9 * np.abs(forces).max())
    change = motion_of(model, mu, seed=1).coefficients - motion.coefficients
    change[0] = 1e-3 * motion.coefficients[0]
    found = system.linearise(motion, mu).apply(change) - bare.linearise(motion, mu).apply(change)

    def contact(sign):
        moved = PeriodicMotion(motion.harmonics, motion.coefficients + sign * 1e-6 * change, motion.omega)
        return moved.harmonics.project(np.array([model.contact.force(x[: model.size]) for x in moved.samples]))

    difference = (contact(1) - contact(-1)) / 2e-6
    assert np.linalg.norm(found[:, : model.size] - difference) < 1e-4 * np.linalg.norm(difference)


@pytest.mark.parametrize("name", ["storage", "averaged mass"])
def test_residual_is_that_of_the_equations_of_motion(name):
    """At every sample, with rates of stiffness damping taken by its tangent."""
    model, mu, system = valve_of(name)
    motion = motion_of(model, mu)
    fine = PeriodicMotion(Harmonics(2, 41), motion.coefficients, motion.omega)
    found = system.residual(fine, mu)
    n = model.size
    rates = fine.rates
    q, v, a = (rates.apply(k, fine.samples) for k in range(3))
    residual = ValveResidual(model)
    for i in (0, 13, 29):
        state = (q[i, :n], v[i, :n], a[i, :n], q[i, n:], v[i, n:])
        force, rest = np.split(residual.value(state, mu), [n])
        assert np.linalg.norm(found[i, :n] - force) < 1e-6 * np.linalg.norm(force)
        assert np.allclose(found[i, n:] / float(model.mesh.rest_area[-1]), rest, rtol=1e-6, atol=1e-3)


@pytest.mark.parametrize("direction", ["none", "-z"])
def test_a_steady_state_is_a_periodic_motion(direction):
    """With the weight of wall and fluid among the forces too."""
    model = make_valve({"gravity.direction": direction, "fluid.density": 900.0})
    q, mu = steady_positions(model, 2e4), dict(MU) | {"inlet": 2e4, "density": 900.0}
    inner = model.flow.steady_inner(model.rows.areas(model.nodal(q)), mu)
    c = np.zeros((5, model.size + len(inner)))
    c[0] = np.concatenate([q, inner])
    rest = PeriodicValve(lambda _: model, mu).residual(PeriodicMotion(Harmonics(2), c, 200.0), mu)
    assert np.abs(rest).max() < 1e-6 * model.force_scale(q, 2e4)


@pytest.mark.parametrize(("left_out", "error"), [(0.0, 1e-9), (blocks.LEFT_OUT, 10 * blocks.LEFT_OUT)])
def test_projections_are_those_of_the_operator(monkeypatch, left_out, error):
    """With exponents too; but for the combinations of matrices that are left out."""
    monkeypatch.setattr(blocks, "LEFT_OUT", left_out)
    monkeypatch.setattr(blocks, "SINGLE", float if left_out == 0.0 else blocks.SINGLE)
    model, mu, system = valve_of("storage")
    motion = motion_of(model, mu)
    # samples that hold all harmonics of products
    motion = PeriodicMotion(Harmonics(2, 41), motion.coefficients, motion.omega)
    operator = system.linearise(motion, mu)
    basis = np.random.default_rng(2).standard_normal((system.size, 3))
    x = np.random.default_rng(3).standard_normal((motion.harmonics.size, 3)) + 0j
    for shift in (0.0, 20.0 + 50.0j):
        whole = operator.apply(x @ basis.T, shift) @ basis
        part = operator.reduced(basis, operator.reduced(basis[:, :2])).matrix(shift)  # the first two known
        assert np.allclose(part, operator.reduced(basis).matrix(shift), rtol=1e-9, atol=1e-9 * np.abs(part).max())
        small = (operator.reduced(basis).matrix(shift) @ x.ravel()).reshape(x.shape)
        assert np.allclose(whole, small, rtol=error, atol=error * np.abs(whole).max())


def test_what_branches_hold_is_what_steps_find():
    """Branches that begin as the filter has them, taken in steps through half a period, meet it there again."""
    model, mu, system = valve_of("loss factors")
    coarse = motion_of(model, mu, size=2e-3)
    motion = PeriodicMotion(Harmonics(2, 17), coarse.coefficients, coarse.omega)
    memory = system._memory(mu)
    wall, samples = memory.wall, motion.samples[:, : model.size]
    slow = np.stack([wall.resultants(q)[1] for q in samples])
    branches = []
    for strength, group, time in zip(wall._strength, wall._group, wall.times[wall._time]):
        share = lambda s, g=strength, t=time: g * s * t / (1 + s * t)  # noqa: E731
        branches.append(motion.rates.apply(share, slow[:, :, :, group])[0])
    later = motion.harmonics.project(motion.at(motion.harmonics.phases + np.pi))
    half = PeriodicMotion(motion.harmonics, later, motion.omega)
    exact = memory.held(half.samples[:, : model.size], half.rates)[0]
    found = []
    for count in (17, 34):
        h = motion.period / (2 * count)
        state = wall.at(samples[0], np.ascontiguousarray(np.stack(branches, axis=2)))
        for k in range(1, count + 1):
            q = motion.at([motion.omega * k * h])[0, : model.size]
            state = wall.advance(state, q, h, 1.0)
        found.append(wall.held(state).held - exact)
    first, second = (np.abs(miss).max() for miss in found)
    assert 3.3 < first / second < 4.7  # of second order, as steps are
    assert np.abs(4 * found[1] - found[0]).max() / 3 < 1e-4 * np.abs(exact).max()


def test_a_column_that_hangs_sets_the_scale_of_velocities_where_nothing_else_drives():
    model = make_valve({"gravity.direction": "-z", "drive.pressure": 0.0, "fluid.density": 20.0})
    head = -model.case.rest_pressure
    scales = PeriodicValve(lambda _: model, {"inlet": 0.0, "density": 20.0}).scales
    assert np.all(scales > 0) and scales[-1] == pytest.approx(10.0 * np.sqrt(2.0 * head / 20.0), rel=0.01)


def test_cases_without_cycles_are_refused():
    model = make_valve({"drive.kind": "uniform"})
    with pytest.raises(SolveError, match="Without flow"):
        PeriodicValve(lambda _: model, dict(MU))
    model = make_valve({"outside.fluid": "same"})
    with pytest.raises(SolveError, match="fluid outside"):
        PeriodicValve(lambda _: model, dict(MU))
