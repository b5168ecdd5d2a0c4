"""The fluid in a time step: the law's own definition, with differences in time for rates.

With f the `sources` of a law and Q what it `held`, pressures p and equations 0 in a step of length h follow from

    [p; 0] = f(at a share theta of the step) + r Q'_{n+1} + (1 - r) Q'_n,      Q'_{n+1} = (Q_{n+1} - Q_n)/h

Q rather than the unknowns is differenced. Of an incompressible fluid it holds psi, the integral of the speed from the
inlet, whose value at the outlet is a momentum: it changes by bounded forces only, whereas speeds fall by orders of
magnitude within a step when lips slam, and a scheme for them then throws them to negative values, at which the ideal
jet runs away. Of a compressed one it holds mass, so that none is lost where a section shrinks to a fraction of itself
within a step.

theta and r are those of the wall's scheme, or 1 and 1, the backward difference of first order. A compressed fluid takes
1 and 3/2, the backward difference of second order: both are L-stable, so that waves that a step does not resolve, and
gas that leaves through lips that shut, die out within it instead of alternating in sign.

The law's unknowns are eliminated in each evaluation: the wall sees pressures and their derivatives by areas. Where the
inlet velocity is the only one, the root taken is that next to the last one in the direction in which it misses the
outlet's pressure; a flow drawn in loses the head of its jets, see `dbvfiv.flow.channel.reversible_head`.

A passage that faces shut at the start of a step has the law of still fluid in front of a seal in that step. Where they
part in it, the flow of the next one begins with the inlet velocity as it is. Where they meet, the film that rough faces
leave passes what has momentum until it is no more than a steady flow would be; that rest ends there, as the film
carries nothing in equilibria.

Equations (T.9), (T.13), (T.23) and (T.24) of docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from dataclasses import dataclass, fields, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from ..errors import SolveError
from .energy import GAS_BOOKS, LINE_BOOKS, BookStep, Instant
from .law import FlowLaw, FlowMotion, call_compiled, find_root, newton_step

#: Length of Newton's last step to the flow of a step that is small enough where nothing flows.
_SMALLEST = 1e-12
#: Inlet velocity, m/s, beyond which no root is looked for.
_RUNAWAY = 1e12
#: Share of a step at which the equations of a compressed fluid are met, and r, for the difference of second order.
SECOND_ORDER = 1.0, 1.5


@dataclass(frozen=True)
class FluidState:
    """The fluid at one instant."""

    inner: np.ndarray  #: (l,); the law's unknowns; the inlet velocity alone where it has none.
    #: held and rate: (m + l,); what the law's balances hold, and the scheme's value of its rate.
    held: np.ndarray
    rate: np.ndarray
    #: area, area_rate and speed: (m,); m2, m2/s and m/s at the stations.
    area: np.ndarray
    area_rate: np.ndarray
    speed: np.ndarray
    turning: np.ndarray  #: (m - 1,); rate of the momentum between stations in the last step, m2/s2.
    #: carried and books: what the next step's energies need, and energies since the start, J of the part; see
    #: `FlowLaw.step_books`.
    carried: np.ndarray
    books: np.ndarray

    @property
    def velocity(self) -> float:
        """Inlet velocity, m/s."""
        return float(self.inner[0])

    @property
    def instant(self) -> Instant:
        """The state as energies see it."""
        return Instant(self.area, self.area_rate, self.inner, self.held, self.rate, self.carried)

    @property
    def packed(self) -> np.ndarray:
        """All numbers in one array, their counts first, and zeros to the length that `packed_size` says."""
        parts = [np.asarray(getattr(self, f.name), float) for f in fields(self)]
        found = np.concatenate([[len(part) for part in parts], *parts])
        return np.append(found, np.zeros(packed_size(len(self.area), len(self.inner)) - len(found)))

    @classmethod
    def unpacked(cls, numbers: np.ndarray) -> FluidState:
        """Undo `packed`. Raises SolveError if the numbers are those of another version."""
        numbers = np.asarray(numbers, float)
        count = len(fields(cls)) if len(numbers) else 0
        cuts = count + np.cumsum([0, *np.asarray(numbers[:count], int)])
        if not 0 < cuts[-1] <= len(numbers):
            raise SolveError("The state of the fluid was kept by another version and cannot be gone on from.")
        return cls(*(numbers[a:b] for a, b in zip(cuts[:-1], cuts[1:])))


def packed_size(stations: int, unknowns: int) -> int:
    """Length of `FluidState.packed` that holds any law of so many stations and unknowns."""
    kept = len(GAS_BOOKS) + len(LINE_BOOKS) + 7
    return len(fields(FluidState)) + 6 * stations + 3 * unknowns + kept


@dataclass
class Flow:
    """Fluid of a step and its force on the wall."""

    inlet: float  #: Inlet pressure where the equations are met, Pa.
    pressure: np.ndarray  #: (m,); Pa, where the equations are met.
    #: area, area_rate and speed: (m,); at the end of the step: m2 of the part, m2/s, m/s.
    area: np.ndarray
    area_rate: np.ndarray
    speed: np.ndarray
    #: inner and held: (l,) and (m + l,); the law's unknowns and what its balances hold, there.
    inner: np.ndarray
    held: np.ndarray
    step: FluidStep | None = None  #: That found it; without one the state is that of the flow, all rates zero.
    passage: tuple | None = None  #: pair of (m,); areas and their rates where the equations are met.
    #: pair of (m,); pressures of fluid at rest in front of a seal, and the lengths, m, over which what moves there adds
    #: to them does work on the areas.
    still: tuple | None = None
    force: np.ndarray | None = None  #: (n,); g p, the wall's part to find.

    def slopes(self, velocity: float) -> np.ndarray:
        """Derivatives (m, m) of the pressures by the new areas, whose rates follow them by `velocity`, 1/s."""
        return self.step.slopes(self, velocity)

    def state(self) -> FluidState:
        """The fluid's state at the end."""
        return self.step.state(self)


