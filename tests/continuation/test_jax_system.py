"""Derivatives by automatic differentiation against differences; sparse against dense."""

import jax.numpy as jnp
import numpy as np
import pytest
import scipy.sparse as sp

from continuation.jax_system import JaxSystem, colour_columns
from continuation.system import System
from tests.continuation.known import brusselator_1d, warped_stuart_landau

MU = {"mu": 0.3, "w": 2.0, "c": 0.7}
POINT = np.array([0.4, -0.2])
RNG = np.random.default_rng(0)
A, B, C, D = RNG.standard_normal((4, 2))
STEP = 1e-5
# Central differences of smooth functions of order one: h^2 and eps/h are both below 1e-9.
CLOSE = {"rtol": 1e-7, "atol": 1e-8}


def central(function):
    return (function(STEP) - function(-STEP)) / (2 * STEP)


@pytest.fixture(scope="module")
def system():
    return warped_stuart_landau()


def test_fulfils_the_contract(system):
    assert isinstance(system, System)


def test_state_derivatives(system):
    lin = system.linear(POINT, MU)
    assert np.allclose(lin.matvec(A), central(lambda h: system.residual(POINT + h * A, MU)), **CLOSE)
    assert np.allclose(
        system.d2(POINT, MU, A, B), central(lambda h: system.linear(POINT + h * B, MU).matvec(A)), **CLOSE
    )
    assert np.allclose(system.d3(POINT, MU, A, B, C), central(lambda h: system.d2(POINT + h * C, MU, A, B)), **CLOSE)


@pytest.mark.parametrize("name", ["mu", "w", "c"])
def test_parameter_derivatives_against_the_defaults_of_the_base(system, name):
    assert np.allclose(system.d_parameter(POINT, MU, name), System.d_parameter(system, POINT, MU, name), **CLOSE)
    assert np.allclose(
        system.d2_parameter(POINT, MU, name, A), System.d2_parameter(system, POINT, MU, name, A), **CLOSE
    )
    assert np.allclose(
        system.d_parameters2(POINT, MU, "mu", name), System.d_parameters2(system, POINT, MU, "mu", name), **CLOSE
    )


def test_second_differences_beside_zero():
    """Branches u = 1.3 and u = 1.3 + mu; the residual is linear in the parameter, and its terms cancel."""

    class Crossing(System):
        size = 1

        def residual(self, u, mu):
            c = np.exp(1.3)
            return (1 + mu["mu"]) * np.exp(u) - (c + c * mu["mu"]) - (u - 0.3) * np.exp(u) + c * (u - 0.3)

    for value in (0.0, 1e-10, -2e-11):
        assert abs(Crossing().d_parameters2(np.array([1.3]), {"mu": value}, "mu", "mu")[0]) < 1e-4


def test_a_parameter_far_from_one_has_a_size():
    class Small(System):
        size, parameter_sizes = 1, {"mu": 1e-9}

        def residual(self, u, mu):
            return u * np.log(mu["mu"])

    assert np.isclose(Small().d_parameter(np.array([1.4]), {"mu": 1e-10}, "mu")[0], 1.4e10, rtol=1e-6)


def test_mass_derivatives(system):
    def mass(u, mu, v):
        return system.linear(u, mu).mass_matvec(v)

    assert np.allclose(system.mass_d(POINT, MU, C, A), central(lambda h: mass(POINT + h * A, MU, C)), **CLOSE)
    assert np.allclose(
        system.mass_d2(POINT, MU, C, A, B), central(lambda h: system.mass_d(POINT + h * B, MU, C, A)), **CLOSE
    )
    assert np.allclose(
        system.mass_parameter(POINT, MU, "mu", C),
        central(lambda h: mass(POINT, {**MU, "mu": MU["mu"] + h}, C)),
        **CLOSE,
    )


def test_sparse_assembly_equals_dense():
    points = 7
    sparse = brusselator_1d(points)
    dense = JaxSystem(sparse._residual, 2 * points)
    u = 2.0 + 0.3 * np.sin(np.arange(2 * points))
    mu = {"A": 2.0, "B": 5.0, "l": 0.7, "D1": 0.008, "D2": 0.004}
    assert np.allclose(sparse.linear(u, mu).jacobian.toarray(), dense.linear(u, mu).jacobian, rtol=0, atol=1e-13)


def test_colours_never_share_a_row():
    pattern = sp.random(60, 60, density=0.06, random_state=1) + sp.identity(60)
    colours = colour_columns(pattern)
    pattern = pattern.toarray() != 0
    for colour in range(colours.max() + 1):
        assert pattern[:, colours == colour].sum(axis=1).max() <= 1
    assert colours.max() + 1 < 60


def test_sparse_state_dependent_mass():
    n = 5
    pattern = sp.diags([1.0, 1.0, 1.0], [-1, 0, 1], shape=(n, n))

    def mass(u, mu, v):
        return (1 + u**2) * v + mu["m"] * jnp.concatenate([v[1:], jnp.zeros(1)])

    system = JaxSystem(lambda u, mu: -u, n, mass=mass, sparsity=pattern)
    u, v = np.linspace(0, 1, n), np.arange(1.0, n + 1)
    lin = system.linear(u, {"m": 0.5})
    assert sp.issparse(lin.mass)
    assert np.allclose(lin.mass_matvec(v), mass(u, {"m": 0.5}, v))


def test_unknown_parameter_is_named(system):
    with pytest.raises(KeyError, match="'rho' is not one of: c, mu, w"):
        system.d_parameter(POINT, MU, "rho")
