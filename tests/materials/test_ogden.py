"""Ogden's law in a wall: energy by stretches, plane stress in closed form, compiled loops, the neo-Hookean case."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dbvfiv.api import Valve
from dbvfiv.materials.energy import plane_stress_invariants, rubber_energy
from dbvfiv.materials.laws import MaterialError, MooneyRivlin, Ogden
from dbvfiv.materials.stability import hill_margin, principal_log_strains, stability_margin
from dbvfiv.shell.kernel_rubber import rubber_tangent
from dbvfiv.studies.case import thesis_case

#: Ogden's own constants for Treloar's rubber (1972).
TRELOAR = Ogden((0.618e6, 1.18e3, -9.81e3), (1.3, 5.0, -2.0), 1000.0)
STEEP = Ogden((2e5, 3e4, -8e4), (1.7, 12.0, -4.0), 1000.0)
STRAINS = np.random.default_rng(4).uniform(-0.15, 0.3, (12, 5))


def by_stretches(law, e):
    """The energy as it is written, of the stretches by an eigenvalue solver."""
    c = np.array([[1 + 2 * e[0], e[2], e[3]], [e[2], 1 + 2 * e[1], e[4]], [e[3], e[4], 0.0]])
    c[2, 2] = 3.0 + plane_stress_invariants(e).i1_minus_3 - c[0, 0] - c[1, 1]
    stretches = np.sqrt(np.linalg.eigvalsh(c))
    return sum(mu / alpha * (np.sum(stretches**alpha) - 3.0) for mu, alpha in zip(law.mu, law.alpha))


#: Compiled once for all laws of as many terms.
energy_of, stress_of, tangent_of = (
    jax.jit(f) for f in (rubber_energy, jax.grad(rubber_energy, argnums=1), jax.hessian(rubber_energy, argnums=1))
)
LAWS = pytest.mark.parametrize("law", [TRELOAR, STEEP], ids=["Treloar", "steep"])


@LAWS
def test_energy_is_that_of_the_stretches(law):
    expected = [by_stretches(law, e) for e in STRAINS]
    assert np.asarray(law.energy(STRAINS.T)) == pytest.approx(expected, rel=1e-12)
    assert [float(energy_of(law.parameters, e)) for e in STRAINS] == pytest.approx(expected, rel=1e-12)


@LAWS
@pytest.mark.parametrize("stretch", [0.6, 0.9, 1.0 + 1e-6, 1.3, 2.0, 4.0])
def test_tension_and_equibiaxial_tension_in_closed_form(law, stretch):
    """Nominal stress: the sum of mu (l^(alpha - 1) - l^(-alpha/2 - 1)), and - l^(-2 alpha - 1) where two sides pull."""
    mu, alpha = np.array(law.mu), np.array(law.alpha)
    for sides, thin in ((stretch**-0.5, 0.5), (stretch, 2.0)):
        e = jnp.array([(stretch**2 - 1) / 2, (sides**2 - 1) / 2, 0.0, 0.0, 0.0])
        expected = np.sum(mu * (stretch ** (alpha - 1) - stretch ** (-thin * alpha - 1)))
        found = np.asarray(stress_of(law.parameters, e)) * stretch
        assert found[0] == pytest.approx(expected, rel=1e-9, abs=1e-9 * law.small_strain_shear_modulus)
        second = 0.0 if thin == 0.5 else expected
        assert found[1] == pytest.approx(second, rel=1e-9, abs=1e-9 * law.small_strain_shear_modulus * stretch**10)


@LAWS
def test_compiled_stress_and_tangent_are_those_of_the_energy(law):
    scale, compiled = law.small_strain_shear_modulus, np.zeros((5, 5))
    for e in (size * strain for size in (1.0, 1e-3, 0.0) for strain in STRAINS):
        found = np.zeros(5)
        rubber_tangent(law.parameters, e, found, compiled)
        stress, tangent = (np.asarray(f(law.parameters, e)) for f in (stress_of, tangent_of))
        assert np.abs(np.triu(compiled) - np.triu(tangent)).max() < 1e-12 * np.abs(tangent).max()
        assert np.abs(found - stress).max() < 1e-12 * max(np.abs(stress).max(), scale)


@pytest.mark.slow
def test_derivatives_to_the_fourth_are_those_of_mooney_and_rivlin_where_both_are_one():
    """W = C10 (I1 - 3) + C01 (I2 - 3) is Ogden's with alpha 2 and -2; also at rest, where the stretches are equal."""
    polynomial = MooneyRivlin(4e5, 1e5, 0.0, 1000.0)
    ogden = Ogden((8e5, -2e5), (2.0, -2.0), 1000.0)
    ways = jnp.asarray(np.random.default_rng(5).standard_normal((4, 5)))

    def derivatives(f):
        """Derivatives along the first way, the first two, three and four; uncompiled, which takes half the time."""
        for way in ways:
            f = (lambda f, w: lambda x: jax.jvp(f, (x,), (w,)))(f, way)
        found = jax.vmap(f)(jnp.asarray([np.zeros(5), STRAINS[0], STRAINS[1]]))
        orders = found[0][0][0][1], found[0][0][1][1], found[0][1][1][1], found[1][1][1][1]
        return [np.asarray(order) for order in orders]

    for found, expected in zip(derivatives(ogden.energy), derivatives(polynomial.energy)):
        assert found == pytest.approx(expected, rel=1e-10, abs=1e-7)


