"""Potential and normal velocity of source panels of unit strength and of their mirror images.

    phi(x) = -1/(4 pi) sum_k s_k integral dS / |R_k x - y|,      u = grad phi

R_k are the identity and the reflections about x = 0, y = 0 and both, s_k the signs of the images: a source mirrored
at x equals the source seen from the mirrored x. Near panels are integrated exactly (Hess and Smith 1967), those
further off by four points or one.
"""

from __future__ import annotations

import math

import numba
import numpy as np

from .panels import Panels

#: Distances over the longer diagonal of a panel, squared, up to which it is integrated exactly and by four points.
EXACT, FOUR = 2.5**2, 8.0**2
#: Reflections about x = 0, y = 0 and both.
REFLECTIONS = np.array([[1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [1.0, -1.0, 1.0], [-1.0, -1.0, 1.0]])
#: Sign of the potential behind x = 0 and behind y = 0 for each class of motions.
CLASSES = {"SS": (1.0, 1.0), "SA": (1.0, -1.0), "AS": (-1.0, 1.0), "AA": (-1.0, -1.0)}


def image_signs(name: str) -> np.ndarray:
    """Signs (4,) of the images for a class of motions: symmetric or antisymmetric about x = 0, then about y = 0."""
    a, b = CLASSES[name]
    return np.array([1.0, a, b, a * b])


@numba.njit(cache=True)
def _exact(x, corners, normal, own, out):
    """Integral of 1/r over a flat panel and its gradient, out (4,)."""
    out[:] = 0.0
    w = 0.0
    for i in range(3):
        w += (x[i] - corners[0, i]) * normal[i]
    for a in range(4):
        b = (a + 1) % 4
        ra = rb = d = 0.0
        for i in range(3):
            ra += (x[i] - corners[a, i]) ** 2
            rb += (x[i] - corners[b, i]) ** 2
            d += (corners[b, i] - corners[a, i]) ** 2
        if d == 0.0:
            continue
        ra, rb, d = math.sqrt(ra), math.sqrt(rb), math.sqrt(d)
        e0 = (corners[b, 0] - corners[a, 0]) / d
        e1 = (corners[b, 1] - corners[a, 1]) / d
        e2 = (corners[b, 2] - corners[a, 2]) / d
        # outward in the plane: edge x normal
        m0 = e1 * normal[2] - e2 * normal[1]
        m1 = e2 * normal[0] - e0 * normal[2]
        m2 = e0 * normal[1] - e1 * normal[0]
        reach = (corners[a, 0] - x[0]) * m0 + (corners[a, 1] - x[1]) * m1 + (corners[a, 2] - x[2]) * m2
        log = math.log((ra + rb + d) / max(ra + rb - d, 1e-300))
        out[0] += reach * log
        out[1] -= m0 * log
        out[2] -= m1 * log
        out[3] -= m2 * log
    angle = 2.0 * math.pi
    if not own:
        angle = _solid_angle(x, corners, 0, 1, 2) + _solid_angle(x, corners, 0, 2, 3)
        out[0] -= w * angle
    for i in range(3):
        out[1 + i] -= angle * normal[i]


@numba.njit(cache=True)
def _solid_angle(x, corners, a, b, c):
    """Signed solid angle of a triangle, positive above it (van Oosterom and Strackee 1983)."""
    p0, p1, p2 = corners[a, 0] - x[0], corners[a, 1] - x[1], corners[a, 2] - x[2]
    q0, q1, q2 = corners[b, 0] - x[0], corners[b, 1] - x[1], corners[b, 2] - x[2]
    r0, r1, r2 = corners[c, 0] - x[0], corners[c, 1] - x[1], corners[c, 2] - x[2]
    p = math.sqrt(p0 * p0 + p1 * p1 + p2 * p2)
    q = math.sqrt(q0 * q0 + q1 * q1 + q2 * q2)
    r = math.sqrt(r0 * r0 + r1 * r1 + r2 * r2)
    triple = p0 * (q1 * r2 - q2 * r1) + p1 * (q2 * r0 - q0 * r2) + p2 * (q0 * r1 - q1 * r0)
    below = p * q * r + (p0 * q0 + p1 * q1 + p2 * q2) * r
    below += (q0 * r0 + q1 * r1 + q2 * r2) * p + (r0 * p0 + r1 * p1 + r2 * p2) * q
    return -2.0 * math.atan2(triple, below)


@numba.njit(cache=True)
def _by_points(x, points, weights, out):
    """The same by quadrature."""
    out[:] = 0.0
    for k in range(points.shape[0]):
        d0, d1, d2 = x[0] - points[k, 0], x[1] - points[k, 1], x[2] - points[k, 2]
        square = d0 * d0 + d1 * d1 + d2 * d2
        value = weights[k] / math.sqrt(square)
        slope = value / square
        out[0] += value
        out[1] -= slope * d0
        out[2] -= slope * d1
        out[3] -= slope * d2


@numba.njit(cache=True, fastmath={"contract", "arcp", "nsz"})
def _influence(targets, sources, rule, signs, shift, potential, velocity):
    """Fill potential and velocity (t, s); target i + shift is panel i of the sources."""
    points, normals = targets
    corners, panel_normals, gauss, weights, centres, areas = sources
    rule_points, rule_centres, reach = rule
    out, x, n = np.empty(4), np.empty(3), np.empty(3)
    factor = 1.0 / (4.0 * math.pi)
    potential[:] = 0.0
    velocity[:] = 0.0
    for i in range(points.shape[0]):
        for k in range(4):
            # the target mirrored in place of the source
            for c in range(3):
                x[c] = REFLECTIONS[k, c] * points[i, c]
                n[c] = REFLECTIONS[k, c] * normals[i, c]
            r0, r1, r2 = (
                REFLECTIONS[k, 0] * rule_points[i, 0],
                REFLECTIONS[k, 1] * rule_points[i, 1],
                REFLECTIONS[k, 2] * rule_points[i, 2],
            )
            sign = factor * signs[k]
            for j in range(corners.shape[0]):
                far = (r0 - rule_centres[j, 0]) ** 2 + (r1 - rule_centres[j, 1]) ** 2 + (r2 - rule_centres[j, 2]) ** 2
                if far >= FOUR * reach[j]:
                    d0, d1, d2 = x[0] - centres[j, 0], x[1] - centres[j, 1], x[2] - centres[j, 2]
                    inverse = 1.0 / (d0 * d0 + d1 * d1 + d2 * d2)
                    value = sign * areas[j] * math.sqrt(inverse)
                    potential[i, j] -= value
                    velocity[i, j] += value * inverse * (d0 * n[0] + d1 * n[1] + d2 * n[2])
                    continue
                if far < EXACT * reach[j]:
                    _exact(x, corners[j], panel_normals[j], k == 0 and i + shift == j, out)
                else:
                    _by_points(x, gauss[j], weights[j], out)
                potential[i, j] -= sign * out[0]
                velocity[i, j] -= sign * (out[1] * n[0] + out[2] * n[1] + out[3] * n[2])


def influence(
    targets: Panels,
    sources: Panels,
    signs: np.ndarray,
    shift: int | None = None,
    frozen: tuple[Panels, Panels] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Potential and normal velocity at the centres of panels, of unit sources on others.

    Parameters
    ----------
    targets, sources : Panels
    signs : (4,) array
        Of the images, see `image_signs`.
    shift : int, optional
        Panel i of the targets is panel i + shift of the sources; without it none is.
    frozen : (Panels, Panels), optional
        Targets and sources whose distances choose between exact integrals and quadratures, so that the result is
        smooth in the places of the others.

    Returns
    -------
    potential, velocity : (t, s) arrays, m and 1
        For sources of 1 m/s; velocities on the fluid's side.
    """
    shape = len(targets), len(sources)
    potential, velocity = np.empty(shape), np.empty(shape)
    near, far = (targets, sources) if frozen is None else frozen
    _influence(
        (targets.centres, targets.normals),
        (sources.corners, sources.normals, *_gauss(sources), sources.centres, sources.areas),
        (near.centres, far.centres, far.extents**2),
        np.asarray(signs, float),
        -(10**9) if shift is None else shift,
        potential,
        velocity,
    )
    if shift is not None:
        rows = np.arange(shape[0])
        velocity[rows, rows + shift] += targets.bend
    return potential, velocity


def _gauss(panels: Panels) -> tuple[np.ndarray, np.ndarray]:
    """Points (k, 4, 3) and weights (k, 4) of a quadrature of panels, exact for bilinear functions of their own
    coordinates.
    """
    c, g = panels.corners, 1.0 / math.sqrt(3.0)
    points, weights = np.empty_like(c), np.empty(c.shape[:2])
    for k, (a, b) in enumerate(((-g, -g), (g, -g), (g, g), (-g, g))):
        shape = 0.25 * np.array([(1 - a) * (1 - b), (1 + a) * (1 - b), (1 + a) * (1 + b), (1 - a) * (1 + b)])
        first = 0.25 * ((1 - b) * (c[:, 1] - c[:, 0]) + (1 + b) * (c[:, 2] - c[:, 3]))
        second = 0.25 * ((1 - a) * (c[:, 3] - c[:, 0]) + (1 + a) * (c[:, 2] - c[:, 1]))
        points[:, k] = np.einsum("a,kai->ki", shape, c)
        weights[:, k] = np.einsum("ki,ki->k", np.cross(first, second), panels.normals)
    return points, weights
