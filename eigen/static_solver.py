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

    def factor(self, family: PencilFamily, stiffness=None) -> None:
        """Factor K of a family, or another stiffness; where it is singular a little inertia stands in.

        Raises
        ------
        SingularShiftError
        """
        stiffness = family.stiffness if stiffness is None else stiffness
        pencil = CoupledPencil(family.mass, sp.csr_matrix(family.mass.shape), stiffness)
        if self._structure is not None and self._structure.fits(pencil):
            self._structure.load(pencil)
        else:
            self._structure = StructureMatrices(pencil)
            self._factor = MumpsFactorization(self._structure)
        for shift in (0.0, 20.0, 100.0):
            try:
                return self._factor.refactor(self._structure.values(shift))
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
