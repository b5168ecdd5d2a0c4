"""Exact derivatives of the augmented conditions: against differences and against JAX.

The block-eliminated Newton step is compared with the Jacobian of the whole augmented system,
formed by automatic differentiation of the dense bordered solve.
"""

from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from continuation.conditions import BogdanovTakensCondition, BranchPointCondition, FoldCondition, HopfCondition
from continuation.jax_system import JaxSystem
from continuation.problem import Local, Problem

RNG = np.random.default_rng(7)
N = 4
MATRIX = RNG.standard_normal((N, N))
QUADRATIC = RNG.standard_normal((N, N, N))
CUBIC = RNG.standard_normal((N, N, N, N))


def force(u, mu):
    return (
        mu["a"] * (MATRIX @ u)
        + jnp.einsum("ijk,j,k", QUADRATIC, u, u)
        + mu["b"] * jnp.einsum("ijkl,j,k,l", CUBIC, u, u, u)
        + mu["a"] ** 2 * jnp.sin(mu["b"] + u)
    )


def mass(u, mu, v):
    return v + 0.2 * mu["b"] * jnp.sin(u) * v + 0.1 * u * jnp.dot(jnp.cos(u), v)


U = 0.3 * RNG.standard_normal(N)
MU = {"a": 0.8, "b": 0.5}
P, Q = RNG.standard_normal((2, N))
PC = RNG.standard_normal(N) + 1j * RNG.standard_normal(N)
QC = RNG.standard_normal(N) + 1j * RNG.standard_normal(N)
OMEGA = 1.7


@pytest.fixture(scope="module")
def system():
    return JaxSystem(force, N, mass=mass)


def jacobians(x):
    u, mu = x[:N], {"a": x[N], "b": x[N + 1]}
    a = jax.jacfwd(force)(u, mu)
    b = jax.vmap(lambda e: mass(u, mu, e))(jnp.eye(N)).T
    return a, b


def bordered_scalar(matrix, p, q):
    full = jnp.block([[matrix, p[:, None]], [jnp.conj(q)[None, :], jnp.zeros((1, 1))]])
    return jnp.linalg.solve(full, jnp.zeros(N + 1, full.dtype).at[-1].set(1.0))


def dense_fold(x):
    p, q = P / np.linalg.norm(P), Q / np.linalg.norm(Q)
    return bordered_scalar(jacobians(x)[0], p, q)[-1:]


def dense_takens(x):
    p, q = P / np.linalg.norm(P), Q / np.linalg.norm(Q)
    a, b = jacobians(x)
    right, left = bordered_scalar(a, p, q), bordered_scalar(a.T, q, p)
    return jnp.stack([right[-1], left[:-1] @ b @ right[:-1]])


def dense_hopf(x):
    p, q = PC / np.linalg.norm(PC), QC / np.linalg.norm(QC)
    a, b = jacobians(x)
    g = bordered_scalar(a - 1j * x[N + 2] * b, p, q)[-1]
    return jnp.stack([g.real, g.imag])


def full_state(extra=()):
    return np.concatenate([U, [MU["a"], MU["b"]], extra])


CASES = {
    "fold": (lambda: FoldCondition(P, Q), dense_fold, ()),
    "bogdanov-takens": (lambda: BogdanovTakensCondition(P, Q), dense_takens, ()),
    "hopf": (lambda: HopfCondition(PC, QC), dense_hopf, (OMEGA,)),
}


@cache
def differentiated(case):
    """Values of the dense condition, and the derivatives of the whole augmented system; compiled once."""
    _, dense, extra = CASES[case]

    def everything(z):
        return jnp.concatenate([force(z[:N], {"a": z[N], "b": z[N + 1]}), dense(z)])

    x = jnp.asarray(full_state(extra))
    return tuple(np.asarray(part) for part in jax.jit(lambda x: (everything(x), jax.jacfwd(everything)(x)))(x))


@pytest.mark.parametrize("case", CASES)
def test_values_and_derivatives_equal_automatic_differentiation(system, case):
    make, _, extra = CASES[case]
    expected, matrix = differentiated(case)
    value = make().evaluate(system, U, MU, ("a", "b"), system.linear(U, MU), extra)
    assert np.allclose(value.values, expected[N:], rtol=1e-12, atol=1e-13)
    for _ in range(3):
        step = RNG.standard_normal(N + 2)
        along = value.along(step[:N], {"a": step[N], "b": step[N + 1]})
        assert np.allclose(along, matrix[N:, : N + 2] @ step, rtol=1e-10, atol=1e-12)
    assert np.allclose(value.d_extra, matrix[N:, N + 2 :], rtol=1e-10, atol=1e-12)


@pytest.mark.parametrize("case", CASES)
def test_newton_step_equals_that_of_the_whole_augmented_jacobian(system, case):
    make, _, extra = CASES[case]
    # One row closes what is left open, so that the step is unique.
    problem = Problem(system, MU, ("a", "b"), make())
    x = full_state(extra)
    closing = problem.m < problem.k + problem.e
    normal = RNG.standard_normal(x.size) if closing else None
    expected, matrix = differentiated(case)
    right = -expected
    if closing:
        matrix, right = np.vstack([matrix, normal]), np.append(right, -0.2)
    local = Local(problem, x, np.hstack([0.1 * np.ones((2, N)), np.eye(2)]))
    step = local.correction(normal, 0.2 if closing else 0.0)
    assert np.allclose(step, np.linalg.solve(matrix, right), rtol=1e-8, atol=1e-9)


def test_branch_point_condition_by_differences(system):
    rows = RNG.standard_normal((2, N + 1))
    condition = BranchPointCondition(P, rows)

    def value(x):
        u, mu = x[:N], {**MU, "a": float(x[N])}
        return condition.evaluate(system, u, mu, ("a",), system.linear(u, mu), ())

    x = np.append(U, MU["a"])
    step = RNG.standard_normal(N + 1)
    h = 1e-5
    difference = (value(x + h * step).values - value(x - h * step).values) / (2 * h)
    along = value(x).along(step[:N], {"a": step[N]})
    # Central differences with h = 1e-5 leave about 1e-9 relative.
    assert np.allclose(along, difference, rtol=1e-6, atol=1e-8)


def test_scalar_vanishes_exactly_with_the_determinant():
    """g det(bordered) = det(A): zero together, and only then."""
    from continuation.linear import MatrixLinearisation

    a = RNG.standard_normal((N, N))
    condition = FoldCondition(P, Q)
    value = condition.evaluate(None, U, MU, (), MatrixLinearisation(a), ())
    full = np.block([[a, condition.p[:, None]], [condition.q[None, :], np.zeros((1, 1))]])
    assert np.isclose(value.values[0] * np.linalg.det(full), np.linalg.det(a), rtol=1e-10)
