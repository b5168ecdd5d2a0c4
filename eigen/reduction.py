"""Small models of a family of pencils, for any of its conditions.

Two stages. The first space holds what coupling forces and motions do statically, K^-1 G and K^-T J^T, and what its own
inertia does, K^-1 M X. The second holds the leading eigenvectors of the first at a few conditions after one correction
with the full matrices, so that eigenvalues of forty vectors carry seven digits. With the inner unknowns scaled by
sqrt(inertia) the parts of the coupling are powers of sqrt(inertia) times those of unit inertia.

Where a stiffness relaxes its parts are projected once; `SmallSpectra` finds the leading eigenvalues of what is rational
then, and corrections are made with the stiffness that a typical motion sees.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from .family import Condition, PencilFamily
from .pencil import CoupledPencil, real_apply
from .rational import Refined
from .relaxation import Relaxation
from .small_spectra import SmallSpectra
from .static_solver import StaticSolver
from .structure_response import Reference
from .transfer import TransferBasis

#: Power of sqrt(inertia) that each part of the coupling goes with.
POWERS = {"A0": 0, "A1": 1, "A2": 2, "B0": 0, "B1": 1, "R0": 0, "R1": 1, "R2": 2, "S0": 0, "S1": 1}
#: Static corrections below this share of the largest are left out of the first space.
COMPRESSION = 1e-4
#: Share of the floor down to which vectors are taken into the second space.
SNAPSHOT = 0.75
#: Low motions that inertia corrections are made for.
MOTIONS = 20
#: Corrections of a vector where parts of the stiffness relax: one leaves 1e-6 of an eigenvalue, two 1e-8, and more do
#: not converge, since the inertia is left out of them.
CORRECTIONS = 2
#: Lowest motions of the structure taken where a band is searched.
LOWEST = 24


@dataclass(frozen=True)
class Pairs:
    """Eigenvalues with right and left vectors (columns): structural parts and inner unknowns."""

    values: np.ndarray
    q: np.ndarray
    u: np.ndarray
    w: np.ndarray
    c: np.ndarray


class ReducedFamily:
    """The pencils of a family on a space.

    Parameters
    ----------
    family : PencilFamily
    space : (n, k) array
        Made orthonormal in the mass here; directions below `compression` of the largest are left out.
    """

    def __init__(self, family: PencilFamily, space: np.ndarray, compression: float = 1e-9):
        self.family = family
        self.V, MV = V, MV = orthonormal(family.mass, space, compression)
        self.K = V.T @ (family.stiffness @ V)
        self.D = V.T @ (family.damping @ V)
        self.M = V.T @ MV
        self.G = family.forces.T.dot(V).T
        self.J = family.slope @ V
        self._coupled: dict[object, dict[str, np.ndarray]] = {}
        #: What `eigen.phase_count` keeps of the structure's response, by damping.
        self.responses: dict[tuple, object] = {}

    @property
    def size(self) -> int:
        """Number k of basis vectors."""
        return self.V.shape[1]

    @cached_property
    def relaxing(self) -> np.ndarray:
        """V^T K_g V of what relaxes, (g, k, k)."""
        relaxation = self.family.relaxation(1.0)
        parts = [] if relaxation is None else [self.V.T @ (matrix @ self.V) for matrix in relaxation.matrices]
        return np.array(parts).reshape(-1, self.size, self.size)

    def relaxation(self, loss: float) -> Relaxation | None:
        """What relaxes, on the space."""
        full = self.family.relaxation(loss)
        return None if full is None else Relaxation(tuple(self.relaxing), full.strengths, full.times)

    @cached_property
    def reference(self) -> Reference:
        """Positive matrices near those of the space."""
        return Reference.of(self.M, self.K, self.D, self.relaxing)

    @cached_property
    def small(self) -> SmallSpectra:
        """Leading eigenvalues of what relaxes."""
        return SmallSpectra(self)

    def coupling(self, law) -> dict[str, np.ndarray]:
        """Parts of the coupling at unit inertia between the vectors of the space."""
        if law not in self._coupled:
            if len(self._coupled) > 256:
                self._coupled.clear()
            p = self.family.parts(law)
            side = {"A": (self.G, self.J), "B": (self.G, None), "R": (None, self.J), "S": (None, None)}
            parts = {}
            for name, value in p.items():
                left, right = side[name[0]]
                value = value if left is None else left @ value
                parts[name] = value if right is None else value @ right
            self._coupled[law] = parts
        return self._coupled[law]

    def laden_frequencies(self, condition: Condition) -> np.ndarray:
        """Angular frequencies of the undamped structure with the inertia that its coupling brings, rad/s; none where
        the family says that it brings none.
        """
        if not self.family.added:
            return np.zeros(0)
        added = self.G[:, -self.family.added :]
        weight = -condition.inertia * np.diag(self.family.parts(condition.law)["A2"])[-self.family.added :]
        symmetric = 0.5 * (self.K + self.K.T)
        squares = la.eigh(symmetric, self.M + (added * weight) @ added.T, eigvals_only=True)
        return np.sqrt(squares[squares > 0])

    def pencil(self, condition: Condition) -> CoupledPencil:
        """The pencil of a condition on the space, inner unknowns scaled."""
        root = np.sqrt(condition.inertia)
        fluid = {name: value * root ** POWERS[name] for name, value in self.family.parts(condition.law).items()}
        return CoupledPencil(
            self.M,
            condition.alpha * self.M + condition.beta * self.D,
            self.K,
            self.G,
            self.J,
            **fluid,
            relaxation=self.relaxation(condition.loss),
        )

    def first_order(self, conditions, stiffening=None, damping=None) -> np.ndarray:
        """Matrices whose eigenvalues are those of the pencils without what relaxes, (cells, 2k + b, 2k + b).

        Parameters
        ----------
        conditions : sequence of Condition
        stiffening, damping : (cells, k, k) arrays, optional
            Added to the stiffness and to the damping.
        """
        k, cells = self.size, len(conditions)
        b = self.coupling(conditions[0].law)["S0"].shape[0]
        left, right = np.zeros((cells, k + b, k + b)), np.zeros((cells, k + b, 2 * k + b))
        for i, condition in enumerate(conditions):
            c, root = self.coupling(condition.law), np.sqrt(condition.inertia)
            left[i] = self._leading(condition)
            right[i, :k, :k] = c["A0"] - self.K
            right[i, :k, k : 2 * k] = root * c["A1"] - condition.alpha * self.M - condition.beta * self.D
            if b:
                right[i, :k, 2 * k :], right[i, k:, 2 * k :] = c["B0"], -c["S0"]
                right[i, k:, :k], right[i, k:, k : 2 * k] = -c["R0"], -root * c["R1"]
        if stiffening is not None:
            right[:, :k, :k] -= stiffening
        if damping is not None:
            right[:, :k, k : 2 * k] -= damping
        out = np.zeros((cells, 2 * k + b, 2 * k + b))
        out[:, :k, k : 2 * k] = np.eye(k)
        out[:, k:] = np.linalg.solve(left, right)
        return out

    def _leading(self, condition: Condition) -> np.ndarray:
        """What multiplies the rates of velocities and inner unknowns, (k + b, k + b)."""
        k, c, root = self.size, self.coupling(condition.law), np.sqrt(condition.inertia)
        b = c["S0"].shape[0]
        matrix = np.zeros((k + b, k + b))
        matrix[:k, :k] = self.M - condition.inertia * c["A2"]
        if b:
            matrix[:k, k:], matrix[k:, k:] = -root * c["B1"], root * c["S1"]
            matrix[k:, :k] = condition.inertia * c["R2"]
        return matrix

    def eigenvalues(self, conditions) -> np.ndarray:
        """All eigenvalues (cells, 2k + b), complex; of cells that relax the leading ones, and NaN."""
        conditions = list(conditions)
        relaxes = [self.family.relaxation(c.loss) is not None for c in conditions]
        if any(relaxes):
            return self._mixed(conditions, np.array(relaxes))
        matrices = self.first_order(conditions)
        return np.linalg.eigvals(matrices) if len(matrices) else np.zeros((0, matrices.shape[1]), complex)

    def _mixed(self, conditions, relaxes) -> np.ndarray:
        """Eigenvalues where some of the cells relax."""
        parts = []
        for group, solve in ((~relaxes, self.eigenvalues), (relaxes, self.small.leading)):
            cells = np.flatnonzero(group)
            if cells.size:
                parts.append((cells, solve([conditions[i] for i in cells])))
        out = np.full((len(conditions), max(found.shape[1] for _, found in parts)), complex(np.nan, np.nan))
        for cells, found in parts:
            out[cells, : found.shape[1]] = found
        return out

    def pairs(self, condition: Condition, most: int = 8, share: float = 1.0) -> Pairs:
        """Leading eigenpairs in the reach of a condition, lifted to the full unknowns; down to a share of its floor."""
        reach = self.family.reach(condition)
        if self.family.relaxation(condition.loss) is not None:
            lowest = share * reach.floor
            found = self.small.leading_pairs(
                condition, lambda values: np.array([v for v in reach.leading(values) if v.real > lowest][:most])
            )
            return self._of_rational(found)
        floor, band = reach.floor, reach.band
        values, left, right = la.eig(self.first_order([condition])[0], left=True, right=True)
        keep = np.flatnonzero((values.imag >= 0) & (values.imag <= band) & (values.real > share * floor))
        return self._lifted(condition, values, left, right, keep[np.argsort(-values.real[keep])][:most])

    def near(self, condition: Condition, eigenvalue: complex) -> Pairs:
        """The eigenpair nearest to a place."""
        if self.family.relaxation(condition.loss) is not None:
            return self._of_rational(self.small.pairs(condition, [eigenvalue]))
        values, left, right = la.eig(self.first_order([condition])[0], left=True, right=True)
        return self._lifted(condition, values, left, right, [int(np.argmin(np.abs(values - eigenvalue)))])

    def _of_rational(self, found: Refined) -> Pairs:
        """Eigenpairs of what relaxes, lifted."""
        k = self.size
        right, left = found.right.T, found.left.T
        return Pairs(found.values, self.V @ right[:k], right[k:], self.V @ left[:k], left[k:])

    def _lifted(self, condition, values, left, right, keep) -> Pairs:
        k = self.size
        # left vectors of F - lambda E from those of E^-1 F
        under = np.linalg.solve(self._leading(condition).T, left[k:, keep])
        return Pairs(values[keep], self.V @ right[:k, keep], right[2 * k :, keep], self.V @ under[:k], under[k:])


def orthonormal(mass, X: np.ndarray, compression: float, passes: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Mass-orthonormal basis of the span of columns, and mass times it; directions weaker than `compression` left out,
    each column counts alike.
    """
    MX = mass @ X
    size = np.sqrt(np.einsum("ij,ij->j", X, MX))
    X, MX = X[:, size > 0] / size[size > 0], MX[:, size > 0] / size[size > 0]
    # a second pass removes what rounding left in the first; the mass goes along, which spares a product
    for threshold in (max(compression**2, 1e-14), 1e-14)[:passes]:
        gram = X.T @ MX
        weight, turn = np.linalg.eigh(0.5 * (gram + gram.T))
        keep = weight > threshold * weight[-1]
        turn = turn[:, keep][:, ::-1] / np.sqrt(weight[keep][::-1])
        X, MX = X @ turn, MX @ turn
    return X, MX


