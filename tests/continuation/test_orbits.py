"""Periodic orbits with exact solutions; multipliers; branches and their files."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from continuation import (
    Branch,
    Checkpoint,
    ContinuationOptions,
    JaxSystem,
    NotABifurcation,
    NotConverged,
    OrbitOptions,
    Reason,
    continue_orbits,
    find_orbit,
    hopf_normal_form,
    orbit_at,
    orbits_from_hopf,
    resume,
)
from continuation.amplitude import amplitude_equation
from continuation.cycle_branch import CycleTracer
from continuation.cycle_points import FOLD
from continuation.first_order import DirectLinearisation, FirstOrderSystem
from continuation.harmonics import Harmonics
from continuation.normal_form import SystemForms
from continuation.orbit_branches import OrbitSolver
from continuation.periodic import PeriodicMotion
from tests.continuation.known import (
    bautin,
    brusselator,
    brusselator_1d,
    fitzhugh_nagumo,
    lorenz,
    stuart_landau,
    van_der_pol,
    warped_stuart_landau,
)
from tests.systems.following import Stop, follow, hopf_of, normal_form_of

MU = {"mu": 0.3, "w": 2.0, "c": 0.7}
PHASE = 2 * np.pi * np.arange(60) / 60
CIRCLE = np.stack([np.cos(PHASE), np.sin(PHASE)], axis=1)


SPARSE = warped_stuart_landau.__wrapped__(np.ones((2, 2)))


@pytest.mark.parametrize("system", [stuart_landau(), warped_stuart_landau(), SPARSE])
def test_stuart_landau_is_exact(system):
    """Radius sqrt(mu), frequency w - c mu, exponent -2 mu; with a state-dependent mass too, dense and sparse."""
    orbit = find_orbit(system, 0.4 * CIRCLE, 3.0, MU)
    assert np.isclose(orbit.period, 2 * np.pi / (2.0 - 0.21), rtol=1e-11)
    assert np.allclose(orbit.amplitude(), np.sqrt(0.3), rtol=1e-9)
    assert np.allclose(orbit.exponents, -0.6, rtol=1e-8)
    assert orbit.stable
    t = np.linspace(0, orbit.period, 7)
    assert np.allclose(np.linalg.norm(orbit(t), axis=1), np.sqrt(0.3), rtol=1e-9)


def circle_with(others):
    """z' = (1 + i) z - z|z|^2 with further unknowns beside it."""

    def residual(u, mu):
        r2 = u[0] ** 2 + u[1] ** 2
        return jnp.stack([u[0] - u[1] - r2 * u[0], u[0] + u[1] - r2 * u[1], *others(u, mu["mu"])])

    return residual


def test_multiple_exponents_count_as_often_as_they_are():
    system = JaxSystem(circle_with(lambda u, mu: (mu * u[2], mu * u[3])), 4)
    orbit = find_orbit(system, np.hstack([CIRCLE, np.zeros((60, 2))]), 6.0, {"mu": 0.1})
    assert np.allclose(orbit.exponents, [0.1, 0.1, -2.0], atol=1e-8) and orbit.floquet.unstable == 2
    twice = JaxSystem(lambda u, mu: jnp.concatenate([circle_with(lambda *_: ())(v, mu) for v in (u[:2], u[2:])]), 4)
    exponents = find_orbit(twice, np.hstack([CIRCLE, CIRCLE]), 6.0, {"mu": 0.0}).exponents
    assert np.allclose(exponents, [0.0, -2.0, -2.0], atol=1e-7)


@pytest.mark.slow
def test_a_slow_modulation_is_no_real_multiplier():
    """A pair mu + 5e-4 i beside a cycle of frequency 1."""

    def slow(u, mu):
        s2 = u[2] ** 2 + u[3] ** 2
        return mu * u[2] - 5e-4 * u[3] - s2 * u[2], 5e-4 * u[2] + mu * u[3] - s2 * u[3]

    system = JaxSystem(circle_with(slow), 4)
    orbit = find_orbit(system, np.hstack([CIRCLE, np.zeros((60, 2))]), 6.0, {"mu": -0.05})
    assert len(orbit.exponents) == 3
    branch = continue_orbits(system, orbit, "mu", ContinuationOptions(limits={"mu": (-0.05, 0.05)}))
    assert [s.kind for s in branch.special] == ["torus"] and abs(branch.special[0].mu["mu"]) < 1e-6
    assert np.isclose(branch.special[0].values["angle"], 2 * np.pi * 5e-4, rtol=1e-3)
    assert branch.unstable[0] == 0 and branch.unstable[-1] == 2


