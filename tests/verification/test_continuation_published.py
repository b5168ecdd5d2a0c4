"""Six problems of the literature: folds, branch points, Hopf points, orbits by closed forms and published digits.

Each test states the source of its digits; where a digit has none, a closed form or another route stands for it.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from continuation import (
    ContinuationOptions,
    OrbitOptions,
    Reason,
    continue_branch,
    continue_hopf,
    continue_orbits,
    find_orbit,
    orbit_at,
    switch_branch,
)
from tests.systems import following
from tests.systems.literature import fitzhugh_nagumo, gelfand, hodgkin_huxley, lorenz_84, predator_prey, roessler


def follow(*given):
    """Branch to its limit, all of whose special points are located."""
    branch = following.follow(*given)
    assert branch.reason.kind is Reason.LIMIT and all(s.located for s in branch.special), branch
    return branch


def kinds(branch):
    return [special.kind for special in branch.special]


def test_predator_and_prey():
    """From the empty state over prey alone to both: two branch points, a fold, a Hopf point (AUTO-07p, pp2)."""
    system, decay = predator_prey(), np.exp(-5 / 3)
    empty = follow(system, [0.0, 0.0], {"p": 0.2}, "p", (0.1, 1.0))
    (first,) = empty.special
    assert first.kind == "branch point" and np.isclose(first.mu["p"], 3 / 5, rtol=1e-10)
    options = ContinuationOptions(eigenvalues=2, limits={"p": (0.1, 1.0)})
    sides = [switch_branch(system, first, "p", options, side) for side in (1, -1)]
    prey = next(side for side in sides if side.states[-1, 0] > 0)
    assert kinds(prey) == ["branch point", "fold"]
    second, fold = prey.special
    assert np.isclose(second.u[0], 1 / 3, rtol=1e-8) and np.isclose(second.mu["p"], 2 / 3 / (1 - decay), rtol=1e-10)
    top = brentq(lambda u: (1 - 2 * u) * -np.expm1(-5 * u) - 5 * u * (1 - u) * np.exp(-5 * u), 0.2, 0.49, xtol=1e-14)
    assert np.isclose(fold.mu["p"], 3 * top * (1 - top) / -np.expm1(-5 * top), rtol=1e-10)
    sides = [switch_branch(system, second, "p", options, side) for side in (1, -1)]
    both = next(side for side in sides if side.states[-1, 1] > 0)
    (hopf,) = both.of_kind("hopf")
    # With u = 1/3 the trace is p (3 - 8 exp(-5/3)) - 1 and the determinant v.
    assert np.isclose(hopf.mu["p"], 1 / (3 - 8 * decay), rtol=1e-10)
    assert np.isclose(hopf.values["omega"] ** 2, hopf.u[1], rtol=1e-10)


@pytest.mark.slow
def test_explosion_in_a_cylinder_and_in_a_sphere():
    """Critical values "2 or ca. 3.32" of Frank-Kamenetskii (1938).

    So quoted by: Thermal explosions and the disappearance of criticality at small activation energies.
    In the cylinder u = 2 log((1 + a) / (1 + a r^2)), lambda = 8 a / (1 + a)^2: the fold is at 2, u(0) = 2 log 2.  In
    the sphere folds fulfil 2 + x w' = 0 on Emden's function w'' + 2 w' / x + exp(w) = 0, lambda = x^2 exp(w).
    """
    limits = {"lambda": (-0.1, 4.0)}
    options = ContinuationOptions(limits=limits, max_points=30, stop_at=frozenset({"fold"}))
    cylinder = continue_branch(gelfand(2, 20), np.zeros(20), {"lambda": 0.0}, "lambda", options)
    (fold,) = cylinder.special
    assert np.isclose(fold.mu["lambda"], 2.0, rtol=1e-9) and np.isclose(fold.u[-1], 2 * np.log(2), rtol=1e-8)
    options = ContinuationOptions(limits=limits, max_points=60)
    sphere = continue_branch(gelfand(3, 80), np.zeros(80), {"lambda": 0.0}, "lambda", options)

    def turn(x, w):
        return 2 + x * w[1]

    emden = solve_ivp(
        lambda x, w: [w[1], -2 * w[1] / x - np.exp(w[0])],
        (1e-4, 40.0),
        [-1e-8 / 6, -1e-4 / 3],
        "DOP853",
        events=turn,
        rtol=1e-12,
        atol=1e-13,
    )
    turns = [x**2 * np.exp(w[0]) for x, w in zip(emden.t_events[0], emden.y_events[0])]
    assert abs(turns[0] - 3.32) < 5e-3
    assert kinds(sphere)[:2] == ["fold", "fold"]
    assert np.allclose([s.mu["lambda"] for s in sphere.special[:2]], turns[:2], rtol=1e-7)


@pytest.mark.parametrize("rate", [0.08, 0.01])
def test_fitzhugh_nagumo(rate):
    """Hopf points v = -+ sqrt(1 - 0.8 rate), omega^2 = rate - 0.64 rate^2; I = 0.3313 and 1.4187 for 0.08."""
    branch = follow(fitzhugh_nagumo(rate), [-1.2, -0.62], {"I": 0.0}, "I", (0.0, 2.0))
    v = np.array([-1, 1]) * np.sqrt(1 - 0.8 * rate)
    assert kinds(branch) == ["hopf", "hopf"]
    assert np.allclose([s.mu["I"] for s in branch.special], (v + 0.7) / 0.8 - v + v**3 / 3, rtol=1e-10)
    assert np.allclose([s.values["omega"] ** 2 for s in branch.special], rate - 0.64 * rate**2, rtol=1e-9)


def test_hodgkin_huxley():
    """Currents 9.775437995393 and 154.522433665808 of both Hopf points, sub- and supercritical, proved in balls.

    C. Hendrick, Hopf bifurcations and bistability in the Hodgkin-Huxley equations at the 1952 parameters (preprint,
    github.com/ChaseHendrick/hh-dynamics): enclosures 1e-12 wide at the leak potential 10.613 mV.
    """
    branch = follow(hodgkin_huxley(), [0.0, 0.053, 0.596, 0.318], {"I": 0.0}, "I", (-1.0, 200.0))
    assert kinds(branch) == ["hopf", "hopf"]
    assert np.allclose([s.mu["I"] for s in branch.special], [9.775437995393, 154.522433665808], rtol=1e-10)
    assert [s.values["criticality"] for s in branch.special] == ["sub", "super"]


def test_fold_hopf_point_of_the_atmosphere():
    """Zero-Hopf point of Shil'nikov, Nicolis & Nicolis (Int. J. Bifurcation Chaos 5 (1995) 1701) in closed form.

    The trace vanishes at x = 9/8; with s = (1 - x)^2 + 16 x^2 equilibria have (F - x) s = 4 G^2, folds F = x + s / s'.
    """
    system = lorenz_84()
    x = -0.5
    s = (1 - x) ** 2 + 16 * x**2
    start = [x, (1 - x) / (2 * s), 2 * x / s]
    branch = follow(system, start, {"F": x + 1 / s, "G": 0.5}, "F", (-1.0, 3.0))
    curve = continue_hopf(
        system, branch.of_kind("hopf")[0], ("F", "G"), ContinuationOptions(limits={"F": (0, 3), "G": (0.4, 3)})
    )
    (point,) = curve.of_kind("zero-hopf")
    x = 9 / 8
    s, slope = (1 - x) ** 2 + 16 * x**2, 2 * (x - 1) + 32 * x
    assert np.isclose(point.mu["F"], x + s / slope, rtol=1e-9)
    assert np.isclose(point.mu["G"] ** 2, s**2 / (4 * slope), rtol=1e-9)
    assert np.isclose(point.u[0], x, rtol=1e-9)


@pytest.mark.slow
def test_roessler_through_its_first_doubling():
    """Cycle of the attractor at a = b = 1/5, c = 5.7: T = 5.88108845586, multiplier -2.403953527.

    Digits of ChaosBook.org (Roessler's model: first four prime periodic orbits and their stabilities), whose multiplier
    of the shift in time, 1.000000003, tells how many count.
    """
    system, mu = roessler(), {"a": 0.2, "b": 0.2, "c": 2.5}

    def section(t, u):
        return u[0]

    section.direction = 1

    def rates(t, u):
        return [-u[1] - u[2], u[0] + 0.2 * u[1], 0.2 + u[2] * (u[0] - 2.5)]

    settled = solve_ivp(rates, (0, 400), [2, 2, 0], events=section, rtol=1e-8)
    start, period = settled.y_events[0][-1], np.diff(settled.t_events[0])[-1]
    times = np.linspace(0, period, 64, endpoint=False)
    turn = solve_ivp(rates, (0, period), start, t_eval=times, rtol=1e-8)
    shape = OrbitOptions(max_harmonics=60)
    orbit = find_orbit(system, turn.y.T, period, mu, shape)
    assert orbit.stable
    branch = continue_orbits(system, orbit, "c", ContinuationOptions(limits={"c": (2.0, 5.7)}), shape)
    assert branch.reason.kind is Reason.LIMIT and kinds(branch) == ["period doubling"] and branch.special[0].located
    last = orbit_at(system, branch, -1, shape)
    assert abs(last.period - 5.88108845586) < 1e-9
    assert abs(last.nontrivial[0] + 2.403953527) < 1e-8
