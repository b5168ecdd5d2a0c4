"""Quadrilateral mid-surface mesh with nodal directors, and the numbering and sparsity of its free unknowns."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.sparse as sp

#: Natural coordinates of the four nodes, in the order of the connectivity.
CORNERS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def shape_functions(xi: float, eta: float) -> tuple[np.ndarray, np.ndarray]:
    """Bilinear shape functions (4,) and their natural derivatives (4, 2) at one point."""
    a, b = CORNERS[:, 0], CORNERS[:, 1]
    values = 0.25 * (1 + a * xi) * (1 + b * eta)
    derivatives = 0.25 * np.stack([a * (1 + b * eta), b * (1 + a * xi)], axis=1)
    return values, derivatives


@dataclass(frozen=True)
class ShellMesh:
    """Mid-surface of a shell."""

    nodes: np.ndarray  #: (nn, 3), m.
    #: (ne, 4); counter-clockwise seen from the outside: the normal points from the first layer to the last.
    quads: np.ndarray
    directors: np.ndarray  #: (nn, 3); unit vectors through the wall.
    #: (nn, 2, 3); two unit vectors at each node that span the plane normal to the director; the two rotation unknowns
    #: turn the director towards them.
    frames: np.ndarray
    thickness: np.ndarray  #: (ne,), m.
    #: (3,) or (ne, 3); direction from which layer angles are measured, projected into each tangent plane.
    material_axis: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    #: (ne,); elements whose layers lie at mirrored angles: measured to the right of that direction seen from outside,
    #: to the left elsewhere. None by default.
    mirrored: np.ndarray | None = None

    def __post_init__(self):
        nn, ne = len(self.nodes), len(self.quads)
        if self.directors.shape != (nn, 3) or self.frames.shape != (nn, 2, 3):
            raise ValueError(
                f"A mesh of {nn} nodes needs directors of shape ({nn}, 3) and frames of shape ({nn}, 2, 3)."
            )
        if self.thickness.shape != (ne,):
            raise ValueError(
                f"A mesh of {ne} elements needs {ne} thicknesses, not an array of shape {self.thickness.shape}."
            )

    @property
    def node_count(self) -> int:
        return len(self.nodes)

    @property
    def element_count(self) -> int:
        return len(self.quads)

    @classmethod
    def build(
        cls,
        nodes,
        quads,
        thickness,
        material_axis=(0.0, 0.0, 1.0),
        frame_axis=None,
        planes=(),
        directors=None,
        mirrored=None,
    ):
        """Mesh with averaged nodal directors.

        Parameters
        ----------
        thickness : float or (ne,) array
        frame_axis : (3,) array, optional
            Direction whose projection is the first frame vector; the material axis by default.
        planes : sequence of (node indices, axis)
            Symmetry planes: the director of these nodes has no component along the axis (0, 1 or 2).
        directors : (nn, 3) array, optional
            Given directors instead of averaged ones.
        mirrored : (ne,) bool array, optional
            Elements whose layers lie at mirrored angles.
        """
        nodes = np.asarray(nodes, float)
        quads = np.asarray(quads, np.int32)
        thickness = np.broadcast_to(np.asarray(thickness, float), (len(quads),)).copy()
        material_axis = np.asarray(material_axis, float)
        if directors is None:
            directors = nodal_directors(nodes, quads, planes)
        axis = material_axis if frame_axis is None else np.asarray(frame_axis, float)
        if axis.ndim > 1:
            raise ValueError("A material axis per element needs a frame_axis of shape (3,).")
        directors = np.asarray(directors, float)
        frames = tangent_frames(directors, axis)
        return cls(nodes, quads, directors, frames, thickness, material_axis, mirrored)


def nodal_thickness(mesh) -> np.ndarray:
    """Mean thickness (nn,) of the elements that meet at each node, m, of a mesh with nodes, quads and thickness."""
    total, count = np.zeros((2, len(mesh.nodes)))
    np.add.at(total, mesh.quads, np.broadcast_to(mesh.thickness[:, None], mesh.quads.shape))
    np.add.at(count, mesh.quads, 1.0)
    return total / count


def nodal_directors(nodes: np.ndarray, quads: np.ndarray, planes=()) -> np.ndarray:
    """Unit normals at the nodes, averaged over the corners of the adjoining elements (nn, 3)."""
    total = np.zeros_like(nodes)
    for corner in range(4):
        _, dn = shape_functions(*CORNERS[corner])
        g1 = np.einsum("a,eai->ei", dn[:, 0], nodes[quads])
        g2 = np.einsum("a,eai->ei", dn[:, 1], nodes[quads])
        normal = np.cross(g1, g2)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        if np.any(length <= 0):
            bad = int(np.argmin(length))
            raise ValueError(f"Element {bad} is degenerate: its surface normal vanishes at a corner.")
        np.add.at(total, quads[:, corner], normal / length)
    for members, axis in planes:
        total[np.asarray(members), axis] = 0.0
    length = np.linalg.norm(total, axis=1, keepdims=True)
    if np.any(length < 1e-6):
        bad = int(np.argmin(length))
        raise ValueError(f"The normals that meet at node {bad} cancel, so it has no director.")
    return total / length


def tangent_frames(directors: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Orthonormal pairs normal to the directors, the first as close to `axis` as can be (nn, 2, 3)."""
    axis = np.asarray(axis, float)
    first = axis - (directors @ axis)[:, None] * directors
    length = np.linalg.norm(first, axis=1)
    parallel = length < 1e-3 * np.linalg.norm(axis)
    if np.any(parallel):  # the axis pierces the wall here: any other direction serves
        for other in np.eye(3):
            trial = other - (directors[parallel] @ other)[:, None] * directors[parallel]
            if np.all(np.linalg.norm(trial, axis=1) > 0.3):
                first[parallel] = trial
                break
    first = first / np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(directors, first)], axis=1)


