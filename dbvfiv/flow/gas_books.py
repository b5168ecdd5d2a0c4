"""The books of energy of a compressed fluid over a time step.

A step meets the balances of mass and momentum of each cell at its end (`dbvfiv.flow.gas_stepping`). Multiplied by the
cell's mean discharge G and mean head H = w + U^2/2 and summed, they say what the fluid does with its energy E over the
step, to the last digit:

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

Equations (T.23) and (T.28) of docs/theory.md.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import jax
import jax.numpy as jnp

from .law import above_floor

if TYPE_CHECKING:
    from .gas import GasChannel

#: What has become of a fluid's energy: taken in at the flange, left through the lips, done on the wall, lost in the
#: passage, taken by differences in time and by cells of finite length.
BOOKS = ("supply", "outflow", "work", "loss", "step_loss", "mesh_loss")

#: Number of powers that a state keeps, see `powers`.
POWERS = 3


class Instant(NamedTuple):
    """A fluid at the beginning or end of a step.

    Attributes
    ----------
    area : (m,) array, m2
    inner, stored, rate : (l,) arrays
        The law's unknowns, m/s, what its balances hold, m2/s and m3, and the scheme's rate of that.
    power : (3,) array, W
        See `powers`.
    """

    area: jnp.ndarray
    inner: jnp.ndarray
    stored: jnp.ndarray
    rate: jnp.ndarray
    power: jnp.ndarray


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


def _stations(law: GasChannel, parameters, area, inner) -> _Stations:
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
def energy(law: GasChannel, parameters, area, inner):
    """Kinetic energy and that of compression, J of the part, with areas (m,) and unknowns (l,)."""
    at = _stations(law, parameters, area, inner)
    return _integral(law, at.mass * (at.held + 0.5 * at.speed**2) - at.open * at.within)


@jax.jit
def powers(law: GasChannel, parameters, area, area_rate, inner):
    """Power taken in at the flange, leaving through the lips and lost in the passage (3,), W of the computed part."""
    at = _stations(law, parameters, area, inner)
    head = law.sources(area, area_rate, inner, parameters)[: law.count - 1]
    lost = _mean(at.flow) * (head - (at.head[:-1] - at.head[1:]))  # what the cells take besides Bernoulli's heads
    return jnp.array([at.flow[-1] * at.head[-1], at.flow[0] * at.head[0], jnp.sum(lost)])


@jax.jit
def step_books(law: GasChannel, parameters, old: Instant, new: Instant, h, weight):
    """Energy budget of one time step (6,), J of the computed part; see `BOOKS`.

    Parameters
    ----------
    h : float, s
    weight : float
        r, of the new rate; see `dbvfiv.flow.gas_stepping`.
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


def _integral(law: GasChannel, values):
    """Integral of values (m,) along the passage."""
    return jnp.sum(law.channel.step * _mean(values))
