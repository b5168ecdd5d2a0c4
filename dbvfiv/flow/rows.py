"""Flow areas of the deforming mesh rows, with exact first and second derivatives."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..geometry.valve_mesh import ValveMesh


class RowAreas:
    """Area of each row: trapezoids between mid-surface and the x axis in the x-y plane, less the wall (Th. 4.12-4.14).

    The constant difference between the surface at rest and the polygon through its nodes is added back, so that the gap
    at rest is the same on every mesh.

    Parameters
    ----------
    index : (nn, c) int array
        Numbers of the free unknowns, -1 where constrained.
    """

    def __init__(self, mesh: ValveMesh, index: np.ndarray):
        self.rows = mesh.rows
        self._rest = mesh.nodes[mesh.rows][:, :, :2]
        self.offset = mesh.rest_area - mesh.wall_deduction - _polygon(self._rest)
        self.size = int(index.max()) + 1
        columns = index[mesh.rows][:, :, :2]  # (rows, columns, 2)
        stations = np.broadcast_to(np.arange(len(mesh.rows))[:, None, None], columns.shape)
        self._keep = columns.ravel() >= 0
        keys = (stations.ravel()[self._keep], columns.ravel()[self._keep])
        count = len(keys[0])
        order = sp.csr_matrix((np.arange(1.0, count + 1), keys), shape=(len(mesh.rows), self.size))
        order.sort_indices()
        self._order = order.data.astype(int) - 1
        self._indptr, self._indices = order.indptr, order.indices

    @property
    def count(self) -> int:
        """Number of rows."""
        return len(self.rows)

    def areas(self, nodal: np.ndarray) -> np.ndarray:
        """Flow areas (rows,) in m2 of the part, from nodal unknowns (nn, c); may be negative when the lips cross."""
        return _polygon(self._rest + nodal[self.rows][:, :, :2]) + self.offset

    def rates(self, nodal: np.ndarray, rate: np.ndarray) -> np.ndarray:
        """Rates (rows,) of the areas at nodal unknowns and their rates (nn, c)."""
        slope = _polygon_slope(self._rest + nodal[self.rows][:, :, :2])
        return np.einsum("rki,rki->r", slope, rate[self.rows][:, :, :2])

    def jacobian(self, nodal: np.ndarray) -> sp.csr_matrix:
        """(rows, n) derivative of the areas with respect to the free unknowns."""
        slope = _polygon_slope(self._rest + nodal[self.rows][:, :, :2]).ravel()[self._keep]
        return self.matrix(slope[self._order])

    def matrix(self, values: np.ndarray) -> sp.csr_matrix:
        """Matrix (rows, n) on the pattern of the Jacobian with the given values."""
        return sp.csr_matrix((values, self._indices, self._indptr), shape=(self.count, self.size), copy=False)

    def second(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Second directional derivative (rows,) of the areas along nodal fields a and b (nn, c); the areas are
        quadratic.
        """
        slope = _polygon_slope(a[self.rows][:, :, :2])
        return np.sum(slope * b[self.rows][:, :, :2], axis=(1, 2))


def _polygon(points: np.ndarray) -> np.ndarray:
    x, y = points[..., 0], points[..., 1]
    return np.sum(0.5 * (y[:, 1:] + y[:, :-1]) * np.diff(x, axis=1), axis=1)


def _polygon_slope(points: np.ndarray) -> np.ndarray:
    """Derivative of `_polygon` with respect to the points, same shape; linear in the points."""
    x, y = points[..., 0], points[..., 1]
    slope = np.zeros_like(points)
    dx, mean = 0.5 * np.diff(x, axis=1), 0.5 * (y[:, 1:] + y[:, :-1])
    slope[:, 1:, 0] += mean
    slope[:, :-1, 0] -= mean
    slope[:, 1:, 1] += dx
    slope[:, :-1, 1] += dx
    return slope
