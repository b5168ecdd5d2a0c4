"""The determinant of a full pencil along a line, relative to a structure known to be stable.

det T(s) / det D_ref(s) with D_ref = s^2 M + s C_ref + K_ref, where M, C_ref, K_ref are
symmetric and positive definite, so that D_ref has no zero on or right of the line (Kelvin,
Tait, Chetaev). What relaxes of the stiffness is part of D_ref, as far as it is not negative: springs and
dashpots take energy out, and their poles lie left of the line. A dense pencil that relaxes is taken
relative to the oscillators that its modes are one by one, which are as stable and cost nothing. The ratio
has no pole right of the line and tends to a known power of s at infinity; its zeros there are the
eigenvalues counted, the structure's own among them.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from .condensation import condensed_matrix
from .factorization import SingularShiftError, StructureMatrices, SuperluFactorization, superlu
from .inertia import is_positive_definite
from .oscillators import Oscillators
from .pencil import CoupledPencil, real_apply, stable_fluid
from .relaxation import Relaxation
from .systems import solved

#: Numbers at most in one stack of dense matrices.
_STACK = 1_000_000
#: Order up to which a structure is represented by its eigenvectors.
_MODAL_BELOW = 160
#: Number of places after which a larger one that does not relax is too.
_MODAL_AFTER = 300
#: Condition of those eigenvectors beyond which it is not.
_LARGEST_CONDITION = 1e6
#: Damping over angular frequency of reference oscillators that may have no other.
_LIGHT = 0.02


class Determinant:
    """log det T(s) - log det D_ref(s) of a pencil, dense or sparse.

    Parameters
    ----------
    pencil : CoupledPencil
    line : float
        Growth rate; the reference is stable to the right of it.

    Attributes
    ----------
    degree : int or None
        The ratio grows like leading * s**degree; None if the leading coefficient vanishes.
    leading_phase : float
        0 or pi.
    fluid : (k,) array
        Zeros of what the ratio is divided by where the fluid has several unknowns, see `eigen.pencil.stable_fluid`.
    evaluations : int

    Raises
    ------
    ValueError
        If M is not symmetric and positive definite.
    """

    dense_below = 400

    def __init__(self, pencil: CoupledPencil, line: float = 0.0):
        self.pencil, self.line = pencil, line
        self.evaluations = 0
        self._dense = pencil.n <= self.dense_below
        if abs(pencil.M - pencil.M.T).max() > 1e-10 * abs(pencil.M).max():
            raise ValueError("The count needs a symmetric mass matrix.")
        if not is_positive_definite(pencil.M):
            raise ValueError("The count needs a positive definite mass matrix.")
        self._prepare_reference()
        self._scale = None
        self.fluid = stable_fluid(pencil.S0, pencil.S1, line)
        self.degree, self.leading_phase = self._at_infinity()

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
            self._oscillators = None
            if self._relaxation is not None or p.n > _MODAL_BELOW:
                parts = np.array([x.toarray() for x in passive]).reshape(-1, p.n, p.n)
                mass, damping, stiffness = (self._parts[i] for i in (0, 3, 4))
                modes = Oscillators.of(mass, damping, stiffness, parts, self._relaxation)
                if changed:  # what was negative no longer damps
                    modes = modes._replace(damping=modes.damping + _LIGHT * np.sqrt(np.maximum(modes.squares, 0.0)))
                self._oscillators = modes
            self._G, self._J = p.G.toarray(), p.J.toarray()
            self._mass_log = np.linalg.slogdet(self._parts[0])[1]
            self._modes, self._modal = None, p.relaxation is None
            if p.n <= _MODAL_BELOW:
                self._take_modes()
            return
        self._structure = StructureMatrices(p)
        self._factor = SuperluFactorization(self._structure)
        if not self.structure_is_reference:
            twin = CoupledPencil(M=p.M, C=self._reference[0], K=self._reference[1], relaxation=self._relaxation)
            self._twin = StructureMatrices(twin)
            self._twin_factor = SuperluFactorization(self._twin)

    def _take_modes(self):
        """Represent the structure by its eigenvectors, if they can stand for it."""
        if self._modal:
            self._modes, self._modal = _StructureModes.of(*self._parts[:3], self._G, self._J), False

    def _at_infinity(self):
        p = self.pencil
        if self._dense:
            H = self._J @ la.solve(self._parts[0], self._G, assume_a="pos")
        else:
            H = p.J @ superlu(sp.csc_matrix(p.M)).solve(p.G.toarray())
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

    def reference_zeros(self) -> np.ndarray:
        """Eigenvalues of the reference in the upper half-plane, relative to the line.

        All of them for a dense pencil, estimated mode by mode where the stiffness relaxes; none are computed for a
        sparse one.
        """
        if not self._dense:
            return np.zeros(0, complex)
        if self._oscillators is not None:
            return self._oscillators.zeros(self._relaxation)
        values = self._every_reference_zero
        return values[values.imag > 0]

    @cached_property
    def _every_reference_zero(self):
        M, _, _, C, K = self._parts
        return la.eigvals(_first_order(M, C, K))

    def __call__(self, z: complex) -> complex:
        """log |ratio| + i arg ratio at line + z; the argument is known modulo 2 pi.

        NaN where the structure is singular to the last bit.
        """
        return complex(self.at([z])[0])

    def at(self, places) -> np.ndarray:
        """The same at many places, shape (k,); a dense pencil is evaluated in stacks."""
        places = np.asarray(places, complex)
        self.evaluations += places.size
        stack = max(1, int(_STACK / self.pencil.n**2)) if self._dense else 1
        pieces = [self._tried(places[i : i + stack]) for i in range(0, places.size, stack)]
        return np.concatenate(pieces) if pieces else np.zeros(0, complex)

    def _tried(self, z):
        with np.errstate(all="ignore"):
            try:
                H, total = self._structure_at(z) if self._dense else self._sparse_structure_at(complex(z[0]))
            except (SingularShiftError, np.linalg.LinAlgError):
                if z.size == 1:
                    return np.full(1, complex(np.nan, np.nan))
                return np.concatenate([self._tried(z[[i]]) for i in range(z.size)])
            return total + self._fluid_log(self.line + z, H) - np.log(z[:, None] - self.fluid).sum(axis=1)

    def _structure_at(self, z):
        """H at a stack of places, shape (k, m, m), and log det D - log det D_ref there."""
        if self.evaluations > _MODAL_AFTER:
            self._take_modes()
        if self._modes is not None:
            H, total = self._modes.response(self.line + z)
        else:
            response, total = solved(self._dynamic_stiffness(self.line + z), self._G)
            if np.isnan(total).any():
                raise np.linalg.LinAlgError("A matrix is singular.")
            H, total = self._J @ response, total - self._mass_log
        if self.structure_is_reference:
            return H, np.zeros(z.size)
        if self._oscillators is not None:
            return H, total - np.log(self._oscillators.values(self._relaxation, z)).sum(axis=1)
        return H, total - np.log(z[:, None] - self._every_reference_zero).sum(axis=1)

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
        self._factor.refactor(self._structure.values(s).astype(complex))
        H = real_apply(p.J, self._factor.solve(p.G.toarray().astype(complex)))[None]
        if self.structure_is_reference:
            return H, np.zeros(1)
        self._twin_factor.refactor(self._twin.values(z).astype(complex))
        return H, np.array([self._factor.log_determinant() - self._twin_factor.log_determinant()])

    def _fluid_log(self, s, H):
        small = condensed_matrix(*self.pencil.fluid_at(s[:, None, None]), H)
        if not small.size:
            return np.zeros(s.size)
        if self._scale is None:  # constant positive factors leave the phase alone
            size = np.abs(small[0]).max(axis=1)
            self._scale = np.where(size > 0, size, 1.0)
        return _log_determinant(small / self._scale[:, None])


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
    """Whether every motion loses energy in what relaxes, whose parts are not negative."""
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
