"""Eigenpairs near a shift by a compact Arnoldi method, for elastic and viscoelastic walls alike.

With x = (q, lambda q, U, lambda U, z_j) and (lambda - sigma) x_new = x_in all structural parts of a new vector are sums
of T(sigma)^-1 f and of parts that are there already, so that those of k vectors lie in k + 2 structural vectors (TOAR:
Lu, Su and Bai 2016; CORK: Van Beeumen, Meerbergen and Michiels 2015): work and memory are those of one structural
vector a step however many relaxation times there are.

Relaxation: thousands of real eigenvalues lie left of each -1/tau_j, nearer to a real shift than what oscillates. In the
plane of theta = 1/(lambda - sigma) they stay on the real axis, inside the circle near which the oscillating ones lie;
so these are counted by |Im theta|, and those right of the relaxation spectrum are taken in as they come.

Why not a library: measured at 6816 structural unknowns with four relaxation times, seconds of processor for ten leading
pairs, this takes 1.1; SLEPc's Krylov-Schur method on whole vectors 1.3 by imaginary part, and by magnitude none found
in 14; SLEPc's NLEIGS, which takes only real targets in real arithmetic, none found in 8. Its Krylov-Schur method works
on all parts of a vector; it can be put in this one's place by one argument, as tests/eigen/test_solver.py does.
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
    eigenvalues : ndarray, shape (k,)
    vectors_q : ndarray, shape (n, k), complex
        Structural part; for left pairs the conjugated left vector w of w^H T = 0.
    vectors_u : ndarray, shape (b, k), complex
    reach : float
        Radius of the disc around the shift in which every eigenvalue was found; of a viscoelastic wall at a real shift
        of the disc around shift + i reach, and of its mirror image.
    applications : int
        Applications of the shift-and-invert operator.
    exhausted : bool
        True if every eigenvalue of the pencil was found.
    beside : float
        Radius of a second disc of an elastic wall, around shift + i beside, in which every eigenvalue was found as
        well: it reaches higher frequencies than the first where real eigenvalues crowd at a limit point.
    """

    eigenvalues: np.ndarray
    vectors_q: np.ndarray
    vectors_u: np.ndarray
    reach: float
    applications: int
    exhausted: bool
    beside: float = 0.0

    def __repr__(self) -> str:
        found = "all there are" if self.exhausted else f"complete within {self.reach:.6g} 1/s of the shift"
        return f"<KrylovPairs: {len(self.eigenvalues)} pairs, {found}, {self.applications} applications>"


#: Steps before convergence is looked at, and between looks at least.
FIRST, EVERY = 30, 10
#: Relative error of theta up to which a pair counts as converged; Newton's corrections do the rest.
CONVERGED = 1e-12
#: Share of |theta| below which an imaginary part is rounding.
REAL = 1e-9
#: Distance over the shift beyond which a search does not wait for what lies right of the relaxation spectrum.
FAR = 10.0


class _Operator:
    """(F - sigma E)^-1 E with every structural part kept as coefficients of common vectors.

    The transposed pencil is one of the same form, whose inner unknowns act with lambda^2 as well, for which lambda U is
    kept among the unknowns.
    """

    def __init__(self, shifted: ShiftedPencil, transposed: bool):
        p, s = shifted.pencil, shifted.shift
        self.shifted, self.transposed = shifted, transposed
        self.n, self.b = p.n, p.b
        self.scale = abs(s) or 1.0
        self._relaxing = [matrix.T.tocsr() if transposed else matrix for matrix in p.relaxing]
        self.times = np.zeros(0) if p.relaxation is None else p.relaxation.times
        self._below = 1.0 / (1.0 + s * self.times)
        strengths = np.zeros((0, 0)) if p.relaxation is None else p.relaxation.strengths
        self._weights = strengths * (self.times * self._below)  # (g, j)

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
        inner, rate = u[0], self.scale * u[1]
        # T(lambda) - T(s) over lambda - s: T_1 + (lambda + s) T_2
        ahead = (v + s * q, rate + s * inner)
        f, g = self.shifted.pencil.polynomial(None, (q, inner), ahead, transposed=self.transposed)
        for matrix, x in zip(self._relaxing, relaxed):
            f = f + real_apply(matrix, x)
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
        self._rng = np.random.default_rng(seed)
        first = self._random()
        self.coefficients[0] = first / np.linalg.norm(first)

    def _random(self) -> np.ndarray:
        """A vector without preferred direction."""
        n, dtype, rng = len(self.Q), self.Q.dtype, self._rng
        c = np.zeros((2 + self.branches, self.rows), dtype)
        c[0] = self._added(rng.standard_normal(n).astype(dtype))
        c[1] = self._added(rng.standard_normal(n).astype(dtype))
        c[2:] = c[0] + rng.standard_normal((self.branches, 1)) * c[1]
        return self._packed(c, rng.standard_normal((2, self.operator.b)).astype(dtype))

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

    def advance(self) -> None:
        """One step; where an invariant space is complete another one begins."""
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
        if left > 1e-14 * size:
            self.H[k + 1, k] = left
            self.coefficients[k + 1] = x / left
            return
        x = self._random()
        for _ in range(2):
            x = x - (known.conj() @ x) @ known
        self.coefficients[k + 1] = x / np.linalg.norm(x)

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


