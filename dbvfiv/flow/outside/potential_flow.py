"""Potential flow outside a moving surface: what pressure its motion makes.

Sources on all panels, of strengths that vary smoothly along a surface; their normal velocities are those of the
surfaces, zero on rigid ones, and on open panels the potential vanishes instead. Panels that never move are eliminated
once.

Equation (T.19) of docs/theory.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.linalg as la
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator

from .influence import REFLECTIONS, image_signs, influence
from .panels import EDGE, IMAGE_X, IMAGE_Y, Panels


@dataclass(frozen=True)
class Surroundings:
    """Surfaces that stay where they are."""

    rigid: Panels | None = None  #: No flow passes them.
    open: Panels | None = None  #: No pressure acts on them.

    @property
    def panels(self) -> Panels | None:
        """All of them, rigid ones first."""
        parts = [p for p in (self.rigid, self.open) if p is not None and len(p)]
        return Panels.joined(*parts) if parts else None

    @property
    def rigid_count(self) -> int:
        return 0 if self.rigid is None else len(self.rigid)


#: Flux through a closed boundary, on the fluid's side, of sources on it over their strength: of a body, of a room.
BODY, ROOM = 1.0, 0.0


class Impedance(LinearOperator):
    """Mean potential of panels, with its sign changed, for unit volume flux through others: 1/m, symmetric.

    Known by the factors of the panels' conditions: a few products cost less than the matrix, see `matrix`.

    Parameters
    ----------
    terms : list of (array, array or None)
        Potentials of the wet panels (wet, j) for sources (j, k) that follow from those of the moving panels; None for
        these themselves. The first has the latter.
    rows : (k, k) array
        Conditions on sources of the moving panels; overwritten.
    areas : (wet,) array, m2
    """

    def __init__(self, terms: list, rows: np.ndarray, areas: np.ndarray):
        super().__init__(float, (len(areas), len(areas)))
        self._terms, self._areas, self._count = terms, areas, len(rows)
        # LAPACK factors columns: the transpose goes without a copy
        self._factor = la.lu_factor(rows.T, overwrite_a=True, check_finite=False)

    def _solve(self, x, transposed):
        return la.lu_solve(self._factor, x, trans=0 if transposed else 1, check_finite=False)

    def _matmat(self, fluxes: np.ndarray) -> np.ndarray:
        """Half of the discretised operator on fluxes (wet, k) and half of its transpose."""
        wet, areas = len(self._areas), self._areas[:, None]
        strength = np.zeros((self._count, fluxes.shape[1]))
        strength[:wet] = fluxes / areas
        source, received = self._solve(strength, False), np.zeros((self._count, fluxes.shape[1]))
        found = np.zeros(fluxes.shape)
        for potential, carried in self._terms:
            sign = 1.0 if carried is None else -1.0
            found += sign * (potential @ (source if carried is None else carried @ source))
            back = potential.T @ fluxes
            received += sign * (back if carried is None else carried.T @ back)
        return -0.5 * (found + self._solve(received, True)[:wet] / areas)

    def _matvec(self, fluxes: np.ndarray) -> np.ndarray:
        return self._matmat(np.reshape(fluxes, (-1, 1)))

    def _adjoint(self) -> Impedance:
        return self

    _transpose = _adjoint

    def matrix(self) -> np.ndarray:
        """Dense matrix (wet, wet), 1/m, of the impedance."""
        (potential, _), *others = self._terms
        for other, carried in others:
            potential = potential - other @ carried
        found = -self._solve(potential.T, True)[: len(self._areas)].T / self._areas
        return 0.5 * (found + found.T)


class PotentialFlow:
    """Potential flow between moving panels and given surroundings.

    What passes a closed boundary is known exactly: all that sources on a body give, nothing of those on the walls of a
    room. The panels' own velocities are set so that it does; without that fluid leaks at edges, and what moves columns
    of it is of first order only.

    Parameters
    ----------
    symmetry : {"SS", "SA", "AS", "AA", "S", "A"}
        Motions symmetric (S) or antisymmetric (A) about x = 0, then about y = 0; all panels lie in x > 0, y > 0. Of a
        half, whose panels lie in y > 0, about y = 0 alone.
    closed : float, optional
        `BODY` or `ROOM`, where moving and other panels with their images make up one closed boundary.
    """

    def __init__(self, surroundings: Surroundings | None = None, symmetry: str = "SS", closed: float | None = None):
        self.surroundings = surroundings or Surroundings()
        self.symmetry, self.closed = symmetry, closed
        self.signs = image_signs(symmetry)
        self._fixed, self._open = self.surroundings.panels, self.surroundings.rigid_count

    @cached_property
    def _alone(self) -> tuple[np.ndarray, np.ndarray]:
        """Influence of the surroundings on themselves."""
        return smooth_influence(self._fixed, self._fixed, self.signs, True)

    def all_panels(self, moving: Panels) -> Panels:
        """Moving panels, then those of the surroundings."""
        return moving if self._fixed is None else Panels.joined(moving, self._fixed)

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
        wet : int, optional
            Number of panels, the first ones, whose motion and pressure matter; the others are rigid. All by default.
        open_count : int
            Number of panels, the last ones, that are open instead of rigid.
        frozen : Panels, optional
            Places of the moving panels that choose between exact integrals and quadratures, see `influence`.

        Returns
        -------
        Impedance
            (wet, wet), 1/m.
        """
        wet = len(moving) if wet is None else wet
        held, shut = moving if frozen is None else frozen, len(moving) - open_count
        blocks = self._blocks(moving, held, self.signs)
        (potential, velocity), across, back, alone = blocks
        if self.closed is not None:
            symmetric = "A" not in self.symmetry
            own, fixed_own = self._own(moving, blocks if symmetric else self._symmetric(moving, held))
            velocity[np.diag_indices(len(moving))] += own
        rows = np.concatenate([velocity[:shut], potential[shut:]])
        terms = [(potential[:wet], None)]
        if self._fixed is not None:
            matrix = self._rows(*alone)
            if self.closed is not None:
                rigid = np.arange(self._open)
                matrix[rigid, rigid] += fixed_own[: self._open]
            carried = la.lu_solve(la.lu_factor(matrix, check_finite=False), self._rows(*back), check_finite=False)
            rows -= np.concatenate([across[1][:shut], across[0][shut:]]) @ carried
            terms.append((across[0][:wet], carried))
        return Impedance(terms, rows, moving.areas[:wet])

    def _blocks(self, moving: Panels, held: Panels, signs: np.ndarray):
        """Potentials and velocities of moving on moving panels, of the surroundings on them, of them on the
        surroundings, and of those on themselves.
        """
        own, fixed = smooth_influence(moving, moving, signs, True, (held, held)), self._fixed
        if fixed is None:
            return own, None, None, None
        across = smooth_influence(moving, fixed, signs, frozen=(held, fixed))
        return own, across, smooth_influence(fixed, moving, signs, frozen=(fixed, held)), self._alone

    def _symmetric(self, moving: Panels, held: Panels):
        """Influence blocks as `_blocks`, for images that are symmetric about both planes.

        The condition on the flux through the whole surface rests on these.
        """
        signs = image_signs("S" * len(self.symmetry))
        blocks = self._blocks(moving, held, signs)
        if self._fixed is None:
            return blocks
        return (*blocks[:3], smooth_influence(self._fixed, self._fixed, signs, True))

    def _own(self, moving: Panels, blocks) -> tuple[np.ndarray, np.ndarray | None]:
        """Corrections of the self-induced velocities that make the total flux of each panel right.

        For moving panels, and for those of the surroundings or None without any.
        """
        (_, velocity), across, back, alone = blocks
        flux = moving.areas @ velocity
        if self._fixed is None:
            return self.closed - flux / moving.areas, None
        areas = self._fixed.areas
        flux += areas @ back[1]
        other = moving.areas @ across[1] + areas @ alone[1]
        return self.closed - flux / moving.areas, self.closed - other / areas


