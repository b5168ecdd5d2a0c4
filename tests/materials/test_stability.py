"""Hill's inequality: against numerical derivatives, closed forms, and the documented table."""

from __future__ import annotations

import re
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dbvfiv.materials import (
    IsotropicElastic,
    MaterialError,
    MooneyRivlin,
    fibre_ply,
    rubber,
    stability_margin,
    stability_warning,
    stable_range,
)
from dbvfiv.materials.hill import hill_moduli
from dbvfiv.materials.stability import hill_margin, principal_log_strains

DOCUMENT = Path(__file__).parents[2] / "docs" / "materials.md"


def _sheet(first, second):
    """Green-Lagrange strains of a sheet stretched along its axes."""
    return np.array([(first**2 - 1) / 2, (second**2 - 1) / 2, 0.0, 0.0, 0.0])


def _principal_energy(law, ln):
    i1, i2 = jnp.sum(jnp.exp(2 * ln)) - 3, jnp.sum(jnp.exp(-2 * ln)) - 3
    return law.c10 * i1 + law.c01 * i2 + law.c11 * i1 * i2


@pytest.mark.parametrize("law", [rubber("SBR", 0.10), rubber("CR", 0.60), MooneyRivlin(1e5, 2e5, 3e4, 1.0)])
def test_moduli_are_the_derivatives_of_the_energy(law):
    rng = np.random.default_rng(2)
    for _ in range(10):
        ln = rng.uniform(-0.4, 0.4, 3)
        ln -= ln.mean()
        moduli = np.tensordot(hill_moduli(ln), law.parameters[:3], axes=([0], [0]))
        tau = np.asarray(jax.grad(_principal_energy, argnums=1)(law, jnp.asarray(ln)))
        second = np.asarray(jax.hessian(_principal_energy, argnums=1)(law, jnp.asarray(ln)))
        basis = np.array([[1, -1, 0], [1, 1, -2]]) / np.sqrt([[2], [6]])
        scale = np.abs(second).max()
        np.testing.assert_allclose(moduli[:2, :2], basis @ second @ basis.T, rtol=0, atol=1e-12 * scale)
        for k, (i, j) in enumerate([(1, 2), (2, 0), (0, 1)]):
            assert moduli[2 + k, 2 + k] == pytest.approx((tau[i] - tau[j]) / (ln[i] - ln[j]), abs=1e-11 * scale)


@pytest.mark.slow
def test_rotating_axes_are_covered():
    """d2W/ds2 along F = exp(s D) F0, D a unit shear between two principal axes.

    It is D : (Jaumann rate of tau), whose factor to tau1 - tau2 is (b1 + b2)/(b1 - b2); the
    modulus per difference of logarithmic strains has the same sign.
    """
    law = MooneyRivlin(1e5, 2e5, 3e4, 1.0)
    ln = np.array([0.2, -0.05, -0.15])
    left = np.exp(2 * ln)

    def energy(s):
        stretch = jax.scipy.linalg.expm(s * jnp.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]))
        b = stretch @ jnp.diag(left) @ stretch
        i1 = jnp.trace(b) - 3
        i2 = (jnp.trace(b) ** 2 - jnp.trace(b @ b)) / 2 - 3
        return law.c10 * i1 + law.c01 * i2 + law.c11 * i1 * i2

    second = float(jax.grad(jax.grad(energy))(0.0))
    tau = np.asarray(jax.grad(_principal_energy, argnums=1)(law, jnp.asarray(ln)))
    moduli = np.tensordot(hill_moduli(ln), law.parameters[:3], axes=([0], [0]))
    jaumann = (left[0] + left[1]) / (left[0] - left[1]) * (tau[0] - tau[1])
    assert second == pytest.approx(2 * jaumann, rel=1e-10)
    assert np.sign(jaumann) == np.sign(moduli[4, 4])


def test_margin_is_one_at_rest_for_every_law():
    for law in (rubber("SBR"), IsotropicElastic(1e6, 0.3, 1.0), fibre_ply()):
        for measure in ("hill", "tangent"):
            assert stability_margin(law, np.zeros((2, 3, 5)), measure) == pytest.approx(np.ones((2, 3)), rel=1e-12)


