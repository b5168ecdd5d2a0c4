"""Bordered linear systems by block elimination that survives a singular block.

``[[A, b], [c', d]] [x; y] = [f; g]`` is solved with solves with ``A`` and its transpose
only, by mixed block elimination (Govaerts & Pryce, IMA J. Numer. Anal. 13 (1993)
161-180): one Doolittle pass gives a first ``y``, one Crout pass corrects it.  The result
stays accurate when ``A`` is singular to working precision, which plain block elimination
does not.  Several borders are nested, so that each level has just one.
"""

from __future__ import annotations

import numpy as np

from continuation.errors import SingularSystem


class Bordered:
    """``[[A, b], [c', d]]`` with the interface of a solver (plain transposes, no conjugates).

    Parameters
    ----------
    inner : object
        ``A``, with ``matvec``, ``rmatvec``, ``solve``, ``solve_transpose``.
    column, row : ndarray, shape (n,)
        ``b`` and ``c``.
    corner : complex
        ``d``.
    refinements : int
        Largest number of refinement steps against the true bordered matrix.

    Raises
    ------
    SingularSystem
        The bordered matrix itself is singular, or a solve gave no finite numbers.
    """

    def __init__(self, inner, column, row, corner=0.0, refinements: int = 2):
        self.inner = inner
        self.b = np.asarray(column)
        self.c = np.asarray(row)
        self.d = corner
        self.refinements = refinements
        self.size = self.b.size + 1
        with np.errstate(all="ignore"):
            self._v = inner.solve(self.b)
            self._w = inner.solve_transpose(self.c)
            self._delta = self.d - self.c @ self._v
            self._delta_star = self.d - self._w @ self.b
        sizes = np.array([abs(self._delta), abs(self._delta_star)])
        if not np.all(np.isfinite(sizes)) or np.any(sizes == 0.0):
            raise SingularSystem("The bordered matrix is singular: the border does not lift the rank loss.")

    @property
    def complement_sign(self) -> float:
        """Sign of ``d - c' A^-1 b``: of the determinant, over that of ``A`` (real matrices)."""
        return float(np.sign(self._delta))

    def matvec(self, z):
        x, y = z[:-1], z[-1]
        return np.append(self.inner.matvec(x) + self.b * y, self.c @ x + self.d * y)

    def rmatvec(self, z):
        x, y = z[:-1], z[-1]
        return np.append(self.inner.rmatvec(x) + self.c * y, self.b @ x + self.d * y)

    def solve(self, rhs):
        """Solve with the bordered matrix; ``rhs`` of shape (n + 1,)."""
        return self._refined(rhs, self._eliminate, self.matvec)

    def solve_transpose(self, rhs):
        """Solve with its plain transpose."""
        return self._refined(rhs, self._eliminate_transpose, self.rmatvec)

    def _eliminate(self, rhs):
        f, g = rhs[:-1], rhs[-1]
        y1 = (g - self._w @ f) / self._delta_star
        x = self.inner.solve(f - self.b * y1)
        y2 = (g - self.d * y1 - self.c @ x) / self._delta
        return np.append(x - self._v * y2, y1 + y2)

    def _eliminate_transpose(self, rhs):
        f, g = rhs[:-1], rhs[-1]
        y1 = (g - self._v @ f) / self._delta
        x = self.inner.solve_transpose(f - self.c * y1)
        y2 = (g - self.d * y1 - self.b @ x) / self._delta_star
        return np.append(x - self._w * y2, y1 + y2)

    def _refined(self, rhs, eliminate, apply):
        z = eliminate(rhs)
        defect = rhs - apply(z)
        size = np.abs(defect).max()
        floor = 4 * np.finfo(float).eps * np.abs(rhs).max(initial=0.0)
        for _ in range(self.refinements):
            if not size > floor:
                break
            better = z + eliminate(defect)
            defect = rhs - apply(better)
            new = np.abs(defect).max()
            if not new < size:
                break
            z, size = better, new
        if not np.all(np.isfinite(z)):
            raise SingularSystem("A bordered solve gave numbers that are not finite.")
        return z


def bordered(inner, columns, rows, refinements: int = 2):
    """Nest ``k`` borders around ``A``.

    Parameters
    ----------
    inner : object
        ``A`` of order n.
    columns : sequence of ndarray, shape (n,)
        The ``k`` columns beside ``A``.
    rows : ndarray, shape (k, n + k)
        The full rows below.

    Returns
    -------
    object
        A solver of order ``n + k``.
    """
    rows = np.atleast_2d(rows)
    solver, n = inner, rows.shape[1] - len(columns)
    for i, column in enumerate(columns):
        order = n + i
        above = np.concatenate([column, rows[:i, order]])
        solver = Bordered(solver, above, rows[i, :order], rows[i, order], refinements)
    return solver
