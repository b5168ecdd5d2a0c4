"""Periodic motions as Fourier series: published orbits, exact bifurcations, exponents, honest failures."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from continuation import ContinuationOptions, NotConverged, OrbitOptions, OutOfDomain
from continuation.cycle_branch import CycleTracer
from continuation.cycle_points import DOUBLING, FOLD, TORUS
from continuation.cycles import Cycle, CycleSolver
from continuation.harmonics import Harmonics, Rates
from continuation.hill import floquet_exponents
from continuation.orbit_branches import find_orbit
from continuation.periodic import PeriodicMotion
from tests.systems import periodic
from tests.systems.langford import langford
from tests.systems.van_der_pol import van_der_pol as first_order_van_der_pol

EXACT = 1e-10
PHASE = 2 * np.pi * np.arange(64) / 64
CIRCLE = np.stack([np.cos(PHASE), np.sin(PHASE)], axis=1)


def solved(system, guess, mu, tolerance=EXACT, **unknown):
    solver = CycleSolver(system, system.basis, tolerance)
    return solver, solver.solve(guess, mu, **unknown)


def begun(system, guess, mu, other, name, options, *shape, **wanted):
    """Tracer with its first two cycles, the second at another value of the parameter."""
    solver, first = solved(system, guess, mu)
    tracer = CycleTracer(solver, name, options, *shape, **wanted)
    tracer.extend(first)
    tracer.extend(solver.solve(first.motion, mu | {name: other}))
    return tracer


def circling(gain):
    """Rate of z' = (gain - |z|^2 + i) z."""

    def rate(u, mu):
        own = gain(mu["mu"]) - u[0] ** 2 - u[1] ** 2
        return jnp.stack([own * u[0] - u[1], u[0] + own * u[1]])

    return rate


def exponents_of(solver, cycle, count=4):
    return floquet_exponents(solver, solver.linearise(cycle.motion, cycle.mu), count)


# -- series


def test_series_are_exact():
    h = Harmonics(3, 11)
    c = np.random.default_rng(0).standard_normal((7, 2))
    assert np.allclose(h.project(h.evaluate(c)), c)
    assert np.allclose(h.real(h.complex(c)), c)
    waves = np.exp(1j * np.outer(h.phases, np.arange(-3, 4)))
    assert np.allclose(waves @ h.two_sided(c), h.evaluate(c))
    t = np.array([0.3, 1.7])
    step = 1e-5
    slope = (h.basis_at(t + step) - h.basis_at(t - step)) @ c / (2 * step)
    assert np.allclose(h.basis_at(t) @ h.rate(c), slope, atol=1e-8)
    assert np.allclose(Rates(h, 2.0).apply(1, h.evaluate(c)), 2.0 * h.evaluate(h.rate(c)))
    # a filter of the rate, and a shift of it: x = exp(s t) p has (d/dt) x = exp(s t) (d/dt + s) p
    shifted = Rates(h, 2.0, 0.5 + 1j)
    assert np.allclose(shifted.apply(1, h.evaluate(c)), h.evaluate(2.0 * h.rate(c) + (0.5 + 1j) * c))
    assert np.allclose(shifted.apply(lambda s: s**2, h.evaluate(c)), shifted.apply(2, h.evaluate(c)))


# -- orbits


@pytest.mark.parametrize(
    ("mu", "period", "amplitude", "multiplier"),
    [(0.5, 6.380676, 2.002488, 0.0391769), (1.0, 6.663287, 2.008620, 8.59695e-4)],
)
def test_van_der_pol(mu, period, amplitude, multiplier):
    """To the printed digits, as an equation of second order and as two of first order; by Liouville's formula the
    product of the multipliers is exp of the integrated divergence.
    """
    system = periodic.van_der_pol()
    guess = PeriodicMotion.of_samples(2 * np.cos(PHASE)[:, None], 30, 1.0)
    solver, cycle = solved(system, guess, {"mu": mu})
    x = cycle.motion.at(np.linspace(0, 2 * np.pi, 4000))[:, 0]
    assert abs(cycle.motion.period - period) < 5.1e-7 and abs(x.max() - amplitude) < 1.5e-6
    found = exponents_of(solver, cycle)
    digit = 10.0 ** (np.floor(np.log10(multiplier)) - 5)
    assert abs(found.multipliers[0] - multiplier) < 0.51 * digit and found.trivial < 1e-8 and found.stable
    orbit = find_orbit(first_order_van_der_pol(), 2 * CIRCLE * [1, -1], 6.4, {"mu": mu})
    assert np.isclose(cycle.motion.period, orbit.period, rtol=1e-9)
    assert abs(orbit.period - period) < 5.1e-7 and abs(orbit.amplitude()[0] - amplitude) < 5.1e-7
    assert abs(orbit.nontrivial[0] - multiplier) < 0.51 * digit
    t = np.linspace(0, orbit.period, 2001)[:-1]
    divergence = np.mean(mu * (1 - orbit(t)[:, 0] ** 2)) * orbit.period
    assert np.isclose(np.prod(orbit.multipliers).real, np.exp(divergence), rtol=1e-6)


