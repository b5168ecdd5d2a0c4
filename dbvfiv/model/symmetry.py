"""Classes of small motion about a state that is symmetric about x = 0 and y = 0, and what each fixes on the quarter.

A mirror image of a motion is the motion itself or its opposite, so small motions split into four classes that do not
act on one another: symmetric (S) or antisymmetric (A) about x = 0, the first letter, and about y = 0, the second. Each
is solved on the quarter, with the same element integrals, by exchanging what is fixed in the planes of symmetry:

    in a plane of symmetry       symmetric motion                  antisymmetric motion
    displacement across it       fixed                             free
    displacements within it      free                              fixed
    director out of it           fixed (second rotation)           free
    director within it           free                              fixed (first rotation)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..geometry import ValveMesh
from ..shell.supports import DofMap


@dataclass(frozen=True)
class Symmetry:
    """A class of motion.

    Attributes
    ----------
    name : str
        "SS", "SA", "AS" or "AA".
    words : str
        What the valve does.
    signs : (int, int)
        +1 where the motion is symmetric about x = 0 and about y = 0, -1 where it is antisymmetric.
    """

    name: str
    words: str
    signs: tuple[int, int]

    @property
    def sway_axis(self) -> int | None:
        """Axis, 0 or 1, along which the sections move as a whole; None where they do not."""
        return {(-1, 1): 0, (1, -1): 1}.get(self.signs)

    @property
    def moves_lips_apart(self) -> bool:
        """Whether the two lips move against each other in y, so that what stands between them acts."""
        return self.signs[1] > 0

    def parity(self, mirrors: np.ndarray) -> np.ndarray:
        """Factors (k,) on a motion in images of the quarter with mirror signs (k, 2) in x and y, besides those of the
        vectors themselves.
        """
        return np.prod(np.where(np.asarray(mirrors)[:, :2] < 0, self.signs, 1), axis=1)

    def free_unknowns(self, mesh: ValveMesh) -> np.ndarray:
        """(nn, 5) free displacements and rotations of the quarter valve in this class.

        The frames' first vector lies in each symmetry plane.
        """
        free = np.ones((len(mesh.nodes), 5), bool)
        for column, across, sign in ((0, 0, self.signs[0]), (-1, 1, self.signs[1])):
            fixed = [across, 4] if sign > 0 else [*{0, 1, 2} - {across}, 3]
            free[np.ix_(mesh.rows[:, column], fixed)] = False
        free[mesh.rows[-1]] = False
        return free


SYMMETRIES = {
    symmetry.name: symmetry
    for symmetry in (
        Symmetry("SS", "both lips open and close", (1, 1)),
        Symmetry("SA", "the lips sway together in y", (1, -1)),
        Symmetry("AS", "the valve sways sideways in x", (-1, 1)),
        Symmetry("AA", "the valve twists", (-1, -1)),
    )
}
#: The class in which equilibria lie, and the word for all of them.
EQUILIBRIA, ALL = "SS", "all"


def chosen_symmetries(name: str) -> tuple[Symmetry, ...]:
    """The classes that a name of the case file stands for."""
    return tuple(SYMMETRIES.values()) if name == ALL else (SYMMETRIES[name],)


@dataclass(frozen=True)
class ClassDofs(DofMap):
    """Unknowns of a class, counted from a symmetric state that may move where they are fixed.

    Attributes
    ----------
    base : (nn, 5) array
        Displacements and rotations of the state.
    """

    base: np.ndarray

    def expand(self, q: np.ndarray) -> np.ndarray:
        """Nodal array (nn, 5) of the state and what the unknowns (n,) add to it."""
        return self.base + super().expand(q)

    def small(self, q: np.ndarray) -> np.ndarray:
        """Nodal array (nn, 5) of the unknowns (n,) alone."""
        return super().expand(q)

    def at(self, base: np.ndarray) -> ClassDofs:
        """The same unknowns counted from another state; numbering and sparsity are shared."""
        for name in ("index", "element_index", "pattern", "slots"):
            getattr(self, name)  # found once, so that the copy has them
        other = object.__new__(ClassDofs)
        other.__dict__.update(self.__dict__, base=base)
        return other
