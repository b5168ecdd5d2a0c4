"""Lowest eigenvalues of the tangent stiffness of a pressed shell: how far it is from buckling, and into which shape.

The eigenvalues are those of K x = mu M x with the mass matrix M, in 1/s2, which do not depend on the mesh as those of K
alone would; K is singular where one vanishes. A follower pressure on a surface with a free edge makes K unsymmetric, so
two answers are given: eigenvalues of K itself, of which a real one passes zero where the equilibrium stops being
unique, and those of its symmetric part, whose smallest is a lower bound (Bromwich) and which alone decide where the
load has a potential.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse.linalg as spla

from ...errors import SolveError
from ...model.linear import DirectFactor
from ...model.pressed_shell import PressedShell


@dataclass(frozen=True)
class StiffnessSpectrum:
    """Eigenvalues nearest to zero at one state, ascending.

    Attributes
    ----------
    values : (k,) complex array, 1/s2
        Of the whole tangent, by real part.
    vectors : (n, k) complex array
    residuals : (k,) array
        Norm of K x - mu M x over that of |K| |x|.
    symmetric_values : (k,) array, 1/s2
        Of the symmetric part.
    asymmetry : float
        Largest entry of K - K' over that of K.
    """

    values: np.ndarray
    vectors: np.ndarray
    residuals: np.ndarray
    symmetric_values: np.ndarray
    asymmetry: float

    @property
    def lowest(self) -> float:
        """Lowest real eigenvalue of the whole tangent, 1/s2; of complex ones the real part if there are no others."""
        real = np.abs(self.values.imag) <= 1e-8 * np.abs(self.values)
        return float((self.values[real] if real.any() else self.values).real.min())

    @property
    def shape(self) -> np.ndarray:
        """Eigenvector (n,) of the lowest eigenvalue, its largest entry positive and one."""
        vector = self.vectors[:, int(np.argmin(np.abs(self.values - self.lowest)))].real
        return vector / vector[np.argmax(np.abs(vector))]

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues among these."""
        return int(np.count_nonzero(self.values.real < 0))


def stiffness_spectrum(
    pressed: PressedShell, q: np.ndarray, pressure: float, count: int = 4, tolerance: float = 1e-8
) -> StiffnessSpectrum:
    """Eigenvalues nearest to zero of a state (n,) at a pressure, Pa; see `spectrum_of`."""
    matrix = pressed.shell.dofs.matrix
    return spectrum_of(
        matrix(pressed.tangent(q, pressure).stiffness), matrix(pressed.mass(q)), pressure, count, tolerance
    )


def spectrum_of(stiffness, mass, pressure: float, count: int = 4, tolerance: float = 1e-8) -> StiffnessSpectrum:
    """Eigenvalues nearest to zero of two sparse matrices (n, n) by shift-and-invert Arnoldi (ARPACK) with sparse LU
    factors.

    Raises
    ------
    SolveError
        If the eigenvalues did not converge, or did not to the accuracy asked for.
    """
    symmetric = (0.5 * (stiffness + stiffness.T)).tocsr()
    symmetric.sort_indices()
    try:
        values, vectors, residuals = _nearest(stiffness, mass, count, 0.0)
        if residuals.max() > tolerance:
            # An eigenvalue next to the shift drowns the others; stand off by a fraction of their distance.
            values, vectors, residuals = _nearest(stiffness, mass, count, -0.1 * float(np.abs(values).max()))
        lower = _symmetric(symmetric, mass, count)
    except (spla.ArpackError, ArithmeticError) as error:
        raise SolveError(f"The lowest stiffness eigenvalues at {pressure:.6g} Pa were not found ({error}).") from error
    if residuals.max() > tolerance:
        raise SolveError(
            f"The lowest stiffness eigenvalues at {pressure:.6g} Pa were found to a relative residual of "
            f"{residuals.max():.2g} only, "
            f"not to {tolerance:.2g}."
        )
    skew = abs(stiffness - stiffness.T).max() / abs(stiffness).max()
    return StiffnessSpectrum(values, vectors, residuals, lower, float(skew))


def _nearest(stiffness, mass, count, shift):
    """Eigenvalues next to a shift with vectors and residuals, by real part."""
    values, vectors = spla.eigs(
        stiffness, count, mass, sigma=shift, OPinv=_inverse(stiffness - shift * mass), v0=_start(stiffness), tol=1e-13
    )
    order = np.argsort(values.real)
    values, vectors = values[order], vectors[:, order]
    # Measured against the size of the terms that cancel, for an eigenvalue may be zero.
    size = np.linalg.norm(abs(stiffness) @ np.abs(vectors), axis=0)
    return values, vectors, np.linalg.norm(stiffness @ vectors - mass @ vectors * values, axis=0) / size


def _symmetric(symmetric, mass, count):
    values = spla.eigsh(
        symmetric,
        count,
        mass,
        sigma=0.0,
        OPinv=_inverse(symmetric),
        v0=_start(symmetric),
        tol=1e-12,
        return_eigenvectors=False,
    )
    return np.sort(values)


def _start(matrix) -> np.ndarray:
    """A fixed generic vector: the same answer in every run."""
    return np.cos(np.arange(1.0, matrix.shape[0] + 1.0))


def _inverse(matrix) -> spla.LinearOperator:
    matrix = matrix.tocsr()
    matrix.sort_indices()
    factor = DirectFactor(matrix.indptr, matrix.indices)
    factor.values[:] = matrix.data
    factor.refactor()
    return spla.LinearOperator(matrix.shape, matvec=lambda x: factor.solve(np.asarray(x, float).ravel()), dtype=float)
