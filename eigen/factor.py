"""Factorisations of the structure at a shift, and solves with the whole pencil through them.

PETSc is built with either real or complex numbers. Real shifts always go to MUMPS. A
complex shift goes to MUMPS where PETSc is complex and to SciPy's SuperLU where it is real:
measured on a shell-like pencil with 6800 unknowns, SuperLU's complex LU took 1.5 times a
real MUMPS refactorisation, the equivalent real form of twice the size 6 times.
"""

from __future__ import annotations

import weakref
from collections.abc import Callable, Iterable
from functools import cache, cached_property
from typing import Any

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
import scipy.sparse.linalg as spla

from .operator import CoupledPencil, real_apply


class SingularShiftError(ArithmeticError):
    """The matrix at a shift is singular to working precision."""


class StructureMatrices:
    """M, C, K and what relaxes of pencils on one common sparsity pattern, so that sums cost no symbolic work.

    Attributes
    ----------
    indptr, indices : ndarray of int32
        The union pattern in compressed rows, made symmetric.
    data : (parts, entries) array
        M, C, K and what relaxes on it.
    relaxation : Relaxation or None
    """

    def __init__(self, pencil: CoupledPencil):
        parts = _parts(pencil)
        self._sources: list[tuple] = []
        self.shape = pencil.M.shape
        pattern = sum(sp.csr_matrix((np.ones(p.nnz), p.indices, p.indptr), p.shape) for p in parts)
        pattern = (pattern + pattern.T + sp.identity(pencil.n, format="csr")).tocsr()
        pattern.sort_indices()
        self.indptr = pattern.indptr.astype(np.int32)
        self.indices = pattern.indices.astype(np.int32)
        self.load(pencil)

    def load(self, pencil: CoupledPencil) -> bool:
        """Take the numbers of a pencil, whose parts may have fewer entries than the common pattern; False where one of
        them lies beyond it.
        """
        parts = _parts(pencil)
        if pencil.M.shape != self.shape:
            return False
        if len(parts) != len(self._sources) or not all(map(_same_pattern, parts, self._sources)):
            keys, wanted = _keys(self), [_keys(part) for part in parts]
            places = [np.searchsorted(keys, own) for own in wanted]
            if not all(np.array_equal(np.take(keys, at, mode="clip"), own) for at, own in zip(places, wanted)):
                return False
            self._places, self._sources = places, [(p.indptr, p.indices) for p in parts]
        self.relaxation = pencil.relaxation
        self.data = np.zeros((len(parts), self.indices.size))
        for row, place, part in zip(self.data, self._places, parts):
            row[place] = part.data
        return True

    def values(self, s: complex) -> np.ndarray:
        """Entries of s^2 M + s C + K + sum phi_g(s) K_g on the common pattern; real for a real s."""
        s = real_if_real(s)
        values = s * s * self.data[0] + s * self.data[1] + self.data[2]
        if self.relaxation is not None:
            values = values + self.relaxation.factors(s) @ self.data[3:]
        return values

    def matrix(self, s: complex) -> sp.csr_matrix:
        """s^2 M + s C + K + sum phi_g(s) K_g."""
        return sp.csr_matrix((self.values(s), self.indices, self.indptr), self.shape)

    def columns(self, values: np.ndarray) -> sp.csc_matrix:
        """Entries on the common pattern as compressed columns."""
        indptr, indices, order = self._transpose
        return sp.csc_matrix((values[order], indices, indptr), self.shape)

    @cached_property
    def _transpose(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        places = np.arange(self.indices.size, dtype=float)
        order = sp.csr_matrix((places, self.indices, self.indptr), self.shape).tocsc()
        return order.indptr, order.indices, order.data.astype(np.int64)


@cache
def direct_solver() -> str:
    """Name of the best LU package of this PETSc: MUMPS, SuperLU, UMFPACK or its own."""
    from petsc4py import PETSc

    probe = PETSc.Mat().createAIJ((1, 1), nnz=1, comm=PETSc.COMM_SELF)
    probe.setValue(0, 0, 1.0)
    probe.assemble()
    for name in ("mumps", "superlu", "umfpack", "petsc"):
        try:
            solver = PETSc.PC().create(PETSc.COMM_SELF)
            solver.setType("lu")
            solver.setFactorSolverType(name)
            solver.setOperators(probe)
            solver.setUp()
        except PETSc.Error:
            continue
        return name
    raise RuntimeError("This PETSc offers no LU factorisation.")


class DirectFactor:
    """LU factors of a matrix of fixed pattern through PETSc; the symbolic analysis is done once.

    Parameters
    ----------
    indptr, indices : int32 arrays
        CSR pattern. Values are handed to `refactor` in the same order.

    Attributes
    ----------
    values : array
        Matrix values, in PETSc's scalars.
    factorisations : int
    """

    def __init__(self, indptr: np.ndarray, indices: np.ndarray):
        from petsc4py import PETSc

        self._petsc, self._mumps, self.factorisations = PETSc, direct_solver() == "mumps", 0
        self.dtype, self.size = np.dtype(PETSc.ScalarType), len(indptr) - 1
        self.values = np.zeros(len(indices), self.dtype)
        self._pattern = tuple(np.ascontiguousarray(part, PETSc.IntType) for part in (indptr, indices))
        shape = self.size, self.size
        self._matrix = PETSc.Mat().createAIJWithArrays(shape, (*self._pattern, self.values), comm=PETSc.COMM_SELF)
        self._solver = PETSc.KSP().create(comm=PETSc.COMM_SELF)
        self._solver.setType("preonly")
        self._rhs_array, self._out_array = np.zeros((2, self.size), self.dtype)
        arrays = self._rhs_array, self._out_array
        self._rhs, self._out = (PETSc.Vec().createWithArray(array, comm=PETSc.COMM_SELF) for array in arrays)
        # PETSc keeps what Python lets go of, factors included, until it is told; runs that start afresh often would
        # fill the memory
        self._held = [self._solver.getPC(), self._solver, self._matrix, self._rhs, self._out]
        release = weakref.finalize(self, _release, self._held)
        release.atexit = False
        self._begin()

    def _begin(self) -> None:
        """Start without factors: failed ones are kept by PETSc and would be used again."""
        self._solver.reset()
        self._solver.setOperators(self._matrix)
        pc = self._solver.getPC()
        pc.setType("lu")
        pc.setFactorSolverType(direct_solver())
        self._factor = None

    def refactor(self, values: np.ndarray | None = None) -> None:
        """Factor the matrix with its `values`, or with others that take their place. Raises SingularShiftError if the
        values are not finite or the matrix is singular to working precision.
        """
        if values is not None:
            self.values[:] = values
        if not np.isfinite(self.values).all():
            raise SingularShiftError("The matrix holds numbers that are not finite.")
        self._matrix.assemble()
        self._matrix.stateIncrease()
        pc = self._solver.getPC()
        try:
            if self._factor is None:
                pc.setFactorSetUpSolverType()
                self._factor = pc.getFactorMatrix()
                self._held.append(self._factor)
                if self._mumps:  # room, in per cent, for what pivoting takes beyond the estimate
                    self._factor.setMumpsIcntl(14, 50)
            self._solver.setOperators(self._matrix)
            self._solver.setUp()
            failed = (
                self._factor.getMumpsInfog(1) < 0
                if self._mumps
                else not np.isfinite(self.solve(np.ones(self.size))).all()
            )
        except self._petsc.Error:
            failed = True
        if failed:
            self._begin()
            raise SingularShiftError("The matrix is singular.")
        self.factorisations += 1

    def solve(self, b: np.ndarray) -> np.ndarray:
        """Solve for one right-hand side, shape (n,), or a block, shape (n, k)."""
        if b.ndim == 2 and not b.shape[1]:
            return np.array(b)
        if np.iscomplexobj(b) and self.dtype.kind == "f":
            if b.ndim == 1:
                return self.solve(b.real) + 1j * self.solve(b.imag)
            both = self.solve(np.hstack([b.real, b.imag]))
            return both[:, : b.shape[1]] + 1j * both[:, b.shape[1] :]
        if b.ndim == 2:
            out = self._block(b)
        else:
            self._rhs_array[:] = b
            self._factor.solve(self._rhs, self._out)
            out = self._out_array.copy()
        return out if np.iscomplexobj(b) or not self._is_real else np.ascontiguousarray(out.real)

    @property
    def _is_real(self) -> bool:
        """True where the matrix is real, whatever PETSc's scalars are."""
        return self.dtype.kind == "f" or not self.values.imag.any()

    def solve_transposed(self, b: np.ndarray) -> np.ndarray:
        """Solve with the transpose (not the adjoint)."""
        if not self._mumps:
            if b.ndim == 2:
                return np.stack([self.solve_transposed(x) for x in b.T], axis=1) if b.shape[1] else np.array(b)
            if np.iscomplexobj(b) and self.dtype.kind == "f":
                return self.solve_transposed(b.real) + 1j * self.solve_transposed(b.imag)
            self._rhs_array[:] = b
            self._factor.solveTranspose(self._rhs, self._out)
            return self._out_array.copy()
        self._factor.setMumpsIcntl(9, 0)  # MUMPS solves with the transpose, whole blocks too, when told so
        try:
            return self.solve(b)
        finally:
            self._factor.setMumpsIcntl(9, 1)

    def _block(self, b: np.ndarray) -> np.ndarray:
        right = np.asfortranarray(b, dtype=self.dtype)
        out = np.zeros(right.shape, self.dtype, order="F")
        wrapped = [self._petsc.Mat().createDense(a.shape, array=a, comm=self._petsc.COMM_SELF) for a in (right, out)]
        for w in wrapped:
            w.assemble()
        self._factor.matSolve(*wrapped)
        for w in wrapped:
            w.destroy()
        return out


def _release(objects):
    for item in objects:
        item.destroy()


class ScaledLU:
    """Real or complex SuperLU of D A D with D = |diag A|^(-1/2), for a nearly symmetric pattern. Raises
    SingularShiftError if a pivot is exactly zero.

    Unknowns of different kinds (metres, radians) differ by powers of ten; unscaled, SuperLU leaves
    the diagonal for its pivots and fills in without need.

    Parameters
    ----------
    matrix : sparse, shape (n, n)
    pivoting : float
        Share of a column below which a pivot is not taken from the diagonal.
    """

    def __init__(self, matrix: sp.csc_matrix, pivoting: float = 0.01):
        matrix = sp.csc_matrix(matrix)
        size = np.abs(matrix.diagonal())
        typical = size.max(initial=0.0) or 1.0
        self._scale = 1.0 / np.sqrt(np.where(size > 1e-12 * typical, size, typical))
        D = sp.diags(self._scale)
        try:
            self._lu = spla.splu(
                (D @ matrix @ D).tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=pivoting,
                options={"SymmetricMode": True},
            )
        except RuntimeError as error:
            raise SingularShiftError(f"SuperLU could not factor the matrix ({error}).") from error
        self.dtype = matrix.dtype

    def solve(self, b: np.ndarray, mode: str = "N") -> np.ndarray:
        """Solve for one right-hand side, shape (n,), or a block, shape (n, k); mode "T" with the transpose."""
        if b.ndim == 2 and b.shape[1] == 0:
            return np.array(b)
        if np.iscomplexobj(b) and self.dtype.kind == "f":
            return self.solve(b.real.copy(), mode) + 1j * self.solve(b.imag.copy(), mode)
        scale = self._scale if b.ndim == 1 else self._scale[:, None]
        return scale * self._lu.solve(scale * np.asarray(b, dtype=self.dtype), mode)

    def solve_transposed(self, b: np.ndarray) -> np.ndarray:
        """Solve with the transpose (not the adjoint)."""
        return self.solve(b, "T")


def negative_directions(matrix) -> int:
    """Number of negative eigenvalues of the symmetric part of a real matrix, those near rounding left out: of the
    pivots on its diagonal (Sylvester's law of inertia).
    """
    symmetric = sp.csc_matrix(0.5 * (matrix + matrix.T))
    size = np.abs(symmetric.diagonal())
    room = 1e-10 * np.where(size > 0, size, size.max(initial=0.0) or 1.0)
    return int(np.sum(ScaledLU(symmetric + sp.diags(room), pivoting=0.0)._lu.U.diagonal() < 0))


def petsc_is_complex() -> bool:
    """True where the PETSc that is installed computes with complex numbers."""
    from petsc4py import PETSc

    return np.dtype(PETSc.ScalarType).kind == "c"


def _parts(pencil):
    return (pencil.M, pencil.C, pencil.K, *pencil.relaxing)


def _keys(matrix):
    rows = np.repeat(np.arange(matrix.shape[0], dtype=np.int64), np.diff(matrix.indptr))
    return rows * matrix.shape[1] + matrix.indices


def _same_pattern(matrix, pattern):
    return all(a is b or np.array_equal(a, b) for a, b in zip((matrix.indptr, matrix.indices), pattern))


def real_if_real(s: complex) -> float | complex:
    """A number without an imaginary part that is zero: matrices stay real at it."""
    s = complex(s)
    return s.real if s.imag == 0.0 else s


class Workspace:
    """Symbolic work that survives from pencil to pencil of one sparsity pattern.

    Hand the same workspace to every call for a family of pencils (a sweep, a path) and the
    pattern is analysed once.

    Examples
    --------
    >>> import numpy as np
    >>> pencil = CoupledPencil(M=np.eye(2), C=0.1 * np.eye(2), K=np.diag([1.0, 4.0]))
    >>> shifted = Workspace().shifted(pencil, 0.5)
    >>> q, U = shifted.solve(np.ones(2), np.zeros(0))
    >>> np.allclose(q, [1 / 1.3, 1 / 4.3])
    True
    """

    def __init__(self):
        self._structure: StructureMatrices | None = None
        self._real: DirectFactor | None = None
        self._loaded: CoupledPencil | None = None

    def structure(self, pencil: CoupledPencil) -> StructureMatrices:
        """M, C, K and what relaxes of the pencil on the common pattern."""
        if self._loaded is pencil:
            return self._structure
        if self._structure is None or not self._structure.load(pencil):
            self._structure = StructureMatrices(pencil)
            self._real = None
        self._loaded = pencil
        return self._structure

    def shifted(self, pencil: CoupledPencil, shift: complex) -> ShiftedPencil:
        """Factor the pencil at a shift.

        The factor of a real shift is valid until the next call with a real shift.

        Raises
        ------
        SingularShiftError
            If the shift is an eigenvalue to working precision.
        """
        return ShiftedPencil(pencil, self.structure(pencil), shift, self.factored(pencil, shift))

    def factored(self, pencil: CoupledPencil, shift: complex):
        """LU of the structure alone at a shift, shift^2 M + shift C + K and what relaxes.

        Raises
        ------
        SingularShiftError
            If a pivot is zero.
        """
        structure = self.structure(pencil)
        if complex(shift).imag == 0.0:
            if self._real is None:
                self._real = DirectFactor(structure.indptr, structure.indices)
            factor = self._real
        elif petsc_is_complex():
            factor = DirectFactor(structure.indptr, structure.indices)
        else:
            return ScaledLU(structure.columns(structure.values(shift)))
        factor.refactor(structure.values(shift))
        return factor

    def factor_stiffness(self, pencil: CoupledPencil):
        """LU of the stiffness of an undamped structure; where that is singular a little inertia stands in.

        Raises
        ------
        SingularShiftError
            If it is singular with that, too.
        """
        typical = pencil.typical_frequency
        return first_regular(self.factored, pencil, (share * typical for share in (0.0, 1e-4, 1e-3)))[1]


def first_regular(factor: Callable, pencil: CoupledPencil, shifts: Iterable[complex]) -> tuple[complex, Any]:
    """First of some shifts that is no eigenvalue, and the factor there, by `Workspace.shifted` or `Workspace.factored`.
    Raises SingularShiftError if all of them are.
    """
    singular = SingularShiftError("No shift is given.")
    for shift in shifts:
        try:
            return shift, factor(pencil, shift)
        except SingularShiftError as error:
            singular = error
    raise singular


class ShiftedPencil:
    """T(sigma) of the full pencil, ready for solves; also with its transpose. Raises SingularShiftError if either the
    sparse or the condensed matrix is singular to working precision.

    Parameters
    ----------
    pencil : CoupledPencil
    structure : StructureMatrices
    shift : complex
    factor : object with solve, solve_transposed
        LU of the structure, sigma^2 M + sigma C + K and what relaxes.
    """

    def __init__(self, pencil, structure, shift, factor):
        self.pencil, self.factor, self.shift = pencil, factor, real_if_real(shift)
        self._A, self._B, self._R, self._S = pencil.fluid_at(self.shift)
        # m further right-hand sides, once
        self.response = factor.solve(pencil.G.toarray())
        transfer = real_apply(pencil.J, self.response)
        small = condensed_matrix(self._A, self._B, self._R, self._S, transfer)
        # rows and columns differ by powers of the fluid's density: equilibrate before pivoting
        self._row = _scale(small, 1)
        self._col = _scale(small * self._row[:, None], 0)
        self._small = None
        if small.shape[0]:
            scaled = small * self._row[:, None] * self._col
            self._small = la.lu_factor(scaled, check_finite=False)
            if not np.isfinite(scaled).all() or _reciprocal_condition(scaled, self._small) < 1e-14:
                raise SingularShiftError("The condensed fluid matrix is singular at the shift.")
        self._check(structure)

    def solve(self, f: np.ndarray, g: np.ndarray):
        """Solve T(sigma) (q, U) = (f, g).

        Parameters
        ----------
        f : array, shape (n,) or (n, k)
        g : array, shape (b,) or (b, k)

        Returns
        -------
        q, U : arrays of the same shapes
        """
        q = self.factor.solve(f)
        if self._small is None:
            return q, np.array(g)
        y = real_apply(self.pencil.J, q)
        right = np.concatenate([self._A @ y, g - self._R @ y])
        unknown = _times(self._col, self._back(_times(self._row, right), 0))
        m = self._A.shape[0]
        return q + self.response @ unknown[:m], unknown[m:]

    def solve_transposed(self, f: np.ndarray, g: np.ndarray):
        """Solve T(sigma)^T (w, W) = (f, g); transposed, not conjugated."""
        if self._small is None:
            return self.factor.solve_transposed(f), np.array(g)
        m = self._A.shape[0]
        s = self.response.T @ f
        # h = A^T s + A^T H^T h - R^T W,  -B^T (s + H^T h) + S^T W = g: with h = small^T-solved
        # (z, W) of [I - A H, -B; R H, S]^T (z, W) = (s, g), h = A^T z - R^T W
        right = np.concatenate([s, g])
        unknown = _times(self._row, self._back(_times(self._col, right), 1))
        z, W = unknown[:m], unknown[m:]
        h = self._A.T @ z - self._R.T @ W
        return self.factor.solve_transposed(f + real_apply(self.pencil.J.T, h)), W

    def _back(self, right, transposed):
        if np.iscomplexobj(right) and not np.iscomplexobj(self._small[0]):
            return la.lu_solve(self._small, right.real, transposed, check_finite=False) + 1j * la.lu_solve(
                self._small, right.imag, transposed, check_finite=False
            )
        return la.lu_solve(self._small, right, transposed, check_finite=False)

    def _check(self, structure):
        """Refuse a factor that does not solve: pivots lost to a shift on an eigenvalue."""
        n = self.pencil.n
        probe = np.cos(1.0 + np.arange(n) ** 1.5)
        q = self.factor.solve(probe)
        error = np.linalg.norm(structure.matrix(self.shift) @ q - probe)
        size = np.linalg.norm(probe)
        # on an eigenvalue the right-hand side is lost in a solution blown up along the eigenvector
        if not error <= 1e-4 * size:
            raise SingularShiftError("The structural matrix is singular at the shift.")


def condensed_matrix(A, B, R, S, H) -> np.ndarray:
    """[I - A H, -B; R H, S], the full pencil condensed to (p, U), shape (..., m + b, m + b).

    Its determinant times that of the structure is the determinant of the full pencil; kept
    bordered, the fluid brings no poles of its own. Stacks of matrices give a stack.
    """
    m, b = B.shape[-2:]
    out = np.empty((*H.shape[:-2], m + b, m + b), np.result_type(A, B, R, S, H))
    out[..., :m, :m] = np.eye(m) - A @ H
    out[..., :m, m:] = -B
    out[..., m:, :m] = R @ H
    out[..., m:, m:] = S
    return out


def _scale(matrix, axis):
    largest = np.abs(matrix).max(axis=axis, initial=0.0)
    return 1.0 / np.where(largest > 0.0, largest, 1.0)


def _times(scale, x):
    return x * (scale if x.ndim == 1 else scale[:, None])


def _reciprocal_condition(matrix, lu):
    (gecon,) = la.get_lapack_funcs(("gecon",), (matrix,))
    return float(gecon(lu[0], np.linalg.norm(matrix, 1))[0])
