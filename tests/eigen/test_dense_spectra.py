"""Spectra that are dense as seen from the shift, as heavy fluids make them: all pairs converge late and together."""

import numpy as np

from eigen import SearchOptions, Workspace, krylov_pairs, leading_modes
from eigen.pairs import empty
from eigen.search import next_shift
from tests.eigen.test_limit_point import chain

LIGHT = 1e-5


def test_pairs_that_converge_late_are_waited_for():
    """From afar the first eigenvalues differ by a few per mille in distance."""
    pencil, values = chain(600, LIGHT)
    found = krylov_pairs(Workspace().shifted(pencil, 150.0), 20)
    upper = found.eigenvalues[found.eigenvalues.imag > 0]
    assert upper.size >= 10
    assert np.abs(upper[:, None] - values).min(axis=1).max() < 1e-8 * np.abs(upper).max()


def test_a_search_from_afar_ends_with_the_right_modes():
    pencil, values = chain(600, LIGHT)
    found = leading_modes(pencil, 6, SearchOptions(shifts=(150.0,), method="krylov"))
    assert len(found) == 6
    np.testing.assert_allclose(found.eigenvalues, values[:6], rtol=1e-8)


def test_where_nothing_was_found_the_next_shift_goes_closer():
    pencil, _ = chain(50, LIGHT)
    found = empty(pencil, False)
    found.shifts.append(900.0)
    assert next_shift(pencil, found, 6, SearchOptions(), Workspace()) == 300.0
