"""The outer face of the wall: where it is and what volume it sweeps as the nodes move."""

from __future__ import annotations

from functools import cached_property

import numpy as np
import scipy.sparse as sp

from .reference import SHAPE, SLOPE
from .shell import Shell


class OuterFace:
    """Nodes of the mid-surface moved out by half the wall along their directors, joined bilinearly.

    Parameters
    ----------
    shell : Shell

    Attributes
    ----------
    half_wall : (nn,) array, m
        Half the thickness at the nodes, the mean of the adjoining elements weighted by area.
    """

    def __init__(self, shell: Shell):
        self.shell = shell
        mesh, area = shell.mesh, shell.geometry.area.sum(axis=1)
        total, weight = np.zeros(mesh.node_count), np.zeros(mesh.node_count)
        np.add.at(total, mesh.quads, (area * mesh.thickness)[:, None])
        np.add.at(weight, mesh.quads, area[:, None])
        self.half_wall = 0.5 * total / weight

    def points(self, nodal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Places (nn, 3), m, and directors (nn, 3) of the face's nodes for nodal unknowns (nn, c)."""
        directors = self.shell.directors(nodal)[0]
        return self.shell.mesh.nodes + nodal[:, :3] + self.half_wall[:, None] * directors, directors

    def fluxes(self, nodal: np.ndarray) -> sp.csr_matrix:
        """Volume that each element's face sweeps outwards per change of the unknowns, (ne, n).

        Its transpose holds the forces of unit pressures on the faces.
        """
        directors, turned, _ = self.shell.directors(nodal)
        place = self.shell.mesh.nodes + nodal[:, :3] + self.half_wall[:, None] * directors
        corners = place[self.shell.mesh.quads]
        basis = np.einsum("pac,eai->epci", SLOPE, corners)
        share = np.einsum("pa,epi->eai", SHAPE, np.cross(basis[:, :, 0], basis[:, :, 1]))
        values = np.empty((*share.shape[:2], 5))
        values[..., :3] = share
        lever = (self.half_wall[:, None, None] * turned)[self.shell.mesh.quads]
        values[..., 3:] = np.einsum("eai,eaji->eaj", share, lever)
        taken, columns, pointers = self._pattern
        return sp.csr_matrix((values.ravel()[taken], columns, pointers), (len(corners), self.shell.size))

    @cached_property
    def _pattern(self):
        """Sparsity pattern of `fluxes`: flat indices of the entries in CSR order, their columns, the row pointers."""
        index = self.shell.dofs.element_index
        order = np.argsort(index, axis=1, kind="stable")
        taken = (order + index.shape[1] * np.arange(len(index))[:, None])[np.take_along_axis(index, order, 1) >= 0]
        pointers = np.concatenate([[0], np.cumsum((index >= 0).sum(axis=1))])
        return taken, index.ravel()[taken], pointers
