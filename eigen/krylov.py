"""Eigenpairs near a shift: SLEPc's Krylov-Schur method, and a compact Arnoldi method for viscoelastic walls.

With x = (q, lambda q, U, lambda U, z_j) and (lambda - sigma) x_new = x_in all structural parts of a new vector are sums
of T(sigma)^-1 f and of parts that are there already, so that those of k vectors lie in k + 2 structural vectors (TOAR:
Lu, Su and Bai 2016; CORK: Van Beeumen, Meerbergen and Michiels 2015): work and memory are those of one structural
vector a step however many branches relax.

Creep: thousands of real eigenvalues lie left of each -1/tau_j, nearer to a real shift than what oscillates. In the
plane of theta = 1/(lambda - sigma) they stay on the real axis, inside the circle near which the oscillating ones lie;
so these are counted by |Im theta|, and those right of the creep are taken in as they come.

Measured at 6816 structural unknowns with four branches, seconds of processor for ten leading pairs: this 1.1, as much
as a search under Rayleigh damping; SLEPc's Krylov-Schur on whole vectors by imaginary part 1.3, by magnitude none found
in 14; SLEPc's NLEIGS, which takes only real targets in real arithmetic, none found in 8; a quadratic pencil in place of
the rational one, its vectors corrected on the latter, 1.9, with one pair of ten lost.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from .factor import ShiftedPencil
from .operator import edge_of, real_apply
from .spectrum import END


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
        p = self.shifted.pencil
        w, W = self.left_vector(z)
        # a is the multiplier of dq/dt = v, from the second block column
        a = z[self.n : 2 * self.n] / self.scale + _apply(self._CT, w)
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
        n = self.n
        return self.shifted.solve_transposed(-(z[:n] + self.shifted.shift * z[n : 2 * n] / self.scale), -z[2 * n :])


#: Restarts at most, and those after which a search ends that neither brought a further pair nor halved the error of the
#: next: next to a limit point no number helps, while in a dense spectrum all pairs converge late and together.
RESTARTS, PATIENCE = 60, 3


def near_shift(
    shifted: ShiftedPencil,
    wanted: int,
    *,
    tolerance: float = 1e-10,
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
    solver.setTolerances(tolerance, RESTARTS)
    stopping = _Patience(SLEPc.EPS.ConvergedReason, _limit_size(shifted, limit_point))
    if enough is not None and not operator.paired:
        stopping.enough = lambda theta: enough(shifted.shift + 1.0 / theta, 1.0 / np.abs(theta).min())
        stopping.matrix = SLEPc.DS.MatType.A
    solver.setStoppingTest(stopping)
    solver.setMonitor(stopping.watch)
    subspace = size if size <= 5 * wanted else max(2 * wanted, wanted + 24)
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
    shift, place = complex(shifted.shift), END * limit_point
    mirror = shift.conjugate() if shift.imag else None
    distance = abs(place - shift)
    return 1.0 / (distance if mirror is None else distance * abs(place - mirror))


class _Patience:
    """Stopping test: enough pairs, too many restarts, no progress, or a limit point reached."""

    def __init__(self, reasons, limit=0.0):
        self.reasons, self.limit = reasons, limit
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
        if restart >= max_restarts or restart - self.since >= PATIENCE:
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


#: Steps before convergence is looked at, and between looks.
FIRST, EVERY = 30, 10
#: Estimated relative error of theta below which a pair counts as converged; Newton's corrections do the rest.
CONVERGED = 1e-10
#: Share of |theta| below which an imaginary part is rounding.
REAL = 1e-9
#: Distance over the shift beyond which a search does not wait for what lies right of the creep.
FAR = 10.0


class _Operator:
    """(F - sigma E)^-1 E with every structural part kept as coefficients of common vectors.

    The transposed pencil is one of the same form, with G and J^T, B and -R^T exchanged; B then has a part with
    lambda^2, for which lambda U is kept among the unknowns.
    """

    def __init__(self, shifted: ShiftedPencil, transposed: bool):
        p, s = shifted.pencil, shifted.shift
        self.shifted, self.transposed = shifted, transposed
        self.n, self.b = p.n, p.b
        self.scale = abs(s) or 1.0
        turn = (lambda a: a.T.tocsr()) if transposed else (lambda a: a)
        self._M = turn(p.M)
        # sigma M + C, one product less where there is no C
        self._C = turn(shifted.damping_shifted) if p.C.nnz else None
        self._relaxing = [turn(matrix) for matrix in p.relaxing]
        self._G, self._J = (p.J.T.tocsr(), p.G.T.tocsr()) if transposed else (p.G, p.J)
        zero = np.zeros((p.b, p.m))
        if transposed:
            self._A = (p.A1.T, p.A2.T)
            self._B, self._R, self._S1 = (-p.R1.T, -p.R2.T), (-p.B1.T, zero), p.S1.T
        else:
            self._A, self._B, self._R, self._S1 = (p.A1, p.A2), (p.B1, zero.T), (p.R1, p.R2), p.S1
        self.times = p.relaxation.times
        self._below = 1.0 / (1.0 + s * self.times)
        self._weights = p.relaxation.strengths * (self.times * self._below)  # (g, j)

    def apply(self, Q, c, u):
        """Structural vector and inner unknowns of the new vector, before the former is made orthogonal.

        Parameters
        ----------
        Q : array, shape (n, r)
        c : array, shape (2 + j, r)
            Coefficients of q, lambda q / scale and z_j.
        u : array, shape (2, b)
        """
        s = self.shifted.shift
        sums = np.vstack([c[1:2] * self.scale, c[:1], self._weights @ c[2:]])
        v, q, *relaxed = (Q @ sums.T).T.copy()
        f = real_apply(self._M, v + s * q) if self._C is None else real_apply(self._M, v) + _apply(self._C, q)
        for matrix, x in zip(self._relaxing, relaxed):
            f += real_apply(matrix, x)
        g = self._S1 @ u[0]
        if self._G.shape[1]:
            yv, yq = self._J @ v, self._J @ q
            motion = self._A[1] @ yv + (self._A[0] + s * self._A[1]) @ yq
            inner = (self._B[0] + s * self._B[1]) @ u[0] + self._B[1] @ u[1] * self.scale
            f -= real_apply(self._G, motion + inner)
            g = g + self._R[1] @ yv + (self._R[0] + s * self._R[1]) @ yq
        solve = self.shifted.solve_transposed if self.transposed else self.shifted.solve
        q, inner = solve(-f, -g)
        return (q, inner) if isinstance(s, complex) else (q.real, inner.real)  # a PETSc of complex numbers

    def rest(self, c, u, q, inner):
        """Coefficients (2 + j, r) and inner unknowns of the new vector from those (r,) of its structural part."""
        s = self.shifted.shift
        below = self._below[:, None]
        new = np.vstack([q, (c[0] + s * q) / self.scale, below * (q - self.times[:, None] * c[2:])])
        return new, np.stack([inner, (u[0] + s * inner) / self.scale])


class _Arnoldi:
    """Krylov vectors as coefficients of an orthonormal basis Q of structural vectors."""

    def __init__(self, operator: _Operator, steps: int, seed: int = 7):
        n, b = operator.n, operator.b
        self.operator = operator
        self.steps = 0
        dtype = np.result_type(operator.shifted.shift, float)
        self.branches = operator.times.size
        most = min(steps + 2, n)
        self.Q = np.zeros((n, most), dtype, order="F")
        self.rows, self.rank = most, 0
        self.coefficients = np.zeros((steps + 1, (2 + self.branches) * most + 2 * b), dtype)
        self.H = np.zeros((steps + 1, steps), dtype)
        rng = np.random.default_rng(seed)
        c = np.zeros((2 + self.branches, most), dtype)
        c[0] = self._added(rng.standard_normal(n).astype(dtype))
        c[1] = self._added(rng.standard_normal(n).astype(dtype))
        c[2:] = c[0] + rng.standard_normal((self.branches, 1)) * c[1]
        first = self._packed(c, rng.standard_normal((2, b)).astype(dtype))
        self.coefficients[0] = first / np.linalg.norm(first)

    def _packed(self, c, u):
        return np.concatenate([c.ravel(), u.ravel()])

    def _parts(self, x):
        split = (2 + self.branches) * self.rows
        return x[:split].reshape(2 + self.branches, self.rows), x[split:].reshape(2, -1)

    def _added(self, q):
        """Coefficients of a structural vector, of which what is new joins the basis."""
        out = np.zeros(self.rows, self.Q.dtype)
        size = np.linalg.norm(q)
        known = self.Q[:, : self.rank]
        for _ in range(2):
            h = known.conj().T @ q
            q = q - known @ h
            out[: self.rank] += h
        left = np.linalg.norm(q)
        if left > 1e-14 * size and self.rank < self.rows:
            self.Q[:, self.rank] = q / left
            out[self.rank] = left
            self.rank += 1
        return out

    def advance(self) -> bool:
        """One step; False where the space is exhausted."""
        k = self.steps
        c, u = self._parts(self.coefficients[k])
        q, inner = self.operator.apply(self.Q[:, : self.rank], c[:, : self.rank], u)
        x = self._packed(*self.operator.rest(c, u, self._added(q), inner))
        size, known = np.linalg.norm(x), self.coefficients[: k + 1]
        for _ in range(2):
            h = known.conj() @ x
            x = x - h @ known
            self.H[: k + 1, k] += h
        left = np.linalg.norm(x)
        self.steps += 1
        if left <= 1e-14 * size:
            return False
        self.H[k + 1, k] = left
        self.coefficients[k + 1] = x / left
        return True

    def ritz(self):
        """theta, estimated relative errors, and coefficients in the Krylov vectors as columns."""
        k = self.steps
        theta, turn = la.eig(self.H[:k, :k], check_finite=False)
        size = np.abs(theta)
        error = np.abs(self.H[k, k - 1]) * np.abs(turn[-1])
        return theta, error / np.where(size > 0, size, 1.0), turn

    def vectors(self, turn):
        """Structural parts (n, k) and inner unknowns (b, k) of combinations of Krylov vectors."""
        x = self.coefficients[: self.steps].T @ turn
        split = (2 + self.branches) * self.rows
        return self.Q[:, : self.rank] @ x[: self.rank], x[split : split + self.operator.b]


def oscillating_pairs(
    shifted: ShiftedPencil,
    *,
    most: int = 300,
    band: float = np.inf,
    tolerance: float = CONVERGED,
    transposed: bool = False,
    enough: Callable[[np.ndarray, float], bool] | None = None,
) -> KrylovPairs:
    """Eigenpairs of a pencil that relaxes: those of large |Im 1/(lambda - shift)|, and those right of the creep.

    At a complex shift those nearest to it.

    Parameters
    ----------
    shifted : ShiftedPencil
    most : int
        Steps at most, one solve each.
    band : float
        Angular frequency, rad/s, up to which those right of the creep are waited for.
    tolerance : float
        Estimated relative error of theta = 1/(lambda - shift) of a pair that has converged.
    transposed : bool
        Left vectors (conjugated) instead of right ones, from the same factor.
    enough : callable, optional
        enough(eigenvalues, reach) is asked now and then about those that have converged; True ends the search.

    Returns
    -------
    KrylovPairs
        `reach` is the radius R of the disc around shift + i R, and of its mirror image, in which all were found; at
        a complex shift of the disc around it.
    """
    shift = shifted.shift
    order = shifted.pencil.order
    most = min(most, order)
    krylov = _Arnoldi(_Operator(shifted, transposed), most)
    edge = edge_of(shifted.pencil.relaxation)
    alive = True
    while True:
        aim = min(most, FIRST if krylov.steps < FIRST else krylov.steps + EVERY)
        while alive and krylov.steps < aim:
            alive = krylov.advance()
        theta, error, turn = krylov.ritz()
        chosen, reach, settled = _settled(shift, theta, error, edge, band, tolerance)
        ended = not alive or krylov.steps >= most
        if ended or (settled and enough is not None and enough(shift + 1.0 / theta[chosen], reach)):
            break
    q, u = krylov.vectors(turn[:, chosen])
    return KrylovPairs(
        eigenvalues=shift + 1.0 / theta[chosen],
        vectors_q=q.astype(complex),
        vectors_u=u.astype(complex),
        reach=reach,
        iterations=1,
        applications=krylov.steps,
        exhausted=False,
    )


def _settled(shift, theta, error, edge, band, tolerance):
    """Mask of converged pairs, the reach, and whether all right of the creep, if not far off, are among them."""
    size = np.abs(theta)
    good = (error <= tolerance) & (size > 1e-12 * size.max(initial=0.0))
    if isinstance(shift, complex):
        far = np.max(size[~good], initial=0.0)
        chosen = np.flatnonzero(good & (size > far))
        return chosen, 1.0 / size[chosen].min() if chosen.size else 0.0, True
    height = np.where(np.abs(theta.imag) > REAL * size, np.abs(theta.imag), 0.0)
    values = shift + 1.0 / np.where(size > 0, theta, 1.0)
    right = (values.real > edge) & (size > 0)
    # outermost first; the first that has not converged ends what is known
    bound = height[~good].max(initial=0.0)
    oscillating = good & (height > bound)
    chosen = np.flatnonzero(oscillating | (good & right))
    lowest = height[oscillating].min(initial=np.inf)
    waited = right & (np.abs(values.imag) <= band) & (size * FAR * shift >= 1.0)
    settled = bool((good | ~waited).all())
    return chosen, 0.5 / lowest if np.isfinite(lowest) else 0.0, settled


def krylov_pairs(
    shifted: ShiftedPencil,
    wanted: int,
    *,
    tolerance: float = 1e-12,
    band: float = np.inf,
    limit_point: float | None = None,
    transposed: bool = False,
    enough: Callable[[np.ndarray, float], bool] | None = None,
) -> KrylovPairs:
    """Eigenpairs near the shift of a factored pencil: what a search asks of any eigen-solver.

    Parameters
    ----------
    shifted : ShiftedPencil
        The pencil, its shift, and solves with it.
    wanted : int
        Number of eigenvalues, conjugates counted apart; those nearest to the shift, and of a viscoelastic wall those
        that oscillate.
    tolerance : float
        Relative.
    band : float
        Angular frequency of interest, rad/s.
    limit_point : float, optional
        Real limit point of eigenvalues, at which the search may end.
    transposed : bool
        Left vectors (conjugated) instead of right ones.
    enough : callable, optional
        enough(eigenvalues, reach) is True where no more are needed.

    Returns
    -------
    KrylovPairs
        With `reach` as large as is known to be complete, and `exhausted` where these are all eigenvalues.
    """
    if shifted.pencil.relaxation is not None:
        return oscillating_pairs(shifted, band=band, transposed=transposed, enough=enough)
    return near_shift(
        shifted, wanted, tolerance=tolerance, transposed=transposed, limit_point=limit_point, enough=enough
    )
