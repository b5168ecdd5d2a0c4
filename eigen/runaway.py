r"""Motions in which a structure that relaxes runs away by itself, once for all conditions of one state and damping.

They are those of `eigen.negative_stiffness` whose D(s) has real unstable eigenvalues. A fluid hardly moves these, so a
space with their motions in it holds them under every fluid; one that holds such motions by halves has unstable
eigenvalues or none by chance.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from .inertia import SymmetricStructure
from .negative_stiffness import motions_of, places_of

#: Inverse iterations on an eigenvalue at most, and the relative change that ends them; their error falls with the third
#: power.
STEPS, SETTLED = 5, 1e-3
#: Relative distance below which two are one.
SAME = 1e-8
#: Relative distance from the rate of the structure alone within which an eigenvalue of a coupled pencil is its own.
NEAR = 0.4
#: Relative distance that one may move from a space to the full matrices.
MOVED = 0.5


@dataclass(frozen=True, eq=False)
class Runaway:
    """Real unstable eigenvalues of a structure by itself.

    Attributes
    ----------
    rates : (r,) array, 1/s
        The fastest first.
    motions : (n, r) array
        Of unit mass.
    core : (n, m) array
        As few motions as have as many eigenvalues: a motion that runs away does so at two rates, and what its two
        vectors differ by is another motion, which swings.
    """

    rates: np.ndarray
    motions: np.ndarray
    core: np.ndarray

    @classmethod
    def none(cls, size: int) -> Runaway:
        """Of a structure of so many unknowns that holds."""
        return cls(np.zeros(0), np.zeros((size, 0)), np.zeros((size, 0)))

    @classmethod
    def of(cls, structure: SymmetricStructure) -> Runaway:
        """Of a structure that relaxes.

        Raises
        ------
        SingularShiftError
            If a sum of its parts is singular.

        Examples
        --------
        >>> from eigen import CoupledPencil, Relaxation
        >>> from eigen.factorization import StructureMatrices
        >>> soft = Relaxation([np.diag([1.0, -1.9])], [[1.0]], [1.0])
        >>> pencil = CoupledPencil(M=0.01 * np.eye(2), C=np.zeros((2, 2)), K=np.eye(2), relaxation=soft)
        >>> Runaway.of(SymmetricStructure(StructureMatrices(pencil))).rates.round(6)
        array([8.347015, 1.142161])
        """
        for rough in (True, False):
            starts = _on_space(structure, motions_of(structure, rough))
            found: list[tuple[float, np.ndarray]] = []
            for place, motion in starts:
                rate, motion = _refined(structure, place, motion)
                if abs(rate - place) <= MOVED * place and all(abs(rate - r) > SAME * rate for r, _ in found):
                    found.append((rate, motion))
            if len(found) == len(starts):
                break
        if not found:
            return cls.none(structure.size)
        found.sort(key=lambda pair: -pair[0])
        motions = np.stack([motion for _, motion in found], axis=1)
        return cls(np.array([rate for rate, _ in found]), motions, _core(structure, motions))


def is_near(values: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Which eigenvalues of a coupled pencil are those of its structure alone at given rates."""
    values = np.array(values, complex).reshape(-1, 1)
    return (np.abs(values - rates) <= NEAR * np.abs(rates)).any(axis=1)


def _on_space(structure: SymmetricStructure, space: np.ndarray) -> list[tuple[float, np.ndarray]]:
    """Real unstable eigenvalues on a space, and their motions."""
    if not space.shape[1]:
        return []
    parts = structure.on_space(space)

    def at(s: float) -> np.ndarray:
        return np.tensordot(structure.at(s), parts, 1)

    places = places_of(structure, parts)
    squares = np.array([np.linalg.eigvalsh(at(s)) for s in places])
    found = []
    for i, j in np.argwhere(squares[:-1] * squares[1:] < 0):
        root = brentq(lambda s, j=j: np.linalg.eigvalsh(at(s))[j], places[i], places[i + 1], rtol=1e-10)
        found.append((root, space @ np.linalg.eigh(at(root))[1][:, j]))
    return found


def _core(structure: SymmetricStructure, motions: np.ndarray) -> np.ndarray:
    """As few directions of motions as have as many real unstable eigenvalues."""
    weight, turn = np.linalg.eigh(motions.T @ structure.times(structure.mass, motions))
    kept = np.flatnonzero(weight > 1e-10 * weight[-1])[::-1]
    for number in range((len(weight) + 1) // 2, len(kept) + 1):
        some = kept[:number]
        core = (motions @ turn[:, some]) / np.sqrt(weight[some])
        if len(_on_space(structure, core)) == len(weight):
            break
    return core


def _refined(structure: SymmetricStructure, rate: float, motion: np.ndarray) -> tuple[float, np.ndarray]:
    """An eigenvalue near a place, and its motion, by inverse iteration with the full matrices; NaN where that has not
    settled.
    """
    for _ in range(STEPS):
        before = rate
        with structure.factored(structure.at(rate)) as factor:
            motion = factor.solve(structure.times(structure.slope(rate), motion))
        motion = motion / np.sqrt(motion @ structure.times(structure.mass, motion))
        parts = structure.on_space(motion[:, None])[:, 0, 0]
        rate, found = _zero_near(structure, parts, rate)
        if found and abs(rate - before) <= SETTLED * before:
            return rate, motion
    return np.nan, motion


def _zero_near(structure: SymmetricStructure, parts: np.ndarray, rate: float, steps: int = 8) -> tuple[float, bool]:
    """Zero of x^T D(s) x near a place, from the parts on one motion, and whether it was reached."""
    change = np.inf
    for _ in range(steps):
        change = (structure.at(rate) @ parts) / (structure.slope(rate) @ parts)
        if not abs(change) < 0.5 * rate:
            break
        rate = rate - change
    return float(rate), bool(abs(change) <= SETTLED * rate)