def smooth_influence(
    targets: Panels, sources: Panels, signs: np.ndarray, own: bool = False, frozen: tuple[Panels, Panels] | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Potential and normal velocity at the centres of panels, of sources of unit strength at the centres of others.

    Parameters
    ----------
    targets, sources, signs, frozen
        See `influence`.
    own : bool
        Whether targets and sources are the same panels. The half of its strength that a source sends to its own side
        is that at its centre.

    Returns
    -------
    potential, velocity : (t, s) arrays, m and 1
    """
    potential, velocity = influence(targets, sources, signs, 0 if own else None, frozen)
    strength = panel_strength(sources, signs)
    velocity = velocity @ strength
    if own:
        velocity += 0.5 * (sp.eye_array(len(sources)) - strength)
    return potential @ strength, velocity


def panel_strength(panels: Panels, signs: np.ndarray) -> sp.csr_array:
    """Strengths (k, k) of panels, constant on each, that act as sources that vary smoothly between their centres.

    A strength s that varies along a surface acts on what is not near as panels of s - h^2 s''/24 do: the moments of a
    panel of width h about its centre give h^2 s''/24, those of the gradient on it -h^2 s''/12. Panel k has

        s_k + sum_j l_kj d_kj (s_k - s_j) / (24 A_k)

    with the panels j beside it, images included, the length l of the side between them and the distance d of their
    centres; so the whole strength stays what it is. Without, waves of m panels are light by (2 pi/m)^2 / 24 at least.

    Parameters
    ----------
    signs : (4,) array
        Of the images, see `image_signs`.
    """
    row, side = np.nonzero(panels.beside != EDGE)
    beside = panels.beside[row, side]
    column = np.where(beside >= 0, beside, row)
    image = np.select([beside == IMAGE_X, beside == IMAGE_Y], [1, 2], 0)
    ends = panels.corners[row, side], panels.corners[row, (side + 1) % 4]
    apart = REFLECTIONS[image] * panels.centres[column] - panels.centres[row]
    share = np.linalg.norm(ends[1] - ends[0], axis=1) * np.linalg.norm(apart, axis=1) / (24.0 * panels.areas[row])
    values = np.concatenate([share, -share * np.asarray(signs)[image]])
    places = np.concatenate([row, row]), np.concatenate([row, column])
    return sp.csr_array(sp.eye_array(len(panels)) + sp.coo_array((values, places), (len(panels),) * 2))
