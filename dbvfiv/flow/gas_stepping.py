"""A compressed fluid as a time step sees it: its state at the end of a step, found from the law's own definition.

With Q what the balances of `dbvfiv.flow.gas.GasChannel` hold and f what their rates are balanced by, a step of length h
ends where

    r Q'_{n+1} + (1 - r) Q'_n + f(A_{n+1}, A'_{n+1}, x_{n+1}) = 0,      Q'_{n+1} = (Q_{n+1} - Q_n)/h

r = 1 is the backward difference of first order, r = 3/2 that of second order. Both are L-stable: waves that a step does
not resolve, and gas that leaves through lips that shut, die out within it instead of alternating in sign. Mass is
differenced, not density, so none is lost where a section shrinks to a fraction of itself within a step.

The unknowns x are eliminated in each evaluation: the wall sees pressures and their derivatives by areas.

The balances of mass and momentum of each cell at the end of a step, multiplied by the cell's mean discharge G and mean
head H = w + U^2/2 and summed, say what the fluid does with its energy E over the step, to the last digit:

    E_1 - E_0 = supply - outflow - loss - work - (what differences in time take) - (what the cells take)

The sums G dH + H dG over a cell are its ends' difference, so convection takes nothing. Supply, outflow and loss are by
the powers at the end of a step of first order, as its balances are, and by the mean powers of one of second order. The
work is that of the mean pressure on the wall, p the pressure of sigma and A its area. With m = rho A the mass and O the
open area, d what changes in the step and q' the last rate of q,

- differences in time take the convex energy's distance from its tangent, O_0 [e(rho_0) - e(rho_1) - w_1 (rho_0 -
  rho_1)] with e = rho w - p, that of the kinetic one, m_0 dU^2/2 + dm U_1 dU, the work of half the pressure's change,
  dp dA/2, what the second order adds, (r - 1)(dq - h q') by G or H, and half the change of the powers, which in a
  smooth motion is the same with the opposite sign: what is left then is of the third order in h;
- the cells take the difference between the products of means and the means of the products, and what walls do to gas
  below the floor of the area and in the cell at the lips, where the density stored is that inside.

Neither is a property of the fluid: the first falls with the step, the second with the mesh.

Equations (T.23), (T.24) and (T.28) of docs/theory.md.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..errors import SolveError
from .law import FlowLaw, above_floor
from .stepping import Load, StepFluid

#: Newton steps within which the flow of a step must be found, and the size of the last one, relative and m/s; what
#: rounding may leave of it, where steps no longer fall.
_STEPS, _TOLERANCE, _SMALLEST, _ROUNDING = 40, 1e-11, 1e-12, 1e-9
#: Absolute pressure, Pa, below which a fluid is a gas: by no more can its pressure fall.
GAS = 1e6
#: Share of a step at which its equations are met, and r, for the difference of second order.
SECOND_ORDER = 1.0, 1.5


#: What has become of a fluid's energy: taken in at the flange, left through the lips, done on the wall, lost in the
#: passage, taken by differences in time and by cells of finite length.
BOOKS = ("supply", "outflow", "work", "loss", "step_loss", "mesh_loss")

#: Number of powers that a state keeps, see `_powers`.
POWERS = 3


class Instant(NamedTuple):
    """A fluid at the beginning or end of a step.

    Attributes
    ----------
    area : (m,) array, m2
    inner, stored, rate : (l,) arrays
        The law's unknowns, m/s, what its balances hold, m2/s and m3, and the scheme's rate of that.
    power : (3,) array, W
        See `_powers`.
    """

    area: jnp.ndarray
    inner: jnp.ndarray
    stored: jnp.ndarray
    rate: jnp.ndarray
    power: jnp.ndarray


def packed_size(inner: int) -> int:
    """Length of `GasState.packed` for a number of unknowns."""
    return 3 * inner + (inner + 1) // 2 + POWERS + len(BOOKS)


@dataclass(frozen=True)
class GasState:
    """A compressed fluid at one instant.

    Attributes
    ----------
    inner : (l,) array
        The law's unknowns, m/s.
    stored, rate : (l,) arrays
        What the balances hold and the scheme's value of its rate.
    area : (m,) array, m2
        Of the passage.
    power : (3,) array, W
        Of a quarter; see `_powers`.
    books : (6,) array
        What has become of its energy since the start, J of the part; see `BOOKS`.
    """

    inner: np.ndarray
    stored: np.ndarray
    rate: np.ndarray
    area: np.ndarray
    power: np.ndarray
    books: np.ndarray

    @property
    def instant(self) -> Instant:
        """The state as the books see it."""
        return Instant(self.area, self.inner, self.stored, self.rate, self.power)

    @property
    def packed(self) -> np.ndarray:
        """All numbers in one array."""
        return np.concatenate([self.inner, self.stored, self.rate, self.area, self.power, self.books])

    @classmethod
    def unpacked(cls, numbers: np.ndarray) -> GasState:
        """Undo `packed`.

        Raises
        ------
        SolveError
            If the numbers are those of another version.
        """
        stations = (len(numbers) - POWERS - len(BOOKS) + 3) // 7  # of 2 m - 1 unknowns
        if packed_size(2 * stations - 1) != len(numbers):
            raise SolveError(
                "The state of the compressed fluid was kept by another version and cannot be gone on from."
            )
        cuts = np.cumsum([2 * stations - 1] * 3 + [stations, POWERS])
        return cls(*np.split(np.asarray(numbers, float), cuts))


class GasFlow:
    """The flow in a passage at one instant.

    Attributes
    ----------
    pressure : (m,) array, Pa
        On the wall.
    speed, psi : (m,) arrays, m/s, m2/s
        At the stations, and its integral from the inlet.
    """

    def __init__(self, step: GasStep | GasInstant, area, area_rate, inner, stored, pressure):
        self._step, self.stored = step, stored
        self.area, self.area_rate, self.inner = area, area_rate, inner
        self.pressure, self.speed = pressure, step.fluid.law.own_velocities(inner)
        cells = 0.5 * step.fluid.law.channel.step * (self.speed[1:] + self.speed[:-1])
        self.psi = np.append(np.cumsum(cells[::-1])[::-1], 0.0)

    def slopes(self) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives (m, m) of the pressures by areas, Pa/m2, and by their rates, Pa s/m2."""
        step = self._step
        found = _slopes(step.fluid.law, step.parameters, self.area, self.area_rate, self.inner, step.weight)
        return tuple(np.asarray(part) for part in found)

    def state(self) -> GasState:
        """The fluid's state."""
        return self._step.end(self)


