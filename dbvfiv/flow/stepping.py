"""The flow as a time step sees it: station speeds, their integral from the inlet, pressures, and derivatives.

    p_k = P_in - rho [ head_k + d psi_k/dt ],      psi_k = integral_in^k U ds

psi rather than U is differentiated in time. Its value at the outlet is a momentum: it changes by bounded forces only,
whereas U falls by orders of magnitude within a step when lips slam, and a scheme for U then throws it to negative
values, at which the ideal jet runs away. Numpy forms of the definition in `dbvfiv.flow.channel`, for speed: a step asks
for them several times. Terms of a channel are evaluated by their definition.

Drawn in through the lips, the fluid starts from rest outside, where the pressure vanishes, and loses the head of its
jets: `dbvfiv.flow.channel.reversible_head`.

The unknown of a step is one number, the inlet velocity: it is eliminated by a scalar root, which is what lets a step
choose between an outward flow and one drawn in. Elastic lines and compressed fluids keep that contract, `StepFluid`:
what else they have is found within each evaluation.

Equation (T.9) of docs/theory.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import jax
import numpy as np

from .law import FlowLaw
from .term import wall_share


@dataclass(frozen=True)
class Step:
    """Start of the fluid in a step.

    Attributes
    ----------
    theta : float
        Point in the step at which the fluid's equations are met: the share of the new state there.
    speed : float
        Inlet velocity at the start, m/s.
    psi_weight : float
    psi_known : (m,) array
        The rate of psi is psi_weight psi + psi_known, with the new psi.
    inlet : float
        Inlet pressure where the equations are met, Pa.
    line : `dbvfiv.flow.line_stepping.LineStep` or LineInstant, optional
        Waves in an elastic upstream pipe; `inlet` is then the pressure at its far end.
    gas : `dbvfiv.flow.gas_stepping.GasStep` or GasInstant, optional
        State of a compressible fluid.
    """

    theta: float
    speed: float
    psi_weight: float
    psi_known: np.ndarray
    inlet: float
    line: Any = None
    gas: Any = None


@dataclass
class Load:
    """Fluid of a step and its force on the wall.

    Attributes
    ----------
    force : (n,) array
        G p, where the equations are met; the wall's part to find.
    outlet : float
        Pressure at the outlet, Pa, to vanish; zero where U is no unknown.
    pressure : (m,) array
        Pa, where the equations are met.
    area, speed, psi : (m,) arrays
        At the end of the step: m2 of the part, m/s, m2/s.
    psi_rate : (m,) array
        Where the equations are met, m2/s2.
    inlet : float
        Inlet pressure there, Pa.
    mid_speed : float
        Inlet velocity there, m/s.
    line : LineState, optional
        Waves in an elastic line at the end of the step.
    flange_slope : float
        Derivative of the pressure at the flange by the inlet velocity, both where the equations are met, Pa s/m.
    gas : GasFlow, optional
        A fluid that is compressed, at the end of the step.
    """

    force: np.ndarray | None
    outlet: float
    pressure: np.ndarray
    area: np.ndarray
    speed: np.ndarray
    psi: np.ndarray
    psi_rate: np.ndarray
    inlet: float
    mid_speed: float
    line: Any = None
    flange_slope: float = 0.0
    gas: Any = None


class StepFluid:
    """Evaluators of a flow law for time steps.

    Parameters
    ----------
    law : FlowLaw
    density : float, kg/m3

    Attributes
    ----------
    moves : bool
        Whether the fluid has inertia, so that psi is part of the state.
    eliminated : bool
        Whether pressures follow from the wall's motion alone, so that a step has no unknown of the fluid; it is the
        inlet velocity otherwise.
    quiet_inward : bool
        Whether steps with inward flow need no numerical damping.
    """

    moves = eliminated = True
    quiet_inward = False

    def __init__(self, law: FlowLaw, density: float):
        self.law, self.density = law, float(density)

    def load(self, mid: tuple, new: tuple, step: Step, speed: float | None = None) -> Load:
        """Fluid of a step but for its force.

        Parameters
        ----------
        mid, new : pairs of (m,) arrays
            Areas and their rates where the equations are met and at the end of the step.
        step : Step
        speed : float, optional
            Inlet velocity at the end, m/s; by default the one at which the outlet pressure vanishes.
        """
        raise NotImplementedError

    def load_slopes(self, mid: tuple, new: tuple, load: Load, theta: float, velocity: float, psi_weight: float):
        """Derivatives of its pressures by the new areas (m, m) and, if it is an unknown, the new inlet velocity (m,).

        Parameters
        ----------
        theta, psi_weight : float
            See `Step`.
        velocity : float
            Derivative of the area rates with respect to the areas at the end of the step, 1/s.
        """
        raise NotImplementedError

    def speeds(self, area: np.ndarray, rate: np.ndarray, state) -> np.ndarray:
        """Speeds (m,) of the fluid in a state, m/s, in its passage; zeros where they are none of the unknowns."""
        return np.zeros(self.law.count)

    def momenta(self, psi: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Momentum per density and area of the fluid between stations (m - 1,), m2/s, by psi and the speeds."""
        return -np.diff(psi)

    def waves(self, inlet_area: float):
        """Equations of an elastic line for the part's area of the inlet, m2; None without one."""
        return None

    def begin_step(self, passage: tuple, state, h: float, inlet: float) -> None:
        """A step of h, s, starts from a state with areas and their rates."""

    def at_an_instant(self) -> StepFluid:
        """Fluid that the accelerations of an instant are found with."""
        return self


