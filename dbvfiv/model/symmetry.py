"""Classes of small motion about a state that is symmetric as the valve is, and what each fixes on the computed part.

A mirror image of a motion is the motion itself or its opposite, so small motions split into four classes that do not
act on one another: symmetric (S) or antisymmetric (A) about x = 0, the first letter, and about y = 0, the second. On a
half, symmetric about y = 0 alone, there are two, S and A. Each is solved on the part that is computed, with the same
element integrals, by exchanging what is fixed in the planes of symmetry:

    in a plane of symmetry       symmetric motion                  antisymmetric motion
    displacement across it       fixed                             free
    displacements within it      free                              fixed
    director out of it           fixed (second rotation)           free
    director within it           free                              fixed (first rotation)
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..case.part import HALF, QUARTER, Part
from ..geometry.valve_mesh import ValveMesh
from ..shell.mesh import DofMap


@dataclass(frozen=True)
class Symmetry:
    """A class of motion."""

    name: str  #: "SS", "SA", "AS" or "AA"; "S" or "A" on a half.
    words: str  #: What the valve does.
    #: (int, int); +1 where the motion is symmetric about x = 0 and about y = 0, -1 where it is antisymmetric; about x =
    #: 0, which is no plane of symmetry of a half, +1 there.
    signs: tuple[int, int]

    @property
    def of_equilibria(self) -> bool:
        """True for the symmetry class in which equilibria lie."""
        return self.signs == (1, 1)

    @property
    def alone(self) -> str:
        """Words of a study that looks at no other class."""
        return f"class {self.name} alone ({self.words})"

    @property
    def sway_axis(self) -> int | None:
        """Axis, 0 or 1, along which the sections move as a whole; None where they do not."""
        return {(-1, 1): 0, (1, -1): 1}.get(self.signs)

    @property
    def moves_lips_apart(self) -> bool:
        """True where the two lips move against each other in y, so that stops or contact between them act."""
        return self.signs[1] > 0

    def parity(self, mirrors: np.ndarray) -> np.ndarray:
        """Factors (k,) on a motion in images of the part with mirror signs (k, 2) in x and y, besides those of the
        vectors themselves.
        """
        return np.prod(np.where(np.asarray(mirrors)[:, :2] < 0, self.signs, 1), axis=1)

    def free_unknowns(self, mesh: ValveMesh) -> np.ndarray:
        """(nn, 5) free displacements and rotations of the part of the valve in this class (App. A).

        The frames' first vector lies in each symmetry plane, so such a plane fixes the second rotation of symmetric
        motions.
        """
        free = np.ones((len(mesh.nodes), 5), bool)
        for column, across in mesh.part.edges:
            fixed = [across, 4] if self.signs[across] > 0 else [*{0, 1, 2} - {across}, 3]
            free[np.ix_(mesh.rows[:, column], fixed)] = False
        free[mesh.rows[-1]] = False
        return free


_CLASSES = {
    symmetry.name: symmetry
    for symmetry in (
        Symmetry("SS", "both lips open and close", (1, 1)),
        Symmetry("SA", "the lips sway together in y", (1, -1)),
        Symmetry("AS", "the valve sways sideways in x", (-1, 1)),
        Symmetry("AA", "the valve twists", (-1, -1)),
        Symmetry("S", "both lips open and close, or sway sideways in x", (1, 1)),
        Symmetry("A", "the lips sway together in y, or the valve twists", (1, -1)),
    )
}
#: The class in which equilibria lie, of a half too where a case asks for it, and the word for all of them.
EQUILIBRIA, ALL = "SS", "all"


def symmetries_of(part: Part) -> dict[str, Symmetry]:
    """All classes of a part by name, that of the equilibria first."""
    return {name: _CLASSES[name] for name in part.classes}


#: Of a quarter and of a half.
SYMMETRIES, HALF_SYMMETRIES = symmetries_of(QUARTER), symmetries_of(HALF)


def equilibria_of(part: Part) -> Symmetry:
    """The class in which the equilibria of a part lie."""
    return next(iter(symmetries_of(part).values()))


def only_class_of(part: Part) -> str:
    """Words of the class that studies without a choice of classes look at."""
    return equilibria_of(part).alone


def symmetry_named(name: str) -> Symmetry:
    """The class of a name."""
    return _CLASSES[name]


def asks_for_equilibria(name: str) -> bool:
    """True where a name of the case file stands for the symmetry class of the equilibria alone."""
    return name != ALL and symmetry_named(name).of_equilibria


def chosen_symmetries(name: str, part: Part) -> tuple[Symmetry, ...]:
    """The classes of a part that a name of the case file stands for."""
    known = symmetries_of(part)
    if name == ALL:
        return tuple(known.values())
    return (equilibria_of(part) if name == EQUILIBRIA else known[name],)


@dataclass(frozen=True)
class ClassDofs(DofMap):
    """Unknowns of a class, counted from a symmetric state that may move where they are fixed."""

    base: np.ndarray  #: (nn, c); displacements and rotations of the state.

    def expand(self, q: np.ndarray) -> np.ndarray:
        """Nodal array (nn, c) of the state and what the unknowns (n,) add to it."""
        return self.base + super().expand(q)

    def small(self, q: np.ndarray) -> np.ndarray:
        """Nodal array (nn, c) of the unknowns (n,) alone."""
        return super().expand(q)

    def at(self, base: np.ndarray) -> ClassDofs:
        """Copy of the unknowns that counts from another state; numbering and sparsity are shared."""
        for name in ("index", "element_index", "pattern", "slots"):
            getattr(self, name)  # found once, so that the copy has them
        other = object.__new__(ClassDofs)
        other.__dict__.update(self.__dict__, base=base)
        return other