def test_a_small_unknown_is_resolved_in_any_unit():
    largest = []
    for unit in (1.0, 1e-10):
        filtered = circle_with(lambda u, mu, unit=unit: (5 * (unit * jnp.exp(20 * (u[0] - 1)) - u[2]),))
        orbit = find_orbit(JaxSystem(filtered, 3), np.hstack([CIRCLE, np.zeros((60, 1))]), 6.0, {"mu": 0.0})
        largest.append(orbit.extrema()[1][2] / unit)
    assert np.isclose(largest[1], largest[0], rtol=1e-4)


def test_linearisation_by_differences():
    """With a mass that depends on the state."""
    system, rng = FirstOrderSystem(warped_stuart_landau()), np.random.default_rng(0)
    motion = PeriodicMotion(Harmonics(4), 0.3 * rng.standard_normal((9, 2)), 2.0)
    change, h = rng.standard_normal((9, 2)), 1e-6
    up, down = (PeriodicMotion(motion.harmonics, motion.coefficients + s * h * change, 2.0) for s in (1, -1))
    difference = motion.harmonics.project(system.residual(up, MU) - system.residual(down, MU)) / (2 * h)
    linear = DirectLinearisation(system, motion, MU)
    found = linear.lift(linear.shaped(linear.quadratic(0.0)[0] @ (change / linear.scale).T.ravel()))
    assert np.allclose(found, difference, rtol=1e-6, atol=1e-7)
    rates = linear.on_samples(motion.harmonics.evaluate(change / linear.scale), 0.0)
    assert np.allclose(linear.lift(motion.harmonics.project(rates)), difference, rtol=1e-6, atol=1e-7)


@pytest.mark.slow
def test_series_grow_for_relaxation_oscillations():
    """The period of van der Pol's oscillator at mu = 3 by integration; harmonics are added as they are needed."""
    system, orbit = van_der_pol(), find_orbit(van_der_pol(), 2 * CIRCLE * [1, -1], 2 * np.pi, {"mu": 1.0})
    options = OrbitOptions(max_harmonics=200)
    for mu in (2.0, 3.0):
        guess = orbit(np.linspace(0, orbit.period, 400, endpoint=False))
        orbit = find_orbit(system, guess, orbit.period, {"mu": mu}, options)

    def upwards(t, u):
        return u[0]

    upwards.direction = 1
    run = solve_ivp(
        lambda t, u: [u[1], 3 * (1 - u[0] ** 2) * u[1] - u[0]],
        (0, 60),
        [2.0, 0.0],
        "DOP853",
        events=upwards,
        rtol=1e-12,
        atol=1e-12,
    )
    assert np.isclose(orbit.period, np.diff(run.t_events[0])[-1], rtol=1e-9)
    assert orbit.motion.harmonics.count > 100
    with pytest.raises(NotConverged, match="harmonics are too few"):
        find_orbit(system, guess, orbit.period, {"mu": 3.0}, OrbitOptions(max_harmonics=60))


def test_cycles_from_a_hopf_point_follow_the_square_root():
    system = stuart_landau()
    hopf = hopf_of(system, [0, 0], {**MU, "mu": -0.5}, "mu", (-1, 1))
    branch = orbits_from_hopf(system, hopf, "mu", ContinuationOptions(limits={"mu": (0, 0.5)}))
    assert branch.reason.kind is Reason.LIMIT
    assert np.allclose(branch.values("period"), 2 * np.pi / (2 - 0.7 * branch.values()), rtol=1e-8)
    assert set(branch.unstable) == {0}
    assert np.isclose(orbit_at(system, branch, -1).amplitude()[0], np.sqrt(0.5), rtol=1e-7)
    near = orbits_from_hopf(system, hopf, "mu", ContinuationOptions(limits={"mu": (-1, 5e-4)}))
    assert near.reason.kind is Reason.LIMIT and near.values()[-1] == 5e-4 and np.all(near.values() <= 5e-4)
    with pytest.raises(NotConverged, match="beyond the limits"):
        orbits_from_hopf(system, hopf, "mu", ContinuationOptions(limits={"mu": (-1, 0)}))