def test_more_harmonics_leave_less():
    """The share of the last two harmonics bounds the error of amplitude and period."""
    system, errors, tails = periodic.van_der_pol(), [], []
    for count in (7, 11, 15):
        _, cycle = solved(system, PeriodicMotion.of_samples(2 * np.cos(PHASE)[:, None], count, 1.0), {"mu": 1.0})
        errors.append(abs(cycle.motion.period - 6.66328686) / 6.663)
        tails.append(cycle.motion.tail)
    assert np.all(np.array(errors) < tails) and errors[2] < 1e-2 * errors[0]


def test_forced_duffing_against_integration():
    """Forced and damped: the motion, and the multipliers of its variational equation."""
    mu = {"w": 1.1, "d": 0.15, "e": 1.0, "f": 0.5}
    system = periodic.duffing()
    solver, cycle = solved(system, PeriodicMotion.of_samples(-1.2 * np.sin(PHASE - 0.5)[:, None], 11, 1.0), mu)

    def rate(t, u):
        x, v, *m = u
        m = np.reshape(m, (2, 2))
        w = mu["w"]
        force = (mu["f"] * np.cos(t) - x - mu["e"] * x**3 - mu["d"] * w * v) / w**2
        slope = np.array([[0, 1], [-(1 + 3 * mu["e"] * x**2) / w**2, -mu["d"] / w]])
        return np.concatenate([[v, force], (slope @ m).ravel()])

    x0, v0, _ = (part[0, 0] for part in cycle.motion.with_rates([0.0]))
    run = solve_ivp(rate, (0, 2 * np.pi), [x0, v0, 1, 0, 0, 1], rtol=1e-11, atol=1e-13)
    assert np.allclose(run.y[:2, -1], [x0, v0], atol=1e-7)
    multipliers = np.linalg.eigvals(run.y[2:, -1].reshape(2, 2))
    found = exponents_of(solver, cycle).multipliers
    assert len(found) == 1  # a pair is given once
    assert np.isclose(abs(found[0]), np.abs(multipliers[0]), rtol=1e-6)
    assert np.isclose(np.abs(np.angle(found[0])), np.abs(np.angle(multipliers[0])), rtol=1e-5)


@pytest.mark.slow
def test_folds_of_the_forced_duffing():
    """Both turning points of the resonance of a hardening spring, against one harmonic's algebra, which is exact for
    small forcing.
    """
    mu = {"w": 0.8, "d": 0.02, "e": 0.02, "f": 0.05}
    system = periodic.duffing()
    guess = PeriodicMotion.of_samples(0.15 * np.cos(PHASE)[:, None], 5, 1.0)
    options = ContinuationOptions(
        max_step=0.4, parameter_scales={"w": 0.2}, limits={"w": (0.5, 1.3)}, max_points=150, location_tolerance=1e-2
    )
    tracer = begun(system, guess, mu, 0.82, "w", options, OrbitOptions(exponents=2, tail=1e-3))
    assert tracer.run() == "ended on the limit w = 1.3"
    folds = [s for s in tracer.special if s.kind == FOLD]
    assert len(folds) == 2 and all(s.located for s in folds)

    # one harmonic: (1 - w^2 + 3/4 e A^2)^2 A^2 + (d w A)^2 = f^2, whose discriminant in A^2 vanishes at folds
    w, k = np.linspace(0.9, 1.3, 40001), 0.75 * mu["e"]
    a, b, c, d = k**2, 2 * k * (1 - w**2), (1 - w**2) ** 2 + (mu["d"] * w) ** 2, -(mu["f"] ** 2)
    discriminant = 18 * a * b * c * d - 4 * b**3 * d + b**2 * c**2 - 4 * a * c**3 - 27 * a**2 * d**2
    expected = w[np.flatnonzero(np.diff(np.sign(discriminant)))]
    assert np.allclose(sorted(s.value for s in folds), expected, rtol=2e-4)
    inside = [p.exponents.unstable for p in tracer.points]
    assert max(inside) == 1 and inside[0] == inside[-1] == 0


