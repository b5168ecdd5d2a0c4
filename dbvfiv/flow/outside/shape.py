"""Derivative of the impedance by the shape of all panels, contracted with fluxes, at the cost of one impedance.

Strengths s of all panels, moving or not, follow from A s = D b with fluxes b, D one over the areas, and pressures are
-P s, so that

    d (a' S b) = -(1/2) [ a' dP s_b - r_a' dA s_b + r_a' dD b ] - (the same with a and b exchanged),    A' r_a = P' a.

A sum of such products costs no more than one: they differ in columns alone.

A and P are sums over pairs of panels. What is integrated by points has its derivatives by all places in one sweep over
the pairs; panels that are near enough to be integrated exactly are few, and are summed anew for each shape.
"""

from __future__ import annotations

import math

import numpy as np
import scipy.linalg as la

from .influence import EXACT, FOUR, REFLECTIONS, _compiled, _exact, _gauss, _sides, influence
from .panels import Panels
from .potential_flow import PotentialFlow, panel_strength


@_compiled
def _slopes(d, n, strength, in_potential, in_velocity, to_distance, to_normal):
    """Add derivatives of the weighted influence of a point source by its distance and the normal; gives that by its
    strength.
    """
    inverse = 1.0 / math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    cube, across = inverse**3, d[0] * n[0] + d[1] * n[1] + d[2] * n[2]
    by_velocity = in_velocity * strength * cube
    along = in_potential * strength * cube - 3.0 * by_velocity * across * inverse**2
    for i in range(3):
        to_distance[i] += along * d[i] + by_velocity * n[i]
        to_normal[i] += by_velocity * d[i]
    return in_velocity * cube * across - in_potential * inverse


@_compiled
def _sweep(panels, points, reach, signs, weights, slopes):
    """Derivatives of the weighted sum over all pairs that are integrated by points, by centres, normals, areas, points
    and their weights.
    """
    centres, normals, areas = panels
    gauss, shares = points
    potential, velocity = weights
    by_centre, by_normal, by_area, by_gauss, by_share = slopes
    step, turn = np.empty(3, np.complex128), np.empty(3, np.complex128)
    x, n, d = np.empty(3), np.empty(3), np.empty(3)
    for i in range(len(areas)):
        for k in range(4):
            if signs[k] == 0.0:
                continue
            mirror, sign = REFLECTIONS[k], signs[k] / (4.0 * math.pi)
            for c in range(3):
                x[c], n[c] = mirror[c] * centres[i, c], mirror[c] * normals[i, c]
            for j in range(len(areas)):
                away = 0.0
                for c in range(3):
                    d[c] = x[c] - centres[j, c]
                    away += d[c] * d[c]
                if away < EXACT * reach[j]:
                    continue
                p, u = potential[i, j], velocity[i, j]
                turn[:] = 0.0
                if away >= FOUR * reach[j]:
                    step[:] = 0.0
                    by_area[j] += sign * _slopes(d, n, sign * areas[j], p, u, step, turn)
                    for c in range(3):
                        by_centre[j, c] -= step[c]
                        by_centre[i, c] += mirror[c] * step[c]
                else:
                    for g in range(4):
                        step[:] = 0.0
                        for c in range(3):
                            d[c] = x[c] - gauss[j, g, c]
                        by_share[j, g] += sign * _slopes(d, n, sign * shares[j, g], p, u, step, turn)
                        for c in range(3):
                            by_gauss[j, g, c] -= step[c]
                            by_centre[i, c] += mirror[c] * step[c]
                for c in range(3):
                    by_normal[i, c] += mirror[c] * turn[c]


@_compiled
def _sum_near(pairs, panels, sides, signs, weights):
    """Weighted sum of the exact integrals of pairs (m, 3): target, image, source."""
    corners, centres, normals = panels
    outward, lengths = sides
    out, r, p, x = np.empty(4), np.empty(4), np.empty((4, 3)), np.empty(3)
    total = 0.0j
    for a in range(len(pairs)):
        i, k, j = pairs[a]
        for c in range(3):
            x[c] = REFLECTIONS[k, c] * centres[i, c]
        _exact(x, corners[j], outward[j], lengths[j], normals[j], k == 0 and i == j, r, p, out)
        slope = 0.0
        for c in range(3):
            slope += REFLECTIONS[k, c] * normals[i, c] * out[1 + c]
        total -= signs[k] / (4.0 * math.pi) * (weights[0][i, j] * out[0] + weights[1][i, j] * slope)
    return total


def _apart(apply, x: np.ndarray) -> np.ndarray:
    """A real linear function of the columns (k, m) of a complex array: of real and imaginary parts side by side."""
    real, imaginary = np.hsplit(apply(np.hstack([x.real, x.imag])), 2)
    return real + 1j * imaginary