class MovingFluid:
    """A law's flow through a passage whose areas move.

    Parameters
    ----------
    density : float, kg/m3
    seal : callable, optional
        Last station, from the outlet on, that faces shut in a passage of areas (m,), or None.

    Attributes
    ----------
    moves : bool
        Whether the fluid has inertia.
    """

    moves = True

    def __init__(self, law: FlowLaw, density: float, seal: Callable[[np.ndarray], int | None] = lambda area: None):
        self.law, self.density, self.seal = law, float(density), seal
        self.traced = jax.device_put(law.reversed())
        self._behind: dict[int | None, MovingFluid] = {None: self}

    def facing(self, area: np.ndarray, speed: np.ndarray, inlet: float | None = None) -> MovingFluid:
        """The fluid of areas and speeds (m,): this one, or still in front of a seal. What moves comes to rest in a new
        state under an inlet pressure, Pa, where no more than a film passes the seal; without one it is a state that
        has been found, which keeps its law. A liquid that is compressed passes, since stopping it would be a blow.
        """
        open_ = self._behind[None]
        seal = None if open_.compressed and not open_.quiet_inward else self.seal(area)
        if seal not in self._behind:
            law = open_.law.shut(seal)
            self._behind[seal] = open_ if law is open_.law else open_._with(law)
        if self._behind[seal] is open_ or speed[seal] == 0.0:
            return self._behind[seal]
        if inlet is None:
            return open_
        passing = abs(speed) * open_.law.open_area(area)
        film = open_.steady_inner(area, inlet)[0] * open_.law.open_area(area)[-1]
        return self._behind[seal if passing[seal] <= film else None]

    def _with(self, law: FlowLaw) -> MovingFluid:
        made = copy(self)
        made.law, made.traced = law, jax.device_put(law.reversed())
        return made

    @staticmethod
    def jets(at: FluidState | Flow) -> np.ndarray:
        """Speeds (m,) of a flow through the passage; none in front of a seal, where nothing leaves."""
        return at.speed if at.speed[0] else np.zeros_like(at.speed)

    def still(self, area: np.ndarray, inlet: float) -> tuple | None:
        """See `Flow.still`."""
        law = self.law
        if not law.sealed:
            return None
        at_rest = law.at_seal(area, self.parameters(inlet))["inlet"]
        return law.steady_pressure(area, float(at_rest)), law.work_lengths(area)

    @property
    def compressed(self) -> bool:
        """True where steps take the difference of `SECOND_ORDER`."""
        return self.law.compressed

    @property
    def quiet_inward(self) -> bool:
        """True for a gas, which is soft: steps with inward flow need no numerical damping."""
        return self.law.is_soft(self.density)

    def parameters(self, inlet: float) -> dict[str, float]:
        """Parameters of the law under an inlet pressure, Pa."""
        return self.law.values({"inlet": inlet, "density": self.density})

    def momenta(self, speed: np.ndarray) -> np.ndarray:
        """Momentum per density and area of a flow between stations (m - 1,), m2/s."""
        return np.zeros(len(speed) - 1) if self.law.sealed else 0.5 * self.law.step * (speed[1:] + speed[:-1])

    def step(self, old: FluidState, passage: tuple, h: float, theta: float, rate: float, inlet: float) -> FluidStep:
        """A step of length h, s, from a state in a passage of areas and rates, with the inlet pressure, Pa, at its
        share theta, and the weight of new rates there.
        """
        return FluidStep(self.facing(old.area, old.speed), old, h, theta, rate, inlet)

    def instant(self, state: FluidState, inlet: float) -> FluidInstant:
        """A step of no length at a state."""
        return FluidInstant(self.facing(state.area, state.speed), state, inlet)

    def steady_inner(self, area: np.ndarray, inlet: float) -> np.ndarray:
        """Unknowns (l,) of a steady flow; those of a fluid at rest at the pressure behind where there is none."""
        found = self.law.steady_inner(area, self.parameters(inlet))
        return found if np.isfinite(found).all() else self.law.still(area, self.parameters(inlet))

    def speeds(self, area, area_rate, inner) -> np.ndarray:
        """Speeds (m,) at the stations, m/s."""
        return np.array(call_compiled("speeds_of", self.traced, area, area_rate, inner, self.parameters(0.0)))

    def operators(self, area, area_rate, inner, inlet: float):
        """`sources` (m + l,) and derivatives of `held` by areas, rates (m + l, m) and unknowns (m + l, l), all in Pa
        but for rates.
        """
        found = _operators(self.traced, self.parameters(inlet), area, area_rate, inner)
        return tuple(np.asarray(part) for part in found)

    def moving(self, passage: tuple, acceleration, inner, inlet: float) -> FluidState:
        """State with unknowns (l,) in a passage of areas and rates (m,) that accelerates so (m,), m2/s2, with the rates
        that the equations ask for.
        """
        inner, m = self.law.with_displaced(*passage, np.asarray(inner, float)), self.law.count
        sources, by_area, by_rate, by_inner = self.operators(*passage, inner, inlet)
        known = sources + by_area @ passage[1] + by_rate @ acceleration
        inner_rate = np.linalg.lstsq(by_inner[m:], -known[m:], rcond=None)[0]
        rate = known - sources + by_inner @ inner_rate
        if self.compressed:  # some equations contain no rates
            rate = np.append(np.zeros(m), np.where(np.any(by_inner[m:] != 0.0, axis=1), -sources[m:], 0.0))
        motion = FlowMotion(*passage, np.asarray(acceleration, float), inner, inner_rate)
        found = _first(self.traced, self.parameters(inlet), motion)
        held, scales, speed, faster, carried = (np.asarray(part) for part in found)
        own = inner, held, rate / scales, *passage, speed
        return FluidState(*own, self.momenta(faster), carried, np.zeros(len(self.law.book_names)))

    def energies(self, area, inner) -> dict[str, float]:
        """Energies of the fluid by name, J of the part."""
        if not self.law.energy_names:
            return {}
        found = call_compiled("energies", self.traced, area, inner, self.parameters(0.0))
        return dict(zip(self.law.energy_names, map(float, found), strict=True))

    def readings(self, area, inner) -> tuple[float, float, float]:
        """Mass flows at outlet and inlet, kg/s of the part, and the largest Mach number, of a compressed fluid."""
        return tuple(map(float, call_compiled("readings", self.traced, area, inner, self.parameters(0.0))))


