"""A large second-order system with low-rank coupling, known through condensed solves only."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest

from continuation import ContinuationOptions, continue_branch
from continuation.jax_system import JaxSystem
from tests.systems.second_order import CoupledChain

MU = {"mu": 0.0}


def dense_twin(chain):
    """The same equations written once in JAX, with dense matrices."""
    k, c = chain.stiffness.toarray(), chain.damping.toarray()
    b = np.eye(chain.size)
    b[chain.count :, chain.count :] = chain.mass.toarray()

    def residual(u, mu):
        q, v = u[: chain.count], u[chain.count :]
        coupling = chain.feed @ (chain.read.T @ (q + chain.delay * v))
        return jnp.concatenate([v, -c @ v - k @ q - q**3 + 0.4 * q * v + mu["mu"] * coupling])

    return JaxSystem(residual, chain.size, mass=b)


@pytest.mark.parametrize("shift", [0.0, 0.3 + 1.1j])
def test_condensed_solves_equal_dense_ones(shift):
    chain = CoupledChain(12)
    u = 0.3 * np.cos(np.arange(24))
    mu = {"mu": 0.7}
    dense, own = dense_twin(chain).linear(u, mu), chain.linear(u, mu)
    x = np.sin(np.arange(24)) + 1j * np.cos(np.arange(24))
    full = dense.jacobian - shift * dense.mass
    assert np.allclose(own.shifted(shift).solve(full @ x), x)
    assert np.allclose(own.shifted(shift).solve_transpose(full.T @ x), x)
    assert np.allclose(own.shifted(shift).rmatvec(x), full.T @ x)
    assert np.allclose(own.solve_transpose(dense.jacobian.T @ x.real), x.real)


OPTIONS = ContinuationOptions(
    eigenvalues=8, near=0.1j, limits={"mu": (0.0, 0.1)}, step=0.01, max_step=0.02, stop_at=frozenset({"hopf"})
)


def test_condensed_and_dense_find_the_same_hopf_point():
    chain = CoupledChain(20)
    found = [continue_branch(s, np.zeros(40), MU, "mu", OPTIONS).of_kind("hopf")[0] for s in (chain, dense_twin(chain))]
    one, two = found
    assert np.isclose(one.mu["mu"], two.mu["mu"], rtol=1e-9)
    assert np.isclose(one.values["omega"], two.values["omega"], rtol=1e-9)
    assert np.isclose(one.values["c1_real"], two.values["c1_real"], rtol=1e-6)


@pytest.mark.slow
def test_seven_thousand_unknowns_without_a_dense_matrix():
    """Also keeps memory in check: a dense matrix of this size would take 0.4 GB."""
    chain = CoupledChain(3500)
    options = dataclasses.replace(OPTIONS, stop_at=frozenset(), limits={"mu": (0.0, 0.025)}, step=0.4, max_step=0.5)
    branch = continue_branch(chain, np.zeros(7000), MU, "mu", options)
    points = branch.of_kind("hopf")
    # Three pairs cross within 1.2 % of one another.
    assert len(points) == 3 and np.all(np.diff([p.mu["mu"] for p in points]) > 0)
    for point in points:
        assert point.values["eigen_residual"] < 1e-8
        assert point.values["criticality"] in ("super", "sub")
        # Confirmed by eigenvalues on both sides.
        near, growth = 1j * point.values["omega"], []
        for factor in (0.999, 1.001):
            s = chain.spectrum(np.zeros(7000), {"mu": factor * point.mu["mu"]}, 4, near)
            growth.append(s.values[np.argmin(abs(s.values - near))].real)
        assert growth[0] < 0 < growth[1]
