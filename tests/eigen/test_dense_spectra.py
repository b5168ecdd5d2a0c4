"""Spectra that are dense as seen from the shift, as heavy fluids make them: all pairs converge late and together."""

import numpy as np
import scipy.sparse as sp

from eigen import CoupledPencil, SearchOptions, Workspace, krylov_pairs, leading_modes
from eigen.pairs import empty
from eigen.search import next_shift


def chain(n=600, stiffness=4e5, damping=1e-5):
    """A chain of masses, eigenvalues in closed form, sorted by size."""
    M = sp.identity(n, format="csr")
    K = sp.diags([-np.ones(n - 1), 2 * np.ones(n), -np.ones(n - 1)], [-1, 0, 1], format="csr") * stiffness
    square = stiffness * 4 * np.sin(0.5 * np.pi * np.arange(1, n + 1) / (n + 1)) ** 2
    values = -0.5 * damping * square + 1j * np.sqrt(square - (0.5 * damping * square) ** 2)
    return CoupledPencil(M, damping * K, K), values


def test_pairs_that_converge_late_are_waited_for():
    """From afar the first eigenvalues differ by a few per mille in distance."""
    pencil, values = chain()
    found = krylov_pairs(Workspace().shifted(pencil, 150.0), 20)
    upper = found.eigenvalues[found.eigenvalues.imag > 0]
    assert upper.size >= 10
    assert np.abs(upper[:, None] - values).min(axis=1).max() < 1e-8 * np.abs(upper).max()


def test_a_search_from_afar_ends_with_the_right_modes():
    pencil, values = chain()
    found = leading_modes(pencil, 6, SearchOptions(shifts=(150.0,), method="krylov"))
    assert len(found) == 6
    np.testing.assert_allclose(found.eigenvalues, values[:6], rtol=1e-8)


def test_where_nothing_was_found_the_next_shift_goes_closer():
    pencil, _ = chain(50)
    found = empty(pencil, False)
    found.shifts.append(900.0)
    assert next_shift(pencil, found, 6, SearchOptions(), Workspace()) == 300.0
