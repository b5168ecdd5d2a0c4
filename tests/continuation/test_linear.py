"""Linearisations from matrices and the ready-made spectra."""

import numpy as np
import pytest
import scipy.sparse as sp

from continuation.linear import MatrixLinearisation, factorise
from continuation.options import SingularSystem
from continuation.spectra import dense_spectrum, shift_invert_spectrum
from continuation.system import Spectrum


@pytest.fixture(params=["dense", "sparse"])
def pencil(request):
    rng = np.random.default_rng(5)
    n = 40
    a = np.diag(-np.arange(1.0, n + 1)) + 0.3 * rng.standard_normal((n, n))
    b = np.eye(n) + 0.1 * np.diag(rng.random(n - 1), 1)
    make = sp.csc_matrix if request.param == "sparse" else np.array
    return a, b, MatrixLinearisation(make(a), make(b))


def test_products_and_solves(pencil):
    a, b, lin = pencil
    x = np.cos(np.arange(40)) + 1j * np.sin(np.arange(40))
    assert np.allclose(lin.matvec(x), a @ x)
    assert np.allclose(lin.rmatvec(x), a.T @ x)
    assert np.allclose(lin.mass_matvec(x), b @ x)
    assert np.allclose(lin.mass_rmatvec(x), b.T @ x)
    assert np.allclose(lin.solve(a @ x), x)
    assert np.allclose(lin.solve_transpose(a.T @ x), x)


def test_shifted_solves_use_the_plain_transpose(pencil):
    a, b, lin = pencil
    shift = 0.4 - 2.0j
    x = np.cos(np.arange(40)) * (1 + 2j)
    shifted = lin.shifted(shift)
    assert np.allclose(shifted.solve((a - shift * b) @ x), x)
    assert np.allclose(shifted.solve_transpose((a - shift * b).T @ x), x)
    assert np.allclose(shifted.rmatvec(x), (a - shift * b).T @ x)


def test_real_shift_stays_real(pencil):
    assert np.isrealobj(pencil[2].shifted(0.5 + 0j).solve(np.ones(40)))


def test_arnoldi_agrees_with_qz(pencil):
    _, _, lin = pencil
    near = -3.0 + 1.0j
    few, all_ = shift_invert_spectrum(lin, 5, near), dense_spectrum(lin, 5, near)
    assert few.converged.all()
    assert np.allclose(few.values, all_.values, atol=1e-8)  # both from the nearest on


def test_asking_too_many_is_refused():
    with pytest.raises(ValueError, match="at most"):
        shift_invert_spectrum(MatrixLinearisation(np.eye(5)), 4)


def test_constraints_give_no_eigenvalues():
    """x' = -2 x + y, 0 = x - y: the singular mass leaves one finite eigenvalue, -1."""
    lin = MatrixLinearisation(np.array([[-2.0, 1.0], [1.0, -1.0]]), np.diag([1.0, 0.0]))
    assert np.allclose(dense_spectrum(lin).values, [-1.0])


def test_not_finite_matrices_are_refused():
    with pytest.raises(SingularSystem, match="not finite"):
        factorise(np.array([[np.nan]]))
    with pytest.raises(SingularSystem, match="not finite"):
        factorise(sp.csc_matrix([[np.inf]]))


def test_upper_half_keeps_one_of_each_pair_and_drops_what_did_not_converge():
    values = np.array([1 - 2j, 1 + 2j, 3.0, -1 - 1j, 5.0, 0.5 + 1e-14j])
    converged = np.array([True, True, True, True, False, True])
    kept, vectors = Spectrum(values, np.eye(6), converged).upper_half()
    assert np.allclose(kept, [3.0, 1 + 2j, 0.5, -1 + 1j])
    assert kept[2].imag == 0.0
    assert vectors.shape == (6, 4)


def test_upper_half_keeps_true_multiples():
    """Two equal pairs are two modes, not one and its partner."""
    values = np.array([2j, 2j, -2j, -2j, 1.0, 1.0])
    kept, _ = Spectrum(values, np.eye(6), np.ones(6, bool)).upper_half()
    assert np.sum(kept.imag > 0) == 2
    assert np.sum(kept.imag == 0) == 2


@pytest.mark.parametrize("seed", range(8))
def test_determinant_sign(seed):
    rng = np.random.default_rng(seed)
    a = rng.standard_normal((9, 9)) * (rng.random((9, 9)) < 0.6) + 0.1 * np.eye(9)
    sign = np.sign(np.linalg.det(a))
    assert MatrixLinearisation(a).determinant_sign() == sign
    assert MatrixLinearisation(sp.csc_matrix(a)).determinant_sign() == sign
