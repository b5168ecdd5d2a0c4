"""Linear solves with explicit matrices, dense or sparse, and with borders around them.

``[[A, b], [c', d]] [x; y] = [f; g]`` is solved with solves with ``A`` and its transpose
only, by mixed block elimination (Govaerts & Pryce, IMA J. Numer. Anal. 13 (1993)
161-180): one Doolittle pass gives a first ``y``, one Crout pass corrects it.  The result
stays accurate when ``A`` is singular to working precision, which plain block elimination
does not.  Several borders are nested, so that each level has just one.
"""

from __future__ import annotations

import warnings

import numpy as np
import scipy.linalg as sla
import scipy.sparse as sp
import scipy.sparse.linalg as spla
from scipy.sparse.csgraph import connected_components

from continuation.options import SingularSystem

#: A zero pivot is replaced by this fraction of the matrix norm.  Bordered solves with
#: refinement against the true matrix remove the perturbation again.
PIVOT_REPAIR = 1e-14
#: Ordering of `scipy.sparse.linalg.splu` for matrices whose pattern is nearly symmetric.
SYMMETRIC = "MMD_AT_PLUS_A"
#: Largest number of refinement steps against the true bordered matrix.
REFINEMENTS = 2


class _Solver:
    """Products with the matrix that is solved with."""

    def matvec(self, x):
        return self.matrix @ x

    def rmatvec(self, x):
        return self.matrix.T @ x


class DenseSolver(_Solver):
    """LU of a dense matrix; exactly zero pivots are repaired."""

    def __init__(self, matrix: np.ndarray):
        self.matrix = matrix
        if not np.all(np.isfinite(matrix)):
            raise SingularSystem("The matrix holds numbers that are not finite.")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sla.LinAlgWarning)
            lu, self._pivots = sla.lu_factor(matrix, check_finite=False)
        diagonal = np.abs(np.diagonal(lu))
        # A zero matrix has no size of its own; any moderate pivot will do for it.
        floor = PIVOT_REPAIR * (np.abs(matrix).max(initial=0.0) or 1.0)
        #: True when the factors are those of a slightly different matrix.
        self.repaired = bool(np.any(diagonal < 1e-3 * floor))
        if self.repaired:
            i = np.flatnonzero(diagonal < 1e-3 * floor)
            lu = lu.copy()
            lu[i, i] = floor
        self._lu = lu

    def solve(self, rhs):
        return sla.lu_solve((self._lu, self._pivots), rhs, check_finite=False)

    def solve_transpose(self, rhs):
        return sla.lu_solve((self._lu, self._pivots), rhs, trans=1, check_finite=False)

    def determinant_sign(self):
        """Sign of the determinant of the (real) matrix factorised."""
        swaps = np.count_nonzero(self._pivots != np.arange(self._pivots.size))
        return float(np.prod(np.sign(np.diagonal(self._lu)))) * (-1.0) ** swaps


class SparseSolver(_Solver):
    """SuperLU of a sparse matrix; a singular one is shifted by a rounding-sized multiple of 1."""

    def __init__(self, matrix: sp.spmatrix, ordering: str = "COLAMD"):
        self.matrix = sp.csc_matrix(matrix)
        if not np.all(np.isfinite(self.matrix.data)):
            raise SingularSystem("The matrix holds numbers that are not finite.")
        self.repaired = False
        try:
            self._lu = spla.splu(self.matrix, permc_spec=ordering)
        except RuntimeError:
            size = np.abs(self.matrix.data).max(initial=0.0) or 1.0
            shift = sp.identity(self.matrix.shape[0], dtype=self.matrix.dtype, format="csc")
            try:
                self._lu = spla.splu((self.matrix + PIVOT_REPAIR * size * shift).tocsc())
            except RuntimeError as error:
                raise SingularSystem(f"The sparse factorisation failed: {error}.") from error
            self.repaired = True

    def determinant_sign(self):
        """Sign of the determinant of the (real) matrix factorised."""
        sign = np.prod(np.sign(self._lu.U.diagonal()))
        return float(sign * _parity(self._lu.perm_r) * _parity(self._lu.perm_c))

    def _solve(self, rhs, trans):
        rhs = np.asarray(rhs)
        if np.iscomplexobj(rhs) and not np.iscomplexobj(self.matrix.data):
            return self._lu.solve(rhs.real.copy(), trans) + 1j * self._lu.solve(rhs.imag.copy(), trans)
        return self._lu.solve(rhs.astype(self.matrix.dtype), trans)

    def solve(self, rhs):
        return self._solve(rhs, "N")

    def solve_transpose(self, rhs):
        return self._solve(rhs, "T")


def _parity(permutation) -> int:
    """+1 for an even permutation, -1 for an odd one."""
    count, _ = connected_components(
        sp.csr_matrix((np.ones(permutation.size), (np.arange(permutation.size), permutation))), directed=False
    )
    return -1 if (permutation.size - count) % 2 else 1


def product(matrix, x: np.ndarray) -> np.ndarray:
    """Product with an array, without making a real matrix complex."""
    if np.iscomplexobj(matrix) or not np.iscomplexobj(x):
        return matrix @ x
    flat = np.ascontiguousarray(x).reshape(len(x), -1)
    out = matrix @ flat.view(float)
    return np.ascontiguousarray(out).view(complex).reshape((matrix.shape[0], *x.shape[1:]))


def factorise(matrix, ordering: str = "COLAMD"):
    """A factorised solver for a dense or sparse matrix, with an ordering of `scipy.sparse.linalg.splu`."""
    return SparseSolver(matrix, ordering) if sp.issparse(matrix) else DenseSolver(np.asarray(matrix))


