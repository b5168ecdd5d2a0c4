"""Second and third derivatives of what a fluid outside resists with, against differences of the whole added mass."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from dbvfiv.model.outside import BASIS, OutsideForms

from .test_outside import valve

STEP = 3e-4  # m, fifteen times the forms' own


@cache
def forms() -> OutsideForms:
    model, q = valve()
    return OutsideForms(model.outside, q, model.shell.dofs.matrix(model.structure(q)[1]))


def whole(shift: np.ndarray) -> np.ndarray:
    """Added mass (n, n) products with the motions, as the pencils have it before anything is left out: X' M_a X."""
    model, q = valve()
    swept = model.outside.face.fluxes(model.nodal(q + shift)) @ forms()._motions
    return swept.T @ (model.outside.impedance(q + shift, forms()._panels) @ swept)


def some(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Coordinates of a smooth motion, and the motion (n,), of the size of the differences."""
    weights = np.random.default_rng(seed).standard_normal(BASIS) / (1 + np.arange(BASIS))
    motion = forms()._motions @ weights
    size = STEP / np.abs(valve()[0].nodal(motion)[:, :3]).max()
    return size * weights, size * motion


def slope(way: np.ndarray) -> np.ndarray:
    """D M[way]."""
    return (whole(way) - whole(-way)) / 2


def bend(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """D2 M[one, other]."""
    return sum(s * t * whole(s * one + t * other) for s in (1, -1) for t in (1, -1)) / 4


@pytest.fixture(scope="module")
def still() -> np.ndarray:
    """No motion at all, (n,)."""
    return np.zeros(valve()[0].size)


def test_the_motions_are_those_of_the_added_mass():
    found = forms()
    model, q = valve()
    structure = model.shell.dofs.matrix(model.structure(q)[1])
    assert found._motions.T @ structure @ found._motions == pytest.approx(np.eye(BASIS), abs=1e-8)
    slow = model.outside.added_mass(q, structure).slowness[:BASIS]
    assert found._here == pytest.approx(np.diag(slow), abs=1e-3 * slow[0])


def test_accelerations_of_a_changed_shape(still):
    (_, u), (a, acceleration) = some(1), some(2)
    found = forms()._motions.T @ forms().second((u, still, still), (still, still, acceleration))
    expected = slope(u) @ a
    assert found == pytest.approx(expected, abs=3e-3 * np.abs(expected).max())


def test_the_power_of_the_resistance_is_the_growth_of_the_energy(still):
    """v . [D M[v] v - grad (v' M v)/2] = v' D M[v] v / 2, and the force along another motion by Lagrange."""
    (v, motion), (w, other) = some(3), some(4)
    force = 0.5 * forms().second((still, motion, still), (still, motion, still))
    along, across = slope(motion), slope(other)
    size = np.abs(along @ v).max() * np.abs(v).max()
    assert motion @ force == pytest.approx(0.5 * v @ along @ v, abs=3e-3 * size)
    assert other @ force == pytest.approx(w @ along @ v - 0.5 * v @ across @ v, abs=3e-3 * size)


def test_third_derivatives(still):
    (_, u), (_, r), (v, motion) = some(5), some(6), some(7)
    found = forms()._motions.T @ forms().third((u, still, still), (r, still, still), (still, still, motion))
    expected = bend(u, r) @ v
    assert found == pytest.approx(expected, abs=1e-2 * np.abs(expected).max())
    force = forms().third((u, still, still), (still, motion, still), (still, motion, still))
    expected = v @ bend(u, motion) @ v
    assert motion @ force == pytest.approx(expected, rel=1e-2)


@pytest.mark.slow
def test_forms_are_symmetric_and_linear(still):
    rng = np.random.default_rng(8)
    one, two, three = (tuple(rng.standard_normal((3, len(still)))) for _ in range(3))
    doubled = tuple(2.0 * x for x in two)
    pair, triple = forms().second(one, two), forms().third(one, two, three)
    assert forms().second(doubled, one) == pytest.approx(2 * pair, rel=1e-9, abs=1e-9 * np.abs(pair).max())
    turned = forms().third(three, doubled, one)
    assert turned == pytest.approx(2 * triple, rel=1e-4, abs=1e-4 * np.abs(triple).max())