class GasStep:
    """A step of a compressed fluid.

    Parameters
    ----------
    fluid : GasFluid
    old : GasState
    h : float, s
    rate : float
        r, the weight of the new rate.
    inlet : float
        Inlet pressure at the end, Pa.
    """

    def __init__(self, fluid: GasFluid, old: GasState, h: float, rate: float, inlet: float):
        self.fluid, self.old, self.h, self.weight = fluid, old, h, rate / h
        self._rate = rate
        self._known = (1.0 - rate) * old.rate - self.weight * old.stored
        self.parameters = fluid.parameters(inlet)
        self._start = old.inner

    def at(self, area: np.ndarray, area_rate: np.ndarray) -> GasFlow:
        """Flow at the end of the step in a passage of areas and rates (m,); not numbers where there is none."""
        given = self.fluid.law, self.parameters, area, area_rate
        found = _advanced(*given, self._start, self.weight, self._known)
        if not np.isfinite(found[0][0]):
            found = _advanced(*given, self.old.inner, self.weight, self._known)
        inner, stored, pressure = (np.array(part) for part in found)
        if np.isfinite(inner[0]):
            self._start = inner
        return GasFlow(self, area, area_rate, inner, stored, pressure)

    def end(self, flow: GasFlow) -> GasState:
        """The state that the step ends with."""
        old, h = self.old, self.h
        rate = (flow.stored - old.stored) / h
        power = self.fluid.powers(flow.area, flow.area_rate, flow.inner)
        new = GasState(flow.inner, flow.stored, rate, flow.area, power, old.books)
        given = self.fluid.law, self.parameters, old.instant, new.instant
        return replace(new, books=old.books + np.asarray(_step_books(*given, h, self._rate)))


