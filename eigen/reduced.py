"""The pencils of a family on a space, for any of its conditions.

With the inner unknowns scaled by sqrt(inertia) the parts of the coupling are powers of sqrt(inertia) times those of
unit inertia. Where a stiffness relaxes its parts are projected once; `SmallSpectra` finds the leading eigenvalues of
what is rational then.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as la

from .family import Condition, PencilFamily
from .mass_basis import orthonormal, outside
from .pencil import CoupledPencil, real_apply
from .rational import Refined
from .relaxation import Relaxation
from .small_spectra import SmallSpectra
from .structure_response import Reference

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
        #: What `eigen.phase_count` keeps of the structure's response, by damping.
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
        """The same of a condition where nothing relaxes."""
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
