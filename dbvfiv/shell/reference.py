"""Reference geometry at the in-plane integration points: metrics, curvature and the maps to local axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .mesh import ShellMesh, shape_functions

GAUSS = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) / np.sqrt(3.0)
SHAPE = np.array([shape_functions(*point)[0] for point in GAUSS])  # (4, 4): point, node
SLOPE = np.array([shape_functions(*point)[1] for point in GAUSS])  # (4, 4, 2): point, node, direction

#: Mid-edge sampling of the transverse shear (Dvorkin & Bathe 1984): first and second node of the edges along which the
#: shears
#: gamma_1 (first two) and gamma_2 (last two) are taken, and their weights at the integration points.
SHEAR_EDGES = np.array([[0, 1], [3, 2], [0, 3], [1, 2]])
SHEAR_WEIGHTS = np.stack(
    [0.5 * (1 - GAUSS[:, 1]), 0.5 * (1 + GAUSS[:, 1]), 0.5 * (1 - GAUSS[:, 0]), 0.5 * (1 + GAUSS[:, 0])], axis=1
)  # (4 points, 4 edges)


@dataclass(frozen=True)
class ReferenceGeometry:
    """Arrays over elements and in-plane points (ne, 4, ...).

    Strains are ordered [11, 22, 2 * 12]. With covariant strain coefficients c0 and c1 and mixed curvature kappa the
    local strain at thickness coordinate t is E = q c0 + t (q c1 - qk c0), qk standing for sym(kappa c0).
    """

    area: np.ndarray  #: (ne, 4) m2.
    thickness: np.ndarray  #: (ne,) m.
    q: np.ndarray  #: (ne, 4, 3, 3), qk : (ne, 4, 3, 3).
    qk: np.ndarray
    p: np.ndarray  #: (ne, 4, 2, 2); transverse shear: gamma_local[a] = p[a, alpha] gamma[alpha].
    shear0: np.ndarray  #: (ne, 4); reference values of the shears at the edges.
    #: (ne, 4, 2, 2); mixed curvature kappa[gamma, beta]: covariant derivative beta of the director against basis vector
    #: gamma.
    curvature: np.ndarray
    #: (ne, 4, 3, 3); local axes (rows): material axis in the tangent plane, the direction across, the normal.
    axes: np.ndarray
    position: np.ndarray  #: (ne, 4, 3) m.


def strain_map(p: np.ndarray) -> np.ndarray:
    """(..., 3, 3) map of covariant strains [11, 22, 2*12] to local axes, from p[..., a, alpha] = e_a . G^alpha."""
    a, b, c, d = p[..., 0, 0], p[..., 0, 1], p[..., 1, 0], p[..., 1, 1]
    return np.stack(
        [
            np.stack([a * a, b * b, a * b], axis=-1),
            np.stack([c * c, d * d, c * d], axis=-1),
            np.stack([2 * a * c, 2 * b * d, a * d + b * c], axis=-1),
        ],
        axis=-2,
    )


def curvature_map(kappa: np.ndarray) -> np.ndarray:
    """(..., 3, 3) map of c0 to sym(kappa c0), both as [11, 22, 2*12]."""
    k11, k12, k21, k22 = kappa[..., 0, 0], kappa[..., 0, 1], kappa[..., 1, 0], kappa[..., 1, 1]
    zero = np.zeros_like(k11)
    return np.stack(
        [
            np.stack([k11, zero, 0.5 * k21], axis=-1),
            np.stack([zero, k22, 0.5 * k12], axis=-1),
            np.stack([k12, k21, 0.5 * (k11 + k22)], axis=-1),
        ],
        axis=-2,
    )


def reference_geometry(mesh: ShellMesh) -> ReferenceGeometry:
    """Evaluate the reference geometry of a mesh at the 2 x 2 points of every element. Raises ValueError if an element
    has no area or its material axis stands normal to the surface.
    """
    x = mesh.nodes[mesh.quads]
    d = mesh.directors[mesh.quads]
    basis = np.einsum("pac,eai->epci", SLOPE, x)  # (ne, 4, 2, 3)
    turn = np.einsum("pac,eai->epci", SLOPE, d)
    normal = np.cross(basis[:, :, 0], basis[:, :, 1])
    area = np.linalg.norm(normal, axis=-1)
    if not np.all(area > 0):
        raise ValueError(f"Element {int(np.argmin(area.min(axis=1)))} has no area.")
    normal /= area[..., None]
    axis = np.broadcast_to(mesh.material_axis, (mesh.element_count, 3))[:, None, :]
    first = axis - np.einsum("epi,epi->ep", np.broadcast_to(axis, normal.shape), normal)[..., None] * normal
    length = np.linalg.norm(first, axis=-1, keepdims=True)
    if np.any(length < 1e-6 * np.linalg.norm(axis, axis=-1, keepdims=True)):
        raise ValueError(f"The material axis stands normal to element {int(np.argmin(length.min(axis=(1, 2))))}.")
    first /= length
    second = np.cross(normal, first)
    if mesh.mirrored is not None:  # a left-handed pair, in which an angle is that of the mirror image
        second[mesh.mirrored] *= -1.0
    axes = np.stack([first, second, normal], axis=2)
    metric = np.einsum("epci,epdi->epcd", basis, basis)
    dual = np.einsum("epcd,epdi->epci", np.linalg.inv(metric), basis)
    p = np.einsum("epai,epci->epac", axes[:, :, :2], dual)
    kappa = np.einsum("epgi,epbi->epgb", dual, turn)
    q = strain_map(p)
    edge = 0.25 * np.einsum(
        "egi,egi->eg",
        x[:, SHEAR_EDGES[:, 1]] - x[:, SHEAR_EDGES[:, 0]],
        d[:, SHEAR_EDGES[:, 1]] + d[:, SHEAR_EDGES[:, 0]],
    )
    return ReferenceGeometry(
        area=area,
        thickness=mesh.thickness,
        q=q,
        qk=q @ curvature_map(kappa),
        p=p,
        shear0=edge,
        curvature=kappa,
        axes=axes,
        position=np.einsum("pa,eai->epi", SHAPE, x),
    )


def shear_map(geometry: ReferenceGeometry) -> np.ndarray:
    """(ne, 4, 2, 4): transverse shears in local axes at the points from those at the edges."""
    covariant = np.zeros((4, 2, 4))
    covariant[:, 0, :2], covariant[:, 1, 2:] = SHEAR_WEIGHTS[:, :2], SHEAR_WEIGHTS[:, 2:]
    return geometry.p @ covariant


def thickness_over_radius(geometry: ReferenceGeometry) -> np.ndarray:
    """(ne, 4): half the wall over the smaller radius of curvature; above one the inner face folds over itself."""
    eigenvalues = np.linalg.eigvals(geometry.curvature)
    return 0.5 * geometry.thickness[:, None] * np.abs(eigenvalues).max(axis=-1)


def shifted_layers(geometry: ReferenceGeometry, points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Maps from strains of the mid-surface to strains of layers at a distance from it.

    A layer of a curved wall is longer or shorter than the mid-surface.

    Parameters
    ----------
    points : (np, 2) or, for zones, (ne, np, 2) array
        Normalised coordinate and weight of every layer point.

    Returns
    -------
    plane : (ne, 4, np, 3, 3) array
        Map of in-plane strains [11, 22, 2*12]: S^-1/2 E S^-1/2 in local axes.
    across : (ne, 4, np, 2, 2) array
        Map of transverse shears: S^-1/2.
    area : (ne, 4, np) array
        det S: area of the layer over that of the mid-surface.
    """
    inverse = np.linalg.inv(geometry.p)
    local = np.swapaxes(inverse, -1, -2) @ geometry.curvature @ np.swapaxes(geometry.p, -1, -2)
    curvature, axes = np.linalg.eigh(0.5 * (local + np.swapaxes(local, -1, -2)))
    heights = geometry.thickness[:, None] * points[..., 0]  # (ne, np)
    stretch = bounded_stretch(heights[:, None, :, None] * curvature[:, :, None])
    root = np.einsum("epai,epli,epbi->eplab", axes, stretch**-0.5, axes)
    return strain_map(root), root, stretch.prod(axis=-1)


def bounded_stretch(x: np.ndarray) -> np.ndarray:
    """Length of a parallel surface over that of the mid-surface, 1 + x with x height times curvature.

    Below x = -1/2, where the wall comes near to folding, its inverse goes on along its tangent, so it stays positive.
    """
    return np.where(x > -0.5, 1.0 + x, 0.25 / np.maximum(-x, 0.5))