class GasInstant:
    """A compressed fluid at one instant, its state known."""

    def __init__(self, fluid: GasFluid, state: GasState, inlet: float):
        self.fluid, self.state, self.parameters = fluid, state, fluid.parameters(inlet)

    def at(self, area: np.ndarray, area_rate: np.ndarray) -> GasFlow:
        """The flow; areas and rates are those of the state."""
        inner = self.state.inner
        pressure = np.array(_pressures(self.fluid.law, self.parameters, inner))
        return GasFlow(self, area, area_rate, inner, self.state.stored, pressure)

    def end(self, flow: GasFlow) -> GasState:
        """The state."""
        return self.state


class GasFluid(StepFluid):
    """Evaluators of a `dbvfiv.flow.gas.GasChannel` for time steps."""

    @property
    def quiet_inward(self) -> bool:
        """True for a gas, which is soft; the water hammer of a liquid hits walls as an incompressible fluid does."""
        return self.density * self.law.sound_speed**2 / self.law.ratio < GAS

    def load(self, mid, new, step, speed=None):
        flow = step.gas.at(*new)
        psi_rate = step.psi_weight * flow.psi + step.psi_known
        moved = new[0], flow.speed, flow.psi, psi_rate, step.inlet, float(flow.speed[-1])
        return Load(None, 0.0, flow.pressure, *moved, gas=flow)

    def load_slopes(self, mid, new, load, theta, velocity, psi_weight):
        by_area, by_rate = load.gas.slopes()
        return by_area + velocity * by_rate, None

    def speeds(self, area, rate, state):
        return self.law.own_velocities(state.gas.inner)

    def parameters(self, inlet: float) -> dict[str, float]:
        """Parameters of the law under an inlet pressure, Pa."""
        return self.law.values({"inlet": inlet, "density": self.density})

    def steady_inner(self, area: np.ndarray, inlet: float) -> np.ndarray:
        """Unknowns (l,) of a steady flow; those of a fluid at rest without pressure where there is none."""
        found = self.law.steady_inner(area, self.parameters(inlet))
        return found if np.isfinite(found).all() else np.zeros(self.law.inner)

    def moving(self, area, area_rate, inner, inlet: float) -> GasState:
        """State with given unknowns (l,) and the rates that the equations ask for."""
        inner = np.asarray(inner, float)
        parts = _instant(self.law, self.parameters(inlet), area, area_rate, inner)
        stored, sources, moves = (np.asarray(part) for part in parts)
        power = self.powers(area, area_rate, inner)
        return GasState(inner, stored, np.where(moves, -sources, 0.0), np.asarray(area), power, np.zeros(len(BOOKS)))

    def powers(self, area, area_rate, inner) -> np.ndarray:
        """Powers (3,) of `GasState`, W."""
        return np.asarray(_powers(self.law, self.parameters(0.0), area, area_rate, inner))

    def energy(self, area, inner) -> float:
        """Kinetic energy of the fluid and that of its compression, J of the part."""
        return float(_energy(self.law, self.parameters(0.0), area, inner))

    def readings(self, area, inner) -> tuple[float, float, float]:
        """Mass flows at outlet and inlet, kg/s of the part, and the largest Mach number."""
        return tuple(float(x) for x in _readings(self.law, self.parameters(0.0), area, inner))


# -- compiled
# ----


def _balance(law, parameters, area, area_rate, weight, inner):
    """Balances (l,) but for what is known of the rates, m2/s2 and m3/s."""
    held = law.stored(area, area_rate, inner, parameters)
    return weight * held + law.sources(area, area_rate, inner, parameters)


