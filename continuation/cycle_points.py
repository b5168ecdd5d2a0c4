"""Points of a branch of periodic motions: options, special points, predictions, zeros of test functions.

The next cycle lies on polynomials through the last ones, in the arclength or in the parameter; a special point lies at
a zero of a test function between two of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from continuation.cycles import Cycle
from continuation.harmonics import Harmonics
from continuation.hill import Exponents
from continuation.periodic import PeriodicMotion

#: Kinds of special points.
FOLD, DOUBLING, TORUS, BRANCH_POINT = "fold", "period doubling", "torus", "branch point"


@dataclass(frozen=True, eq=False)
class CyclePoint:
    """A cycle on a branch."""

    cycle: Cycle
    value: float  #: Of the parameter.
    arclength: float
    exponents: Exponents | None
    asked: bool = False  #: True at a value that was asked for.
    tests: dict = field(default_factory=dict)  #: Values of the events' functions.

    @property
    def motion(self):
        return self.cycle.motion

    @property
    def known(self) -> int:
        """Number of exponents."""
        return 0 if self.exponents is None else len(self.exponents.values)


@dataclass(frozen=True, eq=False)
class SpecialCycle:
    """A special point."""

    kind: str
    point: CyclePoint  #: The cycle nearest to it that was computed.
    value: float  #: Of the parameter, by interpolation.
    frequency: float = 0.0  #: Of the perturbation that becomes neutral, Hz; zero for a fold.
    located: bool = True  #: True when it was found as closely as asked for.

    @property
    def title(self) -> str:
        """Kind, told apart from those of equilibria."""
        return self.kind if self.kind != FOLD else "fold of cycles"


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
    """The exponent nearest to the imaginary axis; zero where none is apart from that of the shift in time."""
    values = exponents.values
    return complex(values[np.argmin(np.abs(values.real))]) if len(values) else 0j


def kind_of(value: complex, omega: float, real: bool) -> str:
    """Kind of the bifurcation at which an exponent becomes neutral, of a real multiplier or a pair."""
    if not real:
        return TORUS
    return DOUBLING if value.imag > 0.25 * omega else FOLD


def change_between(a: Exponents, b: Exponents) -> str | None:
    """Kind of the bifurcation between two cycles, None if there is none.

    A real multiplier has passed 1, or -1, where the number of those beyond it has changed by an odd one: pairs that
    become real, or the reverse, change it by two.
    """
    if a.unstable == b.unstable or min(a.unstable, b.unstable) < 0:
        return None
    few, many = (
        [kind_of(v, e.omega, size == 1) for v, size in zip(e.values[e.grows], e.dimensions[e.grows])]
        for e in sorted((a, b), key=lambda e: e.unstable)
    )
    gained = {kind: many.count(kind) - few.count(kind) for kind in (FOLD, DOUBLING, TORUS)}
    odd = [kind for kind in (FOLD, DOUBLING) if gained[kind] % 2]
    return odd[0] if odd else max(gained, key=lambda kind: gained[kind])


def exponent_that_crosses(a: Exponents, b: Exponents) -> Callable[[CyclePoint], complex]:
    """The exponent that crosses between two cycles, as a function of a point: that of the first dimension, by growth,
    beyond those in which perturbations grow at both; zero where none is known.
    """
    rank = min(a.unstable, b.unstable)

    def exponent(point: CyclePoint) -> complex:
        each = np.repeat(point.exponents.values, point.exponents.dimensions)
        return complex(each[min(rank, len(each) - 1)]) if len(each) else 0j

    return exponent


#: Points that predictions are made of.
POINTS = 4
#: Most by which errors of points may grow in a prediction by the parameter: older points that bring more are not used.
GROWTH = 50.0


def value_by_arclength(points: Sequence[CyclePoint], arclength: float) -> float:
    """The parameter at an arclength, by the polynomial through points."""
    weights = lagrange([p.arclength for p in points], arclength)
    return float(sum(w * p.value for w, p in zip(weights, points)))


def predict_by_arclength(points: Sequence[CyclePoint], arclength: float, h: Harmonics) -> PeriodicMotion:
    """The motion at an arclength, by the polynomial through points."""
    weights = lagrange([p.arclength for p in points], arclength)
    coefficients = sum(w * h.resized(p.motion.coefficients) for w, p in zip(weights, points))
    return PeriodicMotion(h, coefficients, float(sum(w * p.motion.omega for w, p in zip(weights, points))))


def predict_by_parameter(
    points: Sequence[CyclePoint], value: float, h: Harmonics, weight: np.ndarray
) -> PeriodicMotion | None:
    """The motion at a value of the parameter, by polynomials in it through the last points; None where these do not
    lead one way to it.

    Beside an onset the odd harmonics have a size with a root in it; its square, their shape, and all else are functions
    of the parameter without a singularity (Hassard, Kazarinoff & Wan 1981, ch. 1), so that these are continued.

    Parameters
    ----------
    points : sequence of CyclePoint
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


def parameter_predicts_better(points: Sequence[CyclePoint], weight: np.ndarray) -> bool:
    """True when the last point would have been met closer by the parameter than by the arclength."""
    last, before = points[-1], points[:-1]
    h, c = last.motion.harmonics, last.motion.coefficients
    one = predict_by_parameter(before, last.value, h, weight)
    if one is None:
        return len(before) < 2
    other = predict_by_arclength(before[-POINTS:], last.arclength, h)
    return bool(np.sum((one.coefficients - c) ** 2 * weight) <= np.sum((other.coefficients - c) ** 2 * weight))
