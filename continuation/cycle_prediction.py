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
#: Most by which errors of points may grow in a prediction: an older point that brings more is not used.
GROWTH = 50.0


def along(points: Sequence[CyclePoint], arclength: float, h: Harmonics) -> PeriodicMotion:
    """The motion at an arclength, by the polynomial through points."""
    weights = lagrange([p.arclength for p in points], arclength)
    coefficients = sum(w * h.resized(p.motion.coefficients) for w, p in zip(weights, points))
    return PeriodicMotion(h, coefficients, float(sum(w * p.motion.omega for w, p in zip(weights, points))))


def from_onset(
    points: Sequence[CyclePoint], onset: CyclePoint, value: float, h: Harmonics
) -> PeriodicMotion | None:
    """The motion at a value of the parameter on a branch that starts at an onset; None where the branch does not lead
    straight away from it.

    With the root z of the distance from the onset as the way, the branch goes on through the onset to the same cycles
    turned by half a period: odd harmonics over z and even ones are functions of the parameter without a singularity
    (Hassard, Kazarinoff & Wan 1981, ch. 1), and polynomials of these are good even where the branch starts.
    """
    distances = np.array([onset.value - p.value for p in points] + [onset.value - value])
    if np.any(distances * distances[0] <= 0) or np.any(np.diff(np.abs(distances)) <= 0):
        return None
    ways, odd = np.sqrt(np.abs(distances)), (np.arange(1, h.size) + 1) // 2 % 2 == 1
    odd = np.append(False, odd)[:, None]
    count = 2
    for more in range(3, min(POINTS, len(points)) + 1):
        if np.abs(lagrange(distances[-1 - more : -1], distances[-1])).sum() <= GROWTH:
            count = more
    last = points[-count:]
    weights = lagrange(distances[-1 - len(last) : -1], distances[-1])
    coefficients = sum(
        w * h.resized(p.motion.coefficients) * np.where(odd, ways[-1] / way, 1.0)
        for w, p, way in zip(weights, last, ways[-1 - len(last) : -1])
    )
    return PeriodicMotion(h, coefficients, float(sum(w * p.motion.omega for w, p in zip(weights, last))))
