"""The energies: identities, derivatives, objectivity."""

from __future__ import annotations

from decimal import Decimal, localcontext
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from dbvfiv.materials.energy import ENERGIES, mooney_rivlin_energy, plane_stress_invariants, rubber_energy
from dbvfiv.materials.laws import (
    IsotropicElastic,
    MaterialError,
    MooneyRivlin,
    OrthotropicPly,
    SofteningRubber,
    Yeoh,
    fibre_ply,
)
from dbvfiv.materials.shipped import published_rubber, rubber

LAWS = {
    "SBR 10 %": published_rubber("SBR", 0.10),
    "CR 60 %": published_rubber("CR", 0.60),
    "neo-Hookean": MooneyRivlin.neo_hookean(1.1e6, 1300.0),
    "Yeoh": Yeoh(0.3e6, -0.02e6, 0.01e6, 1300.0),
    "softening": SofteningRubber(0.2e6, 1e6, 4e-3, 9e6, 1300.0, 5e7),
    "stable EPDM 20 %": rubber("EPDM", 0.20),
    "isotropic": IsotropicElastic(6e6, 0.49, 1300.0),
    "ply": fibre_ply(),
}
ISOTROPIC = [name for name in LAWS if name != "ply"]
STRAINS = np.random.default_rng(4).uniform(-0.15, 0.3, (20, 5))
#: Compiled once for all laws of a kind.
stress_of, tangent_of = (
    {kind: jax.jit(derivative(energy, argnums=1)) for kind, energy in ENERGIES.items()}
    for derivative in (jax.grad, jax.hessian)
)


@pytest.fixture(params=LAWS)
def law(request):
    return LAWS[request.param]


def _textbook_invariants(e):
    """I1 - 3 and I2 - 3 as the definitions read, det C = 1 giving C33."""
    c11, c22, c12, c13, c23 = 1 + 2 * e[0], 1 + 2 * e[1], e[2], e[3], e[4]
    det = c11 * c22 - c12 * c12
    c33 = 1 / det + (c22 * c13 * c13 - 2 * c12 * c13 * c23 + c11 * c23 * c23) / det
    i1 = c11 + c22 + c33
    square = c11**2 + c22**2 + c33**2 + 2 * (c12**2 + c13**2 + c23**2)
    return i1 - 3, (i1 * i1 - square) / 2 - 3


@pytest.mark.parametrize("size", [Fraction(1), Fraction(1, 10**6)])
def test_invariants_equal_their_definitions_exactly(size):
    rng = np.random.default_rng(1)
    for row in rng.integers(-150, 300, (50, 5)):
        e = [size * Fraction(int(v), 1000) for v in row]
        i1, i2 = _textbook_invariants(e)
        got = plane_stress_invariants(e)
        assert (got.i1_minus_3, got.i2_minus_3, got.i2_minus_i1) == (i1, i2, i2 - i1)


@pytest.mark.parametrize("size", [1e-2, 1e-5, 1e-8])
def test_small_strains_lose_no_digits(size):
    parameters = published_rubber("SBR", 0.10).parameters
    exact_parameters = [Fraction(p) for p in parameters]
    for e in size * STRAINS:
        exact = float(mooney_rivlin_energy(exact_parameters, [Fraction(v) for v in e]))
        assert mooney_rivlin_energy(parameters, e) == pytest.approx(exact, rel=1e-13)


@pytest.mark.parametrize("size", [1e-2, 1e-5, 1e-8])
def test_knee_loses_no_digits_at_small_strain(size):
    law = SofteningRubber(0.0, 1e6, 4e-3, 0.0, 1300.0)
    for e in size * STRAINS:
        x = plane_stress_invariants([Fraction(v) for v in e]).i1_minus_3
        with localcontext() as context:
            context.prec = 60
            ratio = 1 + Decimal(x.numerator) / Decimal(x.denominator) / Decimal(law.x_0)
            exact = float(Decimal(law.mu_0) * Decimal(law.x_0) * (ratio.sqrt() - 1))
        assert law.energy(e) == pytest.approx(exact, rel=1e-13)


def test_softening_energy_is_its_formula():
    law = LAWS["softening"]
    for e in STRAINS:
        x = plane_stress_invariants(e).i1_minus_3
        knee = 2 * law.mu_0 * law.x_0 * (np.sqrt(1 + x / law.x_0) - 1)
        assert law.energy(e) == pytest.approx(
            (law.mu_inf * x + knee + law.c * x**2 / 2 + law.c_3 * x**3 / 3) / 2, rel=1e-12
        )


def test_rubber_without_a_knee_has_finite_derivatives_by_its_constants():
    law = published_rubber("CR")
    for derivative in (jax.grad, jax.hessian):
        assert np.all(np.isfinite(jax.jit(derivative(rubber_energy))(law.parameters, STRAINS[0])))


def test_kirchhoff_energy_is_the_laminate_formula():
    ply = OrthotropicPly(150e9, 9e9, 0.3, 5e9, 4e9, 3e9, 1600.0)
    compliance = np.array([[1 / 150e9, -0.3 / 150e9, 0], [-0.3 / 150e9, 1 / 9e9, 0], [0, 0, 1 / 5e9]])
    e = np.array([1e-3, -2e-3, 3e-3, 4e-3, 5e-3])
    expected = 0.5 * (e[:3] @ np.linalg.solve(compliance, e[:3]) + 4e9 * e[3] ** 2 + 3e9 * e[4] ** 2)
    assert float(ply.energy(e)) == pytest.approx(expected, rel=1e-14)