class FluidStep:
    """A step of a fluid; see `MovingFluid.step`."""

    def __init__(self, fluid: MovingFluid, old: FluidState, h: float, theta: float, rate: float, inlet: float):
        self.fluid, self.old, self.h, self.theta, self.rate, self.inlet = fluid, old, h, theta, rate, inlet
        known = (1.0 - rate) * old.rate - (rate / h) * old.held
        self.parameters, *scheme = jax.device_put((fluid.parameters(inlet), old.inner, theta, rate / h, known))
        self._scheme = tuple(scheme)
        self._start = old.inner

    def at(self, mid: tuple, new: tuple) -> Flow:
        """Flow in a passage of areas and rates (m,) where the equations are met and at the end; not numbers where there
        is none.
        """
        law, given = self.fluid.traced, (self.parameters, mid, new, *self._scheme)
        inner, pressure, held, speed = map(np.array, _advanced(law, *given, self._start))
        if not np.isfinite(inner[0]):
            inner, pressure, held, speed = map(np.array, _advanced(law, *given, self.old.inner))
        if np.isfinite(inner[0]):
            self._start = inner
        return Flow(self.inlet, pressure, *new, speed, inner, held, self, mid, self.fluid.still(mid[0], self.inlet))

    def slopes(self, flow: Flow, velocity: float) -> np.ndarray:
        """See `Flow.slopes`."""
        given = self.parameters, flow.passage, (flow.area, flow.area_rate), *self._scheme
        return np.array(_slopes(self.fluid.traced, *given, flow.inner, velocity))

    def state(self, flow: Flow) -> FluidState:
        """State that the step ends with, for the fluid that the new passage has."""
        old, fluid, rate = self.old, self.fluid, (flow.held - self.old.held) / self.h
        turning = fluid.momenta(fluid.jets(flow) - fluid.jets(old)) / self.h
        new = flow.inner, flow.held, rate, flow.area, flow.area_rate, flow.speed, turning
        carried, books = old.carried, old.books
        if fluid.law.book_names:
            end = Instant(flow.area, flow.area_rate, flow.inner, flow.held, rate, old.carried)
            step = BookStep(old.instant, end, self.h, self.theta, self.rate)
            gained, carried = map(np.asarray, call_compiled("step_books", fluid.traced, step, self.parameters))
            books = books + gained
        after = fluid.facing(flow.area, flow.speed, self.inlet)
        if after is fluid:
            return FluidState(*new, carried, books)
        passage, acceleration = (flow.area, flow.area_rate), (flow.area_rate - old.area_rate) / self.h
        moved = after.moving(passage, acceleration, flow.inner, self.inlet)
        if books.size:  # what a seal stops, and the film in it, are a loss of the step
            held = [sum(at.energies(flow.area, x).values()) for at, x in ((fluid, flow.inner), (after, moved.inner))]
            books[next(i for i, name in enumerate(fluid.law.book_names) if "step_loss" in name)] += held[0] - held[1]
        return replace(moved, books=books)


