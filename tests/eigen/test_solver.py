"""The eigen-solver replaced by one argument."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la

from dbvfiv.case.parameters import Mu
from dbvfiv.model import ValveModel, linearise
from dbvfiv.model.equilibria import LoadPath
from dbvfiv.studies.case import thesis_case
from eigen import KrylovPairs, SearchOptions, certified_spectrum


def dense_pairs(shifted, wanted, *, transposed=False, **_) -> KrylovPairs:
    """Every eigenpair of the first-order form, by QZ."""
    pencil = shifted.pencil
    F, E = pencil.first_order()
    (above, below), left, right = la.eig(F, E, left=True, homogeneous_eigvals=True)
    finite = np.abs(below) > 1e-13 * np.hypot(np.abs(above), np.abs(below))
    x, n = (left.conj() if transposed else right)[:, finite], pencil.n
    q = x[n : 2 * n] if transposed else x[:n]
    u = x[2 * n : 2 * n + pencil.b]
    return KrylovPairs(above[finite] / below[finite], q, u, np.inf, 0, exhausted=True)


@pytest.mark.parametrize("left", [False, True])
def test_a_dense_solver_gives_the_same_spectrum_of_a_valve(left):
    keys = {"mesh.around": 4, "mesh.along": 8, "fluid.density": 100.0, "drive.pressure": 6e3}
    model = ValveModel(thesis_case(keys))
    linear = linearise(model, LoadPath(model).go_to(6e3).q, 6e3)
    pencil = linear.pencil(Mu.of(model.case))
    search = SearchOptions(max_frequency=60.0, left=left)
    own, dense = certified_spectrum(pencil, 6, search), certified_spectrum(pencil, 6, search, solver=dense_pairs)
    assert own.agrees and dense.agrees and dense.spectrum.applications == 0
    np.testing.assert_allclose(dense.spectrum.eigenvalues, own.spectrum.eigenvalues, rtol=1e-7)
    along = np.abs(np.einsum("ij,ij->j", dense.spectrum.q.conj(), own.spectrum.q))
    np.testing.assert_allclose(along, 1.0, atol=1e-6)
    if left:
        assert max(own.spectrum.biorthogonality, dense.spectrum.biorthogonality) < 1e-6
