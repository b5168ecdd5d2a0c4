"""Hill's inequality: against numerical derivatives, closed forms, and the documented table."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from dbvfiv.materials.energy import rubber_energy
from dbvfiv.materials.laws import IsotropicElastic, MaterialError, MooneyRivlin, SofteningRubber, Yeoh, fibre_ply
from dbvfiv.materials.shipped import published_rubber, rubber, rubber_names, strain_levels
from dbvfiv.materials.stability import hill_margin, principal_log_strains, rubber_moduli, stability_margin, stable_range

DOCUMENT = Path(__file__).parents[2] / "docs/evidence/materials.md"


def _sheet(first, second):
    """Green-Lagrange strains of a sheet stretched along its axes."""
    return np.array([(first**2 - 1) / 2, (second**2 - 1) / 2, 0.0, 0.0, 0.0])


def _energy_of_invariants(parameters, i1, i2):
    c10, c01, c11, c20, c30, m0, x0 = (parameters[i] for i in range(7))
    x0 = x0 + (x0 == 0.0)
    knee = m0 * x0 * (jnp.sqrt(1 + i1 / x0) - 1)
    return c10 * i1 + c01 * i2 + c11 * i1 * i2 + c20 * i1**2 + c30 * i1**3 + knee


def _principal_energy(parameters, ln):
    return _energy_of_invariants(parameters, jnp.sum(jnp.exp(2 * ln)) - 3, jnp.sum(jnp.exp(-2 * ln)) - 3)


_tau, _second = (jax.jit(derivative(_principal_energy, argnums=1)) for derivative in (jax.grad, jax.hessian))


def _moduli(law, ln):
    return rubber_moduli(law.parameters, ln)


LAWS = [
    published_rubber("SBR", 0.10),
    published_rubber("CR", 0.60),
    MooneyRivlin(1e5, 2e5, 3e4, 1.0),
    Yeoh(1e5, -2e4, 3e4, 1.0),
    rubber("SBR", 0.10),
    SofteningRubber(0.1e6, 1e6, 2e-3, 5e6, 1.0),
]


@pytest.mark.parametrize("law", LAWS)
def test_moduli_are_the_derivatives_of_the_energy(law):
    rng = np.random.default_rng(2)
    for _ in range(10):
        ln = rng.uniform(-0.4, 0.4, 3)
        ln -= ln.mean()
        moduli = _moduli(law, ln)
        tau, second = (np.asarray(f(law.parameters, ln)) for f in (_tau, _second))
        basis = np.array([[1, -1, 0], [1, 1, -2]]) / np.sqrt([[2], [6]])
        scale = np.abs(second).max()
        np.testing.assert_allclose(moduli[:2, :2], basis @ second @ basis.T, rtol=0, atol=1e-12 * scale)
        for k, (i, j) in enumerate([(1, 2), (2, 0), (0, 1)]):
            assert moduli[2 + k, 2 + k] == pytest.approx((tau[i] - tau[j]) / (ln[i] - ln[j]), abs=1e-11 * scale)


def test_margin_is_one_at_rest_for_every_law():
    for law in (published_rubber("SBR"), IsotropicElastic(1e6, 0.3, 1.0), fibre_ply()):
        for r in (1.0, 1.6):
            assert stability_margin(law, np.zeros((2, 3, 5)), r) == pytest.approx(np.ones((2, 3)), rel=1e-12)


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
    law = published_rubber("CR")
    strains = [[-0.6, 0.0, 0, 0, 0], [-0.6, -0.6, 0, 0, 0], [0, 0, 1.1, 0, 0], [np.nan, 0, 0, 0, 0], [0, 0, 0, 0, 0]]
    for r in (1.0, 1.6):
        assert list(np.isneginf(stability_margin(law, strains, r))) == [True] * 4 + [False]


def test_two_constant_limit_in_closed_form():
    """c11 = 0: equibiaxial tension loses the in-plane shear where c10 + c01 l^-4 = 0."""
    law = published_rubber("SBR", 0.2, terms=2)
    limit = (-law.c01 / law.c10) ** 0.25
    assert stable_range(law).equibiaxial[1] == pytest.approx(limit, rel=1e-9)


def test_margin_changes_sign_at_the_range():
    law = published_rubber("SBR", 0.10)
    limits = stable_range(law)
    for edge, path in (
        (limits.uniaxial[0], lambda s: _sheet(s, s**-0.5)),
        (limits.equibiaxial[1], lambda s: _sheet(s, s)),
        (limits.pure_shear[0], lambda s: _sheet(s, 1.0)),
        (limits.pure_shear[1], lambda s: _sheet(s, 1.0)),
    ):
        inside, outside = 1 + (edge - 1) * (1 - 1e-4), 1 + (edge - 1) * (1 + 1e-4)
        assert stability_margin(law, path(inside)) > 0 > stability_margin(law, path(outside))


#: Traceless stretchings of unit size.
_STRETCHINGS = np.zeros((5, 3, 3))
_STRETCHINGS[:2] = [np.diag([1, -1, 0]) / np.sqrt(2), np.diag([1, 1, -2]) / np.sqrt(6)]
for _k, (_i, _j) in enumerate([(1, 2), (2, 0), (0, 1)]):
    _STRETCHINGS[2 + _k, _i, _j] = _STRETCHINGS[2 + _k, _j, _i] = np.sqrt(0.5)


#: Compiled once for all laws.
_stress, _tangent = (jax.jit(derivative(rubber_energy, argnums=1)) for derivative in (jax.grad, jax.hessian))


def _instantaneous_moduli(law, e, r):
    """r E' : C : E' + 2 tau : (D D) on all D, (5, 5), by the derivatives of the plane-stress energy."""
    s11, s22, s12, s13, s23 = np.asarray(_stress(law.parameters, e))
    tangent = np.asarray(_tangent(law.parameters, e))
    c = np.array([[1 + 2 * e[0], e[2], e[3]], [e[2], 1 + 2 * e[1], e[4]], [e[3], e[4], 0.0]])
    c[2, 2] = 1 / np.linalg.det(c[:2, :2]) + c[2, :2] @ np.linalg.solve(c[:2, :2], c[2, :2])
    f = np.linalg.cholesky(c).T
    tau = f @ np.array([[s11, s12, s13], [s12, s22, s23], [s13, s23, 0.0]]) @ f.T
    rates = [f.T @ d @ f for d in _STRETCHINGS]
    rates = np.array([[x[0, 0], x[1, 1], 2 * x[0, 1], 2 * x[0, 2], 2 * x[1, 2]] for x in rates])
    product = np.einsum("aij,bjk->abik", _STRETCHINGS, _STRETCHINGS)
    return r * rates @ tangent @ rates.T + np.einsum("ij,abji->ab", tau, product + np.swapaxes(product, 0, 1))


@pytest.mark.parametrize("law", LAWS)
def test_slow_criterion_is_that_of_the_hill_moduli(law):
    """Of rates D of turning axes shear moduli are x coth x times those of rates of logarithmic strain."""
    for e in np.random.default_rng(6).uniform(-0.15, 0.3, (12, 5)):
        ln = principal_log_strains(e)
        moduli = _moduli(law, ln)
        for k, (i, j) in enumerate([(1, 2), (2, 0), (0, 1)]):
            moduli[2 + k, 2 + k] *= (ln[i] - ln[j]) / np.tanh(ln[i] - ln[j])
        found, expected = (np.linalg.eigvalsh(m) for m in (_instantaneous_moduli(law, e, 1.0), moduli))
        np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


#: Ways through states of a sheet, with transverse shear in the last.
PATHS = {
    "equibiaxial": lambda s: _sheet(1 + s, 1 + s),
    "pure shear": lambda s: _sheet(1 + s, 1.0),
    "compression": lambda s: _sheet(1 - s, (1 - s) ** -0.5),
    "sheared": lambda s: np.array([s, 0.6 * s, -0.4 * s, 0.5 * s, -0.7 * s]),
}


@pytest.mark.parametrize("path", PATHS)
@pytest.mark.parametrize("law", [published_rubber("SBR", 0.10), published_rubber("EPDM", 0.40)])
def test_margin_vanishes_with_the_moduli_slow_and_instantaneous(law, path):
    ends = []
    for r in (1.0, 1.6, 20.0):
        way = np.linspace(0.0, 0.2, 401)
        first = int(np.argmax(stability_margin(law, [PATHS[path](s) for s in way], r) <= 0))
        end = brentq(lambda s: float(stability_margin(law, PATHS[path](s), r)), way[first - 1], way[first], xtol=1e-14)
        values = np.concatenate([np.linalg.eigvalsh(_instantaneous_moduli(law, PATHS[path](end), x)) for x in {1.0, r}])
        assert abs(values.min()) < 1e-8 * values.max()
        ends.append(end)
    assert np.all(np.diff(ends) < 1e-12)


def test_instant_of_a_sound_material():
    """W = C01 (I2 - 3) is stable however slowly strained; in an instant tension of a large r has it lose that.

    Its Green-Lagrange tangent, which is what is left of the criterion at a large r, turns at the stretch 4^(1/3).
    """
    law = MooneyRivlin(0.0, 1e6, 0.0, 1.0)
    edge = 4 ** (1 / 3)
    below, above = (_sheet(s, s**-0.5) for s in (0.999 * edge, 1.001 * edge))
    assert stability_margin(law, above) > 0.0 > stability_margin(law, above, 1e6)
    assert stability_margin(law, below, 1e6) > 0.0


@pytest.mark.parametrize("level", [0.1, 0.14, 0.2, 0.3, 0.4, 0.5, 0.6])
@pytest.mark.parametrize("name", rubber_names())
def test_shipped_rubbers_are_stable_at_every_level_and_in_every_state(name, level):
    """All isochoric states to logarithmic strains of ln 10; those to 1.2 in an instant of any r, normals anywhere."""
    law = rubber(name, level)
    assert stable_range(law).equivalent_strain == np.inf
    assert stability_margin(law, _states(1.2), 2.56).min() > 0.15
    assert stability_margin(law, _states(1.2), 1e9).min() > 0.05


@cache
def _states(reach):
    """Strains (k, 5) of sheets whose principal logarithmic strains fill a ball, in axes turned at random."""
    rng = np.random.default_rng(7)
    angle, size = np.meshgrid(np.linspace(0, 2 * np.pi, 48, endpoint=False), np.linspace(0, reach, 25))
    ln = (size[..., None] * np.cos(angle[..., None] - np.arange(3) * 2 * np.pi / 3)).reshape(-1, 3)
    turns = [np.eye(3), *(np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(4))]
    c = np.concatenate([(turn * np.exp(2 * ln)[:, None]) @ turn.T for turn in turns])
    return np.stack([(c[:, 0, 0] - 1) / 2, (c[:, 1, 1] - 1) / 2, c[:, 0, 1], c[:, 0, 2], c[:, 1, 2]], axis=-1)


@pytest.mark.slow
@settings(max_examples=20)
@given(st.floats(0.0, 1.0), st.floats(-8.0, 2.0), st.floats(0.0, 1e3), st.floats(0.0, 1e3))
def test_softening_rubber_is_stable_whatever_its_constants(mu_inf, log_knee, c, c_3):
    """With mu_inf of mu_0/200 or more: without it the power law loses a three hundredth of its stiffness."""
    law = SofteningRubber((0.005 + mu_inf) * 1e6, 1e6, 10.0**log_knee, c * 1e6, 1.0, c_3 * 1e6)
    assert stable_range(law).equivalent_strain == np.inf


def test_power_law_alone_is_not_quite_stable():
    law = SofteningRubber(0.0, 1e6, 0.0041, 0.0, 1.0)
    assert 0.1 < stable_range(law).equivalent_strain < 0.3
    assert -0.004 < stability_margin(law, _states(1.2)).min() < 0.0


def test_linear_laws_have_no_limits():
    assert stable_range(fibre_ply()).uniaxial == (0.0, np.inf)


def test_bad_questions_are_refused():
    with pytest.raises(MaterialError, match="five components"):
        stability_margin(published_rubber("CR"), np.zeros(3))
    with pytest.raises(MaterialError, match="at least 1, but 0.9 was given"):
        stability_margin(published_rubber("CR"), np.zeros(5), 0.9)


def _documented_rows(count):
    """Rows of so many cells that begin with a rubber."""
    for line in DOCUMENT.read_text().splitlines():
        cells = [c.strip() for c in line.strip().strip("|").split("|")]
        if re.fullmatch(r"(CR|SBR|EPDM)", cells[0]) and len(cells) == count:
            yield cells


def test_the_documented_margins_of_the_stable_constants_are_true():
    """docs/evidence/materials.md: least over states to 60 % strain, to the digits printed."""
    angle, size = np.meshgrid(np.linspace(0, 2 * np.pi, 72, endpoint=False), np.linspace(0, np.log(1.6), 121))
    ln = size[..., None] * np.cos(angle[..., None] - np.arange(2) * 2 * np.pi / 3)
    strains = np.concatenate([np.expm1(2 * ln) / 2, np.zeros((*size.shape, 3))], axis=-1)
    rows = list(_documented_rows(6))
    assert len(rows) == 6
    for name, r, *cells in rows:
        margins = [stability_margin(rubber(name, level), strains, float(r)).min() for level in strain_levels()]
        assert cells == [f"{margin:.3f}" for margin in margins]


def test_the_documented_table_is_true():
    """docs/evidence/materials.md: every set, to the digits printed."""
    rows = list(_documented_rows(11))
    assert len(rows) == 12
    for name, level, terms, modulus, *cells in rows:
        law = published_rubber(name, float(level.split()[0]) / 100, terms=int(terms))
        found = stable_range(law)
        numbers = [*found.uniaxial, *found.equibiaxial, *found.pure_shear, found.equivalent_strain]
        assert modulus == f"{law.small_strain_shear_modulus / 1e6:.3f}"
        assert cells == ["none" if n in (0.0, np.inf) else f"{n:.3f}" for n in numbers]
