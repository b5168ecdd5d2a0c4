"""Determinant of a small pencil along a line, relative to damped oscillators.

det T(s) / (det M prod r_i(s)) with r_i(s) = s^2 + s c_i + k_i + sum phi_g(s) k_gi, one for each mode of the symmetric
structure, none of which has a zero or pole on or right of the line: springs and dashpots take energy out. The ratio
has no pole right of the line and tends to a known power of s at infinity; its zeros there are the eigenvalues counted,
the structure's own among them.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import NamedTuple

import numpy as np
import scipy.linalg as la

from .factor import condensed_matrix
from .operator import CoupledPencil, Relaxation


def principal(angle):
    """Angles brought to -pi..pi."""
    return (np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi


def middle(a, b) -> np.ndarray:
    """Places at which intervals are parted: on the positive axis in proportion where they are wide, else in length."""
    a, b = np.asarray(a, float), np.asarray(b, float)
    return np.where((a > 0) & (b > 4 * a), np.sqrt(np.abs(a * b)), 0.5 * (a + b))


def thinned(places, widths, apart: float) -> list[float]:
    """Places that lie apart by a share of their widths: zeros that are all well damped share theirs."""
    kept: list[float] = []
    for i in np.argsort(widths):
        at = bisect_left(kept, places[i])
        if all(abs(places[i] - w) > apart * widths[i] for w in kept[max(0, at - 1) : at + 1]):
            kept.insert(at, float(places[i]))
    return kept


def solved(matrices: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Solutions of systems, and logarithms of their determinants, from one factorisation each.

    Parameters
    ----------
    matrices : (k, n, n) complex array
        Overwritten.
    right : (n, m) array
        The same for all.

    Returns
    -------
    solutions : (k, n, m) complex array
    logarithms : (k,) complex array
        Both NaN where a matrix is singular.
    """
    right = np.asarray(right, complex)
    factor, solve = la.get_lapack_funcs(("getrf", "getrs"), (matrices, right))
    solutions = np.full((len(matrices), *right.shape), complex(np.nan, np.nan))
    logarithms = np.full(len(matrices), complex(np.nan, np.nan))
    for i, matrix in enumerate(matrices):
        # of the transpose, whose columns lie in memory as the rows of the matrix
        lu, pivots, singular = factor(matrix.T, overwrite_a=True)
        if singular > 0:
            continue
        solutions[i] = solve(lu, pivots, right, trans=1)[0]
        swaps = np.count_nonzero(pivots != np.arange(len(pivots)))
        logarithms[i] = np.log(lu.diagonal()).sum() + 1j * np.pi * swaps
    return solutions, logarithms


class Oscillators(NamedTuple):
    """Damped oscillators s^2 + s c + k + sum phi_g(s) k_g, one for each mode of a symmetric structure.

    The modes are those of the stiffness that nothing has relaxed of; what couples them besides is left out. A mode that
    diverges or gains energy is replaced by one of its size that does neither.
    """

    #: damping and slow: (k,), 1/s, 1/s2.
    damping: np.ndarray
    slow: np.ndarray
    relaxing: np.ndarray  #: (g, k), 1/s2.

    @classmethod
    def of(cls, M, C, K, relaxing, relaxation: Relaxation | None) -> Oscillators:
        """From dense matrices; relaxing (g, n, n), g = 0 where nothing does."""
        C, K, relaxing = (0.5 * (x + x.swapaxes(-1, -2)) for x in (C, K, relaxing))
        strengths, times = (
            (np.zeros((0, 0)), np.zeros(0)) if relaxation is None else (relaxation.strengths, relaxation.times)
        )
        squares, X = la.eigh(K + np.tensordot(strengths.sum(axis=1), relaxing, 1), M)
        damping, slow = (np.einsum("ik,ij,jk->k", X, part, X, optimize=True) for part in (C, K))
        relaxing = np.maximum(np.einsum("ik,gij,jk->gk", X, relaxing, X, optimize=True), 0.0)
        size = np.abs(squares)
        slow = np.where(slow > EPS * size.max(), slow, np.maximum(-slow, LIGHT * np.median(size)))
        losing = (damping >= 0) & (damping + (strengths @ times) @ relaxing > 0)
        return cls(np.where(losing, damping, LIGHT * np.sqrt(np.maximum(slow, size))), slow, relaxing)

    def values(self, relaxation: Relaxation | None, places: np.ndarray) -> np.ndarray:
        """The left sides at places s, (len(places), k)."""
        s = np.asarray(places, complex)[:, None]
        elastic = self.slow + s * (s + self.damping)
        return elastic if relaxation is None else elastic + relaxation.factors(s[:, 0]).T @ self.relaxing

    def zeros(self, relaxation: Relaxation | None, steps: int = 12) -> np.ndarray:
        """Estimates of the oscillating zeros."""
        fast = 0.0 if relaxation is None else relaxation.strengths.sum(axis=1) @ self.relaxing
        found = 1j * np.sqrt(self.slow + fast)
        for _ in range(steps):
            stiffness = self.slow + 0j
            if relaxation is not None:
                stiffness += (relaxation.factors(found) * self.relaxing).sum(axis=0)
            found = (
                -0.5 * self.damping
                + 1j * np.sqrt(np.maximum((stiffness - 0.25 * self.damping**2).real, 0.0))
                - 0.5 * (stiffness.imag / np.where(found.imag > 0, found.imag, 1.0))
            )
        return found[found.imag > 0]


