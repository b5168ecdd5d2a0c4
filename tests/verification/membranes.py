"""Two classical four-node membrane elements with two unknowns a node, written down from their papers.

Pian & Sumihara (1984), Int. J. Num. Meth. Eng. 20, 1685-1695: five stresses. Taylor, Beresford & Wilson (1976), same
journal 10, 1211-1219: QM6, incompatible displacements whose gradients are taken at the centre so that the patch test
holds.
"""

from __future__ import annotations

import numpy as np

from dbvfiv.shell.reference import GAUSS, SLOPE
from tests.shell.structures import Grid

CENTRE = 0.25 * np.array([[-1.0, 1.0, 1.0, -1.0], [-1.0, -1.0, 1.0, 1.0]])  # slopes of the shape functions there


def _strains(gradients: np.ndarray) -> np.ndarray:
    """(3, 2 n) map of n vectors in the plane to the strains 11, 22, 2*12; gradients (2, n)."""
    out = np.zeros((3, 2 * gradients.shape[1]))
    out[0, ::2], out[1, 1::2] = gradients
    out[2, ::2], out[2, 1::2] = gradients[::-1]
    return out


def pian_sumihara(places: np.ndarray, e: float, nu: float, h: float) -> np.ndarray:
    """Stiffness (8, 8) in plane stress at nodes (4, 2)."""
    compliance = np.array([[1.0, -nu, 0.0], [-nu, 1.0, 0.0], [0.0, 0.0, 2 + 2 * nu]]) / e
    (a1, b1), (a3, b3) = CENTRE @ places
    inner, mixed = np.zeros((5, 5)), np.zeros((5, 8))
    for (r, s), slope in zip(GAUSS, SLOPE):
        jacobian = slope.T @ places
        weight = h * np.linalg.det(jacobian)
        linear = np.array([[a1 * a1 * s, a3 * a3 * r], [b1 * b1 * s, b3 * b3 * r], [a1 * b1 * s, a3 * b3 * r]])
        stresses = np.hstack([np.eye(3), linear])
        inner += weight * stresses.T @ compliance @ stresses
        mixed += weight * stresses.T @ _strains(np.linalg.solve(jacobian, slope.T))
    return mixed.T @ np.linalg.solve(inner, mixed)


def qm6(places: np.ndarray, e: float, nu: float, h: float) -> np.ndarray:
    """Stiffness (8, 8) in plane stress at nodes (4, 2)."""
    law = e / (1 - nu**2) * np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, (1 - nu) / 2]])
    middle = CENTRE @ places
    whole = np.zeros((12, 12))
    for (r, s), slope in zip(GAUSS, SLOPE):
        jacobian = slope.T @ places
        size = np.linalg.det(jacobian)
        bubbles = np.linalg.det(middle) / size * np.linalg.solve(middle, np.diag([-2 * r, -2 * s]))
        strains = np.hstack([_strains(np.linalg.solve(jacobian, slope.T)), _strains(bubbles)])
        whole += h * size * strains.T @ law @ strains
    return whole[:8, :8] - whole[:8, 8:] @ np.linalg.solve(whole[8:, 8:], whole[8:, :8])


def cantilever(patch: Grid, element, *wall) -> float:
    """Deflection of the last edge of a patch, two nodes long, under a unit force along y; held at the first edge."""
    count = 2 * len(patch.nodes)
    stiffness, load, free = np.zeros((count, count)), np.zeros(count), np.ones((len(patch.nodes), 2), bool)
    for quad in patch.quads:
        unknowns = (2 * quad[:, None] + [0, 1]).ravel()
        stiffness[np.ix_(unknowns, unknowns)] += element(patch.nodes[quad, :2], *wall)
    end = patch.index[-1]
    load[2 * end + 1] = 1.0 / len(end)
    free[patch.index[0]] = False
    free, moved = free.ravel(), np.zeros(count)
    moved[free] = np.linalg.solve(stiffness[np.ix_(free, free)], load[free])
    return float(moved[2 * end + 1].mean())
