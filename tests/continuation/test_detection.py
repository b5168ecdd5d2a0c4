"""Detection that does not miss, and location of the point that was detected."""

from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

from continuation import ContinuationOptions, Reason, Spectrum, continue_branch
from continuation.branches import branch_tracer
from continuation.event_location import FoldMonitor, locate_zero
from continuation.jax_system import JaxSystem
from continuation.normal_form import hopf_normal_form
from continuation.spectra import count_unstable, match_modes
from tests.continuation.known import bogdanov_takens, brusselator, brusselator_1d, cusp, pitchfork, stuart_landau
from tests.systems.normal_forms import subcritical_double
from tests.systems.operator_only import OperatorOnly


def wide(**more):
    return ContinuationOptions(**{"limits": {"mu": (-1.0, 1.0)}, "step": 0.5, "max_step": 1.9, **more})


def test_exchange_of_unstable_pairs_is_seen_though_the_count_stays():
    branch = continue_branch(subcritical_double(), np.zeros(4), {"mu": -1.0}, "mu", wide(eigenvalues=4))
    assert set(branch.unstable) == {2}
    found = sorted(s.values["omega"] for s in branch.of_kind("hopf"))
    assert np.allclose(found, [1.0, 2.5], rtol=0, atol=1e-10)
    speed = {round(s.values["omega"], 3): s.values["crossing_real"] for s in branch.of_kind("hopf")}
    assert np.isclose(speed[1.0], 1.0) and np.isclose(speed[2.5], -1.0)


def chain(thresholds, frequencies):
    """Uncoupled oscillators that lose stability one after the other."""
    t, w = jnp.asarray(thresholds), jnp.asarray(frequencies)
    n = len(thresholds)

    def residual(u, mu):
        x, y = u[:n], u[n:]
        g = mu["mu"] - t
        return jnp.concatenate([g * x - w * y - x**3, w * x + g * y])

    return JaxSystem(residual, 2 * n)


@pytest.mark.parametrize("frequencies", [[1.0, 3.0, 2.0], [1.0, 1.001, 1.002], [2.0, 2.0, 2.0]])
def test_three_hopf_points_within_one_step(frequencies):
    """Also with frequencies that all but agree, and with equal ones."""
    thresholds = [-0.11, 0.03, 0.3]
    branch = continue_branch(chain(thresholds, frequencies), np.zeros(6), {"mu": -1.0}, "mu", wide(eigenvalues=6))
    points = sorted(branch.of_kind("hopf"), key=lambda s: s.mu["mu"])
    assert np.allclose([s.mu["mu"] for s in points], thresholds, rtol=0, atol=1e-9)
    assert np.allclose([s.values["omega"] for s in points], frequencies, rtol=0, atol=1e-9)
    assert not branch.of_kind("stability change", located=False)


@pytest.mark.parametrize(("start", "step"), [(-0.4, 0.9), (-0.8, 1.7)])
def test_pair_that_crosses_and_then_splits_into_real_ones_within_the_step(start, step):
    """lambda^2 - 4 mu lambda + 1: Hopf at 0, complex for |mu| < 1/2, real at one or both ends."""

    def residual(u, mu):
        return jnp.stack([u[1], -u[0] + 4 * mu["mu"] * u[1] - u[1] ** 3])

    branch = continue_branch(JaxSystem(residual, 2), np.zeros(2), {"mu": start}, "mu", wide(eigenvalues=2, step=step))
    assert len(branch) <= 4
    (point,) = branch.special
    assert point.kind == "hopf" and point.located
    assert abs(point.mu["mu"]) < 1e-9 and np.isclose(point.values["omega"], 1.0)


def test_a_located_point_outside_of_its_bracket_is_refused():
    """Newton's method may find another point; then the bracket is halved and it starts anew."""
    system, mu = cusp(), {"a": -2.0, "b": 1.0}
    tracer = branch_tracer(system, mu, "a", ContinuationOptions())
    direction = np.array([0.0, 1.0])
    here = [tracer.start(np.array([x, x**3 - x]), direction) for x in (-0.7, -0.5)]
    fold = -1 / np.sqrt(3)
    calls = []

    def attempt(guess, low, high):
        calls.append(guess.z[0])
        x = -fold if len(calls) < 3 else fold  # the other fold, at first
        return SimpleNamespace(z=np.array([x, x**3 - x]))

    result, _, reason = locate_zero(tracer, *here, lambda h: 3 * h.z[0] ** 2 - 1, attempt)
    assert result.z[0] == fold and len(calls) == 3 and reason == ""
    never, guess, reason = locate_zero(
        tracer, *here, lambda h: 3 * h.z[0] ** 2 - 1, lambda *_: SimpleNamespace(z=np.array([-fold, 0.0]))
    )
    assert never is None and "left the bracket" in reason
    assert abs(guess.z[0] - fold) < 1e-3  # the best bracket is kept