class FluidInstant:
    """A fluid at one instant, its state known."""

    def __init__(self, fluid: MovingFluid, state: FluidState, inlet: float):
        self.fluid, self._state, self.inlet, self.parameters = fluid, state, inlet, fluid.parameters(inlet)

    def at(self, mid: tuple, new: tuple) -> Flow:
        """The flow in the passage (areas, rates) of the state."""
        state, given = self._state, (self.parameters, mid, new, self._state.inner, 1.0, 0.0, self._state.rate)
        pressure = np.array(_pressures(self.fluid.traced, *given, state.inner))
        still = self.fluid.still(mid[0], self.inlet)
        return Flow(self.inlet, pressure, *new, state.speed, state.inner, state.held, self, mid, still)

    def state(self, flow: Flow) -> FluidState:
        """The state."""
        return self._state


class SteadyFluid(MovingFluid):
    """The steady law at every instant."""

    moves = False

    def step(self, old, passage, h, theta, rate, inlet) -> SteadyFlow:
        return SteadyFlow(self, theta, inlet)

    def instant(self, state, inlet) -> SteadyFlow:
        return SteadyFlow(self, 1.0, inlet)

    def momenta(self, speed):
        return np.zeros(self.law.count - 1)


class SteadyFlow:
    """Steady flow under an inlet pressure, Pa, in the passage at the share theta of a step."""

    def __init__(self, fluid: SteadyFluid, theta: float, inlet: float):
        self.fluid, self.theta, self.inlet = fluid, theta, inlet

    def at(self, mid: tuple, new: tuple) -> Flow:
        """The flow; see `FluidStep.at`."""
        law, area = self.fluid.law, new[0]
        flows = self.inlet > law.back and self.fluid.seal(area) is None
        velocity = law.inlet_velocity(area, self.inlet, self.fluid.density) if flows else 0.0
        pressure = law.steady_pressure(mid[0], self.inlet)
        none, speed = np.zeros(law.count + law.inner), law.velocities(area, velocity)
        return Flow(self.inlet, pressure, *new, speed, np.array([velocity]), none, self, mid)

    def slopes(self, flow: Flow, velocity: float) -> np.ndarray:
        """See `Flow.slopes`."""
        return self.theta * self.fluid.law.steady_operator(flow.passage[0], self.inlet)[1]

    def state(self, flow: Flow) -> FluidState:
        """State without any rates."""
        turning, none = np.zeros(len(flow.area) - 1), np.zeros(0)
        own = flow.inner, flow.held, flow.held, flow.area, flow.area_rate, flow.speed
        return FluidState(*own, turning, none, none)


