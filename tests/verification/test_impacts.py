"""Contact in time against closed forms: a mass on a spring, an elastic bar on a wall, a beam that hits a stop, and that
no energy comes of a hundred thousand impacts.
"""

from __future__ import annotations

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from dbvfiv.contact import ContactLaw, Rebound, mean_pressure
from dbvfiv.motion.scheme import scheme
from dbvfiv.motion.stepper import StepOptions, Stepper, consistent_state
from tests.systems.beam import beam
from tests.systems.bouncing import BouncingMotion, Planes, bar

TIGHT = StepOptions(tolerance=1e-9, floor=1e-13, largest_turn=np.inf)


def follow(motion, q, v, h, steps, nd=0.0):
    """States and results of a number of steps."""
    stepper = Stepper(motion, scheme("generalised-alpha", nd), lambda t: 0.0, TIGHT)
    state, found = consistent_state(motion, 0.0, q, v, 0.0), []
    for _ in range(steps):
        found.append(stepper.step(state, h))
        state = found[-1].state
    return found


def _mass(rebound=Rebound(), penalty=1.0) -> BouncingMotion:
    """One of 1 kg that hits a plane at zero."""
    return BouncingMotion(np.eye(1), np.zeros((1, 1)), Planes(np.array([0]), np.zeros(1), ContactLaw(penalty), rebound))


@pytest.mark.parametrize("nd", [0.0, 0.2, 0.5])
@pytest.mark.parametrize("h", [0.02, 0.7, 30.0])
def test_a_mass_comes_back_as_fast_as_it_came(nd, h):
    """With any step, resolved or not, and any numerical damping; contact lasts pi sqrt(m/k) = 3.14 s."""
    for phase in (0.1, 0.45, 0.8):
        found = follow(_mass(), np.array([phase * h]), np.array([-1.0]), h, int(4.0 / h) + 4, nd)
        assert found[-1].state.v[0] == pytest.approx(1.0, abs=1e-8)
        assert found[-1].state.a[0] == pytest.approx(0.0, abs=1e-8)
        assert abs(sum(r.contact_loss for r in found)) < 1e-9


@pytest.mark.parametrize("nd", [0.0, 0.2])
def test_a_mass_on_its_spring_follows_the_sine(nd):
    """x = -(v/omega) sin(omega t) while it touches: of second order with any numerical damping."""
    errors = []
    for steps in (40, 80, 160):
        h = 3.0 / steps
        found = follow(_mass(), np.zeros(1), np.array([-1.0]), h, steps, nd)
        errors.append(max(abs(r.state.q[0] + np.sin(r.state.time)) for r in found))
    assert errors[-1] < 2e-4 and errors[1] / errors[2] > 3.5


@pytest.mark.parametrize("share", [1.0, 0.5, 0.1])
def test_a_resolved_impact_loses_what_the_rebound_says(share):
    steps = int(np.pi * (1 + 1 / np.sqrt(share)) / 0.04) + 10  # faces that lose energy part more slowly
    found = follow(_mass(Rebound(share, 1e-4)), np.array([1e-3]), np.array([-1.0]), 0.02, steps)
    v = found[-1].state.v[0]
    assert v == pytest.approx(np.sqrt(share), rel=2e-3)
    assert sum(r.contact_loss for r in found) == pytest.approx(0.5 - 0.5 * v * v, abs=1e-9)
    assert all(r.contact_loss > -1e-12 for r in found)


@pytest.mark.parametrize("nd", [0.0, 0.3])
def test_a_pressed_mass_stays_where_it_is(nd):
    """A contact in equilibrium is one in motion, whatever parting faces lose."""
    planes = Planes(np.array([0]), np.zeros(1), ContactLaw(1e6), Rebound(0.2))
    motion = BouncingMotion(np.eye(1), np.zeros((1, 1)), planes, load=[-3.0])
    found = follow(motion, np.array([-3e-6]), np.zeros(1), 0.01, 50, nd)
    assert max(abs(r.state.q[0] + 3e-6) for r in found) < 1e-12
    assert max(abs(r.state.v[0]) for r in found) < 1e-9
    assert found[-1].state.a[0] == pytest.approx(-3.0)  # without the contact's part