@jax.jit
def _advanced(law, parameters, area, area_rate, start, weight, known):
    """Unknowns (l,), what is stored (l,) and pressures (m,); not numbers where none are found.

    Newton's method, a step halved as long as the next one by it is longer.
    """
    balance = partial(_balance, law, parameters, area, area_rate, weight)
    scales = law.scales(area, parameters)  # rows of one size make the pivots of the factors good ones

    def step_at(inner):
        slope, value = jax.jacfwd(balance)(inner), balance(inner) + known
        return -jnp.linalg.solve(scales[:, None] * slope, scales * value)

    def longer(tried):
        fraction, inner, step, _, after = tried
        return (fraction > 1e-3) & ~(jnp.linalg.norm(after) <= jnp.linalg.norm(step))

    def halved(tried):
        fraction, inner, step, _, _ = tried
        there = inner + 0.5 * fraction * step
        return 0.5 * fraction, inner, step, there, step_at(there)

    def small(inner, step, share):
        return jnp.linalg.norm(step) <= share * jnp.linalg.norm(inner) + _SMALLEST

    def advance(carried):
        inner, step, count, _ = carried
        there = inner + step
        tried = jax.lax.while_loop(longer, halved, (jnp.ones(()), inner, step, there, step_at(there)))
        stays = small(there, step, _ROUNDING) & ~(jnp.linalg.norm(tried[4]) <= 0.5 * jnp.linalg.norm(step))
        return tried[3], tried[4], count + 1, stays

    def goes_on(carried):
        inner, step, count, stays = carried
        return (count < _STEPS) & ~stays & ~small(inner, step, _TOLERANCE)

    inner, step, _, stays = jax.lax.while_loop(goes_on, advance, (start, step_at(start), 0, False))
    inner = jnp.where(stays | small(inner, step, _TOLERANCE), inner + step, jnp.nan)
    return inner, law.stored(area, area_rate, inner, parameters), law.pressures(inner, parameters)


@jax.jit
def _slopes(law, parameters, area, area_rate, inner, weight):
    """Total derivatives (m, m) of the pressures by areas and rates."""
    balance = lambda a, r, x: _balance(law, parameters, a, r, weight, x)  # noqa: E731
    scales = law.scales(area, parameters)[:, None]
    by_area, by_rate, own = (scales * part for part in jax.jacfwd(balance, (0, 1, 2))(area, area_rate, inner))
    pressure = jax.jacfwd(law.pressures)(inner, parameters)
    both = -pressure @ jnp.linalg.solve(own, jnp.concatenate([by_area, by_rate], axis=1))
    return both[:, : len(area)], both[:, len(area) :]


@jax.jit
def _pressures(law, parameters, inner):
    return law.pressures(inner, parameters)


@jax.jit
def _instant(law, parameters, area, area_rate, inner):
    """Stored quantities (l,), their sources (l,), and a mask (l,) of those that change with the unknowns."""
    by_inner = jax.jacfwd(lambda x: law.stored(area, area_rate, x, parameters))(inner)
    sources = law.sources(area, area_rate, inner, parameters)
    return law.stored(area, area_rate, inner, parameters), sources, jnp.any(by_inner != 0.0, axis=1)


@jax.jit
def _readings(law, parameters, area, inner):
    """Mass flows, kg/s of the part, at outlet and inlet, and the largest Mach number."""
    speed, sigma = law.split(inner, parameters)
    sigma = sigma.at[0].add(law.drawn(speed[0], parameters))
    flow = parameters["density"] * jnp.exp(sigma / parameters["sound_speed"]) * above_floor(area, law.floor) * speed
    return flow[0], flow[-1], jnp.max(jnp.abs(speed) / law.local_sound_speed(sigma, parameters))


class _Stations(NamedTuple):
    """Flow at the stations (m,) at an instant; `thick`, `mass`, `held` and `within` belong to the stored mass."""

    area: jnp.ndarray
    open: jnp.ndarray
    speed: jnp.ndarray
    thick: jnp.ndarray
    mass: jnp.ndarray
    held: jnp.ndarray
    within: jnp.ndarray
    head: jnp.ndarray
    flow: jnp.ndarray
    pressure: jnp.ndarray