class FamilyReduction:
    """Small models of a family, and what the full matrices say about them.

    Parameters
    ----------
    family : PencilFamily
    solver, stiffened : StaticSolver, optional
        Keep the symbolic factorisation between families of one pattern: of the stiffness, and of that which a typical
        motion sees where parts of it relax.

    Raises
    ------
    SingularShiftError
        If the stiffness is singular.
    """

    def __init__(self, family: PencilFamily, solver: StaticSolver | None = None, stiffened: StaticSolver | None = None):
        self.family = family
        self.solver = solver or StaticSolver()
        self.solver.factor(family)
        self._stiffened, self._loss = stiffened or StaticSolver(), None

    @cached_property
    def coarse(self) -> ReducedFamily:
        """First stage."""
        family = self.family
        still = [
            self.solver.solve(family.forces.toarray()),
            self.solver.solve_transposed(family.slope.toarray().T.copy()),
        ]
        first, inertia = orthonormal(family.mass, np.hstack(still), COMPRESSION, passes=1)
        # one step of subspace iteration on the lowest motions found there
        stiffness = first.T @ (family.stiffness @ first)
        lowest = la.eigh(0.5 * (stiffness + stiffness.T), subset_by_index=(0, min(MOTIONS, first.shape[1]) - 1))[1]
        moving = self.solver.solve(inertia @ lowest)
        return ReducedFamily(family, np.hstack([first, moving]), COMPRESSION)

    @cached_property
    def wide(self) -> ReducedFamily:
        """First stage with the lowest motions of the structure itself, for bands that damping does not end."""
        family = self.family
        structure = CoupledPencil(family.mass, sp.csr_matrix(family.mass.shape), family.stiffness)
        lowest = TransferBasis(structure, modes=LOWEST).V
        return ReducedFamily(family, np.hstack([lowest, self.coarse.V]), COMPRESSION)

    def residual(self, values, q, u, condition: Condition, left: bool = False):
        """T(lambda) x of pairs, or T^H w of left vectors: force part (n, k) and inner part (b, k)."""
        family, s = self.family, np.conj(values) if left else values
        turn = (lambda a: a.T) if left else (lambda a: a)
        q = np.asarray(q, complex)
        mq, kq = real_apply(family.mass, q), real_apply(turn(family.stiffness), q)
        force = mq * (s * s + condition.alpha * s) + kq
        if condition.beta:
            force += real_apply(turn(family.damping), q) * (condition.beta * s)
        relaxation = family.relaxation(condition.loss)
        if relaxation is not None:
            for factor, matrix in zip(relaxation.factors(s), relaxation.matrices):
                force += real_apply(turn(matrix), q) * factor
        y = real_apply(family.forces.T if left else family.slope, q)
        inner = np.zeros((u.shape[0], len(values)), complex)
        pressure = np.zeros_like(y)
        for i, value in enumerate(s):
            A, B, R, S = family.coupling_at(value, condition)
            if left:
                pressure[:, i] = A.T @ y[:, i] - R.T @ u[:, i]
                inner[:, i] = -B.T @ y[:, i] + S.T @ u[:, i]
            else:
                pressure[:, i] = A @ y[:, i] + B @ u[:, i]
                inner[:, i] = R @ y[:, i] + S @ u[:, i]
        force -= real_apply(family.slope.T if left else family.forces, pressure)
        return force, inner

    def corrected(self, pairs: Pairs, condition: Condition) -> tuple[np.ndarray, np.ndarray]:
        """Right and left structural vectors after one correction of what the space leaves out, (n, k) each."""
        force, _ = self.residual(pairs.values, pairs.q, pairs.u, condition)
        back, _ = self.residual(pairs.values, pairs.w, pairs.c, condition, left=True)
        if self.family.relaxation(condition.loss) is not None:
            return self._corrected_stiffly(pairs, condition, force, back)
        # far from the leading modes T is nearly (1 + lambda beta) K
        scale = 1.0 / (1.0 + pairs.values * condition.beta)
        return pairs.q - self.solver.solve(force) * scale, pairs.w - self.solver.solve_transposed(back) * np.conj(scale)

    def _corrected_stiffly(self, pairs: Pairs, condition: Condition, force, back):
        """The same where parts of the stiffness relax: with the stiffness that a typical motion sees, and repeated for
        what that differs from one mode and one part to another.
        """
        relaxation, small = self.family.relaxation(condition.loss), self.coarse.small
        typical = relaxation.factors(1j * small.frequency).real
        if self._loss != condition.loss:
            parts = zip(typical, relaxation.matrices)
            self._stiffened.factor(self.family, sum((x * part for x, part in parts), self.family.stiffness).tocsr())
            self._loss = condition.loss
        solver, share = self._stiffened, small.stiff_shares
        scale = 1.0 + share @ typical
        scale = scale / (1.0 + pairs.values * condition.beta + share @ relaxation.factors(pairs.values))
        q, w = pairs.q, pairs.w
        for repeat in range(CORRECTIONS):
            if repeat:
                force, _ = self.residual(pairs.values, q, pairs.u, condition)
                back, _ = self.residual(pairs.values, w, pairs.c, condition, left=True)
            q, w = q - solver.solve(force) * scale, w - solver.solve_transposed(back) * np.conj(scale)
        return q, w

    def fine(self, first: ReducedFamily, conditions, most: int = 4) -> ReducedFamily:
        """Second stage: a space made of the corrected leading vectors of a first one at some conditions."""
        columns = []
        for condition in conditions:
            right, left = self.corrected(first.pairs(condition, most, SNAPSHOT), condition)
            columns += [right.real, right.imag, left.real, left.imag]
        return ReducedFamily(self.family, np.hstack(columns), 3e-7)

    def correction(self, pairs: Pairs, condition: Condition) -> np.ndarray:
        """Newton's correction of eigenvalues by the full matrices, -w^H T x / (w^H T' x), complex (k,).

        Vectors are corrected once outside the space first; what the space lacks shows in it.
        """
        right, left = self.corrected(pairs, condition)
        force, inner = self.residual(pairs.values, right, pairs.u, condition)
        top = np.einsum("ij,ij->j", left.conj(), force) + np.einsum("ij,ij->j", pairs.c.conj(), inner)
        # T' by a difference quotient, good enough for the size of a correction
        step = 1e-3 * np.maximum(np.abs(pairs.values), 1.0)
        ahead = self.residual(pairs.values + step, right, pairs.u, condition)
        slope = (
            np.einsum("ij,ij->j", left.conj(), ahead[0] - force)
            + np.einsum("ij,ij->j", pairs.c.conj(), ahead[1] - inner)
        ) / step
        return -top / slope
