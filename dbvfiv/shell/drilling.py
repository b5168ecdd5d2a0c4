"""Drilling rotations: one more unknown of each node, by which the edges of elements bow in the plane of the wall.

The edge from node i to node j, of length l, moves in its middle by

    l/8 (w_j - w_i)     along     edge x director,

a parabola along the edge that fades towards the opposite one, as if the nodes turned about their directors by w (Allman
1984, Computers and Structures 19, 1-8). Neighbours share their edges' bows, so displacements stay continuous and
patches of constant strain exact where w is held or loaded accordingly. Strains are linear in w, at all states by the
same matrix: w counts from the turn of the element with its nodes, so rigid motions of any size leave it alone, and only
its differences matter.

Two patterns need a stiffness of their own. In a saddle pattern g w, what alternating rotations differ by from linear
fields (Flanagan & Belytschko 1981), opposite edges bow apart and the element stretches along one side and shortens
along the other, evenly as far as its four points see. A row of elements pressed along their short sides would buckle by
bowing back what its nodes give way. So that pattern is held as much again as these strains do; linear fields stay free.
And even rotations, which strain nothing, are held a millionth as much as shear is:

    (A/48)^2 (C_11 + C_22) A (g w)^2/2 + c G h A w w/2

with A the area of the element, C its membrane stiffness against covariant strains and G h that against shear, N/m.

Equation (T.31) of docs/theory.md.
"""

from __future__ import annotations

import numpy as np

from .mesh import ShellMesh
from .reference import GAUSS, SLOPE, ReferenceGeometry

#: Share of the shear stiffness that holds an even pattern.
EVEN = 1e-6
#: Inertia of a drilling rotation over its share of the element's mass times the area: of bows in a saddle pattern.
INERTIA = 2.0 / 45.0
#: First and second node of each edge.
_EDGES = np.array([[0, 1], [1, 2], [2, 3], [3, 0]])


def _bows() -> np.ndarray:
    """(4, 4, 2): slope of each edge's parabola at the points."""
    r, s = GAUSS.T
    first = np.stack([-r * (1 - s), 0.5 * (1 - s * s), -r * (1 + s), -0.5 * (1 - s * s)], axis=1)
    second = np.stack([-0.5 * (1 - r * r), -s * (1 + r), 0.5 * (1 - r * r), -s * (1 - r)], axis=1)
    return np.stack([first, second], axis=2)


_BOWS = _bows()


def bow_strains(mesh: ShellMesh) -> np.ndarray:
    """(ne, 4, 3, 4): covariant membrane strains at the points from drilling rotations."""
    x, d = mesh.nodes[mesh.quads], mesh.directors[mesh.quads]
    i, j = _EDGES.T
    across = d[:, i] + d[:, j]
    across /= np.linalg.norm(across, axis=2, keepdims=True)
    bow = np.cross(x[:, j] - x[:, i], across) / 8.0  # (ne, edge, 3), per difference of rotations
    tangent = np.einsum("pac,eai->epci", SLOPE, x)
    along = np.einsum("epci,egi,pgb->epcbg", tangent, bow, _BOWS)
    edges = np.stack([along[:, :, 0, 0], along[:, :, 1, 1], along[:, :, 0, 1] + along[:, :, 1, 0]], axis=2)
    return edges @ (np.eye(4)[j] - np.eye(4)[i])


def own_stiffness(mesh: ShellMesh, geometry: ReferenceGeometry, membrane: np.ndarray) -> np.ndarray:
    """(ne, 4, 4) N m: stiffness of drilling rotations besides that of the strains; `membrane` (ne, 3, 3) is the wall's
    in local axes, N/m.
    """
    area = geometry.area.sum(axis=1)
    strained = geometry.q.mean(axis=1)[:, :, :2]  # local strains of e_11 and e_22
    against = np.einsum("eka,ekl,ela->e", strained, membrane, strained)
    saddle = saddle_pattern(mesh, geometry)
    held = (area**3 * against / 48.0**2)[:, None, None] * saddle[:, :, None] * saddle[:, None]
    return held + (EVEN * membrane[:, 2, 2] * area)[:, None, None] * np.eye(4)


def saddle_pattern(mesh: ShellMesh, geometry: ReferenceGeometry) -> np.ndarray:
    """(ne, 4): alternating numbers less their linear fit over the nodes of each element."""
    x = mesh.nodes[mesh.quads]
    axes = geometry.axes[:, :, :2].mean(axis=1)
    place = np.einsum("eai,eci->eac", x - x.mean(axis=1, keepdims=True), axes)
    linear = np.concatenate([np.ones((len(x), 4, 1)), place], axis=2)
    linear /= np.linalg.norm(linear, axis=1, keepdims=True)
    saddle = np.array([1.0, -1.0, 1.0, -1.0])
    return saddle - np.einsum("eac,ec->ea", linear, np.linalg.pinv(linear) @ saddle)


def own_inertia(mesh: ShellMesh, geometry: ReferenceGeometry, share: np.ndarray) -> np.ndarray:
    """(nn,) kg m2: inertia of drilling rotations; `share` (ne, 4) is that of each node in an element's mass, kg."""
    values = INERTIA * share * geometry.area.sum(axis=1)[:, None]
    return np.bincount(mesh.quads.ravel(), weights=values.ravel(), minlength=mesh.node_count)
