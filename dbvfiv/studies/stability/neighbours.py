"""Valves next to one another: what they share, so that a further one costs a projection and no search.

States and added mass are linear in the numbers that tell the valves apart, from one back-substitution and one
difference each. A state is made exact by Newton's method; the linearised equations of every valve are its own, but for
the added mass, whose error is of second order and measured on further valves, two of them far off to either side in the
direction in which states move most: in a narrow pipe around the wall it grows fast. They project on one space of the
leading motions of several of these valves; what that lacks of a valve is told by a correction with its full matrices
and the factors of the first one (`eigen.columns.cell_beside`). Growth rates decide where they are clear of both errors.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from eigen.basis import orthonormal, outside
from eigen.columns import Cell, cell_beside
from eigen.reduction import FamilyReduction

from ...case.parameters import Mu
from ...model.dynamics import linearise
from ...model.outside import AddedMass
from .derivatives import Neighbourhood
from .samples import Sample
from .verdict import Verdict
from .walk import StabilityWalk, ValveFamily

#: From numbers (d,) to the walk and the parameter point of their valve.
At = Callable[[np.ndarray], tuple[StabilityWalk, Mu]]
#: From a function of an `At`, of neighbours and of numbers, the neighbours and rows of numbers to its values in their
#: order.
Share = Callable[[Callable[..., Any], "Neighbours", Sequence[np.ndarray]], Sequence[Any]]
#: Valves that a space is made of, and that its error is measured on, with the seed of their inputs, which no samples
#: have.
TAKEN, CHECKS, NEAR_SEED = 6, 4, 2**31 + 1
#: Standard deviations to the two far valves: 99 of 100 lie nearer in their direction.
FAR = 2.5
#: Parts at most in which the numbers of a valve, and the valves that an error is measured on, are shared.
PARTS = 4
#: Step of differences over the scale of a number.
STEP = 0.01
#: Leading modes of each valve whose vectors the space has.
MODES = 6
#: Shares of these vectors, and of those of static responses, below which directions are left out.
WEAK, STATIC = 3e-4, 0.5
#: Leading modes that its error is measured on.
WATCHED = 3
#: Errors that growth rates must be clear of.
SAFETY = 5.0


@dataclass(frozen=True)
class Neighbours:
    """First-order states and added mass of valves, and a space of their leading motions."""

    #: origin and scales: (d,); numbers of the first valve, and their scales.
    origin: np.ndarray
    scales: np.ndarray
    q: np.ndarray  #: (n,); displacements of the first valve.
    slopes: np.ndarray  #: (d, n); their change for a step of one scale in each number.
    added: AddedMass | None  #: Of the first valve, at unit density.
    images: np.ndarray  #: (d, n, r); change of the forces on accelerations `added.motions`, likewise.
    space: np.ndarray  #: (n, k); leading motions of several valves.
    error: float = 0.0  #: Relative error of eigenvalues by the added mass at a distance of one scale.

    def steps(self, row: np.ndarray) -> np.ndarray:
        """Distances (d,) of numbers from those of the first valve, in scales."""
        return (row - self.origin) / self.scales

    def state(self, row: np.ndarray) -> np.ndarray:
        """Displacements (n,) to first order."""
        return self.q + self.steps(row) @ self.slopes

    def added_mass(self, row: np.ndarray) -> AddedMass | None:
        """Added mass to first order."""
        known = self.added
        if known is None:
            return None
        images = known.columns @ (known.columns.T @ known.motions)
        return AddedMass.of_images(
            known.motions, images + np.tensordot(self.steps(row), self.images, 1), known.slowness
        )

    def square(self, row: np.ndarray) -> float:
        """Square of the distance from the first valve over the numbers that move its state or change its added mass,
        one at least.
        """
        moving = self.slopes.any(axis=1) | self.images.any(axis=tuple(range(1, self.images.ndim)))
        return max(float((self.steps(row)[moving] ** 2).sum()), 1.0)


def find_neighbours(
    at: At,
    origin: np.ndarray,
    scales: np.ndarray,
    start: np.ndarray,
    taken: np.ndarray,
    checks: np.ndarray,
    numbers: Callable[[np.ndarray], np.ndarray],
    share: Share | None = None,
) -> Neighbours:
    """Find the neighbours of a valve: their first-order states and added mass, and the space that they share. Raises
    SolveError, CaseError if one of them has no steady state or no modes, or cannot be made.

    Parameters
    ----------
    origin, scales : (d,) arrays
        Scales are not zero.
    start : (n,) array
        Displacements next to those of the first valve.
    taken, checks : (s, d), (c, d) arrays
        Numbers of the valves whose leading motions the space has, and of those that the error is measured on.
    numbers : callable
        Numbers (m, d) of valves from standard scores (m, d), for two more of these.
    share : callable, optional
        Where several workers find them.
    """
    share = share or (lambda function, near, rows: [function(at, near, row) for row in rows])
    walk, place = at(origin)
    walk.settle(place, start)
    q, first = walk.equilibrium(place), FamilyReduction(walk.family(place))
    added, d = walk.family(place).linear.added, len(origin)
    images = np.zeros((d, *(() if added is None else added.motions.shape)))
    near = Neighbours(origin, scales, q, np.zeros((d, len(q))), added, images, np.zeros((len(q), 0)))
    tangents = share(_tangents, near, np.array_split(np.arange(d), min(d, PARTS)))
    slopes, images = (np.concatenate(parts) for parts in zip(*tangents))
    near = replace(near, slopes=slopes, images=images)
    others = share(_leading_vectors, near, taken)
    near = replace(near, space=_joint_space(first, [first.leading_vectors(place, MODES), *others]))
    direction = np.linalg.svd(near.slopes, full_matrices=False)[0][:, 0]
    checks = np.vstack([checks, numbers(np.outer((-FAR, FAR), direction))])
    errors = share(_error, near, np.array_split(checks, min(len(checks), PARTS)))
    return replace(near, error=max(errors))


def _tangents(at: At, near: Neighbours, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Changes of state (m, n) and of the forces of added mass (m, n, r) for a step of one scale in some numbers."""
    walk, place = at(near.origin)
    model, added = walk.built(place).model, near.added
    hood = Neighbourhood(model, near.q, place.pressure, place)
    slopes, images = np.zeros_like(near.slopes[axes]), np.zeros_like(near.images[axes])
    here = None if added is None else hood.resisting(model, near.q, added.motions)
    for slope, image, axis in zip(slopes, images, axes):
        other, beside = at(near.origin + STEP * near.scales * (np.arange(len(near.origin)) == axis))
        end = other.built(beside).model, beside.pressure
        tangent = hood.tangent([(model, place.pressure), end], STEP)
        if tangent is not None:
            slope[:] = tangent
        if added is not None and (tangent is not None or end[0].outside.radius != model.outside.radius):
            ahead = hood.resisting(end[0], near.q + STEP * slope, added.motions)
            image[:] = (ahead - here) / STEP
    return slopes, images