@pytest.mark.slow
def test_a_dropped_mass_comes_to_rest():
    """Rebounds of a mass under its weight die out, and what is left does not ring."""
    planes = Planes(np.array([0]), np.zeros(1), ContactLaw(1e5), Rebound(0.5))
    motion = BouncingMotion(np.eye(1), np.zeros((1, 1)), planes, load=[-10.0])
    found = follow(motion, np.array([0.05]), np.zeros(1), 2e-3, 600)
    assert abs(found[-1].state.v[0]) < 2e-3 and abs(found[-1].state.q[0]) < 1e-3
    energy = [motion.energy(r.state.q, r.state.v) for r in found]
    assert np.diff(energy).max() < 1e-7 * energy[0]


@pytest.mark.parametrize("nd", [0.0, 0.1])
def test_an_elastic_bar_leaves_the_wall_when_the_wave_is_back(nd):
    """It touches for 2 L/c with the pressure rho c v and leaves with the speed at which it came (Graff 1975, ch. 2)."""
    count = 100
    mass, stiffness = bar(count)
    planes = Planes(np.array([0]), np.zeros(1), ContactLaw(float(count)))
    motion = BouncingMotion(mass, stiffness, planes)
    q, v, h = np.full(count + 1, 0.1), -np.ones(count + 1), 1.0 / count
    found = follow(motion, q, v, h, 240, nd)
    time = np.array([r.state.time for r in found])
    pressure = np.array([planes.respond(r.state.q)[1][0] for r in found])
    touching = time[pressure > 0]
    middle = (time > 0.3) & (time < 1.9)
    energy = np.array([motion.energy(r.state.q, r.state.v) for r in found])
    speed = float(np.sum(mass @ found[-1].state.v))
    print(f"nd {nd}: contact {touching[-1] - touching[0]:.3f} for 2, pressure {pressure[middle].mean():.4f} for 1, ")
    print(f"    speed {speed:.4f} for 1, energy {energy[-1] / energy[0]:.6f}")
    assert touching[-1] - touching[0] == pytest.approx(2.0, abs=0.04)
    assert pressure[middle].mean() == pytest.approx(1.0, abs=2e-3)
    assert speed == pytest.approx(1.0, abs=0.015)
    assert energy.max() <= energy[0] * (1 + 1e-9)
    assert nd or energy[-1] == pytest.approx(energy[0], rel=1e-9)


class ModalBeam:
    """A clamped beam of unit length, mass and bending stiffness by its modes, with a one-sided spring at its tip."""

    def __init__(self, modes: int, penalty: float):
        roots = [
            brentq(lambda x: np.cos(x) + 1.0 / np.cosh(x), np.pi * (k + 0.1), np.pi * (k + 0.9)) for k in range(modes)
        ]
        self.omega = np.array(roots) ** 2
        # of unit norm, |phi(1)| = 2 for every mode of a cantilever (Blevins 1979)
        self.tip = 2.0 * (-1.0) ** np.arange(modes)
        self.penalty = penalty

    def rates(self, t, y):
        count = len(self.omega)
        q, v = y[:count], y[count:]
        pushed = self.penalty * max(0.0, -float(self.tip @ q))
        return np.concatenate([v, -(self.omega**2) * q + self.tip * pushed])

    def tips(self, deflection: float, times: np.ndarray) -> np.ndarray:
        """Tip deflections after the beam is let go in the shape of its first mode."""
        start = np.zeros(2 * len(self.omega))
        start[0] = deflection / self.tip[0]
        done = solve_ivp(self.rates, (0.0, times[-1]), start, "DOP853", t_eval=times, rtol=1e-10, atol=1e-12)
        return self.tip @ done.y[: len(self.omega)]


