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
#: Sign of the potential behind a plane of symmetry.
_SIGNS = {"S": 1.0, "A": -1.0}


def image_signs(name: str) -> np.ndarray:
    """Signs (4,) of the images for a class of motions of a quarter, symmetric or antisymmetric about x = 0, then about
    y = 0; of a half about y = 0 alone, with no images about x = 0.
    """
    *across, b = (_SIGNS[letter] for letter in name)
    a = across[0] if across else 0.0
    return np.array([1.0, a, b, a * b])


#: Sources that are taken together: where one of them is near, all are looked at again.
BLOCK = 8
#: How a panel is integrated that is not far: by four points, or exactly.
POINTS, NEAR = 1, 2
#: Division by zero gives infinity, which is left out again: a test for it would keep loops from being vectorised.
_compiled = numba.njit(cache=True, error_model="numpy", fastmath={"contract", "arcp", "nsz"})


@_compiled
def _exact(x, corners, sides, lengths, normal, own, r, p, out):
    """Integral of 1/r over a flat panel and its gradient, out (4,); r (4,) and p (4, 3) are room to work in.

    The panel's solid angle is that of its two triangles (van Oosterom and Strackee 1983), halves added as arguments.
    """
    out[:] = 0.0
    w = 0.0
    for a in range(4):
        for i in range(3):
            p[a, i] = corners[a, i] - x[i]
        r[a] = math.sqrt(p[a, 0] ** 2 + p[a, 1] ** 2 + p[a, 2] ** 2)
    for i in range(3):
        w -= p[0, i] * normal[i]
    for a in range(4):
        d = lengths[a]
        if d == 0.0:
            continue
        both = r[a] + r[(a + 1) % 4]
        reach = p[a, 0] * sides[a, 0] + p[a, 1] * sides[a, 1] + p[a, 2] * sides[a, 2]
        log = math.log((both + d) / max(both - d, 1e-300))
        out[0] += reach * log
        for i in range(3):
            out[1 + i] -= sides[a, i] * log
    angle = 2.0 * math.pi
    if not own:
        first, second = _triangle(p, r, 1, 2), _triangle(p, r, 2, 3)
        angle = -2.0 * math.atan2(
            first[0] * second[1] + first[1] * second[0], first[1] * second[1] - first[0] * second[0]
        )
        out[0] -= w * angle
    for i in range(3):
        out[1 + i] -= angle * normal[i]


@_compiled
def _triangle(p, r, b, c):
    """Sine and cosine of half the solid angle of the triangle of corners 0, b and c, times a positive number."""
    triple = p[0, 0] * (p[b, 1] * p[c, 2] - p[b, 2] * p[c, 1])
    triple += p[0, 1] * (p[b, 2] * p[c, 0] - p[b, 0] * p[c, 2])
    triple += p[0, 2] * (p[b, 0] * p[c, 1] - p[b, 1] * p[c, 0])
    below = r[0] * r[b] * r[c] + (p[0, 0] * p[b, 0] + p[0, 1] * p[b, 1] + p[0, 2] * p[b, 2]) * r[c]
    below += (p[b, 0] * p[c, 0] + p[b, 1] * p[c, 1] + p[b, 2] * p[c, 2]) * r[0]
    below += (p[c, 0] * p[0, 0] + p[c, 1] * p[0, 1] + p[c, 2] * p[0, 2]) * r[b]
    return triple, below


@_compiled
def _point(x, n, y0, y1, y2, strength):
    """Potential and normal velocity of a point source, with their signs changed."""
    d0, d1, d2 = x[0] - y0, x[1] - y1, x[2] - y2
    inverse = 1.0 / math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
    value = strength * inverse
    return value, -value * (inverse * inverse) * (d0 * n[0] + d1 * n[1] + d2 * n[2])


@_compiled
def _add_far(x, n, held, sign, y, areas, held_sources, reach, kind, phi, u):
    """Add all panels that are far by one point, and tell the kinds of the others."""
    for j in range(len(areas)):
        value, slope = _point(x, n, y[0, j], y[1, j], y[2, j], sign * areas[j])
        away = (held[0] - held_sources[0, j]) ** 2
        away += (held[1] - held_sources[1, j]) ** 2
        away += (held[2] - held_sources[2, j]) ** 2
        far = away >= FOUR * reach[j]
        phi[j] -= value if far else 0.0
        u[j] -= slope if far else 0.0
        kind[j] = (away < FOUR * reach[j]) + (away < EXACT * reach[j])