def scaled_brusselator(unit):
    """The Brusselator with its second unknown in another unit."""
    plain = brusselator()
    return JaxSystem(lambda u, mu: plain._residual(u * jnp.array([1, 1 / unit]), mu) * jnp.array([1, unit]), 2)


@pytest.mark.parametrize(
    ("system", "start", "mu", "parameter", "limits", "criticality"),
    [
        (brusselator(), [1.0, 1.0], {"A": 1.0, "B": 1.0}, "B", (0.5, 4.0), "super"),
        (scaled_brusselator(1e-6), [1.0, 1e-6], {"A": 1.0, "B": 1.0}, "B", (0.5, 4.0), "super"),
        (lorenz(), [4.9, 4.9, 9.0], {"sigma": 10.0, "b": 8 / 3, "r": 10.0}, "r", (2.0, 30.0), "sub"),
        (fitzhugh_nagumo(0.08), [-1.2, -0.62], {"I": 0.0}, "I", (0.0, 1.0), "sub"),
        (fitzhugh_nagumo(0.001), [-1.2, -0.62], {"I": 0.0}, "I", (0.0, 1.0), "sub"),
        (bautin(), [0.0, 0.0], {"mu": -0.5, "nu": 1.0}, "mu", (-1.0, 1.0), "sub"),
        (bautin(), [0.0, 0.0], {"mu": -0.5, "nu": 0.0}, "mu", (-1.0, 1.0), "degenerate"),
    ],
    ids=["brusselator", "badly scaled", "lorenz", "fitzhugh-nagumo", "stiff", "bautin", "generalised hopf"],
)
def test_first_orbits_beside_hopf_points(system, start, mu, parameter, limits, criticality):
    """Found without any number given, on the side and with the amplitude that the normal form says."""
    hopf = hopf_of(system, start, mu, parameter, limits)
    assert hopf.values["criticality"] == criticality
    branch = orbits_from_hopf(system, hopf, parameter, ContinuationOptions(limits={parameter: limits}, max_points=1))
    form = normal_form_of(system, hopf, parameter)
    change = branch.values()[0] - hopf.mu[parameter]
    amplitude = orbit_at(system, branch, 0).amplitude()
    assert amplitude.max() > 0
    if criticality == "degenerate":  # mu = r^4
        assert np.isclose(change, amplitude[0] ** 4, rtol=1e-6)
        return
    assert np.sign(change) == form.side()
    predicted = [form.amplitude_coefficient(axis) * np.sqrt(abs(change)) for axis in np.eye(system.size)]
    assert np.allclose(amplitude, predicted, rtol=0.25)
    assert branch.points[0].unstable == (0 if criticality == "super" else 1)


def test_the_amplitude_equation_begins_with_the_normal_form():
    """Its cubic coefficient, read off residuals, is that of exact forms: r = 2 |row . q z| of the observed quantity."""
    system, mu = brusselator(), {"A": 1.0, "B": 2.0}
    form = hopf_normal_form(system, [1.0, 2.0], mu, 1.0, [1.0, -1 + 1j])
    beside, periodic = mu | {"B": 2.0 + 1e-6}, FirstOrderSystem(system)
    forms = SystemForms(system, np.array([1.0, 2.0 + 1e-6]), beside)
    found = amplitude_equation(forms, lambda m: -periodic.residual(m, beside), 5e-7 + 1j, form.q, [1.0, 0.0], 0.5)
    assert found.coefficients[1] == pytest.approx(form.c1 / (2 * abs(form.q[0])) ** 2, rel=1e-5)
    assert found.amplitude == pytest.approx(2 * abs(form.q[0]) * np.sqrt(-5e-7 / form.c1.real), rel=1e-5)


BAUTIN_RANGE = ContinuationOptions(limits={"mu": (-1, 0.3)})


@pytest.fixture(scope="module")
def bautin_hopf():
    return hopf_of(bautin(), [0, 0], {"mu": -0.5, "nu": 1.0}, "mu", (-1, 1))


@pytest.fixture(scope="module")
def bautin_cycles(bautin_hopf):
    """z' = (mu + i) z + nu z|z|^2 - z|z|^4, nu = 1: cycles mu = r^4 - r^2, fold at -1/4."""
    return orbits_from_hopf(bautin(), bautin_hopf, "mu", BAUTIN_RANGE)