def krylov_pairs(
    shifted: ShiftedPencil,
    wanted: int,
    *,
    band: float = np.inf,
    limit_point: float | None = None,
    transposed: bool = False,
    enough: Callable[[np.ndarray, float, float], bool] | None = None,
    most: int = 300,
) -> KrylovPairs:
    """Eigenpairs near the shift of a factored pencil.

    Those nearest to the shift; of a viscoelastic wall at a real shift those of large |Im 1/(lambda - shift)| and those
    right of its relaxation spectrum.

    Parameters
    ----------
    shifted : ShiftedPencil
        The pencil, its shift, and solves with it.
    wanted : int
        Number of eigenvalues, conjugates counted apart, that end a search of an elastic wall without `enough`.
    band : float
        Angular frequency, rad/s, up to which those right of the relaxation spectrum are waited for.
    limit_point : float, optional
        Real limit point of eigenvalues: the search ends where all that is left to converge lies as far from the shift.
        If `enough` wants more, it goes on for as many steps again with those of large |Im 1/(lambda - shift)|.
    transposed : bool
        Left vectors (conjugated) instead of right ones, from the same factor.
    enough : callable, optional
        enough(eigenvalues, reach, beside) is asked now and then about those that have converged; True ends the search.
    most : int
        Steps at most, one solve each.

    Returns
    -------
    KrylovPairs
        What did not converge is left out.
    """
    pencil, shift = shifted.pencil, shifted.shift
    whole = pencil.order + pencil.b  # lambda U is among the unknowns
    most = min(max(most, 3 * wanted + FIRST), whole)
    limit = 0.0 if limit_point is None else 1.0 / abs(END * limit_point - shift)
    krylov = _Arnoldi(_Operator(shifted, transposed), most)
    edge = edge_of(pencil.relaxation)
    real, limit_met = not isinstance(shift, complex), False
    while True:
        aim = min(most, max(FIRST, krylov.steps + max(EVERY, krylov.steps // EVERY)))
        while krylov.steps < aim:
            krylov.advance()
        theta, error, turn = krylov.ritz()
        beside, ended = 0.0, False
        if real and pencil.relaxation is not None:
            chosen, reach, ready = _oscillating(shift, theta, error, edge, band)
        else:
            chosen, reach, at_limit = _nearest(theta, error, limit)
            if real and limit:
                above, beside, _ = _oscillating(shift, theta, error, np.inf, band)
                chosen = np.union1d(chosen, above)
            ready = chosen.size > 0
            if at_limit and enough is not None:
                most, limit_met = (most if limit_met else min(most, 2 * krylov.steps)), True
            ended = enough is None and (at_limit or chosen.size >= wanted)
        ended = ended or krylov.steps >= most
        if ended or (ready and enough is not None and enough(shift + 1.0 / theta[chosen], reach, beside)):
            break
    q, u = krylov.vectors(turn[:, chosen])
    return KrylovPairs(
        eigenvalues=shift + 1.0 / theta[chosen],
        vectors_q=q.astype(complex),
        vectors_u=u.astype(complex),
        reach=reach,
        applications=krylov.steps,
        exhausted=krylov.steps == whole and chosen.size >= np.sum(_is_finite(theta)),
        beside=beside,
    )


def _is_finite(theta) -> np.ndarray:
    """Mask of finite eigenvalues."""
    return np.abs(theta) > 1e-12 * np.abs(theta).max(initial=0.0)


def _nearest(theta, error, limit):
    """Pairs that converged before any farther from the shift, the reach, and whether the limit point ends them."""
    size, good = np.abs(theta), (error <= CONVERGED) & _is_finite(theta)
    far = np.max(size[~good], initial=0.0)
    chosen = np.flatnonzero(good & (size > far))
    at_limit = far < limit
    return chosen, 1.0 / (limit if at_limit else size[chosen].min(initial=np.inf)), at_limit


def _oscillating(shift, theta, error, edge, band):
    """Indices of converged pairs, the reach, and whether all right of the relaxation spectrum, if not far off, are
    among them.
    """
    size, good = np.abs(theta), (error <= CONVERGED) & _is_finite(theta)
    height = np.where(np.abs(theta.imag) > REAL * size, np.abs(theta.imag), 0.0)
    values = shift + 1.0 / np.where(size > 0, theta, 1.0)
    right = (values.real > edge) & (size > 0)
    # outermost first; the first that has not converged ends what is known
    bound = height[~good].max(initial=0.0)
    oscillating = good & (height > bound)
    chosen = np.flatnonzero(oscillating | (good & right))
    waited = right & (np.abs(values.imag) <= band) & (size * FAR * shift >= 1.0)
    return chosen, 0.5 / height[oscillating].min(initial=np.inf), bool((good | ~waited).all())
