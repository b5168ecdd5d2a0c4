"""The eigen-solver replaced by one argument: by a dense one, and by SLEPc's Krylov-Schur method."""

from __future__ import annotations

import numpy as np
import pytest
import scipy.linalg as la
from petsc4py import PETSc
from slepc4py import SLEPc

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


def slepc_pairs(shifted, wanted, *, transposed=False, **_) -> KrylovPairs:
    """Eigenpairs nearest to a real shift, by SLEPc with shift-and-invert of the first-order form."""
    pencil, n = shifted.pencil, shifted.pencil.n
    F, E = (part.T if transposed else part for part in pencil.first_order())
    factor = la.lu_factor(F - shifted.shift * E)
    matrix = PETSc.Mat().createDense(E.shape, array=la.lu_solve(factor, E), comm=PETSc.COMM_SELF)
    eps = SLEPc.EPS().create(PETSc.COMM_SELF)
    eps.setOperators(matrix)
    eps.setProblemType(SLEPc.EPS.ProblemType.NHEP)
    eps.setDimensions(2 * wanted)
    eps.setTolerances(1e-12, 200)
    eps.solve()
    real, imaginary = matrix.createVecs()
    theta, x = [], []
    for number in range(eps.getConverged()):
        theta.append(eps.getEigenpair(number, real, imaginary))
        x.append(real.getArray() + 1j * imaginary.getArray())
    theta, x = np.array(theta), np.array(x).T
    q, u = x[n : 2 * n] if transposed else x[:n], x[2 * n : 2 * n + pencil.b]
    return KrylovPairs(shifted.shift + 1 / theta, q, u, float(1 / np.abs(theta).min()), 1, exhausted=False)


@pytest.fixture(scope="module")
def pencil():
    keys = {"mesh.around": 4, "mesh.along": 8, "fluid.density": 100.0, "drive.pressure": 6e3}
    model = ValveModel(thesis_case(keys))
    linear = linearise(model, LoadPath(model).go_to(6e3).q, 6e3)
    return linear.pencil(Mu.of(model.case))


@pytest.mark.parametrize("left", [False, True])
@pytest.mark.parametrize("solver", [dense_pairs, slepc_pairs], ids=["dense", "SLEPc"])
def test_another_solver_gives_the_same_spectrum_of_a_valve(pencil, solver, left):
    search = SearchOptions(max_frequency=60.0, left=left)
    own, other = certified_spectrum(pencil, 6, search), certified_spectrum(pencil, 6, search, solver=solver)
    assert own.agrees and other.agrees and other.spectrum.applications < 10 < own.spectrum.applications
    np.testing.assert_allclose(other.spectrum.eigenvalues, own.spectrum.eigenvalues, rtol=1e-7)
    along = np.abs(np.einsum("ij,ij->j", other.spectrum.q.conj(), own.spectrum.q))
    np.testing.assert_allclose(along, 1.0, atol=1e-6)
    if left:
        assert max(own.spectrum.biorthogonality, other.spectrum.biorthogonality) < 1e-6
