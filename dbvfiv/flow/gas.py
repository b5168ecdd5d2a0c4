"""A channel whose fluid is compressed: isentropic flow of a gas along one streamline (Shapiro 1953).

    d(rho A)/dt + d(rho A U)/ds = 0,      dU/dt + d(U^2/2 + w)/ds = 0,      dw = dp/rho
    p = rho_0 c_0^2/gamma [(rho/rho_0)^gamma - 1]

p is the pressure over that around the jet, rho_0 and c_0 density and speed of sound there: a perfect gas of the
absolute pressure rho_0 c_0^2/gamma, or a liquid whose compression follows Tait's equation. With sigma, m/s, defined as
c_0 ln(rho/rho_0)

    p = rho_0 c_0^2/gamma [exp(gamma sigma/c_0) - 1],      w = c_0^2/(gamma - 1) [exp((gamma - 1) sigma/c_0) - 1]

so that a density is never negative, and p = rho_0 c_0 sigma where c_0 is large. Both balances are taken over the cells
between stations with the trapezoidal rule (the box scheme): as c_0 grows, what is left is the law of `Channel` with
storage, station by station. Losses and inertances are those of the channel's terms, as enthalpies.

The jet leaves at the pressure around it until it is as fast as sound; from there on the speed at the outlet stays that
of sound and the pressure rises. What is drawn in comes from rest outside, and is no denser than it is there at the
speed of sound. At a throat inside, speed over that of sound is lost downstream of it, as in a shock that stands there:
the head CHOKED (U - c)^2. It is lost at that density; that a shock heats the gas is left out.

A liquid boils where its pressure would fall below that of its vapour: the pressure stays, but for what waves at
VAPOUR c_0 need, the density falls on, and mass is kept, so that a cavity fills and empties (column separation,
Bergant, Simpson and Tijsseling 2006).

Equations (T.23), (T.24) and (T.25) of docs/theory.md.
"""

from __future__ import annotations

from functools import partial
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from .channel import AroundChannel, Channel
from .energy import GAS_BOOKS, gas_books, gas_energy, gas_powers
from .law import FlowParameter, above_floor, step_at_rest, with_derivatives

#: Relative error of the frequency of waves that counts as resolved; the box scheme's is (k h)^2/12.
_RESOLVED = 0.01
#: What a flow faster than sound loses, of the square of the difference.
CHOKED = 50.0
#: Speed of waves in a liquid that boils, over that of sound in the liquid.
VAPOUR = 1e-3
#: Absolute pressure, Pa, below which a fluid is a gas: by no more can its pressure fall.
GAS = 1e6
#: Absolute pressure of next to nothing over that around the jet.
NOTHING = 1e-15
#: Steps within which a steady flow must be found, and the relative size of the last one.
_SETTLING, _SETTLED = 200, 1e-12
#: What is left, over rho c^2, where such a step is as long as a wave takes through the passage.
_USUAL = 0.02


def grown(x, rate):
    """(exp(rate x) - 1)/rate; traceable."""
    return jnp.expm1(rate * x) / rate


