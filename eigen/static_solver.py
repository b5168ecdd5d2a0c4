"""Solves with the stiffness of one family after another."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from .factorization import MumpsFactorization, SingularShiftError, StructureMatrices
from .family import PencilFamily
from .pencil import CoupledPencil


class StaticSolver:
    """Block solves with K and its transpose; the symbolic factorisation is kept between families of one pattern."""

    def __init__(self):
        self._structure = None
        self._factor = None

    def factor(self, family: PencilFamily) -> None:
        """Factor K of a family; where it is singular a little inertia stands in.

        Raises
        ------
        SingularShiftError
        """
        pencil = CoupledPencil(family.mass, sp.csr_matrix(family.mass.shape), family.stiffness)
        if self._structure is not None and self._structure.fits(pencil):
            self._structure.load(pencil)
        else:
            self._structure = StructureMatrices(pencil)
            self._factor = MumpsFactorization(self._structure)
        self._refactor(np.array([0.0, 0.0, 1.0]))

    def factor_sum(self, matrices: StructureMatrices, weights: np.ndarray) -> None:
        """Factor a sum of matrices of one pattern, weights as of its data; where it is singular a little inertia stands
        in.

        Raises
        ------
        SingularShiftError
        """
        if self._structure is not matrices:
            self._structure, self._factor = matrices, MumpsFactorization(matrices)
        self._refactor(weights)

    def _refactor(self, weights: np.ndarray) -> None:
        inertia = np.eye(len(weights))[0]
        for shift in (0.0, 20.0, 100.0):
            try:
                return self._factor.refactor((weights + shift**2 * inertia) @ self._structure.data)
            except SingularShiftError:
                continue
        raise SingularShiftError("The stiffness of the family is singular.")

    def solve(self, right: np.ndarray) -> np.ndarray:
        """K^-1 of columns (n, k), real or complex."""
        return self._factor.solve(right)

    def solve_transposed(self, right: np.ndarray) -> np.ndarray:
        """K^-T of columns (n, k)."""
        inner = getattr(self._factor, "_factor", None)
        if not hasattr(inner, "setMumpsIcntl"):
            return self._factor.solve_transposed(right)
        inner.setMumpsIcntl(9, 0)  # MUMPS solves whole blocks with the transpose when told so
        try:
            return self._factor.solve(right)
        finally:
            inner.setMumpsIcntl(9, 1)