def test_two_folds_within_the_step_after_the_unit_of_the_state_grew():
    """a = x^3 - 0.03 x with folds at -0.1 and 0.1, the first point in a tenth of the unit of the second."""
    tracer = branch_tracer(cusp(), {"a": 0.0, "b": 0.03}, "a", ContinuationOptions(state_scale=0.1))
    before = tracer.start(np.array([-0.3, -0.018]), np.array([0.0, 1.0]))
    tracer.problem.rescale(1.0, 1.0)
    before.tangent = before.tangent / tracer.problem.norm(before.tangent)
    after = tracer.start(np.array([0.12, -0.001872]), np.array([0.0, 1.0]))
    folds = FoldMonitor().between(tracer, before, after, 0, [])
    assert all(fold.located for fold in folds) and np.allclose([fold.z[0] for fold in folds], [-0.1, 0.1])


def test_leaving_and_returning_within_a_few_steps():
    """A tongue: unstable only for |mu| < 0.2."""

    def residual(u, mu):
        g = 0.04 - mu["mu"] ** 2
        return jnp.stack([g * u[0] - 2 * u[1] - u[0] ** 3, 2 * u[0] + g * u[1]])

    branch = continue_branch(
        JaxSystem(residual, 2), np.zeros(2), {"mu": -1.0}, "mu", wide(eigenvalues=2, max_step=0.25, step=0.25)
    )
    at = [s.mu["mu"] for s in branch.of_kind("hopf")]
    assert np.allclose(at, [-0.2, 0.2], rtol=0, atol=1e-9)
    assert branch.of_kind("hopf")[0].values["crossing_real"] > 0
    assert branch.of_kind("hopf")[1].values["crossing_real"] < 0


@pytest.mark.parametrize("centre", [0.07, -0.92])
def test_a_tongue_narrower_than_the_step_is_not_stepped_over(centre):
    """Unstable only within 0.06 of the centre, steps of 0.16; points on neither side see it, those of the first step
    together with the next one.
    """

    def residual(u, mu):
        g = 0.06**2 - (mu["mu"] - centre) ** 2
        return jnp.stack([g * u[0] - 2 * u[1] - u[0] ** 3, 2 * u[0] + g * u[1]])

    system, steps = JaxSystem(residual, 2), {"eigenvalues": 2, "max_step": 0.4, "step": 0.4}
    branch = continue_branch(system, np.zeros(2), {"mu": -1.0}, "mu", wide(**steps))
    at = [s.mu["mu"] for s in branch.of_kind("hopf")]
    assert np.allclose(sorted(at), [centre - 0.06, centre + 0.06], rtol=0, atol=1e-9)
    assert all(branch.values()[s.index] <= s.mu["mu"] <= branch.values()[s.index + 1] for s in branch.special)
    stopped = continue_branch(system, np.zeros(2), {"mu": -1.0}, "mu", wide(stop_at="hopf", **steps))
    assert stopped.reason.kind is Reason.STOPPED and np.all(np.diff(stopped.values()) > 0)
    assert [s.mu["mu"] for s in stopped.special] == [pytest.approx(centre - 0.06, abs=1e-9)]


@pytest.mark.parametrize("dip", [-0.05, -0.03])
def test_a_pair_that_comes_near_the_axis_beside_a_fold_makes_no_other_zero(dip):
    """r + u^2, and an oscillator of growth -0.001 - 5 (u - dip)^2."""

    def residual(u, mu):
        g = -0.001 - 5 * (u[0] - dip) ** 2
        return jnp.stack([mu["r"] + u[0] ** 2, g * u[1] - 3 * u[2], 3 * u[1] + g * u[2]])

    limits = {"r": (-1.0, 0.5)}
    options = ContinuationOptions(limits=limits, eigenvalues=3)
    branch = continue_branch(JaxSystem(residual, 3), [-1.0, 0.0, 0.0], {"r": -1.0}, "r", options)
    assert [(s.kind, s.located) for s in branch.special] == [("fold", True)]


def test_pole_of_the_branch_point_test_is_no_branch_point():
    """A fold is passed with the test function of branch points running all over the place."""
    branch = continue_branch(
        bogdanov_takens(),
        [-1.2, 0.0],
        {"b1": -0.3, "b2": -1.0, "s": -1.0},
        "b1",
        ContinuationOptions(limits={"b1": (-0.5, 2.0)}, max_step=0.1),
    )
    assert not [s for s in branch.special if s.kind == "branch point"]