def _stations(law: FlowLaw, parameters, area, inner) -> _Stations:
    speed, sigma = law.split(inner, parameters)
    c, density, open_, held = parameters["sound_speed"], parameters["density"], above_floor(area, law.floor), law.inside
    inside, entering = held(sigma), sigma.at[0].add(law.drawn(speed[0], parameters))
    thick = density * jnp.exp(inside / c)
    return _Stations(
        area,
        open_,
        speed,
        thick,
        open_ * thick,
        law.enthalpy(inside, parameters),
        law.pressure(inside, parameters),
        law.enthalpy(sigma, parameters) + 0.5 * speed**2,
        density * jnp.exp(entering / c) * open_ * speed,
        law.pressure(sigma, parameters),
    )


@jax.jit
def _energy(law: FlowLaw, parameters, area, inner):
    """Kinetic energy and that of compression, J of the part, with areas (m,) and unknowns (l,)."""
    at = _stations(law, parameters, area, inner)
    return _integral(law, at.mass * (at.held + 0.5 * at.speed**2) - at.open * at.within)


@jax.jit
def _powers(law: FlowLaw, parameters, area, area_rate, inner):
    """Power taken in at the flange, leaving through the lips and lost in the passage (3,), W of the computed part."""
    at = _stations(law, parameters, area, inner)
    head = law.sources(area, area_rate, inner, parameters)[: law.count - 1]
    lost = _mean(at.flow) * (head - (at.head[:-1] - at.head[1:]))  # what the cells take besides Bernoulli's heads
    return jnp.array([at.flow[-1] * at.head[-1], at.flow[0] * at.head[0], jnp.sum(lost)])


@jax.jit
def _step_books(law: FlowLaw, parameters, old: Instant, new: Instant, h, weight):
    """Energy budget of one time step (6,), J of the computed part; see `BOOKS`.

    Parameters
    ----------
    h : float, s
    weight : float
        r, of the new rate; see this module.
    """
    a, b = (_stations(law, parameters, at.area, at.inner) for at in (old, new))
    count, flow, head = law.count, _mean(b.flow), parameters["density"] * _mean(b.head)

    def of_cells(held):  # the sum of balances of cells, J, by what is held in them (l,)
        return jnp.sum(flow * held[: count - 1]) + jnp.sum(head * held[count:])

    before = jnp.where(weight == 1.0, 0.0, 0.5)
    mean = new.power + before * (old.power - new.power)
    ahead = before * h * jnp.sum((old.power - new.power) * jnp.array([1.0, -1.0, -1.0]))
    change = new.stored - old.stored
    faster, widened = b.speed - a.speed, b.area - a.area
    tangent = a.open * ((a.thick * a.held - a.within) - (b.thick * b.held - b.within) - b.held * (a.thick - b.thick))
    kinetic = 0.5 * a.mass * faster**2 + (b.mass - a.mass) * b.speed * faster
    in_time = tangent + kinetic + 0.5 * (b.pressure - a.pressure) * widened
    at_stations = b.mass * b.speed * faster + (b.held + 0.5 * b.speed**2) * (b.mass - a.mass)
    below = b.within * (b.open - a.open) - b.pressure * widened
    work = _integral(law, 0.5 * (a.pressure + b.pressure) * widened)
    step_loss = _integral(law, in_time) + (weight - 1.0) * of_cells(change - h * old.rate) + ahead
    mesh_loss = of_cells(change) - _integral(law, at_stations - below)
    return jnp.array([h * mean[0], h * mean[1], work, h * mean[2], step_loss, mesh_loss])


def _mean(values):
    """Means (m - 1,) of values (m,) in the cells."""
    return 0.5 * (values[1:] + values[:-1])


def _integral(law: FlowLaw, values):
    """Integral of values (m,) along the passage."""
    return jnp.sum(law.channel.step * _mean(values))