def _family(near: Neighbours, walk: StabilityWalk, place: Mu, row: np.ndarray) -> ValveFamily:
    """Linearised equations of a neighbour whose state its walk has."""
    built, modes = walk.built(place), walk.case.modes
    linear = linearise(built.model, walk.equilibrium(place), place.pressure, added=near.added_mass(row))
    return ValveFamily(linear, modes.max_frequency, modes.count)


def _leading_vectors(at: At, near: Neighbours, row: np.ndarray) -> np.ndarray:
    """Leading vectors of one neighbour."""
    walk, place = at(row)
    walk.settle(place, near.state(row))
    return FamilyReduction(_family(near, walk, place, row)).leading_vectors(place, MODES)


def _joint_space(first: FamilyReduction, vectors: list[np.ndarray]) -> np.ndarray:
    """Space (n, k) of leading vectors of several valves, and of static responses of one, without weak directions."""
    mass = first.family.mass
    leading = orthonormal(mass, np.hstack(vectors), WEAK, passes=1, alike=False)[0]
    return np.hstack([leading, outside(leading, mass, first.coarse.V, STATIC)])


def _error(at: At, near: Neighbours, checks: np.ndarray) -> float:
    """Largest relative error of leading oscillating eigenvalues on some valves, for a distance of one scale."""
    beside, worst = Beside(at, near), 0.0
    for row in checks:
        walk, place = at(row)
        walk.settle(place, near.state(row))
        if walk.refusal(place):
            continue
        exact, found = walk.cell(place).leading, next(beside.cells(walk, [place], row)[1]).leading
        exact = exact[exact.imag > 0][:WATCHED]
        apart = np.abs(exact[:, None] - found).min(axis=1) / np.abs(exact)
        worst = max(worst, float(apart.max(initial=0.0)) / near.square(row))
    return worst


class Beside:
    """Verdicts on the neighbours of a valve."""

    def __init__(self, at: At, near: Neighbours):
        self.near = near
        walk, self._place = at(near.origin)
        walk.settle(self._place, near.q)
        self._first = FamilyReduction(walk.family(self._place))

    def cells(self, walk: StabilityWalk, places: Sequence[Mu], row: np.ndarray) -> tuple[ValveFamily, Iterator[Cell]]:
        """Family of a neighbour whose state its walk has, and its cells at places that share the state."""
        near = self.near
        family = _family(near, walk, places[0], row)
        reduction, error = self._first.beside(family, near.space, self._place), near.error * near.square(row)
        return family, (cell_beside(reduction, place, error, SAFETY) for place in places)

    def verdicts(self, walk: StabilityWalk, places: Sequence[Mu], row: np.ndarray) -> list[Verdict | None]:
        """Verdicts on a neighbour at places that share the state its walk has; None where growth rates are not clear of
        errors.
        """
        found: list[Verdict | None] = [Verdict.not_valid(why) if (why := walk.refusal(p)) else None for p in places]
        sound = [i for i, verdict in enumerate(found) if verdict is None]
        with suppress(ArithmeticError, ValueError):
            family, cells = self.cells(walk, [places[i] for i in sound], row) if sound else (None, ())
            for i, cell in zip(sound, cells):
                search, sealed = family.leading(places[i]), family.linear.seal is not None
                verdict = Sample.of(np.nan, cell, search, sealed).verdict
                found[i] = verdict if verdict.certain else None
        return found
