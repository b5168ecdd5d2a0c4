"""Inner fluid of a valve that sways: a plug that follows the wall sideways while it flows through it.

A section whose wall moves sideways changes no area to first order, but its fluid goes with it. With w(z, t) the lateral
displacement of the section's centroid, the fluid's momentum per length, rho A Dw, changes by

    rho A D(Dw),   D = d/dt - U d/dz      (z runs against the flow; rho A U is the same everywhere)

which is the force of the wall on the fluid (Paidoussis 1998, Fluid-Structure Interactions, section 3.2): added mass,
Coriolis and centrifugal force. The pressure behind it varies linearly across the section, so it acts along the wall's
normal and its generalised force belongs to the motion of the centroid. In weak form, with linear w between stations,
the centrifugal part keeps its end term -rho A U^2 w' at the outlet, as for a cantilevered pipe.

Equations (T.17) and (T.18) of docs/theory.md.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

#: Gauss points of an interval of unit length.
_POINTS = 0.5 + np.array([-0.5, 0.5]) / np.sqrt(3.0)


def centroid_slope(points: np.ndarray, axis: int, floor: float = 0.0) -> np.ndarray:
    """Derivative of the centroids of sections by the places of their wall.

    Parameters
    ----------
    points : (m, c, 2) array, m
        Wall of the computed part of each section, from x = 0 or y = 0 to y = 0.
    axis : int
        Of the displacement: 0 for x, 1 for y.
    floor : float, m2
        Smallest area that moments are divided by.

    Returns
    -------
    (m, c, 2) array
        Moving all points by one along the axis gives one, as long as the last point lies on y = 0.
    """
    x, y = points[..., 0], points[..., 1]
    x1, x2, y1, y2 = x[:, :-1], x[:, 1:], y[:, :-1], y[:, 1:]
    dx = x2 - x1
    area = np.sum(0.5 * dx * (y1 + y2), axis=1)
    slope = np.zeros_like(points)
    if axis == 1:  # integral of y^2/2 dx
        square = (y1**2 + y1 * y2 + y2**2) / 6
        first = (-square, dx * (2 * y1 + y2) / 6)
        second = (square, dx * (y1 + 2 * y2) / 6)
    else:  # integral of x y dx
        moment = (2 * x1 * y1 + x1 * y2 + x2 * y1 + 2 * x2 * y2) / 6
        first = (dx * (2 * y1 + y2) / 6 - moment, dx * (2 * x1 + x2) / 6)
        second = (dx * (y1 + 2 * y2) / 6 + moment, dx * (x1 + 2 * x2) / 6)
    for i in range(2):
        slope[:, :-1, i] += first[i]
        slope[:, 1:, i] += second[i]
    return slope / np.maximum(area, max(floor, np.finfo(float).tiny))[:, None, None]


def centroid_matrix(slope: np.ndarray, rows: np.ndarray, index: np.ndarray) -> sp.csr_matrix:
    """(m, n) matrix from free unknowns to the displacements of the centroids; `slope` as `centroid_slope` gives it, for
    the nodes `rows` (m, c) with unknowns numbered by `index` (nn, c).
    """
    columns = index[rows][:, :, :2]
    stations = np.broadcast_to(np.arange(len(rows))[:, None, None], columns.shape)
    keep = columns >= 0
    size = int(index.max()) + 1
    return sp.csr_matrix((slope[keep], (stations[keep], columns[keep])), shape=(len(rows), size))


def plug_parts(
    z: np.ndarray, area: np.ndarray, speed: np.ndarray, density: np.ndarray | float, unsteady: bool = True
) -> dict[str, np.ndarray]:
    """Generalised forces on the wall, p = (A0 + lambda A1 + lambda^2 A2) w, of displacements w (m,) of the stations.

    Parameters
    ----------
    z : (m,) array, m
        Stations from the outlet to the inlet.
    area, speed : (m,) arrays, m2, m/s
        Of the passage, and of the steady flow towards the outlet.
    density : (m,) array or float, kg/m3
        Its product with both is the same at all stations.
    unsteady : bool
        False keeps the centrifugal force alone.

    Returns
    -------
    dict
        A0 (N/m), A1 (N s/m), A2 (kg), (m, m).
    """
    m, step = len(z), np.diff(z)
    density = np.broadcast_to(density, z.shape)
    discharge = density[-1] * area[-1] * speed[-1]
    left, right = np.arange(m - 1), np.arange(1, m)
    stiffness, coriolis, mass = np.zeros((3, m, m))
    for s in _POINTS:
        shape = {0: 1.0 - s, 1: s}
        at = (1.0 - s) * area[:-1] + s * area[1:], (1.0 - s) * speed[:-1] + s * speed[1:]
        thick = density[:-1] + s * np.diff(density)
        for i, rows in enumerate((left, right)):
            for j, columns in enumerate((left, right)):
                by, along = (2 * i - 1) / step, (2 * j - 1) / step
                stiffness[rows, columns] += 0.5 * step * discharge * at[1] * by * along
                coriolis[rows, columns] += 0.5 * step * 2.0 * discharge * shape[i] * along
                mass[rows, columns] -= 0.5 * step * thick * at[0] * shape[i] * shape[j]
    for end, sign in ((0, 1.0), (m - 1, -1.0)):
        stiffness[end] += sign * discharge * speed[end] * _end_slope(z, end)
    parts = {"A0": stiffness}
    return parts | {"A1": coriolis, "A2": mass} if unsteady else parts


def _end_slope(z: np.ndarray, end: int) -> np.ndarray:
    """Weights (m,) of the derivative at the first or last station, of the parabola through three."""
    weights = np.zeros(len(z))
    near = np.array([0, 1, 2]) if end == 0 else len(z) - 1 - np.array([0, 1, 2])
    a, b = z[near[1]] - z[near[0]], z[near[2]] - z[near[0]]
    weights[near] = [-(a + b) / (a * b), b / (a * (b - a)), -a / (b * (b - a))]
    return weights