def test_branch_points_of_modes_that_do_not_know_of_each_other():
    """Decoupled pitchforks, two of them within one step; with and without a determinant."""
    thresholds = jnp.array([-0.5, -0.1, 0.05, 0.6])
    system = JaxSystem(lambda u, mu: (mu["mu"] - thresholds) * u - u**3, 4)
    for hidden in (False, True):
        model = OperatorOnly(system, 0.0) if hidden else system
        spectrum = system.spectrum if hidden else None
        branch = continue_branch(
            model, np.zeros(4), {"mu": -1.0}, "mu", wide(eigenvalues=4, step=0.4, max_step=0.4), spectrum=spectrum
        )
        at = sorted(s.mu["mu"] for s in branch.of_kind("branch point"))
        assert np.allclose(at, thresholds, rtol=0, atol=1e-9)


def test_determinant_alone_sees_single_branch_points():
    thresholds = jnp.array([-0.5, 0.05, 0.6])
    system = JaxSystem(lambda u, mu: (mu["mu"] - thresholds) * u - u**3, 3)
    branch = continue_branch(system, np.zeros(3), {"mu": -1.0}, "mu", wide(step=0.2, max_step=0.2))
    at = [s.mu["mu"] for s in branch.of_kind("branch point")]
    assert np.allclose(at, thresholds, rtol=0, atol=1e-9)


def test_real_eigenvalue_without_watching_for_branch_points_is_reported():
    branch = continue_branch(
        pitchfork(), np.zeros(2), {"mu": -1.0, "e": 0.0}, "mu", wide(eigenvalues=2, branch_points=False)
    )
    (special,) = branch.special
    assert special.kind == "zero eigenvalue" and not special.located
    assert "real eigenvalue crossed zero" in special.reason


def test_unconverged_eigenvalues_make_the_count_unknown():
    system = stuart_landau()
    honest = system.spectrum

    def lazy(u, mu, count, near=None):
        s = honest(u, mu, count, near)
        return Spectrum(s.values, s.vectors, np.array([True, False]), 1)

    branch = continue_branch(system, [0, 0], {"mu": -0.5, "w": 2.0, "c": 0.7}, "mu", wide(eigenvalues=2), spectrum=lazy)
    assert set(branch.unstable) == {-1}


def test_without_location_a_point_is_only_bracketed():
    branch = continue_branch(
        stuart_landau(), [0, 0], {"mu": -0.5, "w": 2.0, "c": 0.7}, "mu", wide(eigenvalues=2, locate=False)
    )
    assert not branch.of_kind("hopf")
    (special,) = branch.of_kind("hopf", located=False)
    assert "not asked for" in special.reason


def test_missing_second_derivative_leaves_the_point_bracketed_with_the_reason():
    class NoSecond(JaxSystem):
        def d2(self, u, mu, a, b):
            return super(JaxSystem, self).d2(u, mu, a, b)

    system = NoSecond(brusselator()._residual, 2)
    branch = continue_branch(
        system,
        [1.0, 0.5],
        {"A": 1.0, "B": 0.5},
        "B",
        ContinuationOptions(eigenvalues=2, branch_points=False, limits={"B": (0.0, 4.0)}),
    )
    (special,) = branch.of_kind("hopf", located=False)
    assert "no second derivative" in special.reason
    assert abs(special.mu["B"] - 2.0) < 0.5


@pytest.mark.slow
def test_only_products_and_solves_are_used():
    """Branch, Hopf points and normal form of a system that never shows a matrix."""
    points = 15
    inner = brusselator_1d(points)
    system = OperatorOnly(inner, 2.2j)
    mu = {"A": 2.0, "B": 5.45, "D1": 0.008, "D2": 0.004, "l": 0.3}
    options = ContinuationOptions(eigenvalues=8, limits={"l": (0.2, 0.8)}, max_step=0.1)
    start = np.tile([2.0, 2.725], points)
    hidden = continue_branch(system, start, mu, "l", options).of_kind("hopf")[0]
    shown = continue_branch(inner, start, mu, "l", options).of_kind("hopf")[0]
    assert np.isclose(hidden.mu["l"], shown.mu["l"], rtol=1e-10)
    assert np.isclose(
        hidden.values["first_lyapunov_coefficient"], shown.values["first_lyapunov_coefficient"], rtol=1e-7
    )
    form = hopf_normal_form(system, hidden.u, hidden.mu, hidden.values["omega"], hidden.vectors["right"], "l")
    assert np.isclose(form.l1, hidden.values["first_lyapunov_coefficient"], rtol=1e-9)


def test_matching_follows_shapes_where_values_cross():
    first = (np.array([1.0 + 2.0j, 0.9 + 2.0j]), np.eye(2, dtype=complex))
    second = (np.array([0.96 + 2.0j, 0.95 + 2.0j]), np.eye(2, dtype=complex)[:, ::-1])
    assert sorted(match_modes(first, second)) == [(0, 1), (1, 0)]


def test_counting():
    assert count_unstable([1.0, 0.5 + 1j, -1.0 + 5j, 0.0]) == 3
