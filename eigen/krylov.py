"""Eigenvalues of a pencil near one shift, by SLEPc's Krylov-Schur method."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .condensation import ShiftedPencil
from .pencil import real_apply


@dataclass(frozen=True)
class KrylovPairs:
    """Pairs that converged at one shift.

    Attributes
    ----------
    vectors_q : ndarray, shape (n, k), complex
        Structural part; for left pairs the conjugated left vector w of w^H T = 0.
    vectors_u : ndarray, shape (b, k), complex
    eigenvalues : ndarray, shape (k,)
    reach : float
        Size of the region around the shift in which every eigenvalue was found, as
        |lambda - shift| |lambda - reference| < reach**2, see `SearchedRegion`.
    iterations, applications : int
        Restarts, and applications of the shift-and-invert operator.
    exhausted : bool
        True if every eigenvalue of the pencil was found.
    """

    eigenvalues: np.ndarray
    vectors_q: np.ndarray
    vectors_u: np.ndarray
    reach: float
    iterations: int
    applications: int
    exhausted: bool


class _ShiftAndInvert:
    """Operator (F - sigma E)^-1 E on x = (q, v / scale, U), or its transpose.

    Real arithmetic with a complex shift uses the imaginary part over Im sigma, which is
    (F - sigma E)^-1 E (F - conj(sigma) E)^-1: the same eigenvectors, the transformed
    eigenvalue 1 / ((lambda - sigma)(lambda - conj sigma)).
    """

    def __init__(self, shifted: ShiftedPencil, dtype, transposed: bool):
        pencil = shifted.pencil
        self.shifted, self.transposed = shifted, transposed
        self.n, self.b = pencil.n, pencil.b
        self.paired = np.dtype(dtype).kind == "f" and isinstance(shifted.shift, complex)
        self.scale = abs(shifted.shift) or 1.0
        p, s = pencil, shifted.shift
        self._A12 = p.A1 + s * p.A2
        self._R12 = p.R1 + s * p.R2
        self._MT = p.M.T.tocsr() if transposed else None
        self._CT = shifted.damping_shifted.T.tocsr() if transposed else None
        self._J, self._GT = shifted.motion, shifted.force
        self.applications = 0

    def mult(self, _matrix, x, y):
        self.applications += 1
        out = (self._left if self.transposed else self._right)(x.getArray(readonly=True))
        y.setArray(out.imag / self.shifted.shift.imag if self.paired else out)

    def _right(self, x):
        """y = (F - sigma E)^-1 E x by T(sigma) (q, U) = -(f, g), v = q_in + sigma q."""
        p, s, n = self.shifted.pencil, self.shifted.shift, self.n
        q_in, v_in, u_in = x[:n], x[n : 2 * n] * self.scale, x[2 * n :]
        f = real_apply(p.M, v_in) + _apply(self.shifted.damping_shifted, q_in)
        g = np.zeros(self.b, dtype=np.result_type(x, s))
        if p.m:
            yv, yq = (self._J @ np.stack([v_in, q_in], axis=1)).T
            f -= self._GT.transposed(p.A2 @ yv + self._A12 @ yq + p.B1 @ u_in)
            g = p.R2 @ yv + self._R12 @ yq
        g = g + p.S1 @ u_in
        q, u = self.shifted.solve(-f, -g)
        return np.concatenate([q, (q_in + s * q) / self.scale, u])

    def _left(self, z):
        """y = E^T (F - sigma E)^-T z; the left vector of T is part of (F - sigma E)^-T z."""
        p, s, n = self.shifted.pencil, self.shifted.shift, self.n
        z1, z2, z3 = z[:n], z[n : 2 * n] / self.scale, z[2 * n :]
        w, W = self.shifted.solve_transposed(-(z1 + s * z2), -z3)
        # a is the multiplier of dq/dt = v, from the second block column
        a = z2 + _apply(self._CT, w)
        e2 = real_apply(self._MT, w)
        e3 = p.S1.T @ W
        if p.m:
            t = self._GT @ w
            a = a + self._J.transposed(self._R12.T @ W - self._A12.T @ t)
            e2 = e2 + self._J.transposed(p.R2.T @ W - p.A2.T @ t)
            e3 = e3 - p.B1.T @ t
        return np.concatenate([a, e2 * self.scale, e3])

    def left_vector(self, z):
        """Left vector of the polynomial from an eigenvector of the transposed operator."""
        w, W = self.shifted.solve_transposed(
            -(z[: self.n] + self.shifted.shift * z[self.n : 2 * self.n] / self.scale), -z[2 * self.n :]
        )
        return w, W


def near_shift(
    shifted: ShiftedPencil,
    wanted: int,
    *,
    tolerance: float = 1e-10,
    subspace: int | None = None,
    max_restarts: int = 60,
    patience: int = 3,
    transposed: bool = False,
    limit_point: float | None = None,
    enough: Callable[[np.ndarray, float], bool] | None = None,
) -> KrylovPairs:
    """The eigenvalues nearest to the shift of a factored pencil.

    Parameters
    ----------
    shifted : ShiftedPencil
    wanted : int
        Number of eigenvalues, conjugates counted apart.
    tolerance : float
        Relative, on the transformed eigenvalue.
    subspace : int, optional
        Largest Krylov basis; default twice the number wanted, or the whole of a small space.
    max_restarts, patience : int
        Give up after so many restarts, or after `patience` of them that neither brought a further
        pair nor halved the error of the next: next to a limit point of eigenvalues no number of
        restarts helps, while in a dense spectrum all pairs converge late and together.
    transposed : bool
        Left vectors (conjugated) instead of right ones, from the same factor.
    limit_point : float, optional
        Real limit point of eigenvalues: the search ends when all that is left to converge lies as
        far from the shift as this, 3 per cent less.
    enough : callable, optional
        enough(eigenvalues, reach) is asked after each restart about those that have converged;
        True ends the search. Not asked at a complex shift in real arithmetic.

    Returns
    -------
    KrylovPairs
        Nearest first; what did not converge is left out.
    """
    from petsc4py import PETSc
    from slepc4py import SLEPc

    size = shifted.pencil.order
    wanted = min(wanted, size)
    operator = _ShiftAndInvert(shifted, PETSc.ScalarType, transposed)
    shell = PETSc.Mat().createPython((size, size), operator, comm=PETSc.COMM_SELF)
    shell.setUp()
    solver = SLEPc.EPS().create(comm=PETSc.COMM_SELF)
    solver.setOperators(shell)
    solver.setProblemType(SLEPc.EPS.ProblemType.NHEP)
    solver.setType(SLEPc.EPS.Type.KRYLOVSCHUR)
    solver.setWhichEigenpairs(SLEPc.EPS.Which.LARGEST_MAGNITUDE)
    solver.setTolerances(tolerance, max_restarts)
    stopping = _Patience(patience, SLEPc.EPS.ConvergedReason, _limit_size(shifted, limit_point))
    if enough is not None and not operator.paired:
        stopping.enough = lambda theta: enough(shifted.shift + 1.0 / theta, 1.0 / np.abs(theta).min())
        stopping.matrix = SLEPc.DS.MatType.A
    solver.setStoppingTest(stopping)
    solver.setMonitor(stopping.watch)
    subspace = subspace or (size if size <= 5 * wanted else max(2 * wanted, wanted + 24))
    solver.setDimensions(wanted, min(size, subspace))
    start = shell.createVecRight()
    start.setArray(np.random.default_rng(7).standard_normal(size))
    solver.setInitialSpace(start)
    solver.solve()
    pairs = _collect(solver, shell, operator, size, stopping.limit if stopping.at_limit else 0.0)
    for item in (solver, shell, start):
        item.destroy()
    return pairs


def _limit_size(shifted, limit_point) -> float:
    """Size of the transformed eigenvalue just right of a limit point; 0 without one."""
    if limit_point is None:
        return 0.0
    shift, place = complex(shifted.shift), 0.97 * limit_point
    mirror = shift.conjugate() if shift.imag else None
    distance = abs(place - shift)
    return 1.0 / (distance if mirror is None else distance * abs(place - mirror))


class _Patience:
    """Stopping test: enough pairs, too many restarts, no progress, or a limit point reached."""

    def __init__(self, patience, reasons, limit=0.0):
        self.patience, self.reasons, self.limit = patience, reasons, limit
        self.best, self.since = 0, 0
        self.error = np.inf  # smallest seen of the first pair that has not converged
        self.ritz = np.zeros(0)
        self.at_limit = False
        self.enough = None
        self.matrix = None

    def watch(self, _solver, restart, converged, ritz, errors):
        self.ritz = np.abs(np.array(ritz))
        if converged > self.best:
            self.error = np.inf
        error = errors[converged] if converged < len(errors) else 0.0
        if 0.0 < error <= 0.5 * self.error:
            self.error, self.since = error, restart

    def __call__(self, _solver, restart, max_restarts, converged, wanted):
        if converged >= wanted:
            return self.reasons.CONVERGED_TOL
        # the values of the restart before: they only move outwards
        if self.limit and converged < self.ritz.size and 0 < self.ritz[converged] < self.limit:
            self.at_limit = True
            return self.reasons.CONVERGED_USER
        if converged > self.best:
            self.best, self.since = converged, restart
            if self.enough is not None and self.enough(self._converged(_solver, converged)):
                return self.reasons.CONVERGED_USER
        if restart >= max_restarts or restart - self.since >= self.patience:
            return self.reasons.DIVERGED_ITS
        return self.reasons.CONVERGED_ITERATING

    def _converged(self, solver, number):
        """Transformed eigenvalues converged so far, from the projected Schur form."""
        projected = solver.getDS()
        schur = projected.getMat(self.matrix)
        values = np.linalg.eigvals(schur.getDenseArray()[:number, :number])
        projected.restoreMat(self.matrix, schur)
        return values


def _collect(solver, shell, operator, size, limit=0.0) -> KrylovPairs:
    shift, n = operator.shifted.shift, operator.n
    found = solver.getConverged()
    real = shell.createVecRight()
    imag = shell.createVecRight()
    values, q, u, theta_size = [], [], [], []
    for i in range(found):
        theta = solver.getEigenpair(i, real, imag)
        if theta == 0 or abs(theta) < 1e-14 / operator.scale:
            continue  # an infinite eigenvalue: E is singular
        x = real.getArray() + (0 if np.iscomplexobj(real.getArray()) else 1j * imag.getArray())
        theta_size.append(abs(theta))
        if operator.paired:
            values.append(_from_pair(theta, shift, x, n, operator))
        else:
            values.append(shift + 1.0 / theta)
        if operator.transposed:
            w, W = operator.left_vector(x)
            q.append(w)
            u.append(W)
        else:
            q.append(x[:n])
            u.append(x[2 * n :])
    k = len(values)
    far = limit or (min(theta_size) if k else np.inf)
    reach = far**-0.5 if operator.paired else 1.0 / far
    return KrylovPairs(
        eigenvalues=np.array(values, complex),
        vectors_q=np.array(q, complex).reshape(k, n).T,
        vectors_u=np.array(u, complex).reshape(k, operator.b).T,
        reach=reach,
        iterations=solver.getIterationNumber(),
        applications=operator.applications,
        exhausted=found >= size,
    )


def _from_pair(theta, shift, x, n, operator):
    """lambda from 1/theta = (lambda - shift)(lambda - conj shift); the vector picks the root."""
    root = np.sqrt(complex(1.0 / theta - shift.imag**2))
    candidates = np.array([shift.real + root, shift.real - root])
    if operator.transposed:
        w, W = operator.left_vector(x)
        pencil = operator.shifted.pencil
        estimate = [_left_residual(pencil, c, w, W) for c in candidates]
        return candidates[int(np.argmin(estimate))]
    rate = x[n : 2 * n] * operator.scale
    distance = [np.linalg.norm(rate - c * x[:n]) for c in candidates]
    return candidates[int(np.argmin(distance))]


def _left_residual(pencil, s, w, W):
    A, B, R, S = pencil.fluid_at(s)
    t = real_apply(pencil.G.T.tocsr(), w)
    first = (
        s * s * real_apply(pencil.M.T, w)
        + s * real_apply(pencil.C.T, w)
        + real_apply(pencil.K.T, w)
        + real_apply(pencil.J.T.tocsr(), R.T @ W - A.T @ t)
    )
    return np.linalg.norm(first)


def _apply(matrix, x):
    """Sparse product that keeps a real matrix real."""
    return real_apply(matrix, x) if matrix.dtype.kind == "f" else matrix @ x