class SteadyFluid(StepFluid):
    """The steady law at every instant."""

    moves = False

    def load(self, mid, new, step, speed=None):
        law, inlet, area = self.law, step.inlet, new[0]
        speed = law.inlet_velocity(area, inlet, self.density) if inlet > law.back else 0.0
        zero = np.zeros(law.count)
        pressure = law.steady_pressure(mid[0], inlet)
        return Load(None, 0.0, pressure, area, law.velocities(area, speed), zero, zero, inlet, speed)

    def load_slopes(self, mid, new, load, theta, velocity, psi_weight):
        return theta * self.law.steady_operator(mid[0], load.inlet)[1], None


class FrozenFluid(StepFluid):
    """The thesis's coupling (App. A), for comparison: the fluid first, in the passage of the last state, then the wall
    under its pressures.

    The inlet velocity takes a backward difference in the areas of the last state; the pressures act on the wall as it
    moves, but are not changed by it.

    Parameters
    ----------
    fluid : StepFluid
        That is advanced.
    """

    moves = False

    def __init__(self, fluid: StepFluid):
        super().__init__(fluid.law, fluid.density)
        self._fluid, self._kept = fluid, None

    def begin_step(self, passage, state, h, inlet):
        self._kept = self._fluid.load(passage, passage, Step(1.0, state.speed, 1.0 / h, -state.psi / h, inlet))

    def load(self, mid, new, step, speed=None):
        if self._kept is None:
            return SteadyFluid(self.law, self.density).load(mid, new, step)
        return replace(self._kept, outlet=0.0, inlet=step.inlet)

    def load_slopes(self, mid, new, load, theta, velocity, psi_weight):
        return np.zeros((self.law.count, self.law.count)), None

    def at_an_instant(self):
        self._kept = None
        return self._fluid


@dataclass(frozen=True)
class FlowState:
    """Flow at one instant.

    Attributes
    ----------
    speed : (m,) array
        Velocities at the stations, m/s, from outlet to inlet.
    psi : (m,) array
        m2/s.
    lost : (m,) array or 0
        Heads that terms of the law take, m2/s2.
    """

    speed: np.ndarray
    psi: np.ndarray
    lost: np.ndarray | float = 0.0


