r"""Eigenvalues of a pencil that relaxes: Arnoldi's method on its first-order form, kept compact.

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

import numpy as np
import scipy.linalg as la

from .condensation import ShiftedPencil
from .creep import creep_edge
from .krylov import KrylovPairs
from .pencil import real_apply

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
    edge = creep_edge(shifted.pencil)
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
    """Which pairs have converged, the reach, and whether all right of the creep, if not far off, are among them."""
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


def _apply(matrix, x):
    """Sparse product that keeps a real matrix real."""
    return real_apply(matrix, x) if matrix.dtype.kind == "f" else matrix @ x
