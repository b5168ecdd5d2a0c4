"""Small motions of every class about a steady state: the same part of the valve with other unknowns.

Element integrals are those of the model; only their numbering differs (`dbvfiv.model.symmetry`). Stops stand between
the lips, so they act on motions that are symmetric about y = 0 and not on those in which both lips move together. Areas
do not change to first order but in the class of the equilibria, so what is left of the fluid is the follower stiffness
of its steady pressures, and a plug that sways with the wall (`dbvfiv.flow.plug`). A twist meets no inner fluid.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ..flow.plug import centroid_matrix, centroid_slope, plug_parts
from ..shell.shell import Shell
from .dynamics import LinearisedState, linearise, without_circulation
from .symmetry import ClassDofs, Symmetry
from .valve import ValveModel


@dataclass(frozen=True)
class LinearisedClass(LinearisedState):
    """Matrices of a class that is not that of the equilibria, with the contract of `LinearisedState`.

    `forces` and `slope` belong to the displacements of the sections' centroids along the axis of sway, not to areas;
    they are empty for a twist.
    """

    symmetry: Symmetry = None
    shell: Shell = None  #: With the unknowns of the class, counted from the state.

    @cached_property
    def relaxing(self) -> tuple[sp.csr_matrix, ...]:
        values = self.shell.relaxing_tangents(np.zeros(self.shell.size))
        return tuple(self.shell.dofs.matrix(part) for part in values)

    def resolved(self, mu) -> float:
        return np.inf  # a plug has no waves

    def fluid_parts(self, given) -> dict[str, np.ndarray]:
        """A0 to A2 of the plug; neither the continuity law nor a line matters, since no area changes."""
        flow, density, inlet = self.model.flow, given["density"], self.inlet
        if self.symmetry.sway_axis is None or not flow.has_fluid:
            return {}
        speeds = np.asarray(flow.steady_velocities(self.area, inlet, density, given)) * float(self.seal is None)
        passage = np.asarray(flow.open_area(self.area)), speeds, flow.steady_densities(self.area, inlet, density)
        return plug_parts(self.model.mesh.z, *passage, flow.unsteady)

    def shut_parts(self, given) -> dict[str, np.ndarray]:
        return self.no_flow() | self.fluid_parts(given)

    def steady_parts(self) -> dict[str, np.ndarray]:
        return self.fluid_parts({"density": self.model.flow.density})  # the centrifugal force, alike in all densities

    def nodal(self, q: np.ndarray) -> np.ndarray:
        return self.shell.dofs.small(q)


def linearise_class(model: ValveModel, q: np.ndarray, inlet: float, symmetry: Symmetry) -> LinearisedState:
    """Linearise the motions of a class about a steady state at an inlet pressure, Pa."""
    if symmetry.of_equilibria:
        return linearise(model, q, inlet)
    nodal = model.nodal(q)
    shell = shell_of_class(model.shell, symmetry.free_unknowns(model.mesh), nodal)
    dofs, still = shell.dofs, np.zeros(shell.size)
    area = model.rows.areas(nodal)
    _, structure = shell.force_and_tangent(still)
    if model.weight is not None:
        model.weight.add_tangent(shell, still, structure)
    if symmetry.moves_lips_apart:
        add_stops(structure, model, q, dofs)
    stiffness = model.follower_stiffness(nodal, model.flow.steady_pressure(area, inlet), structure, dofs)
    slope = sway_of_sections(model, nodal, symmetry, dofs)
    matrices = [dofs.matrix(values) for values in (shell.mass(still), structure, stiffness)]
    if model.contact is not None:
        touching = model.contact.stiffness_of_class(q, shell, symmetry.moves_lips_apart)
        matrices[2] = (matrices[2] + touching).tocsr()
    matrices[2] = without_circulation(model, area, matrices[2])
    added = None if model.outside is None else model.outside.added_mass(q, matrices[1], symmetry.name, shell)
    coupled = slope.T.tocsr(), slope, area, added
    return LinearisedClass(model, q, inlet, *matrices, *coupled, symmetry=symmetry, shell=shell)


def shell_of_class(shell: Shell, free: np.ndarray, nodal: np.ndarray) -> Shell:
    """Copy of a shell with other free unknowns (nn, 5), which count from a state (nn, 5)."""
    kept = shell.__dict__.setdefault("_classes", {})
    key = free.tobytes()
    if key not in kept:
        kept[key] = ClassDofs(free, shell.mesh.quads, nodal)
    other = copy(shell)
    other.dofs = kept[key].at(nodal)
    return other


def add_stops(structure: np.ndarray, model: ValveModel, q: np.ndarray, dofs: ClassDofs) -> None:
    """Add the stiffness of the stops that touch to values (nnz,) of a class in which the lips move apart."""
    nodes = np.nonzero(model.shell.dofs.free)[0][model.stops.unknowns]
    unknowns = dofs.index[nodes, 1]
    moving = unknowns >= 0
    structure[dofs.diagonal_slots[unknowns[moving]]] += model.stops.tangent(q)[moving]


def sway_of_sections(model: ValveModel, nodal: np.ndarray, symmetry: Symmetry, dofs: ClassDofs) -> sp.csr_matrix:
    """J (m, n) from the unknowns to the displacements of the sections' centroids; its transpose gives the forces."""
    axis, flow = symmetry.sway_axis, model.flow
    if axis is None or not flow.has_fluid:
        return sp.csr_matrix((0, dofs.size))
    rows = model.mesh.rows
    points = (model.mesh.nodes[:, :2] + nodal[:, :2])[rows]
    slope = centroid_slope(points, axis, flow.floor)
    return centroid_matrix(slope, rows, dofs.index)