class MovingFluid(StepFluid):
    """Flow through a channel whose areas move; it may run backwards, as a whole or in a part of the valve.

    Parameters
    ----------
    channel : Channel
    density : float, kg/m3
    """

    eliminated = False

    def __init__(self, channel: FlowLaw, density: float):
        super().__init__(channel, density)
        self.channel = channel
        count = channel.count
        self._upstream = np.zeros((count, count))
        for k in range(count):
            self._upstream[k, k:-1] += 0.5 * channel.step[k:]
            self._upstream[k, k + 1 :] += 0.5 * channel.step[k:]
        self._bow = np.zeros((count, count))
        if channel.bowed:
            self._bow = np.asarray(jax.vmap(lambda speed: wall_share(channel.step, speed), 1, 1)(np.eye(count)))
        self._momentum = self._upstream + self._bow
        self._parameters = channel.values({"inlet": 0.0, "density": self.density})

    def _open(self, area: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Open area with first and second derivative; see `dbvfiv.flow.law.above_floor`."""
        floor = self.channel.floor
        x = area / floor - 1.0
        rise = np.exp(-np.abs(x))
        softplus = np.maximum(x, 0.0) + np.log1p(rise)
        slope = np.where(x >= 0, 1.0, rise) / (1.0 + rise)
        return floor * (1.0 + softplus), slope, slope * (1.0 - slope) / floor

    def open_area(self, area: np.ndarray) -> np.ndarray:
        """Areas (m,) that the fluid sees: they stay above the channel's floor."""
        return self._open(area)[0]

    def _terms(self, area, rate, velocity: float) -> tuple[np.ndarray, np.ndarray]:
        """Heads and momenta (m,) that the terms add."""
        head, momentum = _term_values(self.channel, self._parameters, area, rate, float(velocity))
        return np.asarray(head), np.asarray(momentum)

    def _term_slopes(self, area, rate, velocity: float):
        """Their derivatives by areas (m, m), rates (m, m) and inlet velocity (m,): three of each."""
        parts = _term_slopes(self.channel, self._parameters, area, rate, float(velocity))
        return tuple(tuple(np.asarray(part) for part in one) for one in parts)

    def state(self, area: np.ndarray, rate: np.ndarray, velocity: float) -> FlowState:
        """Flow for areas and their rates (m,) and the inlet velocity."""
        open_, slope, _ = self._open(area)
        discharge = open_[-1] * velocity
        if self.channel.storage:
            discharge = discharge - self.channel.storage * (self._upstream @ (slope * rate))
        speed = discharge / open_
        psi = self.integrate(speed)
        if not self.channel.terms:
            return FlowState(speed, psi)
        lost, momentum = self._terms(area, rate, velocity)
        return FlowState(speed, psi + momentum, lost)

    def load(self, mid, new, step, speed=None):
        if speed is None:
            speed = self._velocity(mid, new, step)
        mid_speed = step.speed + step.theta * (speed - step.speed)
        flow = self.state(*new, speed)
        psi_rate = step.psi_weight * flow.psi + step.psi_known
        flange, slope, line = self.flange(step, mid_speed)
        p = self.pressure(self.state(*mid, mid_speed), psi_rate, flange)
        outlet, p[0] = float(p[0]), 0.0
        return Load(None, outlet, p, new[0], flow.speed, flow.psi, psi_rate, step.inlet, mid_speed, line, slope)

    def _velocity(self, mid: tuple, new: tuple, step: Step) -> float:
        """Inlet velocity at the end of a step, m/s, at which the outlet pressure vanishes."""
        known = step.speed, step.theta, step.psi_weight, float(step.psi_known[0])
        return self.velocity(mid, new, step.inlet, *known)

    def flange(self, step: Step, velocity: float) -> tuple[float, float, Any]:
        """Static pressure at the flange, Pa, its derivative by the inlet velocity, where the equations are met, and an
        elastic line at the end of the step.
        """
        return step.inlet, 0.0, None

    def load_slopes(self, mid, new, load, theta, velocity, psi_weight):
        speeds = load.mid_speed, load.speed[-1]
        by_area, by_speed = self.pressure_slopes(mid, new, *speeds, theta, velocity, psi_weight)
        return by_area, by_speed + theta * load.flange_slope

    def speeds(self, area, rate, state):
        return self.state(area, rate, state.speed).speed

    def velocity(
        self, mid: tuple, new: tuple, inlet: float, old: float, theta: float, psi_weight: float, psi_known: float
    ) -> float:
        """New inlet velocity at which the outlet pressure vanishes; not a number if there is none.

        Outwards and without terms the pressure is quadratic in the velocity; the root is taken at which more velocity
        means less pressure. Where a speed would be inward there, and with terms, the root is the one next to the old
        velocity, in the direction in which that misses it.

        Parameters
        ----------
        mid, new : pairs of (m,) arrays
            Areas and their rates where the equations are met and at the end of the step.
        old : float
            Inlet velocity at the start of the step.
        theta : float
            Where in the step the equations are met.
        psi_weight, psi_known : float
            There, d psi/dt = psi_weight psi + psi_known at the outlet, psi at the end of the step.
        """
        if self.channel.terms:
            return self._searched(mid, new, inlet, old, theta, psi_weight, psi_known)
        s0, s1 = self._affine(*mid)
        p0, p1 = (self._upstream[0] @ part for part in self._affine(*new))
        start = (1.0 - theta) * old
        a = 0.5 * (s1[0] * s1[0] - 1.0)
        b = s0[0] * s1[0] + psi_weight * p1 / theta
        c = 0.5 * s0[0] * s0[0] + psi_weight * (p0 - p1 * start / theta) + psi_known - self._driving(inlet)
        square = b * b - 4.0 * a * c
        if square >= 0.0:
            root = np.sqrt(square)
            mean = -2.0 * c / (b + root) if b >= 0.0 else (root - b) / (2.0 * a)
            outward = float((mean - start) / theta)
            if np.min(s0 + (start + theta * outward) * s1) >= 0.0:
                return outward
        return self._searched(mid, new, inlet, old, theta, psi_weight, psi_known)

    def _searched(self, mid, new, inlet, old, theta, psi_weight, psi_known, supply=None) -> float:
        """New inlet velocity at which the outlet pressure vanishes, next to the old one in the direction in which that
        misses it; arguments as `velocity` has them.

        With a `supply`, which is anything with the method `at` of `dbvfiv.flow.line_stepping.LineStep`, the pressure at
        the flange follows from the velocity there, and `inlet` comes on top.
        """
        still, unit = self._affine(*mid)
        start = (1.0 - theta) * old  # the velocity where the equations are met is start + theta times the new one
        p0, p1 = (float(part) for part in self.integrate(np.stack(self._affine(*new), axis=1))[0])
        rise = psi_weight * p1 / theta
        known = psi_weight * (p0 - p1 * start / theta) + psi_known - self._driving(inlet)

        def missing(u: float) -> tuple[float, float]:
            speed = still + u * unit
            value = float(self.head(speed)[0]) + rise * u + known
            slope = float(self.head_slope(speed, unit)[0]) + rise
            if self.channel.terms:
                end = (u - start) / theta
                value += self._terms(*mid, u)[0][0] + psi_weight * self._terms(*new, end)[1][0]
                slope += self._term_slopes(*mid, u)[0][2][0]
                slope += psi_weight * self._term_slopes(*new, end)[1][2][0] / theta
            if supply is not None:
                head, rise_of_head = supply.at(u)
                value += 0.5 * u * u - head
                slope += u - rise_of_head
            return value, slope

        return (_zero(missing, old) - start) / theta

    def _affine(self, area: np.ndarray, rate: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Speeds at rest and per unit of inlet velocity (m,)."""
        open_, slope, _ = self._open(area)
        still = np.zeros_like(area)
        if self.channel.storage:
            still = -self.channel.storage * (self._upstream @ (slope * rate)) / open_
        return still, open_[-1] / open_

    def pressure(self, flow: FlowState, psi_rate: np.ndarray, inlet: float) -> np.ndarray:
        """Pressures (m,), Pa; the first, at the outlet, is to vanish."""
        channel = self.channel
        return inlet - channel.back - self.density * (self._whole_head(flow) + psi_rate) + channel.static

    def _driving(self, inlet: float) -> float:
        """Driving pressure over density, m2/s2."""
        return (inlet - self.channel.back) / self.density

    def _whole_head(self, flow: FlowState) -> np.ndarray:
        head = self.head(flow.speed)
        return head + flow.lost if self.channel.terms else head

    def head(self, speed: np.ndarray) -> np.ndarray:
        """Velocity head between the inlet and each station (m,), m2/s2, of speeds (m,): pressure over density."""
        if speed.min() >= 0.0:
            return 0.5 * (speed * speed - speed[-1] ** 2)
        out, back = np.maximum(speed, 0.0), np.minimum(speed, 0.0)
        head = 0.5 * (out * out - out[-1] ** 2)
        head[:-1] -= 0.5 * _upstream(np.maximum(np.diff(back * back), 0.0))
        head[0] -= 0.5 * back[0] ** 2  # what stands for the outlet is the still water outside
        return head

    def head_slope(self, speed: np.ndarray, change: np.ndarray) -> np.ndarray:
        """Its derivative along changes (m,) or (m, l) of the speeds."""
        out = np.maximum(speed, 0.0)
        slope = (out * change.T).T
        slope -= slope[-1]
        if speed.min() >= 0.0:
            return slope
        back = np.minimum(speed, 0.0)
        gains = ((np.diff(back * back) > 0.0) * np.diff(back * change.T)).T
        slope[:-1] -= _upstream(gains)
        slope[0] -= back[0] * change[0]
        return slope

    def slopes(self, area: np.ndarray, rate: np.ndarray, velocity: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Derivatives of the speeds with respect to areas (m, m), area rates (m, m) and inlet velocity (m,)."""
        open_, slope, bend = self._open(area)
        speed = self.state(area, rate, velocity).speed
        by_area = -np.diag(speed * slope / open_)
        by_area[:, -1] += slope[-1] * velocity / open_
        by_rate = np.zeros_like(by_area)
        if self.channel.storage:
            share = self.channel.storage * self._upstream / open_[:, None]
            by_area -= share * (bend * rate)
            by_rate -= share * slope
        return by_area, by_rate, open_[-1] / open_

    def psi_slopes(self, area, rate, velocity: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Derivatives of psi with respect to areas (m, m), area rates (m, m) and inlet velocity (m,)."""
        found = tuple(self.integrate(slope) for slope in self.slopes(area, rate, velocity))
        if not self.channel.terms:
            return found
        return tuple(own + more for own, more in zip(found, self._term_slopes(area, rate, velocity)[1]))

    def integrate(self, values: np.ndarray) -> np.ndarray:
        """Integral from the inlet to each station of speeds (m,) or of each column (m, l), as the wall feels it."""
        return self._momentum @ values

    def momenta(self, psi: np.ndarray, speed: np.ndarray) -> np.ndarray:
        """Momentum per density and area of the fluid between stations (m - 1,), m2/s, by psi and the speeds; without
        what a bow of psi, which the wall feels, takes from one section and gives to the next.
        """
        return -np.diff(psi - self._bow @ speed)

    def pressure_slopes(
        self, mid: tuple, new: tuple, speed: float, new_speed: float, theta: float, velocity: float, psi_weight: float
    ):
        """Derivatives of the pressures with respect to the new areas (m, m) and the new inlet velocity (m,).

        Parameters
        ----------
        mid, new, theta, psi_weight
            As `velocity` has them.
        speed, new_speed : float
            Inlet velocities where the equations are met and at the end of the step.
        velocity : float
            Derivative of the area rates with respect to the areas at the end of the step, 1/s.
        """
        here = self.state(*mid, speed).speed
        area, rate, own = self.slopes(*mid, speed)
        by_area = theta * self.head_slope(here, area + velocity * rate)
        by_speed = theta * self.head_slope(here, own)
        if self.channel.terms:
            area, rate, own = self._term_slopes(*mid, speed)[0]
            by_area, by_speed = by_area + theta * (area + velocity * rate), by_speed + theta * own
        area, rate, own = self.slopes(*new, new_speed)
        by_area += psi_weight * self.integrate(area + velocity * rate)
        by_speed += psi_weight * self.integrate(own)
        if self.channel.terms:
            area, rate, own = self._term_slopes(*new, new_speed)[1]
            by_area, by_speed = by_area + psi_weight * (area + velocity * rate), by_speed + psi_weight * own
        return -self.density * by_area, -self.density * by_speed


def _upstream(values: np.ndarray) -> np.ndarray:
    """Sums of values (m, ...) from each station to the inlet."""
    return np.cumsum(values[::-1], axis=0)[::-1]


def _term_parts(channel, parameters, area, rate, velocity):
    speed = channel.speeds(area, rate, velocity, parameters["storage"])
    stream = channel.stream(area, rate, speed, velocity[None])
    return channel.term_heads(stream, parameters), channel.term_momenta(stream, parameters)


@jax.jit
def _term_values(channel, parameters, area, rate, velocity):
    return _term_parts(channel, parameters, area, rate, jax.numpy.asarray(velocity))


@jax.jit
def _term_slopes(channel, parameters, area, rate, velocity):
    return jax.jacfwd(_term_parts, argnums=(2, 3, 4))(channel, parameters, area, rate, jax.numpy.asarray(velocity))


#: Inlet velocity, m/s, beyond which no zero is looked for.
_RUNAWAY = 1e12


def _zero(function, start: float) -> float:
    """Zero of a function that grows from minus to plus infinity, next to a start; `function` returns value and slope.
    Not a number if there is none.

    Newton's method within a bracket, bisection where it leaves it or slackens.
    """
    value, _ = function(start)
    if value == 0.0 or not np.isfinite(value):
        return start if value == 0.0 else np.nan
    far, reach = start, -np.sign(value) * max(1e-3, 0.1 * abs(start))
    while function(far)[0] * value > 0.0:
        far, reach = far + reach, 2.0 * reach
        if not abs(far) < _RUNAWAY:
            return np.nan
    low, high = (far, start) if value > 0.0 else (start, far)
    u, last = start, high - low
    for _ in range(200):
        value, slope = function(u)
        if value == 0.0:
            return u
        low, high = (low, u) if value > 0.0 else (u, high)
        step = -value / slope if slope else np.inf
        if not (low <= u + step <= high and abs(step) <= 0.5 * abs(last)):
            step = 0.5 * (low + high) - u
        if u + step == u:
            break
        u, last = u + step, step
    return u
