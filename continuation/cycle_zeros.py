"""What tells of special points on a branch of periodic motions: functions that vanish there, and their zeros."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from continuation.cycle_points import DOUBLING, FOLD, TORUS, CyclePoint
from continuation.hill import Exponents


def value_at_zero(met: Sequence[tuple[float, CyclePoint]], one: float, other: float) -> float:
    """The parameter where a test vanishes, from tests and points by decreasing nearness: by the polynomial through all,
    or through two where that leaves the bracket.
    """
    for some in (met, met[:2]):
        tests = [f for f, _ in some]
        if len(set(tests)) == len(tests):
            value = float(sum(w * p.value for w, (_, p) in zip(lagrange(tests, 0.0), some)))
            if min(one, other) <= value <= max(one, other):
                return value
    return float(met[0][1].value)


def zero_ahead(points: Sequence[CyclePoint], name: str) -> float:
    """Arclength from the last point to the zero of an event on the secant of the last two; infinite without."""
    a, b = points[-2:]
    slope = (b.tests[name] - a.tests[name]) / (b.arclength - a.arclength)
    return -b.tests[name] / slope if slope else np.inf


def lagrange(nodes: Sequence[float], x: float) -> np.ndarray:
    """Weights at x of the polynomial through nodes."""
    nodes = np.asarray(nodes, float)
    out = np.ones(len(nodes))
    for i, a in enumerate(nodes):
        for j, b in enumerate(nodes):
            if i != j:
                out[i] *= (x - b) / (a - b)
    return out


def crossing_of(exponents: Exponents) -> complex:
    """The exponent nearest to the imaginary axis."""
    return complex(exponents.values[np.argmin(np.abs(exponents.values.real))])


def change_between(a: Exponents, b: Exponents) -> str | None:
    """What kind of bifurcation lies between two cycles, None if none."""
    if a.unstable == b.unstable:
        return None
    few, many = sorted((a, b), key=lambda e: e.unstable)
    crossing = crossing_of(min((few, many), key=lambda e: abs(crossing_of(e).real)))
    half = 0.5 * many.omega
    if abs(many.unstable - few.unstable) % 2 == 0 and not many.is_real(crossing):
        return TORUS
    if abs(crossing.imag - half) < 0.05 * half:
        return DOUBLING
    return FOLD if crossing.imag < 0.05 * half else TORUS


def growth_of_crossing(a: Exponents, b: Exponents) -> Callable[[CyclePoint], float]:
    """Growth rate of the exponent that crosses, as a function of a point."""
    few, many = (a, b) if a.unstable < b.unstable else (b, a)
    rank = few.unstable if few.unstable < len(few.values) else 0
    index = min(rank, len(many.values) - 1)

    def test(point: CyclePoint) -> float:
        values = point.exponents.values
        return float(values.real[min(index, len(values) - 1)])

    return test