class GasChannel(AroundChannel):
    """Isentropic flow through m stations.

    Its 2 m - 1 unknowns, all in m/s, are the inlet velocity, the velocities at the stations from the outlet on, and
    sigma at those but the outlet. Its equations, all in Pa, are momentum and mass of each cell between stations, and
    the pressure at the flange.

    Parameters
    ----------
    channel : Channel
        The same without compression.
    sound_speed : float, m/s
        c_0.
    ratio : float
        gamma, of the heat capacities; greater than 1.
    vapour : float, Pa, optional
        Pressure at which the fluid boils, over that around the jet; negative.
    """

    DATA = ("channel", "floor", "vapour")
    STATIC = ("boils",)
    compressed = True
    inner_names: ClassVar[tuple[str, ...]] = ("inlet velocity", "velocities", "logarithms of the density")

    def __init__(self, channel: Channel, sound_speed: float, ratio: float = 1.4, vapour: float | None = None):
        self.channel, self.sound_speed, self.ratio = channel, float(sound_speed), float(ratio)
        self.floor, self.density = channel.floor, channel.density
        self.boils, self.vapour = vapour is not None, 0.0 if vapour is None else float(vapour)

    @property
    def inner(self) -> int:
        return 2 * self.count - 1

    @property
    def parameters(self) -> tuple[FlowParameter, ...]:
        return (
            *self.channel.parameters,
            FlowParameter("sound_speed", "m/s", "in the fluid around the jet", self.sound_speed),
            FlowParameter("heat_capacity_ratio", "1", "of the fluid", self.ratio),
        )

    def at_unit_density(self) -> dict[str, float]:
        return self.channel.at_unit_density() | {"sound_speed": self.sound_speed * np.sqrt(self.density)}

    def resolved(self, given) -> float:
        """Frequency up to which waves in the passage are 1 % too high at most, Hz."""
        speed = self.values({"inlet": 0.0, "density": 1.0} | dict(given))["sound_speed"]
        return float(np.sqrt(12.0 * _RESOLVED) * speed / (2.0 * np.pi * np.max(self.channel.step)))

    # -- the fluid

    def pressure(self, sigma, parameters):
        """Pressures over that around the jet, Pa; traceable."""
        c, density = parameters["sound_speed"], parameters["density"]
        liquid, boiling = self._boiling(sigma, parameters)
        found = density * c * grown(liquid, parameters["heat_capacity_ratio"] / c)
        if not self.boils:
            return found
        return found + density * c * VAPOUR**2 * jnp.exp(liquid / c) * grown(boiling, 1.0 / c)

    def enthalpy(self, sigma, parameters):
        """Integrals of dp/rho from the pressure around the jet, m2/s2; traceable."""
        liquid, boiling = self._boiling(sigma, parameters)
        found = self.isentropic(liquid, parameters)
        return found + parameters["sound_speed"] * VAPOUR**2 * boiling if self.boils else found

    @staticmethod
    def isentropic(sigma, parameters):
        """Enthalpies, m2/s2, over that around the jet, of a fluid that does not boil; traceable."""
        c = parameters["sound_speed"]
        return c * grown(sigma, (parameters["heat_capacity_ratio"] - 1.0) / c)

    def _boiling(self, sigma, parameters):
        """sigma, m/s, down to where the fluid boils, and what is below that; traceable."""
        if not self.boils:
            return sigma, jnp.zeros_like(sigma)
        limit = self.compression(self.vapour, parameters)
        return jnp.maximum(sigma, limit), jnp.minimum(sigma - limit, 0.0)

    @staticmethod
    def compression(pressure, parameters):
        """sigma, m/s, of pressures over that around the jet, Pa; of those that no gas has, as of next to none;
        traceable.
        """
        c, ratio = parameters["sound_speed"], parameters["heat_capacity_ratio"]
        return c / ratio * jnp.log1p(jnp.maximum(ratio * pressure / (parameters["density"] * c * c), NOTHING - 1.0))

    @staticmethod
    def outlet(speed, parameters):
        """sigma, m/s, at the outlet with a speed, m/s: zero up to that of sound, beyond such that it is that."""
        c = parameters["sound_speed"]
        over = jnp.log(jnp.maximum(speed / c, 1.0))
        return 2.0 * c / (parameters["heat_capacity_ratio"] - 1.0) * over

    @jax.jit
    def split(self, inner, parameters):
        """Velocities (m,), m/s, and sigma (m,), m/s, at the stations from the law's unknowns; traceable."""
        speed, sigma = jnp.concatenate([inner[1 : self.count], inner[:1]]), inner[self.count :]
        outlet = sigma[:1] if self.sealed else self.outlet(speed[0], parameters)[None]
        return speed, jnp.concatenate([outlet, sigma])

    # -- the definition

    def stored(self, area, area_rate, inner, parameters):
        """Quantities (2 m - 1,) whose rates the balances of momentum and mass contain; traceable.

        Velocities integrated over the cells and the terms' momentum at the flange, m2/s; mass over the outside density
        in the cells, m3.
        """
        channel = self.channel
        speed, sigma = self.split(inner, parameters)
        open_ = above_floor(area, self.floor)
        volume = parameters["storage"] * open_ * jnp.exp(self.inside(sigma) / parameters["sound_speed"])
        added = jnp.zeros_like(area)
        if channel.terms:
            added = added + channel.term_momenta(self.stream(area, area_rate, speed, inner, parameters), parameters)
        psi, flange = _cells(channel.step, speed), added[-1:]
        if self.sealed:  # the differences of what a fluid without compression has, which feeds no motion
            before, spans = channel.spans
            psi = before[:-1] * speed[:-1] + (spans - before)[1:] * speed[1:]
            flange = flange + before[-1:] * speed[-1:]
        psi = psi + added[:-1] - added[1:]
        return self._in_front(psi, flange, _cells(channel.step, volume), speed, sigma)

    def stream(self, area, area_rate, speed, inner, parameters):
        """The streamline as terms see it; traceable."""
        return self.channel.stream(area, area_rate, speed, inner, self.flange(inner, parameters)[0])

    @staticmethod
    def inside(sigma):
        """sigma (m,), m/s, that mass is stored with: at the outlet that of its neighbour, since what is outside there
        says nothing of how much is in the cell; traceable.
        """
        return sigma.at[0].set(sigma[1])

    def balances(self, area, area_rate, inner, parameters, drive=None):
        """Sources (2 m - 1,) that balance the rates of `stored`, m2/s2 and m3/s; traceable."""
        channel = self.channel
        speed, sigma = self.split(inner, parameters)
        open_ = above_floor(area, self.floor)
        head = channel.heads_of(self.stream(area, area_rate, speed, inner, parameters), parameters)
        drive = self.supply(parameters)[0] if drive is None else drive
        total = head + self.enthalpy(sigma, parameters)
        thick = sigma + jnp.zeros_like(sigma).at[0].set(self.drawn(speed[0], parameters))
        flow = open_ * speed * jnp.exp(thick / parameters["sound_speed"])
        momentum = total[:-1] - total[1:] + self.shocks(speed, thick, parameters)
        still = jnp.zeros_like(area)
        return self._in_front(momentum, total[-1:] - drive, flow[:-1] - flow[1:], still, still)

    def drawn(self, speed, parameters):
        """sigma, m/s, of what is drawn in through the outlet with a speed, m/s; 0 where it flows out; traceable."""
        c, ratio = parameters["sound_speed"], parameters["heat_capacity_ratio"]
        lost = jnp.minimum(0.5 * jnp.minimum(speed, 0.0) ** 2, c * c / (ratio + 1.0))
        return c / (ratio - 1.0) * jnp.log1p(-(ratio - 1.0) / c**2 * lost)

    def shocks(self, speed, sigma, parameters):
        """Heads (m - 1,) that the cells take where the fluid enters them faster than sound, m2/s2; traceable."""
        over = jnp.maximum(jnp.abs(speed) - self.local_sound_speed(sigma, parameters), 0.0) ** 2
        return CHOKED * (jnp.where(speed[1:] > 0.0, over[1:], 0.0) - jnp.where(speed[:-1] < 0.0, over[:-1], 0.0))

    def local_sound_speed(self, sigma, parameters):
        """Speed of sound, m/s, where the density is that of sigma, m/s; of the liquid where it boils; traceable."""
        c = parameters["sound_speed"]
        liquid, _ = self._boiling(sigma, parameters)
        return c * jnp.exp(0.5 * (parameters["heat_capacity_ratio"] - 1.0) * liquid / c)

    def scales(self, area, parameters):
        density = parameters["density"]
        mass = jnp.full(self.count - 1, density * parameters["sound_speed"]) / above_floor(area[-1], self.floor)
        return jnp.concatenate([jnp.ones(self.count), jnp.full(self.count, density), mass])

    @jax.jit
    def held(self, area, area_rate, inner, parameters):
        return jnp.concatenate([jnp.zeros(self.count), self.stored(area, area_rate, inner, parameters)])

    @jax.jit
    def sources(self, area, area_rate, inner, parameters, drive=None):
        """As `FlowLaw.sources` has them; `drive` is the enthalpy at the flange, m2/s2, where a line stands in front."""
        _, sigma = self.split(inner, parameters)
        pressure = self.pressure(sigma, parameters) + self.channel.static
        if self.sealed:
            still = self.at_seal(area, parameters)
            rest = self.channel.static + still["inlet"] - self.channel.back
            pressure = self.steady(area, still)[0] + self.channel.front * (pressure - rest)
        return jnp.concatenate([pressure, self.balances(area, area_rate, inner, parameters, drive)])

    # -- the flange, where a line may stand in front

    def supply(self, parameters):
        """Enthalpy at the far end of a line, m2/s2, over that around the jet; nothing else stands against the flow;
        traceable.
        """
        found = self.enthalpy(self.compression(parameters["inlet"] - self.channel.back, parameters), parameters)
        return found, 0.0

    @jax.jit
    def at_seal(self, area, parameters):
        """As `Channel.at_seal`; the head of a pump is an enthalpy."""
        c, slope = parameters["sound_speed"], parameters["heat_capacity_ratio"] - 1.0
        gained = (super().at_seal(area, parameters)["inlet"] - parameters["inlet"]) / parameters["density"]
        sigma = c / slope * jnp.log1p(slope / c**2 * (self.supply(parameters)[0] + gained))
        return {**parameters, "inlet": self.channel.back + self.pressure(sigma, parameters)}

    def flange(self, inner, parameters):
        """Velocity of the flange, m/s, that mass flows with at the density around the jet, and half the square of that
        of the fluid; traceable.
        """
        return inner[0] * jnp.exp(inner[-1] / parameters["sound_speed"]), 0.5 * inner[0] ** 2

    def far_velocity(self, inner, given=None) -> float:
        return float(self.flange(inner, {"sound_speed": self.sound_speed, **(given or {})})[0])

    @property
    def drive_share(self):
        """Derivative (m + l,) of `sources` by the enthalpy at the flange."""
        return jnp.zeros(self.count + self.inner).at[2 * self.count - 1].set(-1.0)

    # -- the steady flow

    def steady_start(self, area, parameters):
        """The flow without compression, no faster than sound, and the densities that its pressures make."""
        pressure, velocity = self.channel.steady(area, parameters)
        open_ = above_floor(area, self.floor)
        speed = jnp.minimum(velocity[0] * open_[-1] / open_, 0.8 * parameters["sound_speed"])
        least = -0.5 * parameters["density"] * parameters["sound_speed"] ** 2 / parameters["heat_capacity_ratio"]
        sigma = self.compression(jnp.maximum(pressure - self.channel.static, least), parameters)
        return jnp.concatenate([speed[-1:], speed[:-1], sigma[1:]])

    @jax.jit
    def steady(self, area, parameters):
        """Searched for; none where no pressure drives it. See `dbvfiv.flow.law.with_derivatives`."""
        own, still = self.without_drives(), parameters["inlet"] == self.channel.back
        # a pressure of 1 Pa drives the flow where there is none
        driven = {**parameters, "inlet": jnp.where(still, self.channel.back + 1.0, parameters["inlet"])}
        inner = _settled(*jax.lax.stop_gradient((own, area, driven)))
        inner = with_derivatives(partial(step_at_rest, own, area, driven), inner)
        _, sigma = own.split(inner, parameters)
        pressure, over = self.pressure(sigma, parameters), parameters["inlet"] - self.channel.back
        # where nothing flows their derivative by the inlet pressure is that of the flow that 1 Pa drives
        pressure = jnp.where(still, over * jax.lax.stop_gradient(pressure), pressure)
        return pressure + self.channel.static, jnp.where(still, 0.0, inner)

    def without_drives(self) -> GasChannel:
        """Copy of the law with only those terms that act on steady flow, which is that of an open passage."""
        return self.changed(channel=self.channel.without_drives())

    def reversed(self) -> GasChannel:
        return self.changed(channel=self.channel.reversed())

    def is_soft(self, density):
        """True for a gas, by its absolute pressure; the water hammer of a liquid hits walls as an incompressible fluid
        does.
        """
        return density * self.sound_speed**2 / self.ratio < GAS

    @jax.jit
    def speeds_of(self, area, area_rate, inner, parameters):
        return self.split(inner, parameters)[0]

    def own_velocities(self, inner):
        return np.append(inner[1 : self.count], inner[0])

    def own_densities(self, inner):
        _, sigma = self.split(inner, {"sound_speed": self.sound_speed, "heat_capacity_ratio": self.ratio})
        return np.exp(np.asarray(sigma) / self.sound_speed)

    # -- still gas in front of a seal

    def _in_front(self, momentum, flange, mass, speed, sigma):
        """Numbers (2 m - 1,) of the cells in front of a seal and of the flange; behind it speeds, that at the seal
        included, and sigma, which stay as they are, take the places of momentum and mass; traceable.
        """
        if self.sealed:
            front = jnp.asarray(self.channel.front) > 0.0
            # a seal at the outlet has no unknown pressure of its own: its cell has that of the next station
            momentum = jnp.where(front[:-1].at[0].set(False), momentum, speed[:-1])
            mass = jnp.where(front[:-1], mass, jnp.where(front[1:], speed[1:], sigma[1:]))
        return jnp.concatenate([momentum, flange, mass])

    @property
    def cells(self):
        """Lengths (m - 1,) of the cells, m, those behind a seal without length."""
        return self.step * self.channel.front[:-1] if self.sealed else self.step

    def with_displaced(self, area, area_rate, inner):
        if not self.sealed:
            return inner
        found = np.array(inner, float)
        found[1 : self.count] *= np.append(0.0, np.asarray(self.channel.front))[: self.count - 1]
        return found

    def with_velocity(self, inner, velocity):
        """Unknowns of the gas at rest, with the pressure at the flange; no other velocity is free."""
        return inner if velocity else np.append(np.zeros(self.count), np.full(self.count - 1, inner[-1]))

    # -- its energy, see `dbvfiv.flow.energy`

    book_names = GAS_BOOKS
    energy_names = ("gas_energy",)

    def first_carried(self, motion, parameters):
        return gas_powers(self, motion.area, motion.area_rate, motion.inner, parameters)

    def step_books(self, step, parameters):
        return gas_books(self, step, parameters)

    def energies(self, area, inner, parameters):
        return gas_energy(self, area, inner, parameters)[None]

    def readings(self, area, inner, parameters):
        """Mass flows at outlet and inlet, kg/s of the part, and the largest Mach number; traceable."""
        speed, sigma = self.split(inner, parameters)
        sigma = sigma.at[0].add(self.drawn(speed[0], parameters))
        thick = parameters["density"] * jnp.exp(sigma / parameters["sound_speed"])
        flow = thick * above_floor(area, self.floor) * speed
        return flow[0], flow[-1], jnp.max(jnp.abs(speed) / self.local_sound_speed(sigma, parameters))


