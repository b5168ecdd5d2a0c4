"""Newton's method at fixed parameters: convergence, reasons for failure, deflation."""

import jax.numpy as jnp
import numpy as np
import pytest

from continuation import Deflation, NewtonOptions, NotConverged, equilibrium
from continuation.jax_system import JaxSystem
from tests.systems.normal_forms import pitchfork


def scalar(f):
    return JaxSystem(lambda u, mu: f(u, mu), 1)


def test_convergence_is_quadratic():
    system = scalar(lambda u, mu: jnp.exp(u) - mu["c"])
    result = equilibrium(system, [1.0], {"c": 2.0}, NewtonOptions(tolerance=1e-14))
    assert abs(result.required().u[0] - np.log(2.0)) < 1e-14
    e = np.array(result.history)
    e = e[(e < 0.5) & (e > 1e-9)]
    assert np.all(e[1:] < 2.0 * e[:-1] ** 2)


def test_deflation_finds_all_three_states_of_a_pitchfork():
    system, mu = pitchfork(), {"mu": 1.0, "e": 0.0}
    known = []
    for _ in range(3):
        result = equilibrium(system, [0.6, 0.1], mu, NewtonOptions(max_iterations=100), Deflation(tuple(known)))
        known.append(result.required().u)
    assert np.allclose(sorted(u[0] for u in known), [-1.0, 0.0, 1.0], atol=1e-9)


def test_deflation_at_the_known_state_itself_does_not_return_it():
    system, mu = pitchfork(), {"mu": 1.0, "e": 0.0}
    result = equilibrium(
        system, [1.0, 1.0 + 1e-9], mu, NewtonOptions(max_iterations=50), Deflation((np.array([1.0, 1.0]),))
    )
    assert not (result.converged and np.allclose(result.u, [1.0, 1.0], atol=1e-6))


def test_line_search_saves_what_plain_newton_loses():
    system = scalar(lambda u, mu: jnp.arctan(u) - mu["c"])
    plain = equilibrium(system, [3.0], {"c": 0.0})
    damped = equilibrium(system, [3.0], {"c": 0.0}, NewtonOptions(line_search=True))
    assert not plain.converged and plain.reason in ("diverged", "not finite", "singular", "maximum iterations")
    assert damped.converged and abs(damped.u[0]) < 1e-10


@pytest.mark.parametrize(
    ("f", "start", "options", "reason"),
    [
        (lambda u, mu: u**2 + 1.0, 0.7, NewtonOptions(max_iterations=8), "maximum iterations"),
        (lambda u, mu: u**2 + 1.0, 0.7, NewtonOptions(line_search=True, max_iterations=200), "line search stalled"),
        (lambda u, mu: jnp.log(u), 5.0, NewtonOptions(), "not finite"),
        (lambda u, mu: 1.0 + u**4, 1e-4, NewtonOptions(divergence=10.0), "diverged"),
    ],
)
def test_failures_are_told_apart(f, start, options, reason):
    result = equilibrium(scalar(f), [start], {"c": 0.0}, options)
    assert not result.converged
    assert result.reason == reason
    with pytest.raises(NotConverged, match="No equilibrium was found at c = 0") as error:
        result.required()
    assert error.value.result is result


def test_reused_factors_give_the_same_state_with_fewer_factorisations():
    calls = {"full": 0, "reused": 0}
    for key, rate in (("full", 0.0), ("reused", 0.5)):
        system = scalar(lambda u, mu: u + 0.1 * jnp.sin(u) - mu["c"])
        original = system.linear

        def counted(u, mu, key=key, original=original):
            calls[key] += 1
            return original(u, mu)

        system.linear = counted
        result = equilibrium(system, [0.0], {"c": 1.0}, NewtonOptions(reuse_rate=rate))
        assert abs(result.required().u[0] + 0.1 * np.sin(result.u[0]) - 1.0) < 1e-10
    assert calls["reused"] < calls["full"]


def test_observer_sees_every_residual():
    seen = []
    result = equilibrium(scalar(lambda u, mu: u**2 - 2.0), [1.0], {"c": 0.0}, observer=lambda i, r: seen.append((i, r)))
    assert [r for _, r in seen] == list(result.history)


def test_own_norm_of_the_system_decides():
    system = scalar(lambda u, mu: u - 1.0)
    system.residual_norm = lambda r: 1e-20 * abs(r[0])
    assert equilibrium(system, [0.0], {"c": 0.0}).iterations == 0
