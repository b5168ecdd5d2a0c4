"""A wall that relaxes, in time: closed forms with one unknown, memory that only accepted steps change, energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

from dbvfiv.materials.laws import IsotropicElastic
from dbvfiv.materials.prony import Prony
from dbvfiv.motion.scheme import scheme
from dbvfiv.motion.stepper import StepOptions, Stepper, consistent_state
from dbvfiv.shell import Layer, Section, Shell, ShellMesh
from tests.shell.structures import observed_order, random_state, rectangle
from tests.verification.moving import ShellMotion

ONE = Prony((0.4,), (1.5e-3,))
THREE = Prony((0.2, 0.3, 0.15), (2e-4, 2e-3, 2e-2))
OPTIONS = StepOptions(tolerance=1e-6, floor=1e-9)


class Bar(ShellMotion):
    """One element pulled along itself and held at one end: one unknown. The inlet pressure is the force on it, N."""

    def __init__(self, series: Prony | None, **rayleigh):
        patch = rectangle(1, 1, 0.1, 0.1)
        mesh = ShellMesh.build(patch.nodes, patch.quads, 0.01, material_axis=(1.0, 0.0, 0.0))
        free = np.zeros((4, 5), bool)
        free[patch.index[1], 0] = True
        section = Section((Layer(IsotropicElastic(4e6, 0.0, 1200.0), 0.01, relaxation=series),))
        super().__init__(Shell(mesh, section, free), **rayleigh)
        rest = np.zeros(2)
        self.stiffness = float(self.shell.force_and_tangent(rest)[1].sum())
        self.mass = float(self.shell.mass(rest).sum())

    def pressure_force(self, q, pressure):
        return np.full(2, 0.5 * pressure)


def first_order(bar: Bar, series: Prony, beta: float = 0.0) -> np.ndarray:
    """Matrix of (x, v, h_1 .. h_J)' for small motions."""
    count = len(series.times)
    matrix = np.zeros((2 + count, 2 + count))
    matrix[0, 1] = 1.0
    matrix[1, 0], matrix[1, 1], matrix[1, 2:] = (
        -bar.stiffness / bar.mass,
        -beta * bar.stiffness / bar.mass,
        -1 / bar.mass,
    )
    for j, (g, tau) in enumerate(zip(series.strengths, series.times)):
        matrix[2 + j, 1], matrix[2 + j, 2 + j] = g * bar.stiffness, -1 / tau
    return matrix


def steps_of(motion, state, pressure, count: int, h: float, rule=scheme("generalised-alpha")):
    stepper = Stepper(motion, rule, pressure, OPTIONS)
    results = []
    for _ in range(count):
        results.append(stepper.step(state, h))
        state = results[-1].state
    return results


@pytest.mark.parametrize("rule", [("generalised-alpha", 0.0), ("generalised-alpha", 0.2), ("hht", 0.1)], ids=str)
def test_free_decay(rule):
    beta, size, end = 5e-4, 1e-7, 8e-3
    bar = Bar(THREE, beta=beta)
    exact = expm(end * first_order(bar, THREE, beta)) @ np.array([1.0, 0.0, 0.0, 0.0, 0.0])
    errors = []
    for count in (40, 80, 160):
        first = consistent_state(bar, 0.0, np.full(2, size), np.zeros(2), 0.0)
        last = steps_of(bar, first, lambda t: 0.0, count, end / count, scheme(*rule))[-1].state
        speed = np.sqrt(bar.stiffness / bar.mass)
        errors.append(np.hypot(last.q[0] / size - exact[0], (last.v[0] / size - exact[1]) / speed))
    assert errors[-1] < 2e-3
    assert min(observed_order(errors)) > 1.9


@pytest.mark.parametrize("series", [ONE, THREE], ids=["one branch", "three branches"])
def test_forced_response(series):
    bar, end, omega, push = Bar(series), 12e-3, 900.0, 4e-3
    matrix = first_order(bar, series)
    count = len(matrix)
    driven = np.zeros((count + 2, count + 2))
    driven[:count, :count] = matrix
    driven[1, count] = push / bar.mass
    driven[count, count + 1], driven[count + 1, count] = omega, -omega  # sine and cosine
    exact, speed = expm(end * driven) @ np.eye(count + 2)[:, -1], np.sqrt(bar.stiffness / bar.mass)
    size = np.hypot(exact[0], exact[1] / speed)
    errors = []
    for n in (80, 160, 320):
        first = consistent_state(bar, 0.0, np.zeros(2), np.zeros(2), 0.0)
        last = steps_of(bar, first, lambda t: push * np.sin(omega * t), n, end / n)[-1].state
        errors.append(np.hypot(last.q[0] - exact[0], (last.v[0] - exact[1]) / speed) / size)
    assert errors[-1] < 2e-3
    assert min(observed_order(errors)) > 1.9


@pytest.mark.parametrize("series", [ONE, THREE], ids=["one branch", "three branches"])
def test_a_motion_on_a_mode_stays_on_it(series):
    bar, size, steps = Bar(series), 1e-7, 400
    values = np.linalg.eigvals(first_order(bar, series))
    mode = values[np.argmax(values.imag)]
    q, h, shape = np.zeros(2), 2 * np.pi / abs(mode.imag) / 200, np.full(2, size, complex)
    memory = bar.wall.on_mode(q, shape, mode, q + shape.real)
    state = consistent_state(bar, 0.0, q + shape.real, (mode * shape).real, 0.0, None, memory)
    exact = np.exp(mode * h * np.arange(1, steps + 1)).real
    found = np.array([r.state.q[0] for r in steps_of(bar, state, lambda t: 0.0, steps, h)]) / size
    assert np.abs(found - exact).max() < 2e-3
    assert state.a[0] == pytest.approx((mode**2 * shape[0]).real, rel=1e-5)