#: Displacements and rotations of the director.
UNKNOWNS_PER_NODE = 5


@dataclass(frozen=True)
class DofMap:
    """Numbering of the free unknowns."""

    free: np.ndarray  #: (nn, 5); three displacements and two rotations of each node.
    quads: np.ndarray  #: (ne, 4).

    @cached_property
    def index(self) -> np.ndarray:
        """(nn, 5) number of each free unknown, -1 where constrained."""
        index = np.full(self.free.shape, -1, np.int32)
        index[self.free] = np.arange(np.count_nonzero(self.free), dtype=np.int32)
        return index

    @property
    def size(self) -> int:
        return int(np.count_nonzero(self.free))

    def expand(self, q: np.ndarray) -> np.ndarray:
        """Nodal array (nn, 5) from free unknowns (n,); zero where constrained."""
        full = np.zeros(self.free.shape, dtype=np.asarray(q).dtype)
        full[self.free] = q
        return full

    def restrict(self, full: np.ndarray) -> np.ndarray:
        """Free unknowns (n,) of a nodal array (nn, 5)."""
        return full[self.free]

    @cached_property
    def element_index(self) -> np.ndarray:
        """(ne, 20) numbers of the displacements and rotations of an element."""
        return self.index[self.quads].reshape(len(self.quads), -1)

    def _entries(self) -> tuple[np.ndarray, np.ndarray]:
        """Rows and columns (ne, 400) of all entries of element matrices."""
        e = self.element_index
        return np.repeat(e, e.shape[1], axis=1), np.tile(e, (1, e.shape[1]))

    @cached_property
    def pattern(self) -> tuple[np.ndarray, np.ndarray]:
        """Row pointers and column indices (int32) of the assembled matrices."""
        rows, columns = self._entries()
        keep = (rows >= 0) & (columns >= 0)
        matrix = sp.csr_matrix((np.ones(keep.sum()), (rows[keep], columns[keep])), shape=(self.size, self.size))
        matrix.sort_indices()
        return matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32)

    @cached_property
    def slots(self) -> np.ndarray:
        """(ne, 400) position of each element matrix entry among the matrix values, -1 where constrained."""
        return self.slots_of(*self._entries())

    def slots_of(self, rows: np.ndarray, columns: np.ndarray) -> np.ndarray:
        """Positions of entries among the matrix values, by the numbers of their unknowns; -1 where constrained."""
        indptr, indices = self.pattern
        number = sp.csr_matrix((np.arange(1, len(indices) + 1), indices, indptr), shape=(self.size, self.size))
        keep, slots = (rows >= 0) & (columns >= 0), np.full(rows.shape, -1, np.int32)
        if keep.any():
            slots[keep] = np.asarray(number[rows[keep], columns[keep]]).ravel() - 1
        return slots

    def matrix(self, data: np.ndarray) -> sp.csr_matrix:
        """Sparse matrix on the common pattern with the given values; shares them."""
        indptr, indices = self.pattern
        return sp.csr_matrix((data, indices, indptr), shape=(self.size, self.size), copy=False)

    @cached_property
    def diagonal_slots(self) -> np.ndarray:
        """(n,) positions of the diagonal among the matrix values."""
        indptr, indices = self.pattern
        rows = np.repeat(np.arange(self.size), np.diff(indptr))
        return np.flatnonzero(rows == indices)
