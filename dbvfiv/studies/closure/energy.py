"""The energy balance of a path of equilibria: work of the pressure against what shell and contact have stored."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ...model.linear import DirectFactor, SingularMatrix
from ...model.pressed_shell import PressedShell

#: Gauss points of a stretch, exact for the work of a load that is quadratic in the positions along a cubic path while
#: the pressure rises linearly.
_POINTS, _WEIGHTS = np.polynomial.legendre.leggauss(6)
#: Most halvings of a stretch, and halvings in a row that do not help.
_DEEPEST, _STUBBORN = 16, 5
#: Most iterations for an equilibrium in between, and unknowns, in sizes of the mesh, beyond which one has lost its way.
_ITERATIONS, _ASTRAY = 25, 10.0


class _Loads(NamedTuple):
    """Pressure and multipliers of a stretch of path, linear in s from 0 to 1."""

    pressure: float
    rise: float
    multiplier: np.ndarray
    change: np.ndarray

    def at(self, s: float) -> tuple[float, np.ndarray]:
        return self.pressure + s * self.rise, self.multiplier + s * self.change


class _Place(NamedTuple):
    """An equilibrium on a stretch: s, unknowns, their derivative by s if known, strain energy and contact potential."""

    s: float
    q: np.ndarray
    rate: np.ndarray | None
    strain: float
    potential: float


@dataclass
class EnergyLedger:
    """Adds up the work along a path of equilibria and compares it with the energies gained.

    On every stretch between two equilibria

        int P f(q) dq + int (dC/dlambda) dlambda = gain of strain energy + gain of the contact's potential C(q, lambda),

    for the path is one of equilibria under loads P and multipliers lambda that change linearly. The second integral is
    the work of renewing multipliers, which change the potential. The path in between is taken as a cubic through both
    ends with the tangents dq/dP where these are known, else as straight. A follower pressure on a surface with a free
    edge has no potential, so that its work is one along the path and not a function of its ends.

    With a `tolerance`, `settle` halves stretches whose balance misses their share of it and solves for the equilibrium
    in between, so that what comes into touch within a load step is found. Forces that were not the derivative of the
    energies would leave a defect that no halving removes.

    Parameters
    ----------
    pressed : PressedShell
    tolerance : float
        Of the balance over the work; 0 does not refine.

    Attributes
    ----------
    work, renewal, contact, strain, defect : float, J
        Work of the pressure and of renewing multipliers, taken up by the contact's potential, strain energy gained,
        and the sum of the sizes of what is missing on each stretch.
    equilibria : int
        Solved for in between.
    """

    pressed: PressedShell
    tolerance: float = 0.0
    work: float = 0.0
    renewal: float = 0.0
    contact: float = 0.0
    strain: float = 0.0
    defect: float = 0.0
    equilibria: int = 0
    _last: tuple | None = field(default=None, repr=False)
    _waiting: list = field(default_factory=list, repr=False)
    _factor: DirectFactor | None = field(default=None, repr=False)

    def __post_init__(self):
        self._own = copy(self.pressed)  # has multipliers of its own

    @property
    def error(self) -> float:
        """Defect of the energy balance, absolute values summed over all stretches, over the work of the pressure."""
        return self.defect / abs(self.work) if self.work else 0.0

    @property
    def totals(self) -> tuple[float, ...]:
        """All sums, to go on with elsewhere."""
        return (self.work, self.renewal, self.contact, self.strain, self.defect, float(self.equilibria))

    @totals.setter
    def totals(self, values: tuple[float, ...]) -> None:
        self.work, self.renewal, self.contact, self.strain, self.defect = (float(value) for value in values[:5])
        self.equilibria = int(values[5])

    def begin(self, q: np.ndarray, pressure: float, slope: np.ndarray | None = None) -> None:
        """Start the ledger at the first state of the path, with dq/dP if that is known."""
        self._last = (pressure, self.pressed.multiplier.copy(), q, slope)

    def add(self, q: np.ndarray, pressure: float, slope: np.ndarray | None = None, refine: bool = True) -> None:
        """Take the next equilibrium, for the multipliers that the shell has now, with dq/dP if that is known; without
        `refine` where equilibria in between cannot be found by their pressure, as on a path that turns back.
        """
        before, multiplier, start, slope0 = self._last
        loads = _Loads(before, pressure - before, multiplier, self.pressed.multiplier - multiplier)
        rates = (None, None)
        if slope0 is not None and slope is not None and not loads.change.any():
            rates = (loads.rise * slope0, loads.rise * slope)
        ends = [self._place(loads, s, x, rate) for s, x, rate in ((0.0, start, rates[0]), (1.0, q, rates[1]))]
        if self.tolerance and refine:
            self._waiting.append((loads, *ends))
        else:
            self._count(loads, *ends)
        self._last = (pressure, self.pressed.multiplier.copy(), q, slope)

    def settle(self) -> None:
        """Count the stretches since the last time, halved as often as the tolerance asks for.

        It is shared out between load steps by their rise; every renewal of multipliers gets as much as a tenth of all
        of them.
        """
        waiting, self._waiting = self._waiting, []
        work = abs(self.work + sum(self._works(*stretch)[0] for stretch in waiting))
        total = sum(abs(loads.rise) for loads, _, _ in waiting)
        for loads, start, stop in waiting:
            share = 0.5 * abs(loads.rise) / total if loads.rise else 0.05
            self._refine(loads, start, stop, share * self.tolerance * work)

    def _refine(self, loads: _Loads, start: _Place, stop: _Place, allowed: float) -> None:
        """Count a stretch, in parts if its balance misses what is allowed, J."""
        start, stop = (self._solve(loads, place.s, place.q) or place for place in (start, stop))
        waiting = [(start, stop, self._missing(loads, start, stop), allowed, 0, 0)]
        while waiting:
            a, b, missing, share, depth, stubborn = waiting.pop()
            halved = abs(missing) > share and depth < _DEEPEST and stubborn < _STUBBORN
            middle = self._between(loads, a, b) if halved else None
            if middle is None:
                self._count(loads, a, b)
                continue
            self.equilibria += 1
            first, second = self._missing(loads, a, middle), self._missing(loads, middle, b)
            stubborn = stubborn + 1 if abs(first) + abs(second) > 0.7 * abs(missing) else 0
            waiting.append((middle, b, second, 0.5 * share, depth + 1, stubborn))
            waiting.append((a, middle, first, 0.5 * share, depth + 1, stubborn))

    def _count(self, loads: _Loads, a: _Place, b: _Place) -> None:
        work, renewal = self._works(loads, a, b)
        self.work += work
        self.renewal += renewal
        self.strain += b.strain - a.strain
        self.contact += b.potential - a.potential
        self.defect += abs(work + renewal - (b.strain - a.strain) - (b.potential - a.potential))

    def _missing(self, loads: _Loads, a: _Place, b: _Place) -> float:
        return sum(self._works(loads, a, b)) - (b.strain - a.strain) - (b.potential - a.potential)

    def _works(self, loads: _Loads, a: _Place, b: _Place) -> tuple[float, float]:
        """Work of the pressure and of renewing multipliers between two places, J."""
        step, length = b.q - a.q, b.s - a.s
        curved = a.rate is not None and b.rate is not None
        work = renewal = 0.0
        for x, w in zip(0.5 * (1 + _POINTS), 0.5 * _WEIGHTS):
            place, rate = _hermite(x, a.q, step, length * a.rate, length * b.rate) if curved else (a.q + x * step, step)
            pressure, multiplier = loads.at(a.s + x * length)
            if loads.change.any():
                self._own.multiplier = multiplier
                renewal += w * length * float(self._own.renewal_force(place) @ loads.change)
            work += w * float(self.pressed.pressure_force(self.pressed.nodal(place), pressure) @ rate)
        return work, renewal

    def _place(self, loads: _Loads, s: float, q: np.ndarray, rate: np.ndarray | None) -> _Place:
        _, self._own.multiplier = loads.at(s)
        return _Place(s, q, rate, self._own.shell.energy(q), self._own.contact_energy(q))

    def _between(self, loads: _Loads, a: _Place, b: _Place) -> _Place | None:
        straight = curved = 0.5 * (a.q + b.q)
        if a.rate is not None and b.rate is not None:
            curved = straight + 0.125 * (b.s - a.s) * (a.rate - b.rate)
        starts = (curved, straight, a.q, b.q)  # where contact comes and goes a straight way may serve better
        return next((found for q in starts if (found := self._solve(loads, 0.5 * (a.s + b.s), q))), None)

    def _solve(self, loads: _Loads, s: float, q: np.ndarray) -> _Place | None:
        """Equilibrium under the loads at s by Newton's method, with its tangent; None if it was not found."""
        own = self._own
        pressure, own.multiplier = loads.at(s)
        if self._factor is None:
            self._factor = own.factor()
        last, found = np.inf, False
        try:
            for _ in range(_ITERATIONS):
                tangent = own.tangent(q, pressure)
                own.refactor(self._factor, tangent)
                residual = float(np.linalg.norm(tangent.residual))
                # as far as it goes: where rounding alone is left, iterations gain nothing more
                found = residual <= own.rounding(q, tangent) and not residual < 0.1 * last
                if found:
                    break
                q, last = q - self._factor.solve(tangent.residual), residual
                if np.linalg.norm(q) > _ASTRAY * np.linalg.norm(own.mesh.nodes):  # where rounding excuses any residual
                    return None
        except (SingularMatrix, ArithmeticError):
            return None
        if not found:
            return None
        push = loads.rise * own.pressure_derivative(q, pressure) + own.multiplier_derivative(q, loads.change)
        return self._place(loads, s, q, -self._factor.solve(push))


def _hermite(x, start, step, m0, m1):
    """Cubic through two states and its derivative with respect to x in 0..1."""
    h = x * x * (3 - 2 * x)
    place = start + h * step + x * (1 - x) ** 2 * m0 + x * x * (x - 1) * m1
    rate = 6 * x * (1 - x) * step + (1 - x) * (1 - 3 * x) * m0 + x * (3 * x - 2) * m1
    return place, rate
