"""Uniform beam of unit length, stiffness and mass: Hermite elements, and problems made of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.polynomial.legendre import leggauss

from eigen import CoupledPencil


@dataclass(frozen=True)
class Beam:
    """Matrices of a beam clamped at x = 0; the unknowns are w, w' at the nodes.

    Attributes
    ----------
    x : ndarray
        Nodes.
    mass, bending : csr
        int w v, int w'' v''.
    tension : csr
        int w' v'.
    slope : csr
        int w' v, rows v.
    curvature : csr
        int (1 - x) w'' v, rows v.
    keep : ndarray of int
        Unknowns that are free, out of the 2 (count + 1).
    """

    x: np.ndarray
    mass: sp.csr_matrix
    bending: sp.csr_matrix
    tension: sp.csr_matrix
    slope: sp.csr_matrix
    curvature: sp.csr_matrix
    keep: np.ndarray

    def tip(self) -> sp.csr_matrix:
        """w'(1) v(1), rows v."""
        n = self.keep.size
        return sp.csr_matrix(([1.0], ([n - 2], [n - 1])), (n, n))


def hermite(xi: np.ndarray, h: float) -> np.ndarray:
    """Cubic shape functions and two derivatives on an element, shape (3, 4, points)."""
    return np.array(
        [
            [1 - 3 * xi**2 + 2 * xi**3, h * (xi - 2 * xi**2 + xi**3), 3 * xi**2 - 2 * xi**3, h * (xi**3 - xi**2)],
            [(-6 * xi + 6 * xi**2) / h, 1 - 4 * xi + 3 * xi**2, (6 * xi - 6 * xi**2) / h, 3 * xi**2 - 2 * xi],
            [(-6 + 12 * xi) / h**2, (-4 + 6 * xi) / h, (6 - 12 * xi) / h**2, (6 * xi - 2) / h],
        ]
    )


def beam(elements: int = 60, *, clamped_end: bool = False) -> Beam:
    """Assemble a beam clamped at x = 0, at x = 1 free or clamped."""
    x = np.linspace(0, 1, elements + 1)
    h = 1.0 / elements
    points, weights = leggauss(5)
    xi, weights = 0.5 * (points + 1), 0.5 * h * weights
    shape, first, second = hermite(xi, h)
    size = 2 * (elements + 1)
    dof = 2 * np.arange(elements)[:, None] + np.arange(4)
    rows, cols = np.repeat(dof, 4, axis=1).ravel(), np.tile(dof, (1, 4)).ravel()
    keep = np.arange(2, size - 2 if clamped_end else size)

    def assemble(left, right, factor=None):
        block = np.einsum("ip,jp,p->ij", left, right, weights)
        blocks = np.broadcast_to(block, (elements, 4, 4))
        if factor is not None:
            place = x[:-1, None] + h * xi
            blocks = np.einsum("ip,jp,ep->eij", left, right, weights * factor(place))
        return sp.csr_matrix((blocks.ravel(), (rows, cols)), (size, size))[keep][:, keep]

    return Beam(
        x,
        assemble(shape, shape),
        assemble(second, second),
        assemble(first, first),
        assemble(shape, first),
        assemble(shape, second, lambda s: 1 - s),
        keep,
    )


def beck_column(load: float, elements: int = 60, damping: float = 0.0) -> CoupledPencil:
    """Cantilever under a tangential force at its tip."""
    b = beam(elements)
    K = b.bending - load * b.tension + load * b.tip()
    return CoupledPencil(M=b.mass, C=damping * b.bending, K=K)


def leipholz_column(load: float, elements: int = 60) -> CoupledPencil:
    """Cantilever under a uniform tangential load."""
    b = beam(elements)
    return CoupledPencil(M=b.mass, C=0 * b.mass, K=b.bending + load * b.curvature)


def fluid_conveying_pipe(
    velocity: float, mass_ratio: float, elements: int = 60, *, clamped_end: bool = False
) -> CoupledPencil:
    """w'''' + u^2 w'' + 2 sqrt(beta) u dw'/dt + d2w/dt2 = 0."""
    b = beam(elements, clamped_end=clamped_end)
    K = b.bending - velocity**2 * b.tension
    if not clamped_end:
        K = K + velocity**2 * b.tip()
    return CoupledPencil(M=b.mass, C=2 * np.sqrt(mass_ratio) * velocity * b.slope, K=K)


def ziegler_pendulum(load: float, damping: float = 0.0) -> CoupledPencil:
    """Two rods, follower force; masses 2 and 1, springs, lengths and dampers equal."""
    return CoupledPencil(
        M=[[3.0, 1.0], [1.0, 1.0]],
        C=damping * np.array([[2.0, -1.0], [-1.0, 1.0]]),
        K=[[2.0 - load, load - 1.0], [-1.0, 1.0]],
    )