class FrozenFluid(MovingFluid):
    """The thesis's coupling (App. A), for comparison: the fluid first, in the passage of the last state, then the wall
    under its pressures.

    The inlet velocity takes a backward difference in the areas of the last state; the pressures act on the wall as it
    moves, but are not changed by it.
    """

    def step(self, old, passage, h, theta, rate, inlet) -> FrozenStep:
        return FrozenStep(FluidStep(self.facing(old.area, old.speed), old, h, 1.0, 1.0, inlet), passage)


class FrozenStep:
    """A step in the passage that it begins in."""

    def __init__(self, step: FluidStep, passage: tuple):
        self._step, self._flow = step, step.at(passage, passage)

    def at(self, mid: tuple, new: tuple) -> Flow:
        """The flow, whatever the passage."""
        found = self._flow
        return replace(found, area=new[0], area_rate=new[1], step=self, passage=mid)

    def slopes(self, flow: Flow, velocity: float) -> np.ndarray:
        """None."""
        return np.zeros((len(flow.area), len(flow.area)))

    def state(self, flow: Flow) -> FluidState:
        """See `FluidStep.state`."""
        return self._step.state(flow)


# -- compiled


def _values(law, parameters, mid, new, old, theta, weight, known, inner):
    """Pressures and residuals (m + l,), Pa, of unknowns (l,) at the end of a step."""
    here = old + theta * (inner - old)
    found = law.sources(*mid, here, parameters) + weight * law.held(*new, inner, parameters) + known
    return law.scales(new[0], parameters) * found


@jax.jit
def _pressures(law, *given):
    return _values(law, *given)[: law.count]


