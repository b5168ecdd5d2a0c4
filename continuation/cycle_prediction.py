"""Where the next cycle of a branch is expected, from those before it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from continuation.cycle_points import CyclePoint
from continuation.cycle_zeros import lagrange
from continuation.harmonics import Harmonics
from continuation.periodic import PeriodicMotion

#: Points that predictions are made of.
POINTS = 4
#: Most by which errors of points may grow in a prediction by the parameter: older points that bring more are not used.
GROWTH = 50.0


def by_arclength(points: Sequence[CyclePoint], arclength: float, h: Harmonics) -> PeriodicMotion:
    """The motion at an arclength, by the polynomial through points."""
    weights = lagrange([p.arclength for p in points], arclength)
    coefficients = sum(w * h.resized(p.motion.coefficients) for w, p in zip(weights, points))
    return PeriodicMotion(h, coefficients, float(sum(w * p.motion.omega for w, p in zip(weights, points))))


def by_parameter(points: Sequence[CyclePoint], value: float, h: Harmonics, weight: np.ndarray) -> PeriodicMotion | None:
    """The motion at a value of the parameter, by polynomials in it through the last points; None where these do not
    lead one way to it.

    Beside an onset the odd harmonics have a size with a root in it; its square, their shape, and all else are functions
    of the parameter without a singularity (Hassard, Kazarinoff & Wan 1981, ch. 1), so that these are continued.

    Parameters
    ----------
    points : sequence of CyclePoint
    value : float
    h : Harmonics
        Of the prediction.
    weight : (n,) array
        Of squares of unknowns in sizes.
    """
    values = [p.value for p in points[-POINTS:]]
    steps = np.diff([*values, value])
    if len(values) < 2 or not (np.all(steps > 0) or np.all(steps < 0)):
        return None
    count = 2
    for more in range(3, len(values) + 1):
        if np.abs(lagrange(values[-more:], value)).sum() <= GROWTH:
            count = more
    odd = np.append(False, (np.arange(1, h.size) + 1) // 2 % 2 == 1)
    weights = lagrange(values[-count:], value)
    parts = [h.resized(p.motion.coefficients) for p in points[-count:]]
    sizes = np.array([np.sqrt(np.sum(c[odd] ** 2 * weight)) for c in parts])
    square = float(weights @ sizes**2)
    if square <= 0 or not np.all(sizes > 0):
        return None
    coefficients = sum(
        w * c * np.where(odd, np.sqrt(square) / size, 1.0)[:, None] for w, c, size in zip(weights, parts, sizes)
    )
    omegas = [p.motion.omega for p in points[-count:]]
    return PeriodicMotion(h, coefficients, float(weights @ omegas))


def parameter_is_better(points: Sequence[CyclePoint], weight: np.ndarray) -> bool:
    """Whether the last point would have been met closer by the parameter than by the arclength."""
    last, before = points[-1], points[:-1]
    h, c = last.motion.harmonics, last.motion.coefficients
    one = by_parameter(before, last.value, h, weight)
    if one is None:
        return len(before) < 2
    other = by_arclength(before[-POINTS:], last.arclength, h)
    return bool(np.sum((one.coefficients - c) ** 2 * weight) <= np.sum((other.coefficients - c) ** 2 * weight))
