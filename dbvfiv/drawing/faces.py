"""Inner and outer face of the wall: the mid-surface moved half the wall along the turned directors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..case.part import QUARTER, Part
from ..record.fields import motion
from ..record.mesh import MeshData
from ..record.whole_valve import WholeValve


def nodal_thickness(mesh: MeshData) -> np.ndarray:
    """Mean thickness (nn,) of the elements that meet at each node, m."""
    total, count = np.zeros(len(mesh.nodes)), np.zeros(len(mesh.nodes))
    np.add.at(total, mesh.quads, np.broadcast_to(mesh.thickness[:, None], mesh.quads.shape))
    np.add.at(count, mesh.quads, 1.0)
    return total / count


def faces(mesh: MeshData, nodal: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Inner and outer face of the part that is computed.

    Parameters
    ----------
    mesh : MeshData
    nodal : (nn, c) array, optional
        Displacements, m, and rotations of the nodes; at rest without it.

    Returns
    -------
    inner, outer : (nn, 3) arrays, m
    """
    half = 0.5 * nodal_thickness(mesh)[:, None]
    if nodal is None:
        return mesh.nodes - half * mesh.directors, mesh.nodes + half * mesh.directors
    moved = motion(mesh, WholeValve.of(mesh, quarter=True), nodal)
    middle = mesh.nodes + moved["displacement"]
    return middle - half * moved["director"], middle + half * moved["director"]


def closed_section(section: np.ndarray, part: Part = QUARTER) -> np.ndarray:
    """Closed curve (k, 2) through the mirror images of a section of a part that ends at (x, 0)."""
    right = np.concatenate([section, section[-2::-1] * [1, -1]])
    return np.concatenate([right, right[-2::-1] * [-1, 1]]) if part.is_quarter else right


def offset_line(z: np.ndarray, y: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Faces of a wall in the plane x = 0 of which the line (z, y) is the middle, where its rotations are not known.

    Parameters
    ----------
    z, y : (m,) arrays, m
    half : (m,) array, m
        Half the wall, towards the outer face; negative for the inner one.

    Returns
    -------
    z, y : (m,) arrays, m
    """
    along = np.stack([np.gradient(z), np.gradient(y)])
    along /= np.linalg.norm(along, axis=0)
    return z - half * along[1], y + half * along[0]


@dataclass(frozen=True)
class ValveSkin:
    """Both faces of the whole valve and the rims that join them, ready to be drawn.

    Attributes
    ----------
    mesh : MeshData
    valve : WholeValve
    """

    mesh: MeshData
    valve: WholeValve

    @classmethod
    def of(cls, mesh: MeshData) -> ValveSkin:
        """Skin of the whole valve."""
        return cls(mesh, WholeValve.of(mesh))

    @cached_property
    def quads(self) -> np.ndarray:
        """(n, 4) points of each quadrilateral: outer face, inner face, rims; inner points follow the outer ones."""
        quads, count = self.valve.quads, len(self.valve.points)
        edges = np.concatenate([quads[:, [i, (i + 1) % 4]] for i in range(4)])
        _, where, often = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
        rim = edges[where[often == 1]]
        return np.concatenate([quads, quads + count, np.hstack([rim, rim[:, ::-1] + count])])

    def points(self, nodal: np.ndarray) -> np.ndarray:
        """(2 np, 3) m, the outer face first, from nodal unknowns (nn, c) of the part."""
        inner, outer = faces(self.mesh, nodal)
        return np.concatenate([self.valve.vectors(outer), self.valve.vectors(inner)])

    def corners(self, nodal: np.ndarray) -> np.ndarray:
        """(n, 4, 3) m, corners of the quadrilaterals."""
        return self.points(nodal)[self.quads]

    def moving_corners(self, steady: np.ndarray, motion: np.ndarray, parity: np.ndarray) -> np.ndarray:
        """(n, 4, 3) m, corners of a motion (nn, c) about a symmetric state (nn, c); `parity` (np,) are its factors at
        the points of mirrored images.
        """
        points = self.points(steady + motion)
        if np.any(parity < 0):
            points = np.where(np.tile(parity, 2)[:, None] < 0, self.points(steady - motion), points)
        return points[self.quads]

    def means(self, field: np.ndarray) -> np.ndarray:
        """(n,) mean over each quadrilateral of a field (nn,) of the part's nodes."""
        both = np.tile(field[self.valve.node], 2)
        return both[self.quads].mean(axis=1)