def test_steps_of_any_unit_pass_a_fold_of_cycles_once(bautin_hopf, bautin_cycles):
    """Cycles of the Bautin system in order, by steps of a fifth of the range and by others."""
    larger = orbits_from_hopf(bautin(), bautin_hopf, "mu", replace(BAUTIN_RANGE, parameter_scales={"mu": 1.0}))
    for branch in (bautin_cycles, larger):
        assert branch.values()[-1] == 0.3
        assert [(s.kind, s.located) for s in branch.special] == [("fold of cycles", True)]
        radius = np.array([orbit_at(bautin(), branch, i).amplitude()[0] for i in range(len(branch))])
        assert np.all(np.diff(radius) > 0)
        assert np.allclose(branch.values(), radius**4 - radius**2, rtol=0, atol=1e-8)
    assert bautin_cycles.plot().get_ylabel() == "period"


@pytest.mark.slow
def test_orbits_towards_a_homoclinic_one_have_no_false_bifurcations():
    """The branch of Lorenz ends on the homoclinic orbit at r = 13.926 (Sparrow 1982)."""
    system, mu = lorenz(), {"sigma": 10.0, "b": 8 / 3, "r": 10.0}
    hopf, options = hopf_of(system, [4.9, 4.9, 9.0], mu, "r", (2.0, 30.0)), ContinuationOptions(limits={"r": (2, 30)})
    branch = orbits_from_hopf(system, hopf, "r", options, OrbitOptions(max_harmonics=60))
    assert not branch.special and set(branch.unstable) <= {1, -1}
    assert abs(branch.values()[-1] - 13.926) < 1e-2 and "harmonics are too few" in branch.reason


@pytest.mark.slow
def test_fold_of_cycles_of_the_bautin_system(tmp_path, bautin_hopf, bautin_cycles):
    system, branch = bautin(), bautin_cycles
    assert bautin_hopf.values["criticality"] == "sub"
    (fold,) = branch.of_kind("fold of cycles")
    assert abs(fold.mu["mu"] + 0.25) < 1e-8
    at = fold.index
    assert set(branch.unstable[: at + 1]) == {1} and set(branch.unstable[at + 1 :]) == {0}
    branch.save(tmp_path / "cycles.h5")
    part = orbits_from_hopf(system, bautin_hopf, "mu", replace(BAUTIN_RANGE, max_points=5))
    part.save(tmp_path / "part.h5")
    longer = resume(system, Branch.load(tmp_path / "part.h5"), BAUTIN_RANGE)
    assert np.allclose(longer.values(), branch.values(), rtol=0, atol=1e-7)
    assert [(s.kind, s.index) for s in longer.special] == [("fold of cycles", at)]
    again = orbit_at(system, Branch.load(tmp_path / "cycles.h5"), -1)
    assert np.allclose(again.amplitude(), np.sqrt(0.5 + np.sqrt(0.25 + 0.3)), rtol=1e-6)


def test_a_fold_of_cycles_that_an_interruption_follows_is_listed_once():
    system, options = bautin(), ContinuationOptions(limits={"mu": (-1, 0.3)}, direction=-1)
    orbit = find_orbit(system, 0.4 * CIRCLE, 2 * np.pi, {"mu": 0.4**4 - 0.4**2, "nu": 1.0})
    part = continue_orbits(system, orbit, "mu", options, observers=Stop())
    assert part.reason.kind is Reason.INTERRUPTED and len(part.special) == 1
    longer = resume(system, part, options)
    assert longer.values()[-1] == 0.3 and [s.kind for s in longer.special] == ["fold of cycles"]


def test_period_doubling_of_a_twisted_band():
    """A cycle on a half-twisted band: multiplier -exp(-2 pi (a - mu)), doubling at mu = a."""
    a = 0.3

    def residual(u, mu):
        # (p, q) rotates at half the speed of (x, y); in the rotated frame one direction grows at mu - a, the other
        # decays: cos and sin of the full angle give the symmetric matrix with half-angle axes
        x, y, p, q = u
        r2 = x**2 + y**2
        c, s = x / jnp.sqrt(r2), y / jnp.sqrt(r2)
        g = mu["mu"] - a
        m, d = 0.5 * (g - 1.0), 0.5 * (g + 1.0)
        slow = (m + d * c) * p + (d * s - 0.5) * q - p**3, (d * s + 0.5) * p + (m - d * c) * q - q**3
        return jnp.stack([x - y - r2 * x, x + y - r2 * y, *slow])

    system = JaxSystem(residual, 4)
    orbit = find_orbit(system, np.hstack([CIRCLE, np.zeros_like(CIRCLE)]), 6.0, {"mu": 0.2})
    real = orbit.nontrivial[np.argmin(np.abs(orbit.nontrivial + np.exp(-0.2 * np.pi)))]
    assert np.isclose(real, -np.exp(-0.2 * np.pi), rtol=1e-6)
    branch = continue_orbits(system, orbit, "mu", ContinuationOptions(limits={"mu": (0, 0.4)}, max_step=0.3))
    (point,) = branch.of_kind("period doubling")
    assert abs(point.mu["mu"] - a) < 1e-7
    assert branch.unstable[0] == 0 and branch.unstable[-1] == 1