def test_isotropic_is_the_equal_ply():
    same = OrthotropicPly(6e6, 6e6, 0.3, 6e6 / 2.6, 6e6 / 2.6, 6e6 / 2.6, 1.0)
    np.testing.assert_allclose(same.parameters, IsotropicElastic(6e6, 0.3, 1.0).parameters, rtol=1e-15)


def test_reference_state_is_free_and_has_the_small_strain_stiffness(law):
    zero = jnp.zeros(5)
    assert float(law.energy(zero)) == 0.0
    np.testing.assert_array_equal(stress_of[law.kind](law.parameters, zero), 0.0)
    tangent = np.asarray(tangent_of[law.kind](law.parameters, zero))
    assert tangent[2, 2] == pytest.approx(law.small_strain_shear_modulus, rel=1e-14)
    assert np.linalg.eigvalsh(tangent)[0] > 0.0


def test_rubber_at_rest_is_incompressible_plane_stress():
    law = published_rubber("EPDM", 0.2)
    mu = law.small_strain_shear_modulus
    expected = mu * np.array([[4, 2, 0, 0, 0], [2, 4, 0, 0, 0], [0, 0, 1, 0, 0], [0, 0, 0, 1, 0], [0, 0, 0, 0, 1]])
    np.testing.assert_allclose(tangent_of[law.kind](law.parameters, jnp.zeros(5)), expected, rtol=1e-13, atol=1e-6)


def test_stress_by_complex_step(law):
    """Plain arithmetic throughout, so the step goes through without jax."""
    for e in STRAINS:
        by_jax = np.asarray(stress_of[law.kind](law.parameters, e))
        by_step = [np.imag(complex(law.energy(e + 1e-30j * np.eye(5)[i]))) / 1e-30 for i in range(5)]
        np.testing.assert_allclose(by_jax, by_step, rtol=1e-11, atol=1e-12 * np.abs(by_jax).max())


def test_tangent_is_symmetric_and_the_derivative_of_the_stress(law):
    step = 1e-5

    def stress(e):
        return stress_of[law.kind](law.parameters, e)

    for e in STRAINS:
        t = np.asarray(tangent_of[law.kind](law.parameters, e))
        scale = np.abs(t).max()
        np.testing.assert_allclose(t, t.T, rtol=0, atol=1e-13 * scale)
        numeric = np.array([(stress(e + d) - stress(e - d)) / (2 * step) for d in step * np.eye(5)])
        np.testing.assert_allclose(t, numeric, rtol=0, atol=1e-7 * scale)


def _turned(e, angle):
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, s], [-s, c]])
    plane = turn @ np.array([[e[0], e[2] / 2], [e[2] / 2, e[1]]]) @ turn.T
    shear = turn @ e[3:]
    return np.array([plane[0, 0], plane[1, 1], 2 * plane[0, 1], *shear])


@pytest.mark.parametrize("name", ISOTROPIC)
def test_isotropic_laws_have_no_preferred_direction(name):
    law = LAWS[name]
    for e in STRAINS:
        for angle in (0.3, 1.2, 2.9):
            assert float(law.energy(_turned(e, angle))) == pytest.approx(float(law.energy(e)), rel=1e-11)


def test_ply_has_one():
    ply, e = LAWS["ply"], STRAINS[0]
    assert float(ply.energy(_turned(e, np.pi))) == pytest.approx(float(ply.energy(e)), rel=1e-12)
    assert float(ply.energy(_turned(e, 0.5))) != pytest.approx(float(ply.energy(e)), rel=0.01)


@pytest.mark.parametrize(
    "make, words",
    [
        (lambda: MooneyRivlin(-2e6, 1e6, 0.0, 1300.0), "shear modulus"),
        (lambda: MooneyRivlin(float("nan"), 1e6, 0.0, 1300.0), "c10 must be a finite number"),
        (lambda: MooneyRivlin(1e6, "1e6", 0.0, 1300.0), "c01 must be a finite number"),
        (lambda: MooneyRivlin(1e6, 1e6, 0.0, 0.0), "density must be greater than zero"),
        (lambda: MooneyRivlin.neo_hookean(-1.0, 1300.0), "shear_modulus"),
        (lambda: IsotropicElastic(-1.0, 0.3, 1.0), "youngs_modulus"),
        (lambda: IsotropicElastic(1.0, 0.51, 1.0), "poisson_ratio"),
        (lambda: IsotropicElastic(1.0, -1.0, 1.0), "poisson_ratio"),
        (lambda: OrthotropicPly(1e6, 1e6, 1.0, 1e6, 1e6, 1e6, 1.0), "nu12"),
        (lambda: OrthotropicPly(1e6, 1e6, 0.1, 0.0, 1e6, 1e6, 1.0), "g12"),
    ],
)
def test_impossible_constants_are_refused(make, words):
    with pytest.raises(MaterialError, match=words):
        make()
