"""Quadrilateral mid-surface mesh with nodal directors: what a shell is made of before it has a wall."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

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
    """Mid-surface of a shell.

    Attributes
    ----------
    nodes : (nn, 3) float array, m
    quads : (ne, 4) int array
        Counter-clockwise seen from the outside: the normal points from the first layer to the last.
    directors : (nn, 3) float array
        Unit vectors through the wall.
    frames : (nn, 2, 3) float array
        Two unit vectors at each node that span the plane normal to the director; the two rotation unknowns turn
        the director towards them.
    thickness : (ne,) float array, m
    material_axis : (3,) or (ne, 3) float array
        Direction from which layer angles are measured, projected into each tangent plane.
    mirrored : (ne,) bool array, optional
        Elements whose layers lie at mirrored angles: measured to the right of that direction seen from outside, to the
        left elsewhere. None by default.
    """

    nodes: np.ndarray
    quads: np.ndarray
    directors: np.ndarray
    frames: np.ndarray
    thickness: np.ndarray
    material_axis: np.ndarray = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
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