@pytest.mark.slow
def test_a_branch_whose_series_grow(tmp_path):
    """Van der Pol's oscillator from mu = 0.5 to 1, periods to the printed digits, checkpoints on the way."""
    system = van_der_pol()
    orbit = find_orbit(system, 2 * CIRCLE * [1, -1], 2 * np.pi, {"mu": 0.5})
    seen = []
    options = ContinuationOptions(limits={"mu": (0.1, 1.0)}, step=0.2, max_step=0.4)
    path = tmp_path / "orbits.h5"
    branch = continue_orbits(
        system, orbit, "mu", options, observers=[lambda b: seen.append(len(b)), Checkpoint(path, 2)]
    )
    assert branch.reason.kind is Reason.LIMIT and seen == list(range(1, len(branch) + 1))
    assert abs(branch.values("period")[0] - 6.380676) < 5.1e-7 and abs(branch.values("period")[-1] - 6.663287) < 5.1e-7
    assert np.all(np.diff(branch.values("harmonics")) >= 0) and np.ptp(branch.values("harmonics")) > 0
    assert branch.states.shape == Branch.load(path).states.shape and set(branch.unstable) == {0}
    assert np.isclose(orbit_at(system, branch, 0).period, orbit.period, rtol=1e-12)
    with pytest.raises(ValueError, match="starts at its limit"):
        continue_orbits(system, orbit_at(system, branch, -1), "mu", options)
    part = continue_orbits(system, orbit, "mu", replace(options, max_points=1))
    states, values = part.states, part.values()
    grown = int(np.argmax(np.diff(branch.values("harmonics")) > 0))
    longer = resume(system, part, replace(options, max_points=grown + 2))
    assert longer.size > part.size == states.shape[1]
    assert np.array_equal(part.states, states) and np.array_equal(part.values(), values)


def test_a_branch_stops_where_it_is_asked_to():
    system, mu = bautin(), {"mu": 0.4**4 - 0.4**2, "nu": 1.0}
    orbit = find_orbit(system, 0.4 * CIRCLE, 2 * np.pi, mu)
    assert not orbit.stable and np.allclose(orbit.exponents, 2 * 0.4**2 - 4 * 0.4**4, atol=1e-9)
    options = ContinuationOptions(limits={"mu": (-1, 0.3)}, direction=-1, stop_at=frozenset({"fold of cycles"}))
    branch = continue_orbits(system, orbit, "mu", options)
    assert branch.reason == "stopped at: fold of cycles" and branch.special[-1].index >= len(branch) - 3


@pytest.mark.slow
def test_an_orbit_of_a_discretised_equation_takes_few_sparse_factorisations(monkeypatch):
    """The Brusselator with diffusion, 20 unknowns: at most three for an orbit, the one of its exponents among them."""
    from continuation import linear

    made = []

    def count(self, matrix, *arguments):
        made.append(matrix.shape[0])
        original(self, matrix, *arguments)

    points, mu = 10, {"A": 2.0, "B": 5.45, "D1": 0.008, "D2": 0.004, "l": 0.49}
    system, limits = brusselator_1d(points), (0.48, 0.53)
    hopf = hopf_of(system, np.tile([2.0, 2.725], points), mu, "l", limits, eigenvalues=4, near=2.2j)
    original = linear.SparseSolver.__init__
    monkeypatch.setattr(linear.SparseSolver, "__init__", count)
    monkeypatch.setattr(linear.DenseSolver, "__init__", None)
    branch = orbits_from_hopf(system, hopf, "l", ContinuationOptions(limits={"l": limits}, max_points=3))
    assert branch.reason.kind is Reason.POINTS and set(branch.unstable) == {0} and not branch.special
    whole = [size for size in made if size > system.size]
    assert len(whole) <= 3 * len(branch)


