"""In-plane strains of the element: twelve numbers sampled from its shape, and constant maps from them to its points.

With x_r, x_s the tangents at the centre of a bilinear element and x_d its distortion, the tangents anywhere are
x_r + s x_d and x_s + r x_d, so its covariant Green-Lagrange strains are combinations of six products x' H_k x / 2 less
their value at rest: x_r.x_r/2, x_s.x_s/2, x_r.x_s, x_r.x_d, x_s.x_d and x_d.x_d/2. Their change along the
directors, x' H_k d, gives the bending strains. Whatever is assumed about the strains is a constant matrix on these
numbers, so the energy stays a function of the nodal unknowns alone: no inner unknowns, no strain under rigid motion, a
symmetric tangent.

``MITC4``
    The products as they are.
``MITC4+EAS``
    The strains along the edges are kept, and inside x_d.x_d is replaced by what the others say of it in a flat
    element, by which warped elements bend without stretching (Ko, Lee & Bathe 2016, Computers and Structures 169,
    57-68; 2017, 182, 404-418). On top of it four enhanced membrane modes (Simo & Rifai 1990, Int. J. Num. Meth. Eng.
    29, 1595-1638), by which flat elements bend in their plane. They are condensed once, with the stiffness of the wall
    at rest: exactly for linear walls; for rubber it is one of many admissible assumed strains, the same at all states.

Enhanced elements are known to buckle by themselves under pressure along their short side (Sussman & Bathe 2014,
Computers and Structures 140, 14-22): the enhancement takes away the stiffness against the hourglass motion x_d, and
x_d.x_d in the strains along the edges, squared strains of that motion, keeps its geometric stiffness. So the edges give
way to the centre, in whose strains there is no x_d.x_d, where warping is small beside the wall and cannot lock: x_d.x_d
counts by its share w = y^2/(y^2 + h^2/12), y the part of x_d normal to the element and h the wall.

Equations (T.2), (T.3) and (T.4) of docs/theory.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .reference import GAUSS, ReferenceGeometry, strain_map

ENHANCED, MITC4 = ELEMENTS = "MITC4+EAS", "MITC4"

#: Tangents at the centre x_r, x_s and distortion x_d from the nodes (3, 4).
VECTORS = 0.25 * np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0], [1.0, -1.0, 1.0, -1.0]])
#: The two vectors of each product and its factor.
PAIRS = np.array([[0, 0], [1, 1], [0, 1], [0, 2], [1, 2], [2, 2]])
FACTORS = np.where(PAIRS[:, 0] == PAIRS[:, 1], 0.5, 1.0)


def _matrices() -> np.ndarray:
    """H_k (6, 4, 4), symmetric."""
    first, second = VECTORS[PAIRS[:, 0]], VECTORS[PAIRS[:, 1]]
    one = FACTORS[:, None, None] * first[:, :, None] * second[:, None, :]
    return one + one.transpose(0, 2, 1)


PRODUCTS = _matrices()


def _bilinear() -> np.ndarray:
    """(4, 3, 6): strains [11, 22, 2 * 12] of a bilinear element at its points from the six products."""
    r, s = GAUSS.T
    zero, one = np.zeros(4), np.ones(4)
    first = [one, zero, zero, s, zero, s**2]
    second = [zero, one, zero, zero, r, r**2]
    shear = [zero, zero, one, r, s, 2 * r * s]
    return np.stack([np.stack(row, axis=1) for row in (first, second, shear)], axis=1)


BILINEAR = _bilinear()
#: Enhanced modes at the points in natural coordinates (4, 3, 4).
_MODES = np.stack([np.array([[r, 0, 0, 0], [0, s, 0, 0], [0, 0, r, s]]) for r, s in GAUSS])


def rest_products(x: np.ndarray, d: np.ndarray) -> np.ndarray:
    """(ne, 12): the six products and their change along the directors, from positions and directors (ne, 4, 3)."""
    u, v = np.einsum("ma,eai->emi", VECTORS, x), np.einsum("ma,eai->emi", VECTORS, d)
    i, j = PAIRS.T
    dot = lambda a, b: FACTORS * np.einsum("eki,eki->ek", a, b)  # noqa: E731
    return np.concatenate([dot(u[:, i], u[:, j]), dot(u[:, i], v[:, j]) + dot(v[:, i], u[:, j])], axis=1)


@dataclass(frozen=True)
class AssumedStrains:
    """Assumed strain fields of the elements, as constant arrays."""

    #: (ne, 4, 6, 12); covariant strain coefficients c0 (3) and c1 (3) at the points from `rest_products`.
    inplane: np.ndarray
    products: np.ndarray  #: (ne, 12); the products at rest.


def assumed_strains(mesh, geometry: ReferenceGeometry, section, element: str) -> AssumedStrains:
    """Assumed strain fields on a mesh for an element by its name (one of `ELEMENTS`). Raises ValueError if there is no
    element of that name.
    """
    if element not in ELEMENTS:
        raise ValueError(f"The element is '{element}', but only {', '.join(ELEMENTS)} exist.")
    x = mesh.nodes[mesh.quads]
    tied = BILINEAR if element == MITC4 else _tied(x, geometry.thickness)
    whole = np.zeros((len(x), 4, 6, 12))
    whole[:, :, :3, :6] = whole[:, :, 3:, 6:12] = tied
    if element == ENHANCED:
        whole[:, :, :3] += _enhancement(x, geometry, section, whole)
    return AssumedStrains(whole, rest_products(x, mesh.directors[mesh.quads]))


def _tied(x: np.ndarray, thickness: np.ndarray) -> np.ndarray:
    """(ne, 4, 3, 6): covariant strains at the points from the products, free of x_d.x_d in flat elements.

    With x_d = a x_r + b x_s + y n, small or homogeneous strains of a flat element have x_d.x_d/2 = a x_r.x_d + b
    x_s.x_d - a^2 e_r - b^2 e_s - a b x_r.x_s, all as changes from rest, e_r and e_s those of x_r.x_r/2 and x_s.x_s/2.
    Those take up the share w of what x_d.x_d/2 differs from that, so that for w = 1 they are means of both edges.
    """
    u = np.einsum("ma,eai->emi", VECTORS, x)
    basis, distortion = u[:, :2], u[:, 2]
    metric = np.einsum("eai,ebi->eab", basis, basis)
    plane = np.linalg.solve(metric, np.einsum("eai,ei->ea", basis, distortion)[..., None])[..., 0]
    normal = distortion - np.einsum("ea,eai->ei", plane, basis)
    a, b = plane.T
    y2 = np.einsum("ei,ei->e", normal, normal)
    w = y2 / (y2 + thickness**2 / 12)
    back = w * (a**2 + b**2)
    inner = np.stack([-(a**2), -(b**2), -a * b, a, b, -back], axis=1) / (1 - back)[:, None]
    share = w[:, None] * np.array([1.0, 1.0, 0.0])
    out = np.tile(BILINEAR, (len(x), 1, 1, 1))
    out[..., 5] = share[:, None]
    return out + (BILINEAR[..., 5] - share[:, None])[..., None] * inner[:, None, None]


def local_map(geometry: ReferenceGeometry) -> np.ndarray:
    """(ne, 4, 6, 6): membrane and bending strains in local axes from the covariant coefficients c0 and c1."""
    out = np.zeros((len(geometry.q), 4, 6, 6))
    out[:, :, :3, :3] = out[:, :, 3:, 3:] = geometry.q
    out[:, :, 3:, :3] = -geometry.qk
    return out


def _enhancement(x, geometry: ReferenceGeometry, section, compatible: np.ndarray) -> np.ndarray:
    """(ne, 4, 3, k): what the enhanced modes add to c0 at their amplitudes of least energy of the wall at rest,
    `compatible` being (ne, 4, 6, k).
    """
    u = np.einsum("ma,eai->emi", VECTORS[:2], x)
    normal = np.cross(u[:, 0], u[:, 1])
    size = np.linalg.norm(normal, axis=1)
    # axes at the centre: the means of those at the points, so that constant stress in local axes does no work
    first = geometry.axes[:, :, 0].mean(axis=1)
    normal /= size[:, None]
    first -= np.einsum("ei,ei->e", first, normal)[:, None] * normal
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(normal, first)
    second *= np.sign(np.einsum("ei,ei->e", second, geometry.axes[:, :, 1].mean(axis=1)))[:, None]
    axes = np.stack([first, second], axis=1)
    dual = np.linalg.inv(np.einsum("eci,edi->ecd", u, u)) @ u
    turned = strain_map(np.einsum("eai,eci->eac", axes, dual))
    modes = (size[:, None] / geometry.area)[..., None, None] * (turned[:, None] @ _MODES)
    covariant = np.linalg.solve(geometry.q, modes)
    local = local_map(geometry)
    strained = np.concatenate([modes, -geometry.qk @ covariant], axis=2)  # (ne, 4, 6, m)
    weighed = geometry.area[..., None, None] * np.swapaxes(strained, 2, 3)
    pull = weighed @ wall_at_rest(section, geometry.thickness)[:, None]
    stiffness = (pull @ strained).sum(axis=1)
    load = (pull @ (local @ compatible)).sum(axis=1)
    amplitude = -np.linalg.solve(stiffness, load)
    return covariant @ amplitude[:, None]


def wall_at_rest(section, thickness: np.ndarray) -> np.ndarray:
    """(ne, 6, 6) stiffness of the wall at rest against membrane strain and curvature."""
    unit = section.plane_stiffness
    h = np.asarray(thickness)[:, None, None]
    power = np.array([1, 1, 1, 2, 2, 2])[:, None] + np.array([0, 0, 0, 1, 1, 1])
    return unit * h**power
