"""Fluid outside a wall in motion: added mass frozen at a shape, and renewed when the wall has left it.

Between two renewals M_a is constant, so that steps treat it as they treat constant mass and the balance of energy
holds. A renewal changes the kinetic energy at given velocities; what it adds is kept in the books. The inertia
quadratic in the velocities that a changing added mass brings is what the renewals leave out.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import scipy.linalg as la

from ..model import ValveModel
from ..model.outside import AddedMass

#: Largest displacement of the wall, over the radius of the flange, up to which an added mass is kept.
KEPT_WITHIN = 0.03
#: Shapes whose added mass is remembered, for motions that come back to them.
REMEMBERED = 24


class MovingOutside:
    """Added mass along a motion.

    Parameters
    ----------
    model : ValveModel
        With a fluid outside.
    density : float
        Of that fluid, kg/m3.
    length : callable
        Largest displacement in a change (n,) of the unknowns, m.

    Attributes
    ----------
    renewed : float
        Energy that renewals have added since the start, J of the part.
    renewals : int
        How often the added mass changed.
    """

    def __init__(self, model: ValveModel, density: float, length: Callable[[np.ndarray], float]):
        self.model, self.density, self._length = model, density, length
        self.within = KEPT_WITHIN * model.case.valve.flange_radius
        self.renewed, self.renewals = 0.0, 0
        self._place: np.ndarray | None = None
        self._mass: AddedMass | None = None
        self._known: list[tuple[np.ndarray, AddedMass]] = []

    def force(self, q: np.ndarray, a: np.ndarray) -> np.ndarray:
        """M_a a (n,); for accelerations at positions q where no added mass is known yet."""
        w = self._at(q).columns
        return self.density * (w @ (w.T @ a))

    def energy(self, q: np.ndarray, v: np.ndarray) -> float:
        """Kinetic energy of the fluid, J of the part."""
        return 0.5 * self.density * float(np.sum((self._at(q).columns.T @ v) ** 2))

    def _at(self, q: np.ndarray) -> AddedMass:
        if self._mass is None:
            self._take(q)
        return self._mass

    def begin_step(self, q: np.ndarray, v: np.ndarray) -> None:
        """Renew the added mass where the wall has moved too far from where it was taken."""
        if self._place is None or self._length(q - self._place) > self.within:
            self._change(q, v)

    def start_afresh(self, q: np.ndarray, v: np.ndarray) -> None:
        """Take the added mass at a state and forget all others, so that what follows depends on the state alone."""
        self._known.clear()
        if self._place is None or not np.array_equal(q, self._place):
            self._change(q, v)

    def _change(self, q, v):
        before = None if self._mass is None else self.energy(q, v)
        self._take(q)
        self.renewals += 1
        if before is not None:
            self.renewed += self.energy(q, v) - before

    def _take(self, q: np.ndarray) -> None:
        near = [pair for pair in self._known if self._length(q - pair[0]) <= 0.5 * self.within]
        if near:
            self._place, self._mass = min(near, key=lambda pair: self._length(q - pair[0]))
            return
        model = self.model
        structure = model.shell.dofs.matrix(model.structure(q)[1])
        self._place, self._mass = np.array(q), model.outside.added_mass(q, structure)
        self._known = [*self._known[1 - REMEMBERED :], (self._place, self._mass)]

    def correction(self, solve: Callable, weight: float) -> OutsideCorrection:
        """Correction that turns solves with a matrix into solves with weight M_a added; see `OutsideCorrection`."""
        return OutsideCorrection(solve, self._mass.columns, weight * self.density)


class OutsideCorrection:
    """Solves with A + c W W' from those with A (Woodbury).

    Parameters
    ----------
    solve : callable
        From forces (n,) and the flow's rows (l,) to changes of q (n,) and of its unknowns (l,), by A.
    columns : (n, r) array W
    weight : float
        c.
    """

    def __init__(self, solve: Callable, columns: np.ndarray, weight: float):
        self._solve, self.columns = solve, columns
        found = [solve(column, None) for column in columns.T]
        self._q = np.array([q for q, _ in found]).T
        self._u = np.array([u for _, u in found]).T
        small = np.eye(columns.shape[1]) + weight * (columns.T @ self._q)
        self._small = la.lu_factor(small, check_finite=False)
        self._weight = weight

    def solve(self, force: np.ndarray, rest: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Changes of q (n,) and of the flow's unknowns (l,)."""
        q, u = self._solve(force, rest)
        share = self._weight * la.lu_solve(self._small, self.columns.T @ q, check_finite=False)
        return q - self._q @ share, u - self._u @ share
