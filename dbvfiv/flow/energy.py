"""Energy of a fluid over time steps, part by part: what came in, went out, was lost, and what the scheme took.

The balances of mass and momentum of each cell of a compressed fluid at the end of a step, multiplied by the cell's mean
discharge G and mean head H = w + U^2/2 and summed, say what the fluid does with its energy E over the step, to the last
digit:

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

An elastic line has the energy W M W/2 in its velocities and pressures W. Equations met at a share theta of the step,
with the weight r of the new rate, leave

    E_1 - E_0 = supply - loss - work - (theta - 1/2) dW M dW - (r - 1) W_theta M (dW - h W'_0)

with the powers there; a step without numerical damping takes nothing.

Equations (T.13) and (T.28) of docs/theory.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import jax.numpy as jnp

from .law import above_floor

if TYPE_CHECKING:
    from .elastic_line import ElasticLine
    from .gas import GasChannel

#: What has become of the energy of a compressed fluid: taken in at the flange, left through the lips, done on the wall,
#: lost in the passage, taken by differences in time and by cells of finite length.
GAS_BOOKS = tuple(f"gas_{name}" for name in ("supply", "outflow", "work", "loss", "step_loss", "mesh_loss"))
#: Of that of an elastic line: taken in at the far end, lost by friction, handed to the valve, taken by differences.
LINE_BOOKS = tuple(f"line_{name}" for name in ("supply", "dissipation", "work", "step_loss"))


class Instant(NamedTuple):
    """A fluid at the beginning or end of a step."""

    #: area and area_rate: (m,); m2, m2/s.
    area: Any
    area_rate: Any
    inner: Any  #: (l,); the law's unknowns.
    #: held and rate: (m + l,); what its balances hold, and the scheme's value of the rate.
    held: Any
    rate: Any
    carried: Any  #: What the books of the next step need, see `FlowLaw.step_books`.


class BookStep(NamedTuple):
    """A step from one instant to another of length h, s, equations met at its share theta with weight r of new rates;
    the end's own `carried` is not known yet.
    """

    old: Instant
    new: Instant
    h: Any
    theta: Any
    weight: Any


class _Stations(NamedTuple):
    """Flow at the stations (m,) at an instant; `thick`, `mass`, `held` and `within` belong to the stored mass."""

    area: Any
    open: Any
    speed: Any
    thick: Any
    mass: Any
    held: Any
    within: Any
    head: Any
    flow: Any
    pressure: Any


def _stations(law: GasChannel, area, inner, parameters) -> _Stations:
    speed, sigma = law.split(inner, parameters)
    c, density, open_ = parameters["sound_speed"], parameters["density"], above_floor(area, law.floor)
    inside, entering = law.inside(sigma), sigma.at[0].add(law.drawn(speed[0], parameters))
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


def gas_energy(law: GasChannel, area, inner, parameters):
    """Kinetic energy and that of compression, J of the part; traceable."""
    at = _stations(law, area, inner, parameters)
    return _integral(law, at.mass * (at.held + 0.5 * at.speed**2) - at.open * at.within)


def gas_powers(law: GasChannel, area, area_rate, inner, parameters):
    """Powers (3,), W of the part: taken in at the flange, leaving through the lips, lost in the passage; traceable."""
    at = _stations(law, area, inner, parameters)
    head = law.balances(area, area_rate, inner, parameters)[: law.count - 1]
    lost = _mean(at.flow) * (head - (at.head[:-1] - at.head[1:]))  # what the cells take besides Bernoulli's heads
    return jnp.array([at.flow[-1] * at.head[-1], at.flow[0] * at.head[0], jnp.sum(lost)])


def gas_books(law: GasChannel, step: BookStep, parameters):
    """Energies (6,), J of the part, by `GAS_BOOKS`, and the powers at the end; traceable."""
    old, new, h, weight = step.old, step.new, step.h, step.weight
    a, b = (_stations(law, at.area, at.inner, parameters) for at in (old, new))
    count, flow, head = law.count, _mean(b.flow), parameters["density"] * _mean(b.head)
    power = gas_powers(law, new.area, new.area_rate, new.inner, parameters)

    def of_cells(held):  # the sum of balances of cells, J, by what is held in them (m + l,)
        own = held[count:]
        return jnp.sum(flow * own[: count - 1]) + jnp.sum(head * own[count:])

    before = jnp.where(weight == 1.0, 0.0, 0.5)
    mean = power + before * (old.carried - power)
    ahead = before * h * jnp.sum((old.carried - power) * jnp.array([1.0, -1.0, -1.0]))
    change = new.held - old.held
    faster, widened = b.speed - a.speed, b.area - a.area
    tangent = a.open * ((a.thick * a.held - a.within) - (b.thick * b.held - b.within) - b.held * (a.thick - b.thick))
    kinetic = 0.5 * a.mass * faster**2 + (b.mass - a.mass) * b.speed * faster
    in_time = tangent + kinetic + 0.5 * (b.pressure - a.pressure) * widened
    at_stations = b.mass * b.speed * faster + (b.held + 0.5 * b.speed**2) * (b.mass - a.mass)
    below = b.within * (b.open - a.open) - b.pressure * widened
    work = _integral(law, 0.5 * (a.pressure + b.pressure) * widened)
    step_loss = _integral(law, in_time) + (weight - 1.0) * of_cells(change - h * old.rate) + ahead
    mesh_loss = of_cells(change) - _integral(law, at_stations - below)
    return jnp.array([h * mean[0], h * mean[1], work, h * mean[2], step_loss, mesh_loss]), power


def _mean(values):
    """Means (m - 1,) of values (m,) in the cells."""
    return 0.5 * (values[1:] + values[:-1])


def _integral(law: GasChannel, values):
    """Integral of values (m,) along the passage, up to a seal."""
    return jnp.sum(law.cells * _mean(values))


class LineInstant(NamedTuple):
    """Velocities (k + 1,) and pressures (k,) of a line, and the enthalpy that drives it, m2/s2."""

    velocity: Any
    pressure: Any
    source: Any = 0.0


def line_energies(line: ElasticLine, at: LineInstant, inlet_area, parameters):
    """Kinetic and elastic energy (2,), J of the part; traceable."""
    momentum, stored = line.held(at.velocity, at.pressure, inlet_area, parameters)
    weight = 0.5 * parameters["density"] * inlet_area
    return weight * jnp.stack([at.velocity @ momentum, at.pressure @ stored])


def line_powers(line: ElasticLine, at: LineInstant, rate, inlet_area, parameters):
    """Powers (3,), W of the part: taken in at the far end, lost on the way, handed to the valve; `rate` is that of the
    momentum at the flange, m/s2. Traceable.
    """
    sources, _ = line.sources(*at, inlet_area, parameters)
    far = line.far_head(at.velocity[0], at.source, inlet_area, parameters) * at.velocity[0]
    lost = line.friction(at.velocity, inlet_area, parameters) @ at.velocity
    return parameters["density"] * inlet_area * jnp.stack([far, lost, -(sources[-1] + rate) * at.velocity[-1]])


def line_books(line: ElasticLine, ends: tuple[LineInstant, LineInstant], step: BookStep, area, parameters):
    """Energies (4,), J of the part, by `LINE_BOOKS`, and the powers with the rate of the momentum at the flange (4,)
    for the next step: the last numbers that a step carries. `ends` are those of the step and `area`, m2 of the part,
    that of the inlet; traceable.

    By the powers where the equations are met; by the mean powers of a step of second order that meets them at its end.
    """
    (old, new), (*powers, before) = ends, step.old.carried[-4:]
    h, theta, weight = step.h, step.theta, step.weight
    dw, dp = new.velocity - old.velocity, new.pressure - old.pressure
    momentum, stored = line.held(dw, dp, area, parameters)
    at = LineInstant(old.velocity + theta * dw, old.pressure + theta * dp, new.source)
    k = len(dp)
    # rates of the step before, those of the flange apart, are what the balances kept
    second = at.velocity @ (momentum - h * jnp.append(step.old.rate[-2 * k : -k], before))
    second += at.pressure @ (stored - h * step.old.rate[-k:])
    taken = (theta - 0.5) * (dw @ momentum + dp @ stored) + (weight - 1.0) * second
    last = momentum[-1] / h
    here = line_powers(line, at, weight * last + (1.0 - weight) * before, area, parameters)
    ahead = jnp.where((theta == 1.0) & (weight != 1.0), 0.5, 0.0) * (jnp.stack(powers) - here)
    taken = parameters["density"] * area * taken + h * (ahead[0] - ahead[1] - ahead[2])
    return jnp.append(h * (here + ahead), taken), jnp.append(here, last)
