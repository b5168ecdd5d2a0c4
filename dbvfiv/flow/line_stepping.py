"""Waves in a line as a time step sees them: what they make of the pressure at the flange.

Within a step the line's own unknowns follow from the velocity at the flange: pressures are eliminated, velocities meet
a banded system that is linear but for friction and the far end. What is left is one number, the total pressure at the
flange over that velocity, with its derivative, so that the step still looks for one root. The scheme is that of the
channel's psi: equations met at a share theta of the step, rates by differences, extrapolated to that instant.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import solve_banded

from ..case.quantity import GRAVITY
from .law import FlowLaw, Traceable
from .line_elements import DEGREE, chain, element
from .stepping import MovingFluid, Step

#: Newton steps within which velocities in the line must be found, and the relative size of the last one.
_STEPS, _TOLERANCE = 40, 1e-14


@dataclass(frozen=True)
class LineState:
    """Waves in a line at one instant; see `dbvfiv.flow.elastic_line` for the unknowns.

    Attributes
    ----------
    velocity, velocity_rate : (k + 1,) arrays
        From the far end to the flange, m/s of the inlet's section, and the scheme's value of the rate.
    pressure, pressure_rate : (k,) arrays
        m/s and m/s2.
    books : (3,) array
        Energy since the start, J of the part: taken in at the far end, lost by friction, handed to the valve.
    """

    velocity: np.ndarray
    velocity_rate: np.ndarray
    pressure: np.ndarray
    pressure_rate: np.ndarray
    books: np.ndarray

    @property
    def packed(self) -> np.ndarray:
        """All numbers in one array."""
        return np.concatenate([self.velocity, self.pressure, self.velocity_rate, self.pressure_rate, self.books])

    def changed(self, inner: np.ndarray) -> LineState:
        """With a change (l,) of the law's unknowns, see `dbvfiv.flow.elastic_line.LineChannel`."""
        k = len(self.pressure)
        velocity = self.velocity + np.append(inner[1 : k + 1], inner[0])
        return replace(self, velocity=velocity, pressure=self.pressure + inner[k + 1 :])

    @classmethod
    def unpacked(cls, numbers: np.ndarray) -> LineState:
        """Undo `packed`."""
        k = (len(numbers) - 5) // 4
        velocity, pressure, velocity_rate, pressure_rate, books = np.split(
            np.asarray(numbers, float), np.cumsum([k + 1, k, k + 1, k])
        )
        return cls(velocity, velocity_rate, pressure, pressure_rate, books)


