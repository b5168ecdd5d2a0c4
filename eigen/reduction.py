"""Reduced-order models of a family of pencils, for any of its conditions.

Two stages. The first space holds the static responses K^-1 G and K^-T J^T, and what their own inertia does, K^-1 M X.
The second holds the leading eigenvectors of the first at a few conditions, corrected once with the full matrices, so
that forty vectors carry seven digits of the eigenvalues; where they do not, its own are corrected once more.
"""

from __future__ import annotations

import weakref
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp

from .basis import TransferBasis, orthonormal, outside
from .factor import MumpsFactorization, SingularShiftError, StructureMatrices, Workspace
from .operator import Condition, CoupledPencil, PencilFamily, Relaxation, real_apply
from .reduced_counts import Reference
from .viscoelastic import Refined, SmallSpectra


class StaticSolver:
    """Block solves with K and its transpose; the symbolic factorisation is kept between families of one pattern."""

    def __init__(self):
        self._structure = None
        self._factor = None

    def factor(self, family: PencilFamily) -> None:
        """Factor K of a family; where it is singular a little inertia stands in.

        Raises
        ------
        SingularShiftError
        """
        pencil = CoupledPencil(family.mass, sp.csr_matrix(family.mass.shape), family.stiffness)
        if self._structure is not None and self._structure.fits(pencil):
            self._structure.load(pencil)
        else:
            self._structure = StructureMatrices(pencil)
            self._factor = MumpsFactorization(self._structure)
        self._refactor(np.array([0.0, 0.0, 1.0]))

    def factor_sum(self, matrices: StructureMatrices, weights: np.ndarray) -> None:
        """Factor a sum of matrices of one pattern, weights as of its data; where it is singular a little inertia stands
        in.

        Raises
        ------
        SingularShiftError
        """
        if self._structure is not matrices:
            self._structure, self._factor = matrices, MumpsFactorization(matrices)
        self._refactor(weights)

    def _refactor(self, weights: np.ndarray) -> None:
        inertia = np.eye(len(weights))[0]
        for shift in (0.0, 20.0, 100.0):
            try:
                return self._factor.refactor((weights + shift**2 * inertia) @ self._structure.data)
            except SingularShiftError:
                continue
        raise SingularShiftError("The stiffness of the family is singular.")

    def solve(self, right: np.ndarray) -> np.ndarray:
        """K^-1 of columns (n, k), real or complex."""
        return self._factor.solve(right)

    def solve_transposed(self, right: np.ndarray) -> np.ndarray:
        """K^-T of columns (n, k)."""
        inner = getattr(self._factor, "_factor", None)
        if not hasattr(inner, "setMumpsIcntl"):
            return self._factor.solve_transposed(right)
        inner.setMumpsIcntl(9, 0)  # MUMPS solves whole blocks with the transpose when told so
        try:
            return self._factor.solve(right)
        finally:
            inner.setMumpsIcntl(9, 1)


