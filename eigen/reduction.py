"""Small models of a family of pencils, for any of its conditions.

Two stages. The first space holds what coupling forces and motions do statically, K^-1 G and K^-T J^T, and what its own
inertia does, K^-1 M X. The second holds the leading eigenvectors of the first at a few conditions after one correction
with the full matrices, so that eigenvalues of forty vectors carry seven digits; where they do not, its own are
corrected once more. Where a stiffness relaxes, corrections are made with the stiffness that a typical motion sees.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from .condensation import Workspace
from .factorization import StructureMatrices
from .family import Condition, PencilFamily
from .mass_basis import orthonormal
from .pencil import CoupledPencil, real_apply
from .reduced import Pairs, ReducedFamily
from .static_solver import StaticSolver
from .transfer import TransferBasis

#: Static corrections below this share of the largest are left out of the first space.
COMPRESSION = 1e-4
#: Share of the floor down to which vectors are taken into the second space.
SNAPSHOT = 0.75
#: Share of a vector corrected again that the second space lacks, below which it is left out.
DEEPER = 1e-5
#: Low motions that inertia corrections are made for.
MOTIONS = 20
#: Corrections of a vector where parts of the stiffness relax: one leaves 1e-6 of an eigenvalue, two 1e-8, and more do
#: not converge, since the inertia is left out of them.
CORRECTIONS = 2
#: Lowest motions of the structure taken where a band is searched.
LOWEST = 24
#: Further motions that the lowest ones are found with, and steps at most.
GUARD, REFINED = 6, 8
#: Relative change of their squares that ends them, a hundred times their error; and of a motion that has nothing new.
SETTLED, SAME = 1e-6, 1e-10


@dataclass(frozen=True)
class _Products:
    """What a residual needs of structural vectors, whatever their eigenvalues: their images under M, K, the damping of
    the material (None without), what relaxes, and the coupling.
    """

    mass: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray | None
    relaxing: list[np.ndarray]
    coupled: np.ndarray

    def __getitem__(self, own: slice) -> _Products:
        damping = None if self.damping is None else self.damping[:, own]
        relaxing = [image[:, own] for image in self.relaxing]
        return _Products(self.mass[:, own], self.stiffness[:, own], damping, relaxing, self.coupled[:, own])


class _Block:
    """Eigenpairs of several conditions side by side; `columns` says which are whose."""

    def __init__(self, several: list[Pairs], conditions):
        self.several, self.conditions = several, conditions
        sizes = [len(pairs.values) for pairs in several]
        ends = np.cumsum(sizes)
        self.columns = [slice(end - size, end) for size, end in zip(sizes, ends)]
        self.values = np.concatenate([pairs.values for pairs in several])
        self.beta = np.repeat([c.beta for c in conditions], sizes)
        self.q, self.w = np.hstack([pairs.q for pairs in several]), np.hstack([pairs.w for pairs in several])


class FamilyReduction:
    """Small models of a family, and what the full matrices say about them.

    Parameters
    ----------
    family : PencilFamily
    solver, stiffened : StaticSolver, optional
        Keep the symbolic factorisation between families of one pattern: of the stiffness, and of that which a typical
        motion sees where parts of it relax.
    workspace : Workspace, optional
        Keeps the pattern of the structure likewise.

    Raises
    ------
    SingularShiftError
        If the stiffness is singular.
    """

    def __init__(
        self,
        family: PencilFamily,
        solver: StaticSolver | None = None,
        stiffened: StaticSolver | None = None,
        workspace: Workspace | None = None,
    ):
        self.family, self._workspace = family, workspace or Workspace()
        self._matrices: StructureMatrices | None = None
        self.solver = solver or StaticSolver()
        self.solver.factor(family)
        self._stiffened, self._loss = stiffened or StaticSolver(), None
        family.model = weakref.ref(self)

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

    def lowest_frequencies(self, count: int) -> np.ndarray:
        """Lowest frequencies of the undamped symmetric structure, Hz, ascending, as the function of that name has them;
        none where the first stage does not lead to them.
        """
        family, coarse = self.family, self.coarse
        squares, turn = la.eigh(0.5 * (coarse.K + coarse.K.T))
        order = np.argsort(np.abs(squares))[: count + GUARD]  # those next to zero, as shift and invert finds them
        X, squares = coarse.V @ turn[:, order], squares[order]
        symmetric = ((family.stiffness + family.stiffness.T) * 0.5).tocsr()
        KX, MX = symmetric @ X, family.mass @ X
        for _ in range(REFINED):
            known = squares[:count]
            X = np.hstack([X, self.solver.solve((KX - MX * squares)[:, :count])])
            X, MX = orthonormal(family.mass, X, SAME)
            KX = symmetric @ X
            squares, turn = la.eigh(X.T @ KX)
            order = np.argsort(np.abs(squares))[: count + GUARD]
            squares, turn = squares[order], turn[:, order]
            X, KX, MX = X @ turn, KX @ turn, MX @ turn
            found = squares[:count]
            if known.size == found.size and (np.abs(found - known) <= SETTLED * np.abs(found)).all():
                return np.sort(np.sqrt(np.maximum(found, 0.0))) / (2 * np.pi)
        return np.zeros(0)

    def residual(self, values, q, u, condition: Condition, left: bool = False):
        """T(lambda) x of pairs, or T^H w of left vectors: force part (n, k) and inner part (b, k)."""
        return self._residual(self._products(q, condition.beta, condition.loss, left), values, u, condition, left)

    def _products(self, q, beta: float, loss: float, left: bool = False) -> _Products:
        family, relaxation = self.family, self.family.relaxation(loss)
        turn = (lambda a: a.T) if left else (lambda a: a)
        q = np.asarray(q, complex)
        return _Products(
            real_apply(family.mass, q),
            real_apply(turn(family.stiffness), q),
            real_apply(turn(family.damping), q) if beta else None,
            [] if relaxation is None else [real_apply(turn(matrix), q) for matrix in relaxation.matrices],
            real_apply(family.forces.T if left else family.slope, q),
        )

    def _residual(self, products: _Products, values, u, condition: Condition, left: bool = False):
        family, s, y = self.family, np.conj(values) if left else values, products.coupled
        force = products.mass * (s * s + condition.alpha * s) + products.stiffness
        if products.damping is not None:
            force += products.damping * (condition.beta * s)
        if products.relaxing:
            for factor, image in zip(family.relaxation(condition.loss).factors(s), products.relaxing):
                force += image * factor
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
        return self._all_corrected([pairs], [condition])[0]

    def _all_corrected(self, several: list[Pairs], conditions) -> list[tuple[np.ndarray, np.ndarray]]:
        """The same of several conditions, those of one factor on the loss factors in one block."""
        found = {}
        for loss in dict.fromkeys(c.loss for c in conditions):
            members = [i for i, c in enumerate(conditions) if c.loss == loss]
            block = _Block([several[i] for i in members], [conditions[i] for i in members])
            found |= zip(members, self._block_corrected(block, loss))
        return [found[i] for i in range(len(conditions))]

    def _block_corrected(self, block: _Block, loss: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        relaxation, values = self.family.relaxation(loss), block.values
        # far from the leading modes T is nearly (1 + lambda beta) K
        solver, passes, scale = self.solver, 1, 1.0 / (1.0 + values * block.beta)
        if relaxation is not None:
            # with the stiffness that a typical motion sees, and repeated for what that differs from one mode and one
            # part to another
            small = self.coarse.small
            typical, share = relaxation.factors(1j * small.frequency).real, small.stiff_shares
            solver, passes = self._stiffened_by(typical, block.conditions[0]), CORRECTIONS
            scale = (1.0 + share @ typical) / (1.0 + values * block.beta + share @ relaxation.factors(values))
        q, w = block.q, block.w
        for _ in range(passes):
            force, back = self._forces(block, q, loss), self._forces(block, w, loss, left=True)
            q, w = q - solver.solve(force) * scale, w - solver.solve_transposed(back) * np.conj(scale)
        return ((q[:, own], w[:, own]) for own in block.columns)

    def _forces(self, block: _Block, vectors: np.ndarray, loss: float, left: bool = False) -> np.ndarray:
        """Force parts of the residuals of a block with other structural vectors, (n, k)."""
        products = self._products(vectors, block.beta.max(initial=0.0), loss, left)
        return np.hstack(
            [
                self._residual(products[own], pairs.values, pairs.c if left else pairs.u, condition, left)[0]
                for own, pairs, condition in zip(block.columns, block.several, block.conditions)
            ]
        )

    def _stiffened_by(self, factors: np.ndarray, condition: Condition) -> StaticSolver:
        """Solver of the stiffness with its relaxing parts as stiff as factors say; that of the last one is kept."""
        if self._loss != condition.loss:
            if self._matrices is None:
                mass, relaxation = self.family.mass, self.family.relaxation(condition.loss)
                pencil = CoupledPencil(mass, sp.csr_matrix(mass.shape), self.family.stiffness, relaxation=relaxation)
                self._matrices = self._workspace.structure(pencil)
            self._stiffened.factor_sum(self._matrices, np.array([0.0, 0.0, 1.0, *factors]))
            self._loss = condition.loss
        return self._stiffened

    def fine(self, first: ReducedFamily, conditions, most: int = 4) -> ReducedFamily:
        """Second stage: a space made of the corrected leading vectors of a first one at some conditions."""
        columns = self._corrected_leading(first, conditions, most)
        if not columns.shape[1]:
            return first  # nothing leads anywhere: there is nothing to be found better
        return ReducedFamily(self.family, columns, 3e-7)

    def deeper(self, fine: ReducedFamily, conditions, most: int = 4) -> ReducedFamily:
        """A second stage made wider by its own leading vectors, corrected once more.

        What the first space has by too little is corrected by too little at once: an error of 1e-2 of its vectors
        leaves 1e-5 of an eigenvalue however many conditions they come from.
        """
        columns = self._corrected_leading(fine, conditions, most)
        return ReducedFamily(self.family, columns, DEEPER, base=fine) if columns.shape[1] else fine

    def _corrected_leading(self, model: ReducedFamily, conditions, most: int) -> np.ndarray:
        """Right and left leading vectors of a small model at some conditions, corrected by the full matrices, real and
        imaginary parts side by side.
        """
        several = model.several_pairs(conditions, most, SNAPSHOT)
        parts = [
            part
            for right, left in self._all_corrected(several, conditions)
            for part in (right.real, right.imag, left.real, left.imag)
        ]
        return np.hstack(parts)

    def correction(self, pairs: Pairs, condition: Condition) -> np.ndarray:
        """Newton's correction of eigenvalues by the full matrices, -w^H T x / (w^H T' x), complex (k,).

        Vectors are corrected once outside the space first; what the space lacks shows in it.
        """
        return self._newton(pairs, *self.corrected(pairs, condition), condition)

    def _newton(self, pairs: Pairs, right, left, condition: Condition) -> np.ndarray:
        products = self._products(right, condition.beta, condition.loss)
        force, inner = self._residual(products, pairs.values, pairs.u, condition)
        top = np.einsum("ij,ij->j", left.conj(), force) + np.einsum("ij,ij->j", pairs.c.conj(), inner)
        # T' by a difference quotient, good enough for the size of a correction
        step = 1e-3 * np.maximum(np.abs(pairs.values), 1.0)
        ahead = self._residual(products, pairs.values + step, pairs.u, condition)
        slope = (
            np.einsum("ij,ij->j", left.conj(), ahead[0] - force)
            + np.einsum("ij,ij->j", pairs.c.conj(), ahead[1] - inner)
        ) / step
        return -top / slope