# -- bifurcations


def trace(system, guess, mu, other, name, limits, tail=1e-3, max_harmonics=24, located=1e-2, **options):
    options = ContinuationOptions(
        limits={name: limits}, parameter_scales={name: 1.0}, max_angle=1.5, location_tolerance=located, **options
    )
    shape = OrbitOptions(tail=tail, max_harmonics=max_harmonics, exponents=4)
    tracer = begun(system, guess, mu, other, name, options, shape)
    return tracer, tracer.run()


def test_torus_of_langford():
    """Neimark-Sacker at exactly mu = 2 with exponents +- i sqrt(1.2) modulo the frequency 1/4."""
    system = periodic.of_first_order(langford()._residual, 3)
    samples = np.hstack([CIRCLE, np.ones((64, 1))])
    guess = PeriodicMotion.of_samples(samples, 3, 0.25)
    tracer, reason = trace(
        system, guess, {"mu": 1.95}, 1.96, "mu", step=0.02, max_step=0.05, limits=(1.9, 2.05), located=1e-9
    )
    assert reason.startswith("ended on the limit mu")
    (torus,) = tracer.special
    assert torus.kind == TORUS and torus.located and abs(torus.value - 2.0) < 1e-6
    turns = (np.sqrt(1.2) - 2 * np.pi * torus.frequency) / 0.25, (np.sqrt(1.2) + 2 * np.pi * torus.frequency) / 0.25
    assert min(abs(t - round(t)) for t in turns) < 1e-4
    assert tracer.points[0].exponents.unstable == 0 and tracer.points[-1].exponents.unstable == 2


@pytest.mark.slow
def test_period_doubling_of_an_adaptive_control_system():
    """u' = v, v' = w, w' = -a w - b v - u + u^2, of the manual of MATCONT: at b = 1 doubling at a = 0.6303020, period
    6.364071. Volumes shrink by exp(-a T) over a period, so that the product of both multipliers is that.
    """
    system = periodic.of_first_order(
        lambda u, mu: jnp.stack([u[1], u[2], -mu["a"] * u[2] - mu["b"] * u[1] - u[0] + u[0] ** 2]), 3
    )
    wave = 0.2 * np.stack([np.cos(PHASE), -np.sin(PHASE), -np.cos(PHASE)], axis=1)
    options = {"step": 0.05, "max_step": 0.2, "limits": (0.55, 1.0), "located": 1e-9, "tail": 1e-7, "max_harmonics": 40}
    guess = PeriodicMotion.of_samples(wave, 9, 1.0)
    tracer, reason = trace(system, guess, {"a": 0.97, "b": 1.0}, 0.96, "a", **options)
    assert reason.startswith("ended on the limit a")
    (point,) = tracer.special
    assert point.kind == DOUBLING and point.located
    there = tracer.solver.solve(point.point.motion, {"a": point.value, "b": 1.0})
    assert abs(point.value - 0.6303020) < 6e-8 and abs(there.motion.period - 6.364071) < 6e-7
    for kept in (*tracer.points[2:], point.point):
        pair = kept.exponents.multipliers
        product = np.prod(pair) if len(pair) == 2 else np.abs(pair[0]) ** 2  # a pair is given once
        assert np.isclose(product, np.exp(-kept.value * kept.motion.period), rtol=1e-5)


