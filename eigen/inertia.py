"""Inertia of symmetric sparse matrices by the signs of their pivots (Sylvester), without computing any eigenvalue."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from .factorization import SingularShiftError


class SymmetricLU:
    """SuperLU of a symmetric matrix with pivots from the diagonal only: their signs are its inertia (Sylvester).

    Raises
    ------
    SingularShiftError
        If a pivot is zero, or had to be taken from elsewhere.
    """

    def __init__(self, matrix: sp.spmatrix):
        matrix = sp.csc_matrix(matrix)
        size = np.abs(matrix.diagonal())
        scale = sp.diags(1.0 / np.sqrt(np.where(size > 0, size, 1.0)))
        try:
            lu = spla.splu(
                (scale @ matrix @ scale).tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise SingularShiftError(f"SuperLU could not factor the matrix ({error}).") from error
        if not np.array_equal(lu.perm_r, lu.perm_c):
            raise SingularShiftError("A pivot of the symmetric matrix is zero.")
        #: Pivots of the matrix scaled to a diagonal of ones.
        self.pivots = lu.U.diagonal()

    @property
    def negative(self) -> int:
        """Number of negative eigenvalues."""
        return int(np.sum(self.pivots < 0))


def is_positive_definite(matrix: sp.spmatrix) -> bool:
    """Whether a symmetric sparse matrix is positive definite, by its pivots."""
    if (matrix.diagonal() <= 0).any():
        return False
    try:
        return bool((SymmetricLU(matrix).pivots > 1e-13).all())
    except SingularShiftError:
        return False
