"""Buckling out of the symmetry of the model: stiffness eigenvalues in the other classes of motion along the path.

The path itself stays symmetric. Contact acts on motions in which the lips move against each other; lips that move
together slide without friction and turn their contact forces with them. A duckbill that is held shut by its supports
is not free to move with the other lip, so classes are watched with contact alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
import scipy.sparse as sp

from ...contact import class_stiffness
from ...model.classes import shell_of_class
from ...model.load_steps import LoadStepOptions
from ...model.pressed_shell import PressedShell
from ...model.symmetry import Symmetry, symmetries_of
from ...shell import Shell
from ...shell.pressure import pressure_stiffness
from .buckling import Buckling, BucklingWatch
from .model import CONTACT, ClosureModel
from .stiffness import StiffnessSpectrum, spectrum_of


@dataclass(frozen=True)
class ClassStiffness:
    """Tangent of a pressed shell in a class of motion.

    Parameters
    ----------
    pressed : PressedShell
    free : (nn, 5) bool array
        Unknowns of the class.
    closing : bool
        Whether the two walls move against each other, so that contact resists.
    """

    pressed: PressedShell
    free: np.ndarray
    closing: bool

    @classmethod
    def of(cls, model: ClosureModel, symmetry: Symmetry) -> ClassStiffness:
        """Stiffness of a valve with contact in a symmetry class."""
        return cls(model.pressed, symmetry.free_unknowns(model.mesh), symmetry.moves_lips_apart)

    def shell(self, q: np.ndarray) -> Shell:
        """The shell with the unknowns of the class, counted from a state."""
        return shell_of_class(self.pressed.shell, self.free, self.pressed.nodal(q))

    def matrices(self, q: np.ndarray, pressure: float) -> tuple[sp.csr_matrix, sp.csr_matrix]:
        """Stiffness and mass (k, k) of the class at a state (n,) and a pressure, Pa."""
        pressed, nodal, shell = self.pressed, self.pressed.nodal(q), self.shell(q)
        surface, dofs, still = shell.mesh, shell.dofs, np.zeros(shell.size)
        _, values = shell.force_and_tangent(still)
        nodes = np.full(surface.node_count, pressed.sign * pressure)
        pressure_stiffness(surface.quads, surface.nodes, nodal, nodes, pressed.loaded, dofs.slots, -1.0, values)
        return (dofs.matrix(values) + self._contact(nodal, shell)).tocsr(), dofs.matrix(shell.mass(still))

    def spectrum(self, count: int, q: np.ndarray, pressure: float) -> StiffnessSpectrum:
        """Eigenvalues nearest to zero; see `spectrum_of`."""
        return spectrum_of(*self.matrices(q, pressure), pressure, count)

    def _contact(self, nodal: np.ndarray, shell: Shell) -> sp.csr_matrix:
        contact = self.pressed.contact
        if contact is None:
            return sp.csr_matrix((shell.size, shell.size))
        return class_stiffness(contact, nodal, self.pressed.multiplier, shell, self.closing)


@dataclass
class ClassWatch:
    """Watches for buckling into every class that the path itself does not have.

    Attributes
    ----------
    watches : dict
        One for each class by its name.
    lowest : list of (pressure, dict)
        Lowest eigenvalue, 1/s2, of each class at the states seen.
    """

    watches: dict[str, BucklingWatch]
    lowest: list[tuple[float, dict[str, float]]]

    @classmethod
    def of(cls, model: ClosureModel, steps: LoadStepOptions, eigenvalues: int, wanted: bool) -> ClassWatch:
        """Buckling watches of a model with contact, one for each class besides that of the path; none unless wanted."""
        watches = {}
        for name, symmetry in symmetries_of(model.mesh.part).items() if wanted and model.supports == CONTACT else ():
            if not symmetry.of_equilibria:
                spectrum = partial(ClassStiffness.of(model, symmetry).spectrum, eigenvalues)
                watches[name] = BucklingWatch(model.pressed, steps, eigenvalues, spectrum=spectrum)
        return cls(watches, [])

    def see(self, pressure: float, q: np.ndarray) -> None:
        """Look at the next equilibrium."""
        if self.watches:
            found = {name: watch.see(pressure, q).lowest for name, watch in self.watches.items()}
            self.lowest.append((float(pressure), found))

    def resume(self, pressure: float, q: np.ndarray) -> None:
        """Go on from a state whose own eigenvalues are known."""
        for watch in self.watches.values():
            watch.see(pressure, q)

    def forget(self) -> None:
        """The path has jumped."""
        for watch in self.watches.values():
            watch.forget()

    @property
    def found(self) -> list[tuple[str, Buckling]]:
        """Buckling states of all classes, class by class."""
        return [(name, found) for name, watch in self.watches.items() for found in watch.found]