def test_a_branch_between_two_onsets_ends_at_the_second():
    """z' = (mu (1 - mu) + i) z - z|z|^2: radius sqrt(mu (1 - mu)), back on itself beyond 1."""
    system = periodic.of_first_order(circling(lambda mu: mu * (1 - mu)), 2)
    guess = PeriodicMotion.of_samples(0.2 * CIRCLE, 2, 1.0)
    options = {"step": 0.1, "max_step": 0.1, "limits": (-1.0, 2.0), "max_points": 60}
    tracer, reason = trace(system, guess, {"mu": 0.04}, 0.06, "mu", **options)
    assert "shrinks to nothing" in reason and len(tracer.points) < 30
    assert 0.95 < tracer.points[-1].value < 1.0
    assert all(0 < p.value < 1 for p in tracer.points)


def test_events_are_located():
    """The radius of Stuart and Landau's cycle, sqrt(mu), passes 0.6 at 0.36."""
    system, guess = periodic.of_first_order(circling(lambda mu: mu), 2), PeriodicMotion.of_samples(0.3 * CIRCLE, 2, 1.0)
    event = {"radius": lambda cycle: float(np.linalg.norm(cycle.motion.at([0.0]))) - 0.6}
    options = ContinuationOptions(limits={"mu": (0.0, 0.5)}, location_tolerance=1e-9)
    told = []
    wanted = {"values": (0.12, 0.2, 0.3), "events": event, "report": told.append}
    tracer = begun(system, guess, {"mu": 0.09}, 0.12, "mu", options, **wanted)
    tracer.run()
    (special,) = tracer.special
    assert special.kind == "radius" and abs(special.value - 0.36) < 1e-5 and special in told
    assert [p.value for p in tracer.points if p.asked] == [0.12, 0.2, 0.3]
    again = CycleTracer(tracer.solver, "mu", options, values=(0.2, 0.3), events=event)
    again.restore(tracer.points[:3])
    again.run()
    assert np.isclose(again.points[-1].value, tracer.points[-1].value) and len(again.special) == 1
    for known, count in (((), 1), ([("radius", 0.36)], 0)):  # between the two cycles that a branch starts with
        told = []
        between = CycleTracer(tracer.solver, "mu", options, events=event, report=told.append)
        between.known = list(known)
        for radius in (0.5, 0.65):
            between.extend(tracer.solver.solve(guess, {"mu": radius**2}))
        assert len(told) == 2 + count and [s.kind for s in between.special] == ["radius"] * count


def test_a_fold_between_the_origin_and_the_first_cycles():
    """Cycles mu = r^4 - r^2 with radii on either side of the fold at r^2 = 1/2, mu = -1/4; a branch that is restored
    predicts from the origin as the whole one does.
    """

    def rate(u, mu):
        own = mu["mu"] + u @ u - (u @ u) ** 2
        return jnp.stack([own * u[0] - u[1], u[0] + own * u[1]])

    system = periodic.of_first_order(rate, 2)
    solver = CycleSolver(system, system.basis, EXACT)
    options = ContinuationOptions(limits={"mu": (-1.0, 0.3)}, parameter_scales={"mu": 2.0})
    rest = PeriodicMotion.of_samples(0.0 * CIRCLE, 2, 1.0)
    origin = Cycle(rest, {"mu": 0.0}, 0.0, 0, 0)
    tracer = CycleTracer(solver, "mu", options)
    for radius, start in ((0.65, origin), (0.85, None)):
        guess = PeriodicMotion.of_samples(radius * CIRCLE, 2, 1.0)
        tracer.extend(solver.solve(guess, {"mu": radius**4 - radius**2}), origin=start)
    assert tracer.points[1].value > tracer.points[0].value
    (fold,) = tracer.special
    assert fold.kind == FOLD and fold.located and abs(fold.value + 0.25) < 1e-6
    steps = {}
    tracer.report = lambda _: steps.setdefault(len(tracer.points), tracer.next_step)
    tracer.run()
    assert len(tracer.special) == 1
    again = CycleTracer(solver, "mu", options)
    again.restore(tracer.points[:3], origin)
    again.run(step=steps[3])
    assert np.allclose([p.value for p in again.points], [p.value for p in tracer.points], rtol=0, atol=1e-9)