def test_long_after_a_step_the_slow_law_holds():
    bar, push = Bar(THREE), 4e-3
    first = consistent_state(bar, 0.0, np.zeros(2), np.zeros(2), push)
    last = steps_of(bar, first, lambda t: push, 500, 1e-3)[-1].state
    assert last.q[0] == pytest.approx(push / bar.stiffness, rel=1e-4)
    memory = last.memory
    assert np.abs(memory.branches).max() < 1e-6 * np.abs(memory.slow).max()


def test_trials_and_rejected_steps_leave_the_memory_alone():
    bar = Bar(THREE)
    first = consistent_state(bar, 0.0, np.full(2, 1e-7), np.zeros(2), 0.0)
    state = steps_of(bar, first, lambda t: 0.0, 5, 1e-4)[-1].state
    kept = {name: np.array(getattr(state.memory, name)) for name in ("branches", "stretch", "work", "loss", "strain")}
    stepper = Stepper(bar, scheme("generalised-alpha"), lambda t: 0.0, OPTIONS)
    stepper.step(state, 4e-4)
    stepper.forget()
    again = stepper.step(state, 1e-4).state
    for name, value in kept.items():
        assert np.array_equal(value, getattr(state.memory, name))
    fresh = Stepper(bar, scheme("generalised-alpha"), lambda t: 0.0, OPTIONS).step(state, 1e-4).state
    assert np.array_equal(fresh.memory.branches, again.memory.branches)


def test_linear_branches_store_and_lose_what_springs_and_dashpots_do():
    bar, end = Bar(THREE), 5e-3
    matrix = first_order(bar, THREE)
    first = consistent_state(bar, 0.0, np.full(2, 1e-7), np.zeros(2), 0.0)
    count = 500
    last = steps_of(bar, first, lambda t: 0.0, count, end / count)[-1].state
    propagate = expm(end / count * matrix)
    u, lost = np.concatenate([[1e-7], np.zeros(4)]), 0.0
    g, tau = np.array(THREE.strengths), np.array(THREE.times)
    for _ in range(count):
        new = propagate @ u
        lost += 0.5 * end / count * sum(((h**2) / (g * bar.stiffness * tau)).sum() for h in (u[2:], new[2:]))
        u = new
    assert last.memory.stored.sum() == pytest.approx((0.5 * u[2:] ** 2 / (g * bar.stiffness)).sum(), rel=1e-3)
    assert last.memory.loss.sum() == pytest.approx(lost, rel=1e-3)
    assert last.memory.work.sum() == pytest.approx(last.memory.stored.sum() + last.memory.loss.sum(), rel=1e-12)


def test_the_force_of_a_step_is_that_of_the_memory_it_leaves(mixed_walls):
    shell, old, new = mixed_walls
    wall = ShellMotion(shell).wall
    memory = wall.advance(wall.at(old), 0.5 * (old + new), 1e-3, 0.6)
    after = wall.advance(memory, new, 1e-3, 0.6)
    expected = shell.force(new, wall.held(after))
    assert np.abs(shell.force(new, wall.step(memory, 1e-3)) - expected).max() < 1e-11 * np.abs(expected).max()


def test_work_against_branches_is_that_of_their_forces(mixed_walls):
    """Over a way of many steps on a mesh of curved elements that move a lot; the rest falls as the square of a step."""
    shell, old, new = mixed_walls
    wall, off = ShellMotion(shell).wall, []
    for count in (10, 20, 40):
        memory, total, q, h = wall.at(old), 0.0, old, 4e-3 / count
        for _ in range(count):
            way = (new - old) / count
            after = wall.advance(memory, q + way, h, 0.5)
            for here, held in ((q, memory), (q + way, after)):
                total += 0.5 * ((shell.force(here, wall.held(held)) - shell.force(here)) @ way)
            memory, q = after, q + way
        off.append(abs(memory.work.sum() / total - 1))
    assert off[-1] < 1e-3 and min(observed_order(off)) > 1.9


@pytest.mark.slow
def test_the_tangent_of_a_step_is_the_slope_of_its_force(mixed_walls):
    shell, old, new = mixed_walls
    wall = ShellMotion(shell).wall
    step = wall.step(wall.advance(wall.at(old), 0.5 * (old + new), 1e-3, 0.5), 1e-3)
    way = (new - old) * 1e-3
    slope = (shell.force(new - 2 * way, step) - shell.force(new + 2 * way, step)) / 12
    slope += 8 * (shell.force(new + way, step) - shell.force(new - way, step)) / 12
    found = shell.dofs.matrix(shell.force_and_tangent(new, step=step)[1]) @ way
    assert np.linalg.norm(found - slope) < 1e-7 * np.linalg.norm(slope)


@pytest.fixture
def mixed_walls():
    """A doubly curved shell of which four layers relax, and two states of it."""
    from tests.shell.conftest import MESHES
    from tests.shell.test_relaxing_layers import relaxing_section

    shell = Shell(MESHES["saddle"](), relaxing_section(ONE, THREE, THREE, THREE, None))
    states = [shell.dofs.restrict(random_state(shell.mesh, 3, size, 4 * size, 0.0)) for size in (0.02, 0.06)]
    return shell, *states


def test_an_elastic_wall_has_no_memory():
    bar = Bar(replace(ONE, strengths=(0.0,)))
    assert bar.wall is None
    assert consistent_state(bar, 0.0, np.zeros(2), np.zeros(2), 0.0).memory is None