def _settling_step(law: GasChannel, area, parameters, inner):
    """Change (l,) of the unknowns in an implicit step of time, the longer the less is left."""
    c, still = parameters["sound_speed"], jnp.zeros_like(area)
    slope, left = jax.jacfwd(lambda x: (law.at_rest(area, x, parameters)[1],) * 2, has_aux=True)(inner)
    passing = jnp.sum(law.channel.step) / c  # time that a wave takes
    rate = jnp.linalg.norm(left) / (_USUAL * parameters["density"] * c * c * passing)
    held = jax.jacfwd(law.stored, 2)(area, still, inner, {**parameters, "storage": 1.0})
    return -jnp.linalg.solve(slope + rate * law.scales(area, parameters)[law.count :, None] * held, left)


def _settled(law: GasChannel, area, parameters):
    """Unknowns (l,) of the steady flow: that which a flow settles in, by implicit steps of time whose length grows as
    what is left falls (Mulder and van Leer 1985), Newton's method in the end; not numbers where it does not settle.
    """
    longest = 0.3 * parameters["sound_speed"]

    def advance(carried):
        inner, _, count = carried
        step = _settling_step(law, area, parameters, inner)
        inner = inner + jnp.minimum(1.0, longest / jnp.max(jnp.abs(step))) * step
        return inner, jnp.linalg.norm(step) / jnp.linalg.norm(inner), count + 1

    def goes_on(carried):
        return (carried[2] < _SETTLING) & (carried[1] > _SETTLED)

    inner, last, _ = jax.lax.while_loop(goes_on, advance, (law.steady_start(area, parameters), 1.0, 0))
    return jnp.where(last <= _SETTLED, inner, jnp.nan)


def _cells(step, values):
    """Integrals (m - 1,) of values (m,) over the cells between stations."""
    return 0.5 * step * (values[1:] + values[:-1])
