"""Potential flow outside a moving surface: what pressure its motion makes.

Sources sigma on all panels; their normal velocities are those of the surfaces, zero on rigid ones, and on open
panels the potential vanishes instead. Panels that never move are eliminated once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg as la

from .influence import image_signs, influence
from .panels import Panels


@dataclass(frozen=True)
class Surroundings:
    """Surfaces that stay where they are.

    Attributes
    ----------
    rigid : Panels or None
        No flow passes them.
    open : Panels or None
        No pressure acts on them.
    """

    rigid: Panels | None = None
    open: Panels | None = None

    @property
    def panels(self) -> Panels | None:
        """All of them, rigid ones first."""
        parts = [p for p in (self.rigid, self.open) if p is not None and len(p)]
        return Panels.joined(*parts) if parts else None

    @property
    def rigid_count(self) -> int:
        return 0 if self.rigid is None else len(self.rigid)


class PotentialFlow:
    """Potential flow between moving panels and given surroundings.

    Parameters
    ----------
    surroundings : Surroundings
    symmetry : {"SS", "SA", "AS", "AA"}
        Motions symmetric (S) or antisymmetric (A) about x = 0, then about y = 0; all panels lie in x > 0, y > 0.
    """

    def __init__(self, surroundings: Surroundings | None = None, symmetry: str = "SS"):
        self.surroundings = surroundings or Surroundings()
        self.signs = image_signs(symmetry)
        self._fixed, self._open = self.surroundings.panels, self.surroundings.rigid_count
        self._factor = None
        if self._fixed is not None:
            potential, velocity = influence(self._fixed, self._fixed, self.signs, 0)
            self._factor = la.lu_factor(self._rows(potential, velocity), check_finite=False)

    def _rows(self, potential, velocity):
        """Conditions on the panels of the surroundings."""
        return np.concatenate([velocity[: self._open], potential[self._open :]])

    def impedance(
        self, moving: Panels, wet: int | None = None, open_count: int = 0, frozen: Panels | None = None
    ) -> np.ndarray:
        """Mean potential of panels, with its sign changed, for unit volume flux through others.

        Times the fluid's density and the rate of the fluxes it is the pressure on the panels, positive where the fluid
        resists. The discretised operator is symmetric up to its error; its symmetric part is given.

        Parameters
        ----------
        moving : Panels
        wet : int, optional
            Number of panels, the first ones, whose motion and pressure matter; the others are rigid. All by default.
        open_count : int
            Number of panels, the last ones, that are open instead of rigid.
        frozen : Panels, optional
            Places of the moving panels that choose between exact integrals and quadratures, see `influence`.

        Returns
        -------
        (wet, wet) array, 1/m
        """
        wet = len(moving) if wet is None else wet
        held, shut = moving if frozen is None else frozen, len(moving) - open_count
        potential, velocity = influence(moving, moving, self.signs, 0, (held, held))
        rows, potential = np.concatenate([velocity[:shut], potential[shut:]]), potential[:wet]
        if self._fixed is not None:
            fixed = self._fixed
            back = self._rows(*influence(fixed, moving, self.signs, frozen=(fixed, held)))
            back = la.lu_solve(self._factor, back, check_finite=False, overwrite_b=True)
            there, passing = influence(moving, fixed, self.signs, frozen=(held, fixed))
            rows -= np.concatenate([passing[:shut], there[shut:]]) @ back
            potential = potential - there[:wet] @ back
        # potential rows^-1 by solves with the transpose
        factor = la.lu_factor(rows.T, overwrite_a=True, check_finite=False)
        solved = la.lu_solve(factor, potential.T, overwrite_b=True, check_finite=False)[:wet].T
        found = -solved / moving.areas[:wet]
        return 0.5 * (found + found.T)
