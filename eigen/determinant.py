"""Determinant of a pencil along a line, relative to a structure known to be stable.

det T(s) / det D_ref(s) with D_ref = s^2 M + s C_ref + K_ref, where M, C_ref, K_ref are
symmetric and positive definite, so that D_ref has no zero on or right of the line (Kelvin,
Tait, Chetaev). What relaxes of the stiffness is part of D_ref, as far as it is not negative: springs and
dashpots take energy out, and their poles lie left of the line. A dense pencil that relaxes is taken
relative to the oscillators that its modes are one by one, which are as stable and cost nothing. The ratio
has no pole right of the line and tends to a known power of s at infinity; its zeros there are the
eigenvalues counted, the structure's own among them.
"""

from __future__ import annotations

from bisect import bisect_left
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from .factor import ScaledLU, SingularShiftError, StructureMatrices, condensed_matrix, is_positive_definite
from .operator import CoupledPencil, Relaxation, real_apply


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
    """A symmetric structure that relaxes, one equation s^2 + s c + k + sum phi_g(s) k_g = 0 for each mode.

    The modes are those of the stiffness that nothing has relaxed of; what couples them besides is left out.

    Attributes
    ----------
    squares : (k,) array
        Of their angular frequencies, rad2/s2.
    damping, slow : (k,) arrays, 1/s, 1/s2
    relaxing : (g, k) array, 1/s2
    """

    squares: np.ndarray
    damping: np.ndarray
    slow: np.ndarray
    relaxing: np.ndarray

    @classmethod
    def of(cls, M, C, K, relaxing, relaxation: Relaxation | None) -> Oscillators:
        """From symmetric matrices; relaxing (g, n, n), g = 0 where nothing does."""
        fast = 0.0 if relaxation is None else np.tensordot(relaxation.strengths.sum(axis=1), relaxing, 1)
        squares, X = la.eigh(K + fast, M)
        damping, slow = (np.einsum("ik,ij,jk->k", X, part, X, optimize=True) for part in (C, K))
        relaxing = np.einsum("ik,gij,jk->gk", X, relaxing, X, optimize=True)
        return cls(squares, damping, slow, np.maximum(relaxing, 0.0))  # but for rounding they are

    def values(self, relaxation: Relaxation | None, places: np.ndarray) -> np.ndarray:
        """The left sides at places s, (len(places), k)."""
        s = np.asarray(places, complex)[:, None]
        elastic = self.slow + s * (s + self.damping)
        return elastic if relaxation is None else elastic + relaxation.factors(s[:, 0]).T @ self.relaxing

    def zeros(self, relaxation: Relaxation | None, steps: int = 12) -> np.ndarray:
        """Estimates of the oscillating zeros."""
        found = 1j * np.sqrt(np.maximum(self.squares, 0.0))
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
#: Condition of eigenvectors beyond which they do not represent a structure: its square root of rounding is lost.
_LARGEST_CONDITION = 0.01 * EPS**-0.5
#: Damping over angular frequency of reference oscillators that may have no other.
_LIGHT = 0.02


