"""All four quarters of a valve meshed: the structure about a symmetric state without any use of its symmetry."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from dbvfiv.model import ValveModel
from dbvfiv.record.mesh import MeshData, WholeValve
from dbvfiv.shell import Section, Shell, ShellMesh
from dbvfiv.shell.pressure import pressure_stiffness


@dataclass(frozen=True)
class Whole:
    """Matrices (n, n) of the whole valve: mass, structure, structure less follower stiffness, and what relaxes; what
    its points come from; numbers (np, c) of its unknowns.
    """

    mass: sp.csr_matrix
    structure: sp.csr_matrix
    stiffness: sp.csr_matrix
    relaxing: tuple[sp.csr_matrix, ...]
    valve: WholeValve
    index: np.ndarray

    def basis(self, free: np.ndarray, signs: tuple[int, int]) -> sp.csr_matrix:
        """(n, k) motions of the whole valve from unknowns of a quarter that are free (nn, 5), mirrored with signs."""
        number = np.full(free.shape, -1)
        number[free] = np.arange(np.count_nonzero(free))
        mirror = self.valve.sign
        parity = np.where(mirror[:, 0] < 0, signs[0], 1) * np.where(mirror[:, 1] < 0, signs[1], 1)
        columns, rows = number[self.valve.node], self.index
        values = np.ones(rows.shape) * parity[:, None]
        values[:, :3] *= mirror
        # the second frame vector is a cross product, and a mirror image turns the other way
        values[:, 4:] *= mirror[:, :1] * mirror[:, 1:2]
        keep = (rows >= 0) & (columns >= 0)
        return sp.csr_matrix((values[keep], (rows[keep], columns[keep])), shape=(self.mass.shape[0], free.sum()))


def whole_valve(model: ValveModel, q: np.ndarray, inlet: float) -> Whole:
    """The whole valve at a state (n,) of the quarter and an inlet pressure, Pa.

    Plies of mirrored quarters lie at mirrored angles, as symmetry supposes, so two shells share the nodes. A stop holds
    the lips apart from each other, not from the plane.
    """
    quarter, mesh = model.shell.mesh, MeshData.of(model)
    valve = WholeValve.of(mesh)
    nodal, pressure = model.nodal(q), model.flow.steady_pressure(model.rows.areas(model.nodal(q)), inlet)
    handed = np.prod(valve.sign[:, :2], axis=1)
    full = nodal[valve.node]
    full[:, :3] *= valve.sign
    full[:, 4:] *= handed[:, None]
    free = np.ones(full.shape, bool)
    free[np.isin(valve.node, mesh.rows[-1])] = False
    count = len(quarter.quads)
    images = np.repeat([1, -1, 1, -1], count)
    section = model.shell.section
    mirrored = Section(tuple(replace(layer, angle=-layer.angle) for layer in section.layers), section.points_per_layer)
    mass = structure = follower = 0
    relaxing = [0] * len(section.relaxing)
    for sign, wall in ((1, section), (-1, mirrored)):
        own = images == sign
        surface = ShellMesh.build(
            valve.points,
            valve.quads[own],
            quarter.thickness[valve.cell[own]],
            directors=quarter.directors[valve.node] * valve.sign,
        )
        shell = Shell(surface, wall, free, model.shell.metric, model.shell.element, mass_kind=model.shell.mass_kind)
        state, dofs = shell.dofs.restrict(full), shell.dofs
        mass = mass + dofs.matrix(shell.mass(state))
        structure = structure + dofs.matrix(shell.force_and_tangent(state)[1])
        relaxing = [part + dofs.matrix(added) for part, added in zip(relaxing, shell.relaxing_tangents(state))]
        values = np.zeros(len(dofs.pattern[1]))
        nodes, loaded = pressure[model.station_of_node][valve.node], model.loaded[valve.cell[own]]
        pressure_stiffness(surface.quads, surface.nodes, full, nodes, loaded, dofs.slots, 1.0, values)
        follower = follower + dofs.matrix(values)
    structure = structure + _stops(model, q, valve, dofs.index)
    return Whole(mass, structure, (structure - follower).tocsr(), tuple(relaxing), valve, dofs.index)


def _stops(model, q, valve, index) -> sp.csr_matrix:
    """Springs on half the approach of opposite points, one for each half of each lip."""
    nodes = np.nonzero(model.shell.dofs.free)[0][model.stops.unknowns]
    place = {(node, *np.sign(point[:2].round(12))): i for i, (node, point) in enumerate(zip(valve.node, valve.points))}
    size = int(index.max()) + 1
    out = sp.lil_matrix((size, size))
    for node, stiffness in zip(nodes, model.stops.tangent(q)):
        for side in (1, -1):
            across = 0.0 if abs(model.shell.mesh.nodes[node, 0]) < 1e-12 else side
            pair = [index[place[node, across, up], 1] for up in (1.0, -1.0)]
            for i, a in enumerate(pair):
                for j, b in enumerate(pair):
                    out[a, b] += 0.5 * stiffness * (1 if i == j else -1)
    return out.tocsr()
