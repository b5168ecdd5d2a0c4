"""Rubber in the standard states of strain, from the energy by differentiation.

Closed forms (any text on rubber elasticity), with W1 = dW/dI1 and W2 = dW/dI2: nominal stress in uniaxial tension
2 (l - l^-2)(W1 + W2/l), equibiaxial 2 (l - l^-5)(W1 + l^2 W2), pure shear 2 (l - l^-3)(W1 + W2).
Tolerance 1e-9 relative: what the cancelling constants of the fitted rubbers leave of double precision in the closed
forms.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from dbvfiv.fit import uniaxial_stress
from dbvfiv.materials.energy import ENERGIES
from dbvfiv.materials.laws import MooneyRivlin
from dbvfiv.materials.shipped import published_rubber

STRETCHES = np.array([0.6, 0.85, 0.99, 1.001, 1.05, 1.2, 1.6, 2.5])
LAWS = {
    "neo-Hookean": MooneyRivlin.neo_hookean(1e6, 1300.0),
    "Mooney": MooneyRivlin(4e5, 1e5, 0.0, 1300.0),
    "three constants": MooneyRivlin(4e5, 1e5, 2e4, 1300.0),
    "CR 10 %": published_rubber("CR", 0.10),
    "SBR 10 %": published_rubber("SBR", 0.10),
    "EPDM 40 %": published_rubber("EPDM", 0.40),
}


def _strain(first, second):
    none = 0.0 * first
    return jnp.stack([(first**2 - 1) / 2, (second**2 - 1) / 2, none, none, none])


#: One program for all laws: second Piola-Kirchhoff stresses (k, 5) of parameters (n,) at strains (k, 5).
_stresses = jax.jit(jax.vmap(jax.grad(ENERGIES[MooneyRivlin.kind], 1), (None, 0)))


def _stress(law, first, second) -> np.ndarray:
    """At principal stretches (k,)."""
    return np.array(_stresses(law.parameters, _strain(first, second + 0.0 * first).T))


def _slopes(law, first, second):
    """W1 and W2 at the principal stretches first, second, 1/(first second)."""
    squares = np.array([first, second, 1 / (first * second)]) ** 2
    i1, i2 = squares.sum(axis=0), (1 / squares).sum(axis=0)
    return law.c10 + law.c11 * (i2 - 3), law.c01 + law.c11 * (i1 - 3)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_nominal_stresses_in_standard_states(law):
    """Uniaxial, equibiaxial and pure shear."""
    x = STRETCHES
    w1, w2 = _slopes(law, x, x**-0.5)
    expected, found = 2 * (x - x**-2) * (w1 + w2 / x), _stress(law, x, x**-0.5)
    scale = 1e-9 * (abs(expected) + 1e-3 * law.small_strain_shear_modulus)
    assert (abs(x * found[:, 0] - expected) < scale).all()
    assert (abs(found[:, 1]) < scale).all()  # the side is free
    assert (abs(np.array([uniaxial_stress(law, each) for each in x]) - expected) < scale).all()
    w1, w2 = _slopes(law, x, x)
    expected, found = 2 * (x - x**-5) * (w1 + x**2 * w2), _stress(law, x, x)
    np.testing.assert_allclose(x[:, None] * found[:, :2], np.stack([expected, expected], axis=1), rtol=1e-9)
    w1, w2 = _slopes(law, x, 1.0 + 0.0 * x)
    np.testing.assert_allclose(x * _stress(law, x, 1.0)[:, 0], 2 * (x - x**-3) * (w1 + w2), rtol=1e-9)


@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_simple_shear_in_the_plane_and_through_the_thickness(law):
    """I1 = I2 = 3 + g^2 either way, so dW/dg = 2 g (W1 + W2) and both planes are equally stiff."""
    g, none = np.array([1e-3, 0.1, 0.5]), np.zeros(3)
    expected = 2 * g * (law.c10 + law.c01 + 2 * law.c11 * g**2)
    in_plane = np.array(_stresses(law.parameters, np.stack([none, g * g / 2, g, none, none], axis=1)))
    np.testing.assert_allclose(g * in_plane[:, 1] + in_plane[:, 2], expected, rtol=1e-9)
    # x = X + g Z: no strain in the plane, C13 = g and C33 = 1 + g^2 by itself
    for slot in (3, 4):
        across = _stresses(law.parameters, g[:, None] * np.eye(5)[slot])
        np.testing.assert_allclose(across[:, slot], expected, rtol=1e-9)


@pytest.mark.parametrize("pressure, largest, period", [(1.0, 1.079943, 1.29213), (2.0, 1.205003, 1.53042)])
def test_suddenly_pressurised_balloon(pressure, largest, period):
    """C01/C10 = 0.25; p r0/(h0 C10) and r0 sqrt(rho/C10) as units; reference values to the digits given."""
    law = MooneyRivlin(1.0, 0.25, 0.0, 1.0)

    def kinetic(stretch):  # rate^2 / 2, from the balance of energy
        return pressure * (stretch**3 - 1) / 3 - float(law.energy(_strain(stretch, stretch)))

    top = brentq(kinetic, 1.01, 1.5, xtol=1e-13)
    assert top == pytest.approx(largest, abs=6e-7)
    # the square-root ends of the orbit are removed by a cosine substitution
    middle, half = (top + 1) / 2, (top - 1) / 2
    rate = lambda t: half * np.sin(t) / np.sqrt(2 * kinetic(middle - half * np.cos(t)))  # noqa: E731
    time, _ = quad(rate, 1e-4, np.pi - 1e-4, epsrel=1e-8)
    time += 1e-4 * (rate(1e-4) + rate(np.pi - 1e-4))
    assert 2 * time == pytest.approx(period, abs=6e-6)


def test_third_constant_multiplies_both_invariants():
    """C11 (I1 - 3)(I2 - 3), not C20 (I1 - 3)^2: stresses per unit of the constant at stretch 2.

    Uniaxial, I1 - 3 = 2 and I2 - 3 = 1.25 give 3.5 (1.25 + 2/2) = 7.875 against 3.5 x 2 x 2 = 14.
    Equibiaxial, I1 - 3 = 5.0625 and I2 - 3 = 13.5 give 3.9375 (13.5 + 4 x 5.0625) = 132.890625
    against 3.9375 x 2 x 5.0625 = 39.8671875.
    """
    base, more = (MooneyRivlin(4e5, 1e5, c11, 1.0) for c11 in (0.0, 1e3))

    def per_unit(second):
        first = [2 * _stress(law, np.array([2.0]), second)[0, 0] for law in (base, more)]
        return (first[1] - first[0]) / 1e3

    assert per_unit(2**-0.5) == pytest.approx(7.875, rel=1e-8)
    assert per_unit(2.0) == pytest.approx(132.890625, rel=1e-8)