@given(st.floats(0.01, 2.0), st.floats(0.0, 2.0), st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
def test_mooney_with_non_negative_constants_is_always_stable(c10, c01, first, second):
    law = MooneyRivlin(c10 * 1e6, c01 * 1e6, 0.0, 1300.0)
    assert hill_margin(law, [first, second, -first - second]) > 0.0


def test_strains_give_their_stretches_whatever_the_axes():
    rng = np.random.default_rng(3)
    for _ in range(20):
        ln = rng.uniform(-0.5, 0.5, 3)
        ln -= ln.mean()
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        c = turn @ np.diag(np.exp(2 * ln)) @ turn.T
        e = [(c[0, 0] - 1) / 2, (c[1, 1] - 1) / 2, c[0, 1], c[0, 2], c[1, 2]]
        np.testing.assert_allclose(principal_log_strains(e), np.sort(ln), atol=1e-12)


def test_impossible_strains_are_beyond_every_limit():
    law = rubber("CR")
    strains = [[-0.6, 0.0, 0, 0, 0], [-0.6, -0.6, 0, 0, 0], [0, 0, 1.1, 0, 0], [np.nan, 0, 0, 0, 0], [0, 0, 0, 0, 0]]
    for measure in ("hill", "tangent"):
        assert list(np.isneginf(stability_margin(law, strains, measure))) == [True] * 4 + [False]


def test_two_constant_limit_in_closed_form():
    """c11 = 0: equibiaxial tension loses the in-plane shear where c10 + c01 l^-4 = 0."""
    law = rubber("SBR", 0.2, terms=2)
    limit = (-law.c01 / law.c10) ** 0.25
    assert stable_range(law).equibiaxial[1] == pytest.approx(limit, rel=1e-9)


def test_states_of_the_same_stretches_are_one_state():
    """Equibiaxial tension of a sheet is compression through its thickness."""
    limits = stable_range(rubber("EPDM", 0.2))
    assert limits.equibiaxial[1] ** -2 == pytest.approx(limits.uniaxial[0], rel=1e-9)
    assert (
        limits.equivalent_strain
        <= min(-np.log(limits.uniaxial[0]), 2 / np.sqrt(3) * np.log(limits.pure_shear[1])) + 1e-12
    )


def test_margin_changes_sign_at_the_range():
    law = rubber("SBR", 0.10)
    limits = stable_range(law)
    for edge, path in (
        (limits.uniaxial[0], lambda s: _sheet(s, s**-0.5)),
        (limits.equibiaxial[1], lambda s: _sheet(s, s)),
        (limits.pure_shear[0], lambda s: _sheet(s, 1.0)),
        (limits.pure_shear[1], lambda s: _sheet(s, 1.0)),
    ):
        inside, outside = 1 + (edge - 1) * (1 - 1e-4), 1 + (edge - 1) * (1 + 1e-4)
        assert stability_margin(law, path(inside)) > 0 > stability_margin(law, path(outside))


def test_green_lagrange_tangent_is_another_matter():
    """W = C01 (I2 - 3) is a sound material whose tangent turns at the stretch 4^(1/3)."""
    law = MooneyRivlin(0.0, 1e6, 0.0, 1.0)
    edge = 4 ** (1 / 3)
    below, above = (_sheet(s, s**-0.5) for s in (0.9 * edge, 1.3 * edge))
    assert stability_margin(law, above, "tangent") < 0.0 < stability_margin(law, above, "hill")
    uniaxial = jax.grad(lambda c: 2 * jnp.sqrt(c) + 1 / c)
    assert jax.grad(uniaxial)(edge**2) == pytest.approx(0.0, abs=1e-12)
    tangent = np.asarray(jax.hessian(law.energy)(jnp.asarray(below)))
    rest = np.asarray(jax.hessian(law.energy)(jnp.zeros(5)))
    ratio = np.linalg.eigvals(np.linalg.solve(rest, tangent)).real.min()
    assert stability_margin(law, below, "tangent") == pytest.approx(ratio, rel=1e-9)


def test_warning_counts_and_places_the_loss():
    law = rubber("SBR", 0.10)
    fine, lost = _sheet(1.005, 1.005), _sheet(1.05, 1.05)
    assert stability_warning("SBR", law, [fine, fine]) is None
    sentence = stability_warning("SBR", law, [[fine, lost], [fine, fine]])
    assert "SBR" in sentence and "1 of 4 strains" in sentence and "0.907, 1.050, 1.050" in sentence
    assert "no sheet can reach" in stability_warning("SBR", law, [[-0.7, 0, 0, 0, 0]])
    assert stability_warning("ply", fibre_ply(), [lost]) is None


def test_linear_laws_have_no_limits():
    assert stable_range(fibre_ply()).uniaxial == (0.0, np.inf)


def test_bad_questions_are_refused():
    with pytest.raises(MaterialError, match="five components"):
        stability_margin(rubber("CR"), np.zeros(3))
    with pytest.raises(MaterialError, match="hill, tangent"):
        stability_margin(rubber("CR"), np.zeros(5), "drucker")


def _documented_rows():
    for line in DOCUMENT.read_text().splitlines():
        cells = [c.strip() for c in line.strip().strip("|").split("|")]
        if re.fullmatch(r"(CR|SBR|EPDM)", cells[0]) and len(cells) == 11:
            yield cells


def test_the_documented_table_is_true():
    """docs/materials.md: every set, to the digits printed."""
    rows = list(_documented_rows())
    assert len(rows) == 24
    for name, level, terms, modulus, *cells in rows:
        law = rubber(name, float(level.split()[0]) / 100, terms=int(terms))
        found = stable_range(law)
        numbers = [*found.uniaxial, *found.equibiaxial, *found.pure_shear, found.equivalent_strain]
        assert modulus == f"{law.small_strain_shear_modulus / 1e6:.3f}"
        assert cells == ["none" if n in (0.0, np.inf) else f"{n:.3f}" for n in numbers]