class ShapeDerivative:
    """Derivative of a sum of products a_i' S b_i by the shape, with S the impedance of panels.

    Parameters
    ----------
    flow : PotentialFlow
        Of a closed boundary, in motions symmetric about both planes.
    wet, open_count : int
        See `PotentialFlow.impedance`.
    a, b : (wet, m) complex arrays
        Fluxes.

    Attributes
    ----------
    pressures : (2, wet, m) complex array
        S a_i and S b_i.
    """

    def __init__(self, flow: PotentialFlow, moving: Panels, wet: int, open_count: int, a, b):
        panels = self.panels = flow.all_panels(moving)
        self.signs, areas, count = flow.signs, panels.areas, len(panels)
        held = np.ones(count, bool)  # no flow passes
        held[len(moving) - open_count : len(moving)] = False
        held[len(moving) + flow.surroundings.rigid_count :] = False
        self._strength = panel_strength(panels, self.signs)
        raw_potential, raw_velocity = influence(panels, panels, self.signs, 0)
        raw_velocity[np.diag_indices(count)] -= 0.5
        potential, velocity = raw_potential @ self._strength, raw_velocity @ self._strength
        velocity[np.diag_indices(count)] += 0.5
        flux = areas @ velocity
        matrix = np.where(held[:, None], velocity, potential)
        matrix[np.flatnonzero(held), np.flatnonzero(held)] += (flow.closed - flux / areas)[held]
        factor = la.lu_factor(matrix, overwrite_a=True, check_finite=False)
        fluxes = np.zeros((count, a.shape[1] + b.shape[1]), complex)
        fluxes[:wet] = np.hstack([a, b])
        sources = _apart(lambda x: la.lu_solve(factor, x, check_finite=False), fluxes / areas[:, None])
        received = _apart(lambda x: la.lu_solve(factor, potential.T @ x, trans=1, check_finite=False), fluxes)
        pressures = -0.5 * (_apart(potential.__matmul__, sources) + received / areas[:, None])[:wet]
        self.pressures = np.stack(np.hsplit(pressures, 2))
        # weights of potentials and velocities as sums of products of columns; sources in the order b, a
        other, crossed = (-0.5 * np.roll(x, a.shape[1], axis=1) for x in (sources, fluxes))
        own = np.where(held, (received * other).sum(axis=1) / areas, 0.0)
        left = [
            np.where(held[:, None], fluxes, fluxes - received),
            np.column_stack([np.where(held[:, None], -received, 0.0), areas]),
        ]
        right = [other, np.column_stack([other, own])]
        self._right = np.hstack(right)
        self._back = np.hstack([_apart(raw.T.__matmul__, x) for raw, x in zip((raw_potential, raw_velocity), left)])
        self._weights = tuple(x @ (self._strength @ y).T for x, y in zip(left, right))
        self._slopes = self._swept()
        self._slopes["areas"] += velocity @ own - own * flux / areas
        self._slopes["areas"] -= (received * crossed).sum(axis=1) / areas**2
        self._slopes["bend"] = np.diag(self._weights[1])
        near = self._near()
        still = np.minimum(near[:, 0], near[:, 2]) >= len(moving)
        self._moving, self._near_pairs = len(moving), (near[~still], near[still])

    def _swept(self) -> dict[str, np.ndarray]:
        """Derivatives by the places of all pairs that are integrated by points."""
        panels, (gauss, shares) = self.panels, _gauss(self.panels)
        shapes = {"centres": panels.centres, "normals": panels.normals, "areas": panels.areas}
        shapes |= {"gauss": gauss, "shares": shares}
        slopes = {name: np.zeros(array.shape, complex) for name, array in shapes.items()}
        own = panels.centres, panels.normals, panels.areas
        _sweep(own, (gauss, shares), panels.extents**2, self.signs, self._weights, tuple(slopes.values()))
        return slopes

    def _near(self) -> np.ndarray:
        """Pairs (m, 3) that are integrated exactly: target, image, source."""
        centres, reach, found = self.panels.centres, EXACT * self.panels.extents**2, []
        for k in np.flatnonzero(self.signs):
            x = REFLECTIONS[k] * centres
            away = sum((x[:, None, c] - centres[:, c]) ** 2 for c in range(3))
            i, j = np.nonzero(away < reach)
            found.append(np.column_stack([i, np.full(len(i), k), j]))
        return np.concatenate(found)

    def between(self, below: Panels, above: Panels) -> complex:
        """Difference of the sum between two shapes next to this one, of all panels. Raises ValueError if they have
        another number of panels.
        """
        if not len(below) == len(above) == len(self.panels):
            raise ValueError("Panels of the surroundings come or go where the shape changes.")
        first = self._moving  # of the surroundings, which move with the shape at rest only
        still = np.array_equal(below.corners[first:], above.corners[first:])
        pairs = self._near_pairs[0] if still else np.concatenate(self._near_pairs)
        ends = [self._data(panels, pairs) for panels in (below, above)]
        change = sum((slope * (ends[1][0][name] - ends[0][0][name])).sum() for name, slope in self._slopes.items())
        strength = (ends[1][2] - ends[0][2]) @ self._right
        return complex(change + ends[1][1] - ends[0][1] + (self._back * strength).sum())

    def _data(self, panels: Panels, pairs: np.ndarray):
        """Data of panels that derivatives are taken by, the sum over near pairs, and the strengths of the panels."""
        gauss, shares = _gauss(panels)
        data = {"centres": panels.centres, "normals": panels.normals, "areas": panels.areas, "bend": panels.bend}
        own = panels.corners, panels.centres, panels.normals
        near = _sum_near(pairs, own, _sides(panels), self.signs, self._weights)
        return data | {"gauss": gauss, "shares": shares}, near, panel_strength(panels, self.signs)
