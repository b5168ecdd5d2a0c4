"""Order of accuracy of the coupled steps, energy of a free swing, and oscillators with one unknown through the same
stepper.
"""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import dbvfiv
from dbvfiv.motion.equations import ValveMotion
from dbvfiv.motion.scheme import scheme
from dbvfiv.motion.start import steady_positions
from dbvfiv.motion.stepper import StepOptions, Stepper, consistent_state
from dbvfiv.studies.case import thesis_case
from tests.small_valves import FORMER
from tests.verification.moving import PointMotion

TIGHT = StepOptions(tolerance=1e-9, floor=1e-13)
COARSE = {"mesh.around": 6, "mesh.along": 8, **FORMER}  # on which the shortest steps resolve all that moves


def run(motion, state, step: float, count: int, pressure=lambda t: 0.0, nd: float = 0.0, options=TIGHT):
    """States after each of `count` steps, the first included."""
    stepper = Stepper(motion, scheme("generalised-alpha", nd), pressure, options)
    states = [state]
    for _ in range(count):
        states.append(stepper.step(states[-1], step).state)
    return states


# -- order


@pytest.mark.parametrize(
    ("law", "nd", "finest"),
    [("quasi-steady", 0.0, 80), ("storage", 0.5, 80)]
    + [pytest.param(law, nd, 160, marks=pytest.mark.slow) for law, nd in (("quasi-steady", 0.5), ("storage", 0.0))],
)
def test_order_of_the_coupled_scheme(law, nd, finest):
    """The open valve in water while the inlet pressure changes smoothly, compared at one instant."""
    model = dbvfiv.load(thesis_case(), COARSE | {"fluid.continuity": law, "damping.alpha": 0.0}).model
    motion = ValveMotion(model)
    q = steady_positions(model, 12e3)
    density = motion.mu.density
    speed = model.flow.inlet_velocity(model.rows.areas(model.nodal(q)), 12e3, density)
    start = consistent_state(motion, 0.0, q, 0 * q, 12e3, np.array([speed]))

    def pressure(t):
        return 12e3 + 4e3 * np.sin(0.5 * np.pi * min(t / 0.02, 1.0)) ** 4

    lip = model.shell.dofs.index[model.mesh.rows[0, 0], 1]
    ends = []
    for count in (finest // 4, finest // 2, finest):
        end = run(motion, start, 0.02 / count, count, pressure, nd)[-1]
        ends.append([end.q[lip], end.v[lip], end.fluid.velocity, np.linalg.norm(end.q)])
    ends = np.array(ends)
    differences = np.abs(np.diff(ends, axis=0))
    orders = np.log2(differences[:-1] / differences[1:])
    print(
        f"\n{law}, numerical damping {nd}: orders of lip position, lip velocity, inlet velocity, "
        f"|q|:\n{orders.round(2)}"
    )
    assert orders[-1].min() > 1.85
    assert orders[-1].mean() == pytest.approx(2.0, abs=0.1)


# -- energy


def free_swing(count: int, changes=MappingProxyType({})) -> tuple[np.ndarray, np.ndarray]:
    """Energy after each of `count` steps over that at the start, less one, and the kinetic share of it.

    The valve is let go from its shape at 2 kPa: no load, no stops, no damping of any kind.
    """
    start = steady_positions(dbvfiv.load(thesis_case(), COARSE).model, 2e3)
    free = {
        "drive.kind": "uniform",
        "drive.pressure": 0.0,
        "supports.lip_stop": False,
        "damping.alpha": 0.0,
        "damping.beta": 0.0,
    }
    motion = ValveMotion(dbvfiv.load(thesis_case(), COARSE | free | dict(changes)).model)
    state = consistent_state(motion, 0.0, start, 0 * start, 0.0)
    stepper = Stepper(motion, scheme("generalised-alpha"), lambda t: 0.0, StepOptions(tolerance=1e-8))
    energy = sum(motion.energies(state.q, state.v))
    off, moving = np.empty(count), np.empty(count)
    for k in range(count):
        state = stepper.step(state, 2e-4).state
        energies = motion.energies(state.q, state.v)
        off[k], moving[k] = sum(energies) / energy - 1.0, energies[0] / energy
    return off, moving


@pytest.mark.slow
def test_a_free_swing_keeps_its_energy_over_10_000_steps():
    off, _ = free_swing(10_000)
    quarters = np.array_split(off, 4)
    print(
        f"\nrelative energy off by {off.min():.2e} to {off.max():.2e}; means of the quarters "
        f"{[f'{t.mean():.1e}' for t in quarters]}"
    )
    assert np.abs(off).max() < 1.15e-4  # docs/evidence/time.md
    assert abs(quarters[-1].mean() - quarters[0].mean()) < 5e-5


@pytest.mark.slow
def test_a_free_swing_with_the_averaged_mass_keeps_its_energy():
    """A swing and more, in which most of the energy turns into motion and back."""
    off, moving = free_swing(400, {"shell.mass": "averaged"})
    print(f"\nrelative energy off by {off.min():.2e} to {off.max():.2e}; kinetic share up to {moving.max():.3f}")
    assert moving.max() > 0.8 and moving[np.argmax(moving) :].min() < 0.2
    assert np.abs(off).max() < 2e-4


# -- one unknown


def oscillator_start(motion, q: float, v: float):
    return consistent_state(motion, 0.0, np.array([q]), np.array([v]), 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(
    "mu, period, amplitude", [(0.5, 6.380676, 2.002488), pytest.param(1.0, 6.663287, 2.008620, marks=pytest.mark.slow)]
)
def test_van_der_pol(mu, period, amplitude):
    """x'' - mu (1 - x^2) x' + x = 0: period and amplitude of its cycle (reference numbers), by two steps; from so near
    it that three turns settle what is left.
    """
    motion = PointMotion(lambda q: q, np.ones_like, lambda q: -mu * (1 - q**2), lambda q: 2 * mu * q)
    found = []
    for step in (0.01, 0.005):
        states = run(motion, oscillator_start(motion, 2.0, 0.0), step, int(27 / step))
        curve = CubicSpline([s.time for s in states], [s.q[0] for s in states])
        tops = [t for t in curve.derivative().roots(extrapolate=False) if t > 18 and curve(t) > 0]
        found.append((np.diff(tops)[-1], float(curve(tops[-1]))))
    limit = np.array(found[1]) + (np.array(found[1]) - found[0]) / 3
    print(f"\nmu {mu}: {found} limit {limit}")
    assert limit == pytest.approx([period, amplitude], rel=1e-6)


@pytest.mark.parametrize("beta", [0.0, 0.05])
def test_linear_oscillator(beta):
    """q'' + q + beta q' = 0 against its exact solution; the damping goes the way of stiffness damping."""
    motion = PointMotion(lambda q: q, np.ones_like, beta=beta)
    decay, omega = 0.5 * beta, np.sqrt(1 - 0.25 * beta**2)
    errors = []
    for count in (50, 100, 200):
        end = run(motion, oscillator_start(motion, 1.0, 0.0), 10 / count, count)[-1]
        exact = np.exp(-decay * 10) * (np.cos(omega * 10) + decay / omega * np.sin(omega * 10))
        errors.append(abs(end.q[0] - exact))
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    print(f"\nbeta {beta}: errors {errors} orders {orders}")
    assert orders == pytest.approx(2.0, abs=0.1)