class LineWaves:
    """The line's equations in numpy, for one inlet area.

    Parameters
    ----------
    line : ElasticLine
    inlet_area : float
        Of the part, m2.
    density : float, kg/m3
    """

    def __init__(self, line: Traceable, inlet_area: float, density: float):
        one, count = element(), line.elements
        own = {"pipe_length": line.line.length, "wave_speed": line.wave_speed}
        segments = line.segments(inlet_area, own)
        self.length, self.ratio, self.speed, self.lost = (np.array(column)[:, None] for column in segments[:4])
        self._rigid, self._loss = np.array(segments.inertance), np.array(segments.loss)
        self._before, self.lossy = np.array(segments.lost_before)[:, None], bool(self.lost.any() or self._loss.any())
        self.density, self.area, self.count = density, float(inlet_area), count
        self.reservoir, self.pump = line.line.reservoir, line.pump
        self._first_ratio = float(line.line.section(inlet_area)[1])
        self.nodes = chain(count)
        self.size = DEGREE * count + 1
        local = np.arange(DEGREE + 1)
        self._place = (  # of the entries of all elements in the banded form
            np.broadcast_to(DEGREE + local[:, None] - local, (count, DEGREE + 1, DEGREE + 1)),
            np.broadcast_to(self.nodes[:, None, :], (count, DEGREE + 1, DEGREE + 1)),
        )
        self._value, self._slope, self._weights, self._mass = one.value, one.slope, one.weights, one.mass
        self._stiff = one.slope.T @ (one.weights[:, None] * one.slope)
        self._banded: tuple[float, np.ndarray] | None = None

    # -- parts
    # ----

    def _sum(self, local: np.ndarray) -> np.ndarray:
        """Vector (k + 1,) from the shares (count, N + 1) of the elements."""
        return np.bincount(self.nodes.ravel(), weights=local.ravel(), minlength=self.size)

    def _assembled(self, local: np.ndarray) -> np.ndarray:
        """Banded matrix from those (count, N + 1, N + 1) of the elements."""
        out = np.zeros((2 * DEGREE + 1, self.size))
        np.add.at(out, self._place, local)
        return out

    def inertia(self, rate: np.ndarray) -> np.ndarray:
        """Inertia term (k + 1,) of the rates (k + 1,) of the velocities, m2/s2."""
        return self._sum(self.ratio * self.length * (rate[self.nodes] @ self._mass.T)) + self._rigid * rate

    def push(self, pressure: np.ndarray) -> np.ndarray:
        """Driving term (k + 1,) of the pressures (k,) at the velocity nodes, m2/s2."""
        return self._sum(self.ratio * self.speed * ((self._weights * pressure.reshape(self.count, -1)) @ self._slope))

    def stretch(self, velocity: np.ndarray) -> np.ndarray:
        """- d pi/dt (k,) of velocities (k + 1,)."""
        return (self.speed / self.length * (velocity[self.nodes] @ self._slope.T)).ravel()

    def _friction(self, velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Friction (count, N) at the points with their weights, m2/s2, and twice the speed there, as its slope."""
        flows = velocity[self.nodes] @ self._value.T
        size = np.abs(flows)
        return self.lost * self._weights * flows * size, 2.0 * self.lost * self._weights * size

    def friction(self, velocity: np.ndarray) -> np.ndarray:
        """Friction (k + 1,), m2/s2."""
        return self._sum(self._friction(velocity)[0] @ self._value) + self._loss * velocity * np.abs(velocity)

    def far(self, velocity: float, inlet: float) -> tuple[float, float]:
        """Total pressure at the far end over the density, m2/s2, and its slope."""
        head, slope = self._source(velocity, inlet)
        if self.pump is None:
            return head, slope
        per_velocity = self.pump.copies * self.area
        lift, falling = self.pump.head_and_slope(per_velocity * velocity)
        return head + GRAVITY * (lift - self.pump.reference), slope + GRAVITY * falling * per_velocity

    def _source(self, velocity: float, inlet: float) -> tuple[float, float]:
        """Total pressure over the density ahead of any pump, m2/s2, and its derivative by the velocity, m/s."""
        speed = self._first_ratio * velocity
        gained = min(speed, 0.0) if self.reservoir else speed
        return inlet / self.density + 0.5 * gained**2, self._first_ratio * gained

    def linear(self, rate: float) -> np.ndarray:
        """Banded matrix of inertia and compression where the rate of everything is `rate` times it."""
        if self._banded is None or self._banded[0] != rate:
            length, speed, ratio = (column[:, :, None] for column in (self.length, self.speed, self.ratio))
            mass, stiff = rate * length * self._mass, speed**2 / (rate * length) * self._stiff
            banded = self._assembled(ratio * (mass + stiff))
            banded[DEGREE] += rate * self._rigid
            self._banded = rate, banded
        return self._banded[1]

    def tangent(self, rate: float, velocity: np.ndarray, far_slope: float) -> np.ndarray:
        """Banded derivative of the momentum at velocities (k + 1,)."""
        out = self.linear(rate)
        if self.lossy:
            slope = self._friction(velocity)[1]
            out = out + self._assembled(np.einsum("ep,pi,pj->eij", slope, self._value, self._value))
            out[DEGREE] += 2.0 * self._loss * np.abs(velocity)
        else:
            out = out.copy()
        out[DEGREE, 0] -= far_slope
        return out

    # -- what is read off
    # ----

    def energies(self, state: LineState) -> tuple[float, float]:
        """Kinetic and elastic energy, J of the part."""
        weight = 0.5 * self.density * self.area
        kinetic = weight * float(state.velocity @ self.inertia(state.velocity))
        squares = self.ratio * self.length * self._weights * state.pressure.reshape(self.count, -1) ** 2
        return kinetic, weight * float(squares.sum())

    def steady(self, velocity: float, inlet: float) -> LineState:
        """Uniform flow with an inlet velocity, m/s, under a pressure at the far end, Pa."""
        lost = self._before + self.lost * element().points
        head = self._source(velocity, inlet)[0] - lost * velocity * abs(velocity)
        k = self.size - 1
        pressure = (head / (self.ratio * self.speed)).ravel()
        return LineState(np.full(k + 1, velocity), np.zeros(k + 1), pressure, np.zeros(k), np.zeros(3))

    def at_rest(self) -> LineState:
        """Fluid at rest without pressure."""
        k = self.size - 1
        return LineState(np.zeros(k + 1), np.zeros(k + 1), np.zeros(k), np.zeros(k), np.zeros(3))

    def moving(self, state: LineState, inlet: float, flange_rate: float) -> LineState:
        """A state with the rates that the equations ask for where the inlet velocity changes at a given rate, m/s2."""
        momentum = self.friction(state.velocity) - self.push(state.pressure)
        momentum[0] -= self.far(state.velocity[0], inlet)[0]
        mass, fixed = self._masses()
        rate = np.append(_solve(mass, -momentum[:-1] - fixed[:-1] * flange_rate), flange_rate)
        return replace(state, velocity_rate=rate, pressure_rate=-self.stretch(state.velocity))

    @property
    def inertance(self) -> float:
        """Length, m, of the rigid column at the flange that the line is for sudden changes of the inlet velocity."""
        mass, fixed = self._masses()
        return float(fixed[-1] - fixed[:-1] @ _solve(mass, fixed[:-1]))

    def _masses(self) -> tuple[np.ndarray, np.ndarray]:
        """Banded mass of all nodes but the flange's, and the column (k + 1,) of that."""
        whole = self._assembled((self.ratio * self.length)[:, :, None] * self._mass)
        whole[DEGREE] += self._rigid
        unit = np.zeros(self.size)
        unit[-1] = 1.0
        return whole[:, :-1], self.inertia(unit)


class LineInstant:
    """A line at one instant, its rates known."""

    def __init__(self, waves: LineWaves, state: LineState):
        self.state = state
        self._head = float((waves.push(state.pressure) - waves.inertia(state.velocity_rate))[-1])
        self._head -= float(waves.friction(state.velocity)[-1])

    def at(self, velocity: float) -> tuple[float, float]:
        """Total pressure at the flange over the density, m2/s2, and its derivative by the inlet velocity."""
        return self._head, 0.0

    def end(self, velocity: float) -> LineState:
        """The state."""
        return self.state


class LineStep:
    """A line in a step.

    Parameters
    ----------
    waves : LineWaves
    old : LineState
    step : float, s
    theta : float
        Where in the step the equations are met.
    rate : float
        Weight of the new rate there.
    inlet : float
        Pressure at the far end there, Pa.
    """

    def __init__(self, waves: LineWaves, old: LineState, step: float, theta: float, rate: float, inlet: float):
        self.waves, self.old, self.step, self.theta, self.inlet = waves, old, step, theta, inlet
        self._rate = rate / (step * theta)
        self._kept = (1.0 - rate) * old.velocity_rate, (1.0 - rate) * old.pressure_rate
        self._known = waves.inertia(self._kept[0] - self._rate * old.velocity)
        self._known -= waves.push(old.pressure - self._kept[1] / self._rate)
        self._velocity = old.velocity.copy()

    def _momentum(self, velocity: np.ndarray) -> tuple[np.ndarray, float]:
        """Momentum (k + 1,) but for the flange's pressure at velocities where the equations are met, and the slope of
        the far end.
        """
        waves = self.waves
        head, slope = waves.far(velocity[0], self.inlet)
        out = self._known + _product(waves.linear(self._rate), velocity)
        if waves.lossy:
            out += waves.friction(velocity)
        out[0] -= head
        return out, slope

    def at(self, velocity: float) -> tuple[float, float]:
        """Total pressure at the flange over the density, m2/s2, and its derivative by the inlet velocity, both where
        the equations are met. Not numbers where they have no solution.
        """
        w = self._velocity.copy()
        if not np.isfinite(w).all():
            w = self.old.velocity.copy()
        w[-1] = velocity
        size = np.inf
        for _ in range(_STEPS):
            momentum, slope = self._momentum(w)
            tangent = self.waves.tangent(self._rate, w, slope)
            column = _last_column(tangent)
            both = np.stack([-momentum[:-1], -column[:-1]], axis=1)
            change, along = _solve(tangent[:, :-1], both).T
            w[:-1] += change
            before, size = size, np.abs(change).max()
            scale = np.abs(w).max()
            if size <= _TOLERANCE * scale or (size >= before and size <= 1e-11 * scale):
                break
        else:
            return np.nan, np.nan
        self._velocity = w
        momentum, _ = self._momentum(w)
        return float(-momentum[-1]), float(-(column[-1] + column[:-1] @ along))

    def end(self, velocity: float) -> LineState:
        """The state at the end of the step, from the inlet velocity where the equations are met."""
        waves, old, theta, h = self.waves, self.old, self.theta, self.step
        head, _ = self.at(velocity)
        w = self._velocity
        pressure = old.pressure - (self._kept[1] + waves.stretch(w)) / self._rate
        change, change_of_pressure = (w - old.velocity) / theta, (pressure - old.pressure) / theta
        power = waves.density * waves.area * h
        work = power * np.array([waves.far(w[0], self.inlet)[0] * w[0], waves.friction(w) @ w, head * velocity])
        return LineState(
            old.velocity + change,
            change / h,
            old.pressure + change_of_pressure,
            change_of_pressure / h,
            old.books + work,
        )


class LineFluid(MovingFluid):
    """The unsteady flow of a time step behind an elastic line.

    Parameters
    ----------
    channel : Channel
        Without the line.
    density : float, kg/m3
    line : ElasticLine
    """

    def __init__(self, channel: FlowLaw, density: float, line: Traceable):
        super().__init__(channel, density)
        self.line = line

    def waves(self, inlet_area: float) -> LineWaves:
        """The line's equations for the part's area of the inlet, m2."""
        return LineWaves(self.line, inlet_area, self.density)

    def _velocity(self, mid: tuple, new: tuple, step: Step) -> float:
        known = step.speed, step.theta, step.psi_weight, float(step.psi_known[0])
        return self._searched(mid, new, 0.0, *known, step.line)

    def flange(self, step: Step, velocity: float) -> tuple[float, float, LineState]:
        head, slope = step.line.at(velocity)
        static = self.density * (head - 0.5 * velocity**2), self.density * (slope - velocity)
        return *static, step.line.end(velocity)


def _solve(banded: np.ndarray, rhs: np.ndarray) -> np.ndarray:
    """Solution of a banded system; not numbers where it has none."""
    try:
        return solve_banded((DEGREE, DEGREE), banded, rhs, check_finite=False)
    except np.linalg.LinAlgError:
        return np.full_like(rhs, np.nan)


def _last_column(banded: np.ndarray) -> np.ndarray:
    """Last column (k + 1,) of a banded matrix."""
    out = np.zeros(banded.shape[1])
    out[-DEGREE - 1 :] = banded[: DEGREE + 1, -1]
    return out


def _product(banded: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """Product of a banded matrix with a vector."""
    n = len(vector)
    out = banded[DEGREE] * vector
    for i in range(1, DEGREE + 1):
        out[:-i] += banded[DEGREE - i, i:] * vector[i:]
        out[i:] += banded[DEGREE + i, : n - i] * vector[: n - i]
    return out