def test_energy_goes_on_analytically_to_complex_strains():
    """Its holomorphic gradient at real strains is that of these, and a complex step finds it again."""
    continued = jax.jit(jax.grad(rubber_energy, argnums=1, holomorphic=True))
    way, step = STRAINS[-1], 1e-5
    for law in (TRELOAR, STEEP):
        scale = law.small_strain_shear_modulus
        for e in (np.zeros(5), *STRAINS):
            expected = np.asarray(stress_of(law.parameters, e))
            size = max(np.abs(expected).max(), scale)
            assert np.abs(np.asarray(continued(law.parameters, e + 0j)) - expected).max() < 1e-11 * size
            ahead = complex(energy_of(law.parameters, e + 1j * step * way))
            assert ahead.imag / step == pytest.approx(expected @ way, abs=1e-7 * size)


def test_neo_hookean_is_one_term_with_exponent_two():
    law, ogden = MooneyRivlin.neo_hookean(1.1e6, 1300.0), Ogden((1.1e6,), (2.0,), 1300.0)
    assert ogden.small_strain_shear_modulus == law.small_strain_shear_modulus
    logs = principal_log_strains(STRAINS)
    np.testing.assert_allclose(hill_margin(ogden, logs), hill_margin(law, logs), rtol=1e-12)
    np.testing.assert_allclose(stability_margin(ogden, STRAINS, 2.0), stability_margin(law, STRAINS, 2.0), rtol=1e-12)


@pytest.mark.parametrize(
    "mu, alpha, words",
    [
        ((), (), "as many entries"),
        ((1e6,), (2.0, 3.0), "as many entries"),
        ((1e6,), (0.0,), "must not be 0"),
        ((-1e6,), (2.0,), "greater than zero"),
        ((float("nan"),), (2.0,), "finite"),
    ],
)
def test_constants_that_no_rubber_has(mu, alpha, words):
    with pytest.raises(MaterialError, match=words):
        Ogden(mu, alpha, 1000.0)


@pytest.fixture(scope="module")
def pair():
    """The 12-inch valve with rubber of one law, said as neo-Hookean and as one term of Ogden's."""
    common = {"density": 1300.0, "loss_factor": 0.1}
    neo_hookean = {"kind": "neo-hookean", "shear_modulus": 1.1e6} | common
    one_term = {"kind": "ogden", "mu": [1.1e6], "alpha": [2.0]} | common
    small = {"mesh.around": 6, "mesh.along": 8, "damping.model": "loss factor"}
    return [
        Valve(thesis_case(small | {f"materials.{name}": card for name in ("CR", "SBR", "EPDM")}))
        for card in (neo_hookean, one_term)
    ]


@pytest.mark.slow
def test_a_valve_of_one_term_stands_as_the_neo_hookean_one(pair):
    known, found = (valve.steady(pressure=18e3) for valve in pair)
    assert found.mass_flow == pytest.approx(known.mass_flow, rel=1e-11)
    assert found.lip_displacement == pytest.approx(known.lip_displacement, rel=1e-11)


@pytest.mark.slow
def test_its_modes_and_its_motion_are_the_same(pair):
    known, found = (valve.modes("6 kPa", count=2) for valve in pair)
    assert [m.growth_rate for m in found.modes] == pytest.approx([m.growth_rate for m in known.modes], rel=1e-7)
    assert [m.frequency for m in found.modes] == pytest.approx([m.frequency for m in known.modes], rel=1e-8)
    known, found = (valve.transient("4 ms", pressure="6 kPa").history for valve in pair)
    for name in ("lip_displacement", "strain_energy"):
        assert found[name] == pytest.approx(known[name], rel=1e-8)