@_compiled
def _add_point(x, n, sign, y0, y1, y2, weights, kind, phi, u):
    """Add one of the four points of panels that are taken by them."""
    for j in range(len(kind)):
        value, slope = _point(x, n, y0[j], y1[j], y2[j], sign * weights[j])
        here = kind[j] == POINTS
        phi[j] -= value if here else 0.0
        u[j] -= slope if here else 0.0


@_compiled
def _add_points(x, n, sign, gauss, weights, kind, some, phi, u):
    """Add the panels that are taken by points, in runs of blocks that have any: long loops are the fast ones."""
    first = 0
    while first < len(some):
        last = first
        while last < len(some) and some[last] & POINTS:
            last += 1
        lo, hi = first * BLOCK, last * BLOCK
        if hi > lo:
            for g in range(4):
                y0, y1, y2 = gauss[g, 0, lo:hi], gauss[g, 1, lo:hi], gauss[g, 2, lo:hi]
                _add_point(x, n, sign, y0, y1, y2, weights[g, lo:hi], kind[lo:hi], phi[lo:hi], u[lo:hi])
        first = last + 1


@_compiled
def _influence(targets, sources, points, rule, signs, shift, potential, velocity):
    """Fill potential and velocity (t, s); target i + shift is panel i of the sources.

    Points of sources and what chooses the rule have panels last, as many as whole blocks hold.
    """
    places, normals, held = targets
    corners, sides, lengths, panel_normals = sources
    y, areas, gauss, weights = points
    held_sources, reach = rule
    count, blocks = len(corners), len(areas) // BLOCK
    out, r, p = np.empty(4), np.empty(4), np.empty((4, 3))
    kind, some = np.empty(len(areas), np.uint8), np.empty(blocks, np.uint8)
    phi, u = np.empty(len(areas)), np.empty(len(areas))
    for i in range(len(places)):
        phi[:] = 0.0
        u[:] = 0.0
        for k in range(4):
            if signs[k] == 0.0:
                continue
            # the target mirrored in place of the source
            m0, m1, m2 = REFLECTIONS[k]
            x = (m0 * places[i, 0], m1 * places[i, 1], m2 * places[i, 2])
            n = (m0 * normals[i, 0], m1 * normals[i, 1], m2 * normals[i, 2])
            h = (m0 * held[i, 0], m1 * held[i, 1], m2 * held[i, 2])
            sign = signs[k] / (4.0 * math.pi)
            _add_far(x, n, h, sign, y, areas, held_sources, reach, kind, phi, u)
            for block in range(blocks):
                some[block] = 0
                for j in range(block * BLOCK, (block + 1) * BLOCK):
                    some[block] |= kind[j]
            _add_points(x, n, sign, gauss, weights, kind, some, phi, u)
            for block in range(blocks):
                if some[block] & NEAR:
                    for j in range(block * BLOCK, min((block + 1) * BLOCK, count)):
                        if kind[j] == NEAR:
                            own = k == 0 and i + shift == j
                            _exact(x, corners[j], sides[j], lengths[j], panel_normals[j], own, r, p, out)
                            phi[j] -= sign * out[0]
                            u[j] -= sign * (out[1] * n[0] + out[2] * n[1] + out[3] * n[2])
        potential[i] = phi[:count]
        velocity[i] = u[:count]


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
    gauss, weights = _gauss(sources)
    sides, lengths = _sides(sources)
    _influence(
        (targets.centres, targets.normals, near.centres),
        (sources.corners, sides, lengths, sources.normals),
        (_rows(sources.centres), _rows(sources.areas), _rows(gauss), _rows(weights)),
        (_rows(far.centres), _rows(far.extents**2)),
        np.asarray(signs, float),
        -(10**9) if shift is None else shift,
        potential,
        velocity,
    )
    if shift is not None:
        rows = np.arange(shape[0])
        velocity[rows, rows + shift] += targets.bend
    return potential, velocity


def _rows(array: np.ndarray) -> np.ndarray:
    """With the panels (k, ...) last, as vector units want them, and filled up to whole blocks with zeros."""
    rest = -len(array) % BLOCK
    whole = np.concatenate([array, np.zeros((rest, *array.shape[1:]))])
    return np.ascontiguousarray(np.moveaxis(whole, 0, -1))


def _sides(panels: Panels) -> tuple[np.ndarray, np.ndarray]:
    """Outward unit normals (k, 4, 3) of the sides of panels in their planes, and the sides' lengths (k, 4)."""
    way = np.roll(panels.corners, -1, axis=1) - panels.corners
    length = np.linalg.norm(way, axis=2)
    outward = np.cross(way, panels.normals[:, None]) / np.where(length > 0.0, length, 1.0)[..., None]
    return outward, length


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