def test_a_guess_that_is_no_orbit():
    decay = JaxSystem(lambda u, mu: jnp.stack([-u[0] - u[1], u[0] - u[1]]), 2)
    with pytest.raises(NotConverged):
        find_orbit(decay, CIRCLE, 6.0, {"mu": 0.0})


def test_orbits_start_at_hopf_points_only():
    branch = follow(bautin(), [0, 0], {"mu": -0.5, "nu": 1.0}, "mu", (-1, 1), locate=False)
    with pytest.raises(NotABifurcation):
        orbits_from_hopf(bautin(), branch.special[0], "mu")
    hopf = hopf_of(bautin(), [0, 0], {"mu": -0.5, "nu": 1.0}, "mu", (-1, 1))
    with pytest.raises(NotABifurcation, match="The growth rate does not change with nu"):
        orbits_from_hopf(bautin(), hopf, "nu")


def test_a_branch_point_of_cycles_is_no_fold():
    """z' = (1 + i) z - z|z|^2 and w' = mu w - w^3 + mu |z|^2 w: the exponent of w, 2 mu, passes zero at mu = 0."""

    def residual(u, mu):
        r2 = u[0] ** 2 + u[1] ** 2
        rate = mu["mu"] * (1 + r2)
        return jnp.stack([u[0] - u[1] - r2 * u[0], u[0] + u[1] - r2 * u[1], rate * u[2] - u[2] ** 3])

    system = JaxSystem(residual, 3)
    orbit = find_orbit(system, np.hstack([CIRCLE, np.zeros((60, 1))]), 6.0, {"mu": -0.5})
    options = ContinuationOptions(limits={"mu": (-1.0, 0.5)})
    branch = continue_orbits(system, orbit, "mu", options)
    assert [(s.kind, s.located) for s in branch.special] == [("branch point", True)]
    assert abs(branch.special[0].mu["mu"]) < 1e-7 and branch.unstable[0] == 0 and branch.unstable[-1] == 1
    # in the last step, of a run that ends or is interrupted there, and once when it goes on
    beyond = branch.special[0].index + 2
    part = continue_orbits(system, orbit, "mu", replace(options, max_points=beyond - 1))
    halted = continue_orbits(system, orbit, "mu", options, observers=Stop(beyond))
    assert len(part) == len(halted) == beyond and not halted.special
    for found in (part, resume(system, part, options), resume(system, halted, options)):
        assert [(s.kind, s.located, s.index) for s in found.special] == [("branch point", True, beyond - 2)]
        assert abs(found.special[0].mu["mu"]) < 1e-7


def test_a_fold_of_cycles_in_the_last_step_is_no_branch_point():
    """Cycles mu = r^4 - r^2, the last a little behind the fold; the parameter has not gone back yet."""
    system, mu = bautin(), lambda r: {"mu": r**4 - r**2, "nu": 1.0}
    solver = OrbitSolver(system, OrbitOptions())
    options = ContinuationOptions(limits={"mu": (-1, 0.3)}, max_points=3)
    tracer = CycleTracer(solver, "mu", options, OrbitOptions(exponents=1))
    radii = (0.4, 0.5, np.sqrt(0.5) + 0.1)
    for r in radii:
        tracer.extend(solver.solve(PeriodicMotion.of_samples(r * CIRCLE, 6, 1.0), mu(r)))
    tracer.restore(tracer.points)
    assert mu(radii[-1])["mu"] < mu(radii[-2])["mu"]
    assert tracer.run().kind is Reason.POINTS
    (fold,) = tracer.special
    assert fold.kind == FOLD and abs(fold.value + 0.25) < 1e-6


def test_exponents_only_where_asked():
    orbit = find_orbit(stuart_landau(), 0.4 * CIRCLE, 3.0, MU, OrbitOptions(exponents=0))
    assert orbit.exponents.size == 0 and orbit.stable is None
    options = ContinuationOptions(limits={"mu": (0.1, 0.5)})
    branch = continue_orbits(stuart_landau(), orbit, "mu", options, OrbitOptions(exponents=0))
    assert branch.reason.kind is Reason.LIMIT and set(branch.unstable) == {-1}