@pytest.mark.slow
def test_a_beam_that_hits_a_stop_follows_its_modes():
    """Two impacts of a cantilever on a spring thirty times as stiff as itself."""
    elements, penalty, end = 10, 100.0, 2.4
    parts = beam(elements)
    mass, stiffness = parts.mass.toarray(), parts.bending.toarray()
    tip = 2 * elements - 2
    planes = Planes(np.array([tip]), np.zeros(1), ContactLaw(penalty))
    motion = BouncingMotion(mass, stiffness, planes)
    values, shapes = np.linalg.eigh(
        np.linalg.solve(np.linalg.cholesky(mass), np.linalg.solve(np.linalg.cholesky(mass), stiffness).T)
    )
    shape = np.linalg.solve(np.linalg.cholesky(mass).T, shapes[:, 0])
    assert np.sqrt(values[0]) == pytest.approx(3.5160, rel=1e-4)
    finest = ModalBeam(8, penalty).tips(0.1, end / 1200 * np.arange(1, 1201))
    errors = []
    for steps in (300, 600, 1200):
        h = end / steps
        found = follow(motion, 0.1 * shape / shape[tip], np.zeros(motion.size), h, steps)
        exact = finest[1200 // steps - 1 :: 1200 // steps]
        errors.append(np.abs(np.array([r.state.q[tip] for r in found]) - exact).max() / 0.1)
    print("largest error of the tip over its amplitude", errors)
    assert np.count_nonzero(np.diff(np.sign(exact)) < 0) >= 2, "it hits the stop twice"
    assert errors[-1] < 5e-3 and errors[1] / errors[2] > 2.5


def _oscillators(count, rebound):
    generator = np.random.default_rng(0)
    omega = generator.uniform(0.5, 2.0, count)
    planes = Planes(np.arange(count), generator.uniform(-0.5, 0.2, count), ContactLaw(1e4, 1e-3), rebound)
    return omega**2, planes


def test_many_small_systems_gain_no_energy():
    """Oscillators before and behind planes, contact not resolved by the step: by the stepper itself."""
    stiffness, planes = _oscillators(3, Rebound(1.0))
    motion = BouncingMotion(sp.identity(3), sp.diags(stiffness), planes)
    found = follow(motion, np.ones(3), np.zeros(3), 0.1, 80)
    energy = np.array([motion.energy(r.state.q, r.state.v) for r in found])
    assert np.abs(energy / motion.energy(np.ones(3), np.zeros(3)) - 1).max() < 1e-6
    direct = _steps(stiffness, planes, 0.1, 80, scheme("generalised-alpha", 0.0))[0]
    assert found[-1].state.q == pytest.approx(direct, abs=1e-4)


def _steps(stiffness, planes, h, steps, rule):
    """The same equations for oscillators that know nothing of each other, each solved by bisection: new positions,
    number of impacts, largest energy over that at the start.
    """
    count = len(stiffness)
    q, v = np.ones(count), np.zeros(count)
    a = -stiffness * q + np.zeros(count)
    weight, now = (1 - rule.alpha_m) / (2 * rule.beta), rule.now

    def energy():
        return 0.5 * v * v + 0.5 * stiffness * q * q + planes.energies(q)

    def push(x):
        old, new = q + planes.start, x + planes.start
        return planes.rebound.factor((new - old) / h)[0] * mean_pressure(planes.law, old, new)[0]

    first, largest, hits = energy(), 0.0, 0
    for _ in range(steps):
        known = q + h * v + h * h * (0.5 - rule.beta) * a

        def left(x):
            new = (x - known) / (rule.beta * h * h)
            mid = rule.alpha_m * a + (1 - rule.alpha_m) * new
            return mid + stiffness * (q + now * (x - q)) - weight * push(x)

        low, high = q - 5.0 * np.ones(count), q + 5.0 * np.ones(count)
        for _ in range(45):
            x = 0.5 * (low + high)
            above = left(x) > 0
            low, high = np.where(above, low, x), np.where(above, x, high)
        pushed = push(x)
        new = (x - known) / (rule.beta * h * h)
        speed = v + h * ((1 - rule.gamma) * a + rule.gamma * new) + h * (1 - 0.5 * rule.gamma / rule.beta) * pushed
        hits += np.count_nonzero((pushed > 0) & (v < 0) & (speed >= 0))
        q, v, a = x, speed, new - pushed / (2 * rule.beta)
        largest = max(largest, float((energy() / first).max()))
    return q, hits, largest


@pytest.mark.slow
@pytest.mark.parametrize("nd, share", [(0.0, 1.0), (0.1, 0.5)])
def test_a_hundred_thousand_impacts_bring_no_energy(nd, share):
    stiffness, planes = _oscillators(2000, Rebound(share))
    _, hits, largest = _steps(stiffness, planes, 0.4, 400, scheme("generalised-alpha", nd))
    print(f"nd {nd}, rebound {share}: {hits} impacts, largest energy over that at the start {largest:.9f}")
    assert hits > 1e5
    assert largest < 1 + (2e-9 if nd == 0 else 0.02)