@pytest.mark.slow
def test_a_restored_branch_tells_what_its_last_step_met():
    """w' = mu w - w^3 + mu |z|^2 w beside a cycle of z: the exponent of w, 2 mu, passes zero at mu = 0."""

    def rate(u, mu):
        r2 = u[0] ** 2 + u[1] ** 2
        own = mu["mu"] * (1 + r2)
        return jnp.stack([u[0] - u[1] - r2 * u[0], u[0] + u[1] - r2 * u[1], own * u[2] - u[2] ** 3])

    guess = PeriodicMotion.of_samples(np.hstack([CIRCLE, np.zeros((64, 1))]), 2, 1.0)
    options = ContinuationOptions(limits={"mu": (-1.0, 0.5)})
    tracer, told = begun(periodic.of_first_order(rate, 3), guess, {"mu": -0.5}, -0.45, "mu", options), []
    steps = {}

    def tell(item):
        told.append(item)
        steps[len(tracer.points)] = tracer.next_step

    tracer.report = tell
    tracer.run()
    assert [special.kind for special in tracer.special] == ["branch point"]
    passed = next(i for i, point in enumerate(tracer.points) if point.value > 0)
    again = CycleTracer(tracer.solver, "mu", options)
    again.restore(tracer.points[: passed + 1])
    again.run(step=steps[passed + 1])
    assert [special.value for special in again.special] == [special.value for special in tracer.special]
    assert [point.value for point in again.points] == [point.value for point in tracer.points]
    for off, count in ((1e-9, 0), (1e-3, 1)):
        again.restore(tracer.points[: passed + 1])
        again.special.clear()
        again.known = [("branch point", tracer.special[0].value + off)]
        again.run(step=steps[passed + 1])
        assert len(again.special) == count


def test_an_event_that_ends_a_branch_is_located_from_one_side():
    """Motions that reach x = -0.6 are refused, and the radius sqrt(mu) is that at 0.36."""

    class Walled(periodic.SmallPeriodic):
        def residual(self, motion, mu):
            if np.linalg.norm(motion.samples, axis=1).max() > 0.6 + 1e-9:
                raise OutOfDomain("beyond the wall")
            return super().residual(motion, mu)

    rate, guess = circling(lambda mu: mu), PeriodicMotion.of_samples(0.3 * CIRCLE, 2, 1.0)
    system = Walled(lambda u, v, a, t, mu: v - rate(u, mu), 2)
    event = {"wall": lambda cycle: 0.6 - float(np.linalg.norm(cycle.motion.at([0.0])))}
    options = ContinuationOptions(limits={"mu": (0.0, 0.5)})
    told = []
    tracer = begun(system, guess, {"mu": 0.09}, 0.12, "mu", options, events=event, report=told.append)
    assert "no further cycle" in tracer.run()
    (special,) = tracer.special
    assert special.kind == "wall" and special.located and special in told
    assert abs(special.value - 0.36) < 1e-4


# -- failures


def test_a_guess_that_is_no_cycle():
    system = periodic.of_first_order(lambda u, mu: jnp.stack([-u[0] - u[1], u[0] - u[1]]), 2)
    with pytest.raises(NotConverged, match="No periodic motion"):
        solved(system, PeriodicMotion.of_samples(CIRCLE, 3, 1.0), {"mu": 0.0})


def test_too_few_harmonics_end_a_branch_with_a_sentence():
    system = periodic.van_der_pol()
    guess = PeriodicMotion.of_samples(2 * np.cos(PHASE)[:, None], 9, 1.0)
    tracer, reason = trace(
        system, guess, {"mu": 0.5}, 0.6, "mu", max_step=0.5, limits=(0.1, 9.0), tail=1e-3, max_harmonics=13
    )
    assert "harmonics are too few" in reason and tracer.points[-1].value > 0.9
    assert all(p.motion.tail <= 1e-3 for p in tracer.points[2:])


def test_bad_options():
    with pytest.raises(ValueError, match="odd"):
        Harmonics(3, 6)
    with pytest.raises(ValueError, match="condition"):
        system = periodic.van_der_pol()
        solved(system, PeriodicMotion.of_samples(np.cos(PHASE)[:, None], 3, 1.0), {"mu": 0.5}, free=("mu",))


def test_motions_are_resized():
    motion = PeriodicMotion(Harmonics(2), np.arange(10.0).reshape(5, 2), 3.0)
    longer = motion.resized(4)
    t = np.linspace(0, 6, 5)
    assert np.allclose(motion.at(t), longer.at(t)) and longer.tail == 0.0 and motion.tail > 0