class MatrixLinearisation(_Solver):
    """``A`` and ``B`` given as matrices, both dense or both sparse.

    Parameters
    ----------
    jacobian : ndarray or sparse matrix, shape (n, n)
        ``dF/du``.
    mass : ndarray or sparse matrix, shape (n, n), or None
        ``B``; None is the identity.

    Examples
    --------
    >>> import numpy as np
    >>> lin = MatrixLinearisation(np.array([[0.0, 1.0], [-4.0, 0.0]]))
    >>> lin.solve(np.array([1.0, 0.0]))
    array([-0.,  1.])
    """

    def __init__(self, jacobian, mass=None):
        sparse = sp.issparse(jacobian)
        self.size = jacobian.shape[0]
        self.jacobian = self.matrix = sp.csc_matrix(jacobian) if sparse else np.asarray(jacobian, float)
        if mass is None:
            self.mass = sp.identity(self.size, format="csc") if sparse else np.eye(self.size)
        else:
            dense = mass.toarray() if sp.issparse(mass) and not sparse else mass
            self.mass = sp.csc_matrix(dense) if sparse else np.asarray(dense, float)
        self._solver = None

    def __repr__(self) -> str:
        kind = "sparse" if sp.issparse(self.jacobian) else "dense"
        return f"<MatrixLinearisation: {kind} matrices of order {self.size}>"

    @property
    def _factors(self):
        if self._solver is None:
            self._solver = factorise(self.jacobian)
        return self._solver

    def solve(self, rhs):
        return self._factors.solve(rhs)

    def solve_transpose(self, rhs):
        return self._factors.solve_transpose(rhs)

    def determinant_sign(self) -> float:
        """Sign of ``det A``; optional in the contract, it makes branch points easy to see."""
        return self._factors.determinant_sign()

    def mass_matvec(self, x):
        return self.mass @ x

    def mass_rmatvec(self, x):
        return self.mass.T @ x

    def shifted(self, shift):
        """A solver for ``A - shift B``; real arithmetic for a real shift."""
        shift = complex(shift)
        return factorise(self.jacobian - (shift.real if shift.imag == 0 else shift) * self.mass)

    def to_dense(self):
        """``(A, B)`` as dense arrays; for small problems and tests."""
        if sp.issparse(self.jacobian):
            return self.jacobian.toarray(), self.mass.toarray()
        return self.jacobian, self.mass


class Bordered:
    """``[[A, b], [c', d]]`` with the interface of a solver (plain transposes, no conjugates). Raises SingularSystem:
    the bordered matrix itself is singular, or a solve gave no finite numbers.

    Parameters
    ----------
    inner : object
        ``A``, with ``matvec``, ``rmatvec``, ``solve``, ``solve_transpose``.
    column, row : ndarray, shape (n,)
        ``b`` and ``c``.
    corner : complex
        ``d``.
    """

    def __init__(self, inner, column, row, corner=0.0):
        b, c, self.d = np.asarray(column), np.asarray(row), corner
        with np.errstate(all="ignore"):
            v, w = inner.solve(b), inner.solve_transpose(c)
            delta, delta_star = corner - c @ v, corner - w @ b
        self._delta = delta
        #: Product, solve, column, row, solutions with both and Schur complements by both, of the matrix and of its
        #: transpose.
        self._plain = inner.matvec, inner.solve, b, c, v, w, delta, delta_star
        self._turned = inner.rmatvec, inner.solve_transpose, c, b, w, v, delta_star, delta
        sizes = np.array([abs(delta), abs(delta_star)])
        if not np.all(np.isfinite(sizes)) or np.any(sizes == 0.0):
            raise SingularSystem("The bordered matrix is singular: the border does not lift the rank loss.")

    @property
    def complement_sign(self) -> float:
        """Sign of ``d - c' A^-1 b``: of the determinant, over that of ``A`` (real matrices)."""
        return float(np.sign(self._delta))

    def matvec(self, z):
        return self._apply(self._plain, z)

    def rmatvec(self, z):
        return self._apply(self._turned, z)

    def solve(self, rhs):
        """Solve with the bordered matrix; ``rhs`` of shape (n + 1,)."""
        return self._refined(self._plain, rhs)

    def solve_transpose(self, rhs):
        """Solve with its plain transpose."""
        return self._refined(self._turned, rhs)

    def _apply(self, side, z):
        multiply, _, column, row, *_ = side
        x, y = z[:-1], z[-1]
        return np.append(multiply(x) + column * y, row @ x + self.d * y)

    def _eliminate(self, side, rhs):
        _, solve, column, row, v, w, delta, delta_star = side
        f, g = rhs[:-1], rhs[-1]
        y1 = (g - w @ f) / delta_star
        x = solve(f - column * y1)
        y2 = (g - self.d * y1 - row @ x) / delta
        return np.append(x - v * y2, y1 + y2)

    def _refined(self, side, rhs):
        z = self._eliminate(side, rhs)
        defect = rhs - self._apply(side, z)
        size = np.abs(defect).max()
        floor = 4 * np.finfo(float).eps * np.abs(rhs).max(initial=0.0)
        for _ in range(REFINEMENTS):
            if not size > floor:
                break
            better = z + self._eliminate(side, defect)
            defect = rhs - self._apply(side, better)
            new = np.abs(defect).max()
            if not new < size:
                break
            z, size = better, new
        if not np.all(np.isfinite(z)):
            raise SingularSystem("A bordered solve gave numbers that are not finite.")
        return z


def bordered(inner, columns, rows):
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
        solver = Bordered(solver, above, rows[i, :order], rows[i, order])
    return solver