@jax.jit
def _advanced(law, parameters, mid, new, old, theta, weight, known, start):
    """Unknowns (l,), pressures (m,), what is held (m + l,) and speeds (m,); not numbers where none are found."""
    values = partial(_values, law, parameters, mid, new, old, theta, weight, known)
    residual = lambda inner: values(inner)[law.count :]  # noqa: E731
    inner = (
        _next_root(residual, start) if law.inner == 1 else find_root(partial(newton_step, residual), start, _SMALLEST)
    )
    held = law.held(*new, inner, parameters)
    return inner, values(inner)[: law.count], held, law.speeds_of(*new, inner, parameters)


def _next_root(residual, start):
    """Zero (1,) of a function that falls from plus to minus infinity, next to a start; not a number if there is none.

    Newton's method within a bracket, bisection where it leaves it or slackens.
    """

    def at(u):
        value, slope = jax.jvp(lambda x: -residual(x[None])[0], (u,), (jnp.ones_like(u),))
        return value, slope

    def further(carried):
        far, reach, _ = carried
        return far + reach, 2.0 * reach, at(far + reach)[0]

    first = start[0]
    value = jax.lax.optimization_barrier(at(first)[0])  # computed twice, its sign could differ where it is rounding
    reach = jnp.where(value > 0.0, -1.0, 1.0) * jnp.maximum(1e-3, 0.1 * jnp.abs(first))
    away = lambda c: (c[2] * value > 0.0) & (jnp.abs(c[0]) < _RUNAWAY)  # noqa: E731
    far, _, end = jax.lax.while_loop(away, further, (first + reach, reach, at(first + reach)[0]))
    low, high = jnp.where(value > 0.0, far, first), jnp.where(value > 0.0, first, far)

    def advance(carried):
        u, last, low, high, count, _ = carried
        here, slope = at(u)
        low, high = jnp.where(here > 0.0, low, u), jnp.where(here > 0.0, u, high)
        step = jnp.where(slope == 0.0, jnp.inf, -here / jnp.where(slope == 0.0, 1.0, slope))
        inside = (low <= u + step) & (u + step <= high) & (jnp.abs(step) <= 0.5 * jnp.abs(last))
        step = jnp.where(here == 0.0, 0.0, jnp.where(inside, step, 0.5 * (low + high) - u))
        return u + step, step, low, high, count + 1, u + step == u

    begin = first, high - low, low, high, 0, value == 0.0
    u, *_ = jax.lax.while_loop(lambda c: (c[4] < 200) & ~c[5], advance, begin)
    found = jnp.isfinite(value) & (end * value <= 0.0)
    return jnp.where(found, u, jnp.nan)[None]


@jax.jit
def _slopes(law, parameters, mid, new, old, theta, weight, known, inner, velocity):
    """Total derivatives (m, m) of the pressures by the new areas, whose rates follow them."""

    def shifted(change, x):
        there = mid[0] + theta * change, mid[1] + theta * velocity * change
        end = new[0] + change, new[1] + velocity * change
        return _values(law, parameters, there, end, old, theta, weight, known, x)

    by_area, by_inner = jax.jacfwd(shifted, (0, 1))(jnp.zeros(law.count), inner)
    m = law.count
    return by_area[:m] - by_inner[:m] @ jnp.linalg.solve(by_inner[m:], by_area[m:])


@jax.jit
def _operators(law, parameters, area, area_rate, inner):
    scales = law.scales(area, parameters)
    held = jax.jacfwd(lambda a, r, x: law.held(a, r, x, parameters), (0, 1, 2))(area, area_rate, inner)
    return scales * law.sources(area, area_rate, inner, parameters), *(scales[:, None] * part for part in held)


@jax.jit
def _first(law, parameters, motion):
    """Quantities held (m + l,), scales, speeds and their rates (m,), and what the first step's energies need."""
    area, rate, acceleration, inner, inner_rate = motion
    carried = law.first_carried(motion, parameters)
    speeds = lambda *at: law.speeds_of(*at, parameters)  # noqa: E731
    speed, faster = jax.jvp(speeds, (area, rate, inner), (rate, acceleration, inner_rate))
    held = law.held(area, rate, inner, parameters)
    return held, law.scales(area, parameters), speed, jnp.zeros_like(speed) if law.compressed else faster, carried