#: Power of sqrt(inertia) that each part of the coupling goes with.
POWERS = {"A0": 0, "A1": 1, "A2": 2, "B0": 0, "B1": 1, "R0": 0, "R1": 1, "R2": 2, "S0": 0, "S1": 1}


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
    base : ReducedFamily, optional
        Of the same family: its space is kept as it is, and made wider by what `space` has outside it; directions below
        `compression` of a vector's length are left out then.
    """

    def __init__(
        self,
        family: PencilFamily,
        space: np.ndarray,
        compression: float = 1e-9,
        base: ReducedFamily | None = None,
    ):
        self.family, self._base = family, base
        if base is None:
            self._own, _ = orthonormal(family.mass, space, compression)
            self.V = self._own
        else:
            self._own = outside(base.V, family.mass, space, compression)
            self.V = np.hstack([base.V, self._own])
        self._images: dict[object, np.ndarray] = {}
        self.K = self._projected("K", family.stiffness, None if base is None else base.K)
        self.D = self._projected("D", family.damping, None if base is None else base.D)
        self.M = self._projected("M", family.mass, None if base is None else base.M)
        self.G = family.forces.T.dot(self.V).T
        self.J = family.slope @ self.V
        self._coupled: dict[object, dict[str, np.ndarray]] = {}
        #: What `eigen.reduced_counts` keeps of the structure's response, by damping.
        self.responses: dict[tuple, object] = {}

    def _projected(self, name, matrix, known: np.ndarray | None) -> np.ndarray:
        """V^T A V, of which the part on the base may be known, and A V of the base under a name."""
        image = matrix @ self._own
        if known is None:
            self._images[name] = image
            return self._own.T @ image
        first, before = self._base.V, self._base._images.get(name)
        back = (first.T @ (matrix.T @ self._own)).T if before is None else self._own.T @ before
        return np.block([[known, first.T @ image], [back, self._own.T @ image]])

    @property
    def size(self) -> int:
        """Number k of basis vectors."""
        return self.V.shape[1]

    @cached_property
    def relaxing(self) -> np.ndarray:
        """V^T K_g V of what relaxes, (g, k, k)."""
        relaxation = self.family.relaxation(1.0)
        matrices = () if relaxation is None else relaxation.matrices
        known = [None] * len(matrices) if self._base is None else self._base.relaxing
        parts = [self._projected(i, *pair) for i, pair in enumerate(zip(matrices, known))]
        return np.array(parts).reshape(-1, self.size, self.size)

    def relaxation(self, loss: float) -> Relaxation | None:
        """Relaxation on the space."""
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
        """Matrix that multiplies the rates of velocities and inner unknowns, (k + b, k + b)."""
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

    def several_pairs(self, conditions, most: int = 8, share: float = 1.0) -> list[Pairs]:
        """`pairs` of several conditions; those that relax at once."""
        relaxing = [c for c in conditions if self.family.relaxation(c.loss) is not None]

        def chosen(condition, values):
            reach = self.family.reach(condition)
            return np.array([v for v in reach.leading(values) if v.real > share * reach.floor][:most])

        found = iter(self.small.leading_pairs(relaxing, chosen) if relaxing else ())
        return [
            self._linear_pairs(c, most, share)
            if self.family.relaxation(c.loss) is None
            else self.of_rational(next(found))
            for c in conditions
        ]

    def pairs(self, condition: Condition, most: int = 8, share: float = 1.0) -> Pairs:
        """Leading eigenpairs in the reach of a condition, lifted to the full unknowns; down to a share of its floor."""
        return self.several_pairs([condition], most, share)[0]

    def _linear_pairs(self, condition: Condition, most: int, share: float) -> Pairs:
        """Small pencil of a condition where nothing relaxes."""
        reach = self.family.reach(condition)
        floor, band = reach.floor, reach.band
        values, left, right = la.eig(self.first_order([condition])[0], left=True, right=True)
        keep = np.flatnonzero((values.imag >= 0) & (values.imag <= band) & (values.real > share * floor))
        return self._lifted(condition, values, left, right, keep[np.argsort(-values.real[keep])][:most])

    def nearest(self, condition: Condition, place: complex) -> complex:
        """The eigenvalue nearest to a place close to it."""
        if self.family.relaxation(condition.loss) is not None:
            return complex(self.small.pairs(condition, [place]).values[0])
        values = np.linalg.eigvals(self.first_order([condition])[0])
        return complex(values[int(np.argmin(np.abs(values - place)))])

    def near(self, condition: Condition, eigenvalue: complex) -> Pairs:
        """The eigenpair nearest to a place."""
        if self.family.relaxation(condition.loss) is not None:
            return self.of_rational(self.small.pairs(condition, [eigenvalue]))
        values, left, right = la.eig(self.first_order([condition])[0], left=True, right=True)
        return self._lifted(condition, values, left, right, [int(np.argmin(np.abs(values - eigenvalue)))])

    def of_rational(self, found: Refined) -> Pairs:
        """Eigenpairs of the small pencils of what relaxes, lifted."""
        k = self.size
        right, left = found.right.T, found.left.T
        return Pairs(found.values, real_apply(self.V, right[:k]), right[k:], real_apply(self.V, left[:k]), left[k:])

    def _lifted(self, condition, values, left, right, keep) -> Pairs:
        k = self.size
        # left vectors of F - lambda E from those of E^-1 F
        under = np.linalg.solve(self._leading(condition).T, left[k:, keep])
        right = right[:, keep]
        return Pairs(
            values[keep], real_apply(self.V, right[:k]), right[2 * k :], real_apply(self.V, under[:k]), under[k:]
        )


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
    """Parts that a residual needs of structural vectors, whatever their eigenvalues: their images under M, K, the
    damping of the material (None without), what relaxes, and the coupling.
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
        """Right and left structural vectors corrected once with the full matrices, (n, k) each."""
        return self._all_corrected([pairs], [condition])[0]

    def _all_corrected(self, several: list[Pairs], conditions) -> list[tuple[np.ndarray, np.ndarray]]:
        """Spectra of several conditions, those of one factor on the loss factors in one block."""
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