#: Unit of rounding.
EPS = np.finfo(float).eps
#: Numbers at most in one stack of dense matrices.
_STACK = 1_000_000
#: Damping over angular frequency of reference oscillators that may have no other; their stiffness over a typical one.
LIGHT = 0.02


class Structure:
    """det D(s) of a structure over that of stable oscillators, and J D(s)^-1 G, kept for every pencil of the structure.
    Raises ValueError if M is not symmetric and positive definite, or the line lies left of the creep.

    Parameters
    ----------
    pencil : CoupledPencil
        Its fluid does not matter; treated densely.
    line : float
        Growth rate right of which the oscillators have no zero.
    """

    def __init__(self, pencil: CoupledPencil, line: float = 0.0):
        self.pencil, self.line = pencil, line
        self._known: dict[complex, tuple[np.ndarray, complex]] = {}
        M, C, K, *relaxing = (x.toarray() for x in (pencil.M, pencil.C, pencil.K, *pencil.relaxing))
        if np.abs(M - M.T).max() > 1e-10 * np.abs(M).max():
            raise ValueError("The count needs a symmetric mass matrix.")
        self._G, self._J = pencil.G.toarray(), pencil.J.toarray()
        flat = np.stack([K, C, M, *relaxing]).reshape(3 + len(relaxing), -1)
        filled = np.flatnonzero(flat.any(axis=0))
        self._filled = filled if 2 * filled.size < flat.shape[1] else slice(None)
        self._flat = np.ascontiguousarray(flat[:, self._filled])
        # (g + z)^2 M + (g + z) C + K = z^2 M + z (C + 2 g M) + (K + g C + g^2 M)
        relaxing, self._relaxation = np.array(relaxing).reshape(-1, *M.shape), None
        stiffness = K + line * C + line**2 * M
        if pencil.relaxation is not None:
            slow, self._relaxation = pencil.relaxation.beside(line)
            stiffness = stiffness + np.tensordot(slow, relaxing, 1)
        try:
            self._oscillators = Oscillators.of(M, C + 2 * line * M, stiffness, relaxing, self._relaxation)
        except np.linalg.LinAlgError as error:
            raise ValueError("The count needs a positive definite mass matrix.") from error
        self.inertance = self._J @ la.solve(M, self._G, assume_a="pos")  # J M^-1 G
        self._mass_log = np.linalg.slogdet(M)[1]

    def at(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """J D^-1 G at places line + z, (k, m, m), and the logarithm of the ratio, (k,); NaN where D is singular."""
        new = np.array([place for place in z.tolist() if place not in self._known], complex)
        stack = max(1, int(_STACK / self.pencil.n**2))
        for i in range(0, new.size, stack):
            places = new[i : i + stack]
            self._known.update(zip(places.tolist(), zip(*self._computed(places))))
        H, total = zip(*(self._known[place] for place in z.tolist()))
        return np.array(H), np.array(total)

    def reference_zeros(self) -> np.ndarray:
        """Estimates of the zeros of the oscillators in the upper half-plane, relative to the line."""
        return self._oscillators.zeros(self._relaxation)

    @property
    def slowest(self) -> float:
        """Least rate of what creeps, 1/s: of overdamped oscillators and of relaxations; infinite where nothing does."""
        damping, slow, _ = self._oscillators
        creeping = damping**2 > 4.0 * slow
        times = () if self._relaxation is None else self._relaxation.times
        return float(min([*(slow[creeping] / damping[creeping]), *(1.0 / np.asarray(times))], default=np.inf))

    def _computed(self, z):
        response, total = solved(self._dynamic_stiffness(self.line + z), self._G)
        own = np.log(self._oscillators.values(self._relaxation, z)).sum(axis=1)
        return self._J @ response, total - self._mass_log - own

    def _dynamic_stiffness(self, s):
        """s^2 M + s C + K and what relaxes at a stack of places, shape (k, n, n)."""
        weights = [np.ones_like(s), s, s * s]
        if self.pencil.relaxation is not None:
            weights += list(self.pencil.relaxation.factors(s))
        # one product of real matrices, whose rows are real and imaginary parts in turn
        both = np.ascontiguousarray(np.stack(weights, axis=1)).view(float).reshape(s.size, -1, 2)
        flat = np.moveaxis(both, 2, 1).reshape(2 * s.size, -1) @ self._flat
        out = np.zeros((s.size, self.pencil.n**2), complex)
        out.real[:, self._filled], out.imag[:, self._filled] = flat[0::2], flat[1::2]
        return out.reshape(s.size, self.pencil.n, -1)


class Determinant:
    """log det T(s) - log det D_ref(s) of a pencil.

    Parameters
    ----------
    structure : Structure
        Of the pencil.

    Attributes
    ----------
    degree : int or None
        The ratio grows like leading * s**degree; None if the leading coefficient vanishes.
    leading_phase : float
        0 or pi.
    power : float
        Exponent with which the ratio may grow over a wide interval: twice the unknowns of the fluid that it is not
        divided for, but for those that stand apart, and two.
    fluid : (k,) array
        Zeros of what the ratio is divided by where the fluid has several unknowns, see `eigen.operator.FluidMotions`.
    evaluations : int
    """

    def __init__(self, pencil: CoupledPencil, structure: Structure):
        self.pencil, self.structure, self.line = pencil, structure, structure.line
        self.evaluations = 0
        self.fluid = pencil.fluid.stable(self.line)
        others = np.hstack([pencil.R0, pencil.R1, pencil.R2, pencil.S1, pencil.S0 - np.diag(np.diag(pencil.S0))])
        self.power = 2.0 * (np.count_nonzero(others.any(axis=1)) - len(self.fluid) + 1)
        self.degree, self.leading_phase = self._at_infinity()

    def _at_infinity(self):
        p, H = self.pencil, self.structure.inertance
        grows = (p.B1 != 0).any(axis=0) | (p.S1 != 0).any(axis=0)
        leading = condensed_matrix(
            np.zeros_like(p.A0), np.where(grows, p.B1, p.B0), np.zeros_like(p.R0), np.where(grows, p.S1, p.S0), H
        )
        m = p.m
        if leading.size:
            leading[:m, :m] -= p.A2 @ H
            leading[m:, :m] = p.R2 @ H
        if not leading.size:
            return 0, 0.0
        size = np.abs(leading).max(axis=1)
        if (size == 0).any():
            return None, 0.0
        leading = leading / size[:, None]
        columns = np.abs(leading).max(axis=0)
        if (columns == 0).any():
            return None, 0.0
        leading = leading / columns
        if np.linalg.cond(leading) > 1e12:
            return None, 0.0
        return int(grows.sum()) - len(self.fluid), 0.0 if np.linalg.slogdet(leading)[0] > 0 else np.pi

    def at(self, places) -> np.ndarray:
        """Values at line + z for places z, shape (k,), the argument modulo 2 pi; NaN where the structure is singular to
        the last bit.
        """
        z = np.asarray(places, complex)
        self.evaluations += z.size
        if not z.size:
            return np.zeros(0, complex)
        with np.errstate(all="ignore"):
            H, total = self.structure.at(z)
            if self.pencil.m + self.pencil.b:
                coupling, own = self.pencil.fluid.condensed(self.line + z)
                total = total + own + _log_determinant(np.eye(self.pencil.m) - coupling @ H)
            return total - np.log(z[:, None] - self.fluid).sum(axis=1)


def _log_determinant(stack) -> np.ndarray:
    sign, size = np.linalg.slogdet(stack)
    return size + 1j * np.angle(sign)