class Structure:
    """det D(s) of a structure over that of a stable one, and J D(s)^-1 G; dense or sparse.

    Parameters
    ----------
    pencil : CoupledPencil
        Its fluid does not matter.
    line : float
        Growth rate; the stable structure is so to the right of it.
    keep : bool
        Keep what was computed, for further pencils of one structure.

    Raises
    ------
    ValueError
        If M is not symmetric and positive definite.
    """

    dense_below = 400

    def __init__(self, pencil: CoupledPencil, line: float = 0.0, keep: bool = False):
        self.pencil, self.line = pencil, line
        self._known: dict[complex, tuple[np.ndarray, complex]] | None = {} if keep else None
        self._dense = pencil.n <= self.dense_below
        if abs(pencil.M - pencil.M.T).max() > 1e-10 * abs(pencil.M).max():
            raise ValueError("The count needs a symmetric mass matrix.")
        if not is_positive_definite(pencil.M):
            raise ValueError("The count needs a positive definite mass matrix.")
        self._prepare_reference()

    def at(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """J D^-1 G at places line + z, (k, m, m), and the logarithm of the ratio, (k,); NaN where D is singular."""
        if self._known is None:
            return self._computed(z)
        new = np.array([place for place in z.tolist() if place not in self._known], complex)
        if new.size:
            self._known.update(zip(new.tolist(), zip(*self._computed(new))))
        H, total = zip(*(self._known[place] for place in z.tolist()))
        return np.array(H), np.array(total)

    def _computed(self, z):
        stack = max(1, int(_STACK / self.pencil.n**2)) if self._dense else 1
        pieces = [self._tried(z[i : i + stack]) for i in range(0, z.size, stack)]
        return tuple(np.concatenate(parts) for parts in zip(*pieces))

    def _tried(self, z):
        try:
            return self._structure_at(z) if self._dense else self._sparse_structure_at(complex(z[0]))
        except (SingularShiftError, np.linalg.LinAlgError):
            if z.size == 1:
                m = self.pencil.m
                return np.full((1, m, m), np.nan + 0j), np.full(1, complex(np.nan, np.nan))
            return tuple(np.concatenate(parts) for parts in zip(*(self._tried(z[[i]]) for i in range(z.size))))

    def _prepare_reference(self):
        p, g = self.pencil, self.line
        # (g + z)^2 M + (g + z) C + K = z^2 M + z (C + 2 g M) + (K + g C + g^2 M)
        damping = (p.C + 2 * g * p.M).tocsr()
        stiffness = (p.K + g * p.C + g * g * p.M).tocsr()
        slow, self._relaxation = [], None
        if p.relaxation is not None:
            slow, self._relaxation = p.relaxation.beside(g)
            stiffness = (stiffness + sum(x * m for x, m in zip(slow, p.relaxing))).tocsr()
        symmetric = [((x + x.T) * 0.5).tocsr() for x in (damping, stiffness)]
        passive = [] if self._relaxation is None else _passive(p.relaxing, p.M, self._dense)
        changed = any(a is not b for a, b in zip(passive, p.relaxing))
        unit = abs(p.M).max()
        shifts = []
        for part in symmetric:
            if part is symmetric[0] and not part.nnz and not changed and _dissipates(self._relaxation):
                shifts.append(0.0)
                continue
            size = max(abs(part).max() / unit, 1e-300) if part.nnz else 1.0
            candidates = np.concatenate([[0.0], size * 10.0 ** np.arange(-8, 5)])
            for shift in candidates:
                if is_positive_definite(part + shift * p.M):
                    shifts.append(shift)
                    break
            else:
                raise ValueError("No stable reference structure was found for the count.")
        self._reference = tuple((part + shift * p.M).tocsr() for part, shift in zip(symmetric, shifts))
        difference = max(_gap(damping, self._reference[0]), _gap(stiffness, self._reference[1]))
        if changed:
            difference = np.inf
            self._relaxation = Relaxation(passive, self._relaxation.strengths, self._relaxation.times)
        self.structure_is_reference = difference < 1e-14
        if self._dense:
            self._parts = [x.toarray() for x in (p.M, p.C, p.K, *self._reference)]
            own = [self._parts[2], self._parts[1], self._parts[0], *(x.toarray() for x in p.relaxing)]
            self._flat = np.stack(own).reshape(len(own), -1)
            parts = np.array([x.toarray() for x in passive]).reshape(-1, p.n, p.n)
            modes = Oscillators.of(*(self._parts[i] for i in (0, 3, 4)), parts, self._relaxation)
            if changed:  # what was negative no longer damps
                modes = modes._replace(damping=modes.damping + _LIGHT * np.sqrt(np.maximum(modes.squares, 0.0)))
            self._oscillators = modes
            self._G, self._J = p.G.toarray(), p.J.toarray()
            self._mass_log = np.linalg.slogdet(self._parts[0])[1]
            elastic = p.relaxation is None
            self._modes = _StructureModes.of(*self._parts[:3], self._G, self._J) if elastic else None
            return
        self._structure = StructureMatrices(p)
        if not self.structure_is_reference:
            twin = CoupledPencil(M=p.M, C=self._reference[0], K=self._reference[1], relaxation=self._relaxation)
            self._twin = StructureMatrices(twin)

    @cached_property
    def inertance(self) -> np.ndarray:
        """J M^-1 G."""
        if self._dense:
            return self._J @ la.solve(self._parts[0], self._G, assume_a="pos")
        return self.pencil.J @ ScaledLU(self.pencil.M).solve(self.pencil.G.toarray())

    def reference_zeros(self) -> np.ndarray:
        """Eigenvalues of the reference in the upper half-plane, relative to the line.

        Estimated mode by mode for a dense pencil; none are computed for a sparse one.
        """
        return self._oscillators.zeros(self._relaxation) if self._dense else np.zeros(0, complex)

    def _structure_at(self, z):
        """H at a stack of places, shape (k, m, m), and log det D - log det D_ref there."""
        if self._modes is not None:
            H, total = self._modes.response(self.line + z)
        else:
            response, total = solved(self._dynamic_stiffness(self.line + z), self._G)
            if np.isnan(total).any():
                raise np.linalg.LinAlgError("A matrix is singular.")
            H, total = self._J @ response, total - self._mass_log
        if self.structure_is_reference:
            return H, np.zeros(z.size)
        return H, total - np.log(self._oscillators.values(self._relaxation, z)).sum(axis=1)

    def _dynamic_stiffness(self, s):
        """s^2 M + s C + K and what relaxes at a stack of places, shape (k, n, n)."""
        weights = [np.ones_like(s), s, s * s]
        if self.pencil.relaxation is not None:
            weights += list(self.pencil.relaxation.factors(s))
        # one product of real matrices, whose rows are real and imaginary parts in turn
        both = np.ascontiguousarray(np.stack(weights, axis=1)).view(float).reshape(s.size, -1, 2)
        flat = np.moveaxis(both, 2, 1).reshape(2 * s.size, -1) @ self._flat
        out = np.empty((s.size, self._flat.shape[1]), complex)
        out.real, out.imag = flat[0::2], flat[1::2]
        return out.reshape(s.size, self.pencil.n, -1)

    def _sparse_structure_at(self, z):
        p, s = self.pencil, self.line + z
        factor = ScaledLU(self._structure.columns(self._structure.values(s).astype(complex)))
        H = real_apply(p.J, factor.solve(p.G.toarray().astype(complex)))[None]
        if self.structure_is_reference:
            return H, np.zeros(1)
        twin = ScaledLU(self._twin.columns(self._twin.values(z).astype(complex)))
        return H, np.array([factor.log_determinant() - twin.log_determinant()])


class Determinant:
    """log det T(s) - log det D_ref(s) of a pencil.

    Parameters
    ----------
    pencil : CoupledPencil
    structure : Structure
        Of the pencil.

    Attributes
    ----------
    degree : int or None
        The ratio grows like leading * s**degree; None if the leading coefficient vanishes.
    leading_phase : float
        0 or pi.
    fluid : (k,) array
        Zeros of what the ratio is divided by where the fluid has several unknowns, see `eigen.operator.FluidMotions`.
    evaluations : int
    """

    def __init__(self, pencil: CoupledPencil, structure: Structure):
        self.pencil, self.structure, self.line = pencil, structure, structure.line
        self.evaluations = 0
        self.fluid = pencil.fluid.stable(self.line)
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


class _StructureModes:
    """J (s^2 M + s C + K)^-1 G and det / det M of a small structure from its eigenvectors."""

    def __init__(self, values, motions, forces):
        self.values, self.motions, self.forces = values, motions, forces

    @classmethod
    def of(cls, M, C, K, G, J) -> _StructureModes | None:
        """None where the eigenvectors are too close to each other to stand in for solves."""
        n = M.shape[0]
        values, vectors = la.eig(_first_order(M, C, K))
        force = np.vstack([np.zeros_like(G), la.solve(M, G, assume_a="pos")])
        scale = np.repeat([1.0, 1.0 / (np.abs(values).max(initial=0.0) or 1.0)], n)
        if not np.linalg.cond(scale[:, None] * vectors) < _LARGEST_CONDITION:
            return None
        return cls(values, J @ vectors[:n], la.solve(vectors, force.astype(complex)))

    def response(self, s):
        """H, shape (k, m, m), and log det D - log det M, shape (k,)."""
        distance = s[:, None] - self.values
        return (self.motions / distance[:, None, :]) @ self.forces, np.log(distance).sum(axis=1)


def _first_order(M, C, K):
    n = M.shape[0]
    return np.block([[np.zeros((n, n)), np.eye(n)], [-la.solve(M, K, assume_a="pos"), -la.solve(M, C, assume_a="pos")]])


def _passive(matrices, mass, dense: bool):
    """Relaxing stiffnesses, or where one is not symmetric or gives energy away one near it that does neither.

    Without it the reference of a wall that has no other damping would have its zeros on the line. Dense ones lose their
    negative part alone; sparse ones get a multiple of the mass on top.
    """
    return [_passive_part(matrix, mass, dense) for matrix in matrices]


def _passive_part(matrix, mass, dense):
    size = abs(matrix).max() / abs(mass).max() if matrix.nnz else 0.0
    if not size:
        return matrix
    symmetric = _gap(matrix, matrix.T) <= 1e-12
    if symmetric and is_positive_definite(matrix + 1e-9 * size * mass):
        return matrix
    other = matrix if symmetric else ((matrix + matrix.T) * 0.5).tocsr()
    if dense:
        weight, turn = la.eigh(other.toarray(), mass.toarray())
        turn = mass @ turn
        return sp.csr_matrix((turn * np.maximum(weight, 0.0)) @ turn.T)
    for shift in size * 10.0 ** np.arange(-8, 5):
        if is_positive_definite(other + shift * mass):
            return (other + shift * mass).tocsr()
    raise ValueError("No stable reference structure was found for the count.")


def _dissipates(relaxation: Relaxation | None) -> bool:
    """True where every motion loses energy in what relaxes, whose parts are not negative."""
    if relaxation is None:
        return False
    weight = (relaxation.strengths * relaxation.times).sum(axis=1)
    return is_positive_definite(sum(x * part for x, part in zip(weight, relaxation.matrices)))


def _log_determinant(stack) -> np.ndarray:
    sign, size = np.linalg.slogdet(stack)
    return size + 1j * np.angle(sign)


def _gap(a, b) -> float:
    size = max(abs(a).max(), abs(b).max()) if a.nnz or b.nnz else 0.0
    return float(abs(a - b).max() / size) if size else 0.0


MAX_PHASE = np.pi / 3
MAX_LOG = 1.0  # largest accepted increment of log |f|: feels zeros beside the line
CLOSE = 0.4  # distance of two places beside zeros that relax, over the distance of the zero from the line
MAX_PREDICTED = 1.5  # largest increment of log f that a neighbour's slope may predict
