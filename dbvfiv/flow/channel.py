"""One streamline of an incompressible, inviscid fluid (Th. 4.1-4.10).

    p_k = P_in - rho [ (U_k^2 - U^2)/2 + d/dt integral_in^k U ds ],      p_outlet = 0

Stations run from the outlet (first) to the inlet (last) and keep their places along the axis, as in the thesis's
program (App. A). U is the inlet velocity. Continuity is blended between two laws by `storage` in 0..1: A_k U_k = A_in U
- storage * integral_in^k dA/dt ds, so 0 is the quasi-steady law of the thesis and 1 the conservation of volume under
moving walls. Terms add losses and inertances: see `dbvfiv.flow.term`. The thesis leaves gravity out; here `levels` has
what it does to a valve that stands upright.

Where faces in contact shut the passage, nothing leaves: the fluid in front of the seal is still but for what the wall
displaces there, which comes from the inlet; see `Channel.shut`. Its pressures at rest are those of equilibria, which
fall to nothing where the faces lie on each other, and follow them.

Equations (T.9), (T.10), (T.11) and (T.31) of docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

from .law import FlowLaw, FlowParameter, above_floor, solve_steady
from .term import VISCOSITY, FlowTerm, Stream, upstream_integral, wall_share


class Channel(FlowLaw):
    """Flow through m stations; its one unknown is the inlet velocity, its one equation the pressure at the outlet.
    Raises ValueError if the positions do not increase, two terms share the name of a parameter, or heads and momenta of
    a fluid without viscosity do not go with the square of the speeds and the speeds.

    Parameters
    ----------
    z : (m,) array
        Axial positions from the outlet to the inlet, m, increasing.
    floor : float
        Smallest area, m2: the passage narrows towards it smoothly as the wall's area falls to zero and below, so a
        closed valve stays finite.
    storage : float
        Blend of the continuity laws, 0 quasi-steady, 1 storage.
    unsteady : bool
        Keep the term d/dt integral U ds.
    terms : sequence of FlowTerm
        Losses and inertances on the way.
    back : float
        Pressure at the far end downstream, Pa.
    levels : (m,) array, optional
        Pressure of the fluid inside at rest under its weight, Pa, over that at the outlet; those of the fluid outside
        in `levels_outside`. The levels keep their places, as the stations do.
    reversible : bool
        Let flow that is drawn in lose its head; see `reversible_head`. Small motions of an outward flow are the same.
    perimeter : (m,) array, optional
        Arcs of the wall that the fluid wets, m; terms of a viscous fluid need them.
    density : float, kg/m3
        Of the fluid that equilibria are found with.
    bowed : bool
        Let the integral of the speed be a parabola between stations, as the wall feels it, and not straight.
    """

    DATA = ("step", "floor", "terms", "back", "static", "perimeter", "front")
    STATIC = ("unsteady", "reversible", "bowed", "sealed")
    inner_names = ("inlet velocity",)
    front = 1.0
    sealed = False

    def __init__(
        self,
        z: np.ndarray,
        floor: float,
        storage: float = 0.0,
        unsteady: bool = True,
        terms: Sequence[FlowTerm] = (),
        reversible: bool = False,
        back: float = 0.0,
        levels: np.ndarray | None = None,
        levels_outside: np.ndarray | None = None,
        perimeter: np.ndarray | None = None,
        density: float = 1.0,
        bowed: bool = False,
    ):
        self.z = np.asarray(z, float)
        self.step = np.diff(self.z)
        if np.any(self.step <= 0):
            raise ValueError("The stations of a channel must have increasing positions from the outlet to the inlet.")
        self.floor = float(floor)
        self.storage = float(storage)
        none = np.zeros(len(self.z))
        inside, outside = (none if given is None else np.asarray(given, float) for given in (levels, levels_outside))
        self.level, self.static = float(inside[-1] - inside[0]), inside - inside[0] - (outside - outside[0])
        self.back = float(back) + self.level
        self.unsteady, self.reversible, self.bowed = bool(unsteady), bool(reversible), bool(bowed)
        self.perimeter, self.density = none if perimeter is None else np.asarray(perimeter, float), float(density)
        self.terms = tuple(terms)
        self._check_terms()

    def _check_terms(self) -> None:
        names = self.names
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"Two parts of the flow have a parameter '{twice[0]}'.")
        parameters = self.values({"inlet": 0.0, "density": 1.0})
        for term in self.losses:
            if term.viscous:
                continue
            for sign in (1.0, -1.0):
                (head, momentum), (more_head, more_momentum) = (
                    map(np.asarray, _trial(term, self.count, size, parameters)) for size in (sign, 3.0 * sign)
                )
                if not (np.allclose(more_head, 9.0 * head) and np.allclose(more_momentum, 3.0 * momentum)):
                    raise ValueError(
                        f"Heads must go with the square of the speeds and momenta with the speeds, or equilibria would "
                        f"depend on the fluid's density; those of {type(term).__name__} do not."
                    )

    @property
    def count(self) -> int:
        return len(self.step) + 1

    @property
    def losses(self) -> tuple[FlowTerm, ...]:
        """Terms that steady flow sees."""
        return tuple(term for term in self.terms if not term.drives)

    @property
    def viscous(self) -> bool:
        """True where the fluid has a viscosity, so that steady flow depends on its density."""
        return any(term.viscous for term in self.terms)

    def at_unit_density(self) -> dict[str, float]:
        viscosity = next((term.viscosity for term in self.terms if term.viscous), None)
        return {} if viscosity is None else {VISCOSITY: viscosity / np.sqrt(self.density)}

    @property
    def parameters(self) -> tuple[FlowParameter, ...]:
        own = (
            FlowParameter("inlet", "Pa", "inlet pressure"),
            FlowParameter("density", "kg/m3", "density of the fluid"),
            FlowParameter("storage", "1", "blend of the flow models", self.storage),
        )
        return own + tuple(parameter for term in self.terms for parameter in term.parameters)

    # -- the definition

    def speeds(self, area, area_rate, velocity, storage):
        """Speeds (m,) at the stations; traceable."""
        open_, opening = jax.jvp(lambda a: above_floor(a, self.floor), (area,), (area_rate,))
        if self.sealed:
            velocity = self.displaced(area, area_rate, storage)
        speeds = (open_[-1] * velocity - storage * upstream_integral(self.step, opening)) / open_
        return jnp.where(self.spans[0] > 0, speeds, 0.0) if self.sealed else speeds

    def heads(self, area, area_rate, inner, parameters):
        """Heads (m,) from the inlet to each station, m2/s2: Bernoulli's and those of the terms; traceable."""
        speed = self.speeds(area, area_rate, inner[0], self._blend(parameters))
        return self.heads_of(self.stream(area, area_rate, speed, inner), parameters)

    def heads_of(self, stream: Stream, parameters):
        """Heads (m,) from the inlet to each station, m2/s2, of given speeds; traceable."""
        head = (reversible_head if self.reversible and not self.sealed else outward_head)(stream.speed, stream.inner[0])
        if self.terms:
            terms = [term for term in self.terms if not (self.sealed and term.behind_throat)]
            head = head + self.term_heads(stream, parameters, terms)
        return head

    def psi(self, area, area_rate, inner, parameters):
        """Momentum per density and area of the fluid before each station (m,), m2/s: the integral of the speed from the
        inlet, and what the terms add; traceable.
        """
        speed = self.speeds(area, area_rate, inner[0], self._blend(parameters))
        if self.sealed:
            before, spans = self.spans
            psi = jnp.cumsum((spans * speed)[::-1])[::-1] - (spans - before) * speed
        else:
            psi = upstream_integral(self.step, speed)
        if self.bowed and not self.sealed:
            psi = psi + wall_share(self.step, speed)
        if self.terms:
            psi = psi + self.term_momenta(self.stream(area, area_rate, speed, inner), parameters)
        return psi

    def stream(self, area, area_rate, speed, inner, passing=None) -> Stream:
        """The streamline as terms see it; traceable."""
        open_ = above_floor(area, self.floor)
        return Stream(area, area_rate, speed, inner, open_, self.perimeter, self.step, passing)

    def term_heads(self, stream: Stream, parameters, terms: Sequence[FlowTerm] | None = None):
        """Heads (m,) that the terms, or some of them, add; traceable."""
        terms = self.terms if terms is None else terms
        return sum((term.head(stream, parameters) for term in terms), jnp.zeros_like(stream.speed))

    def term_momenta(self, stream: Stream, parameters):
        """Momenta (m,) that the terms add; traceable."""
        return sum((term.momentum(stream, parameters) for term in self.terms), jnp.zeros_like(stream.speed))

    @jax.jit
    def sources(self, area, area_rate, inner, parameters, drive=None):
        """Heads (m + 1,), m2/s2, as `FlowLaw.sources` has them; `drive` is the static one at the flange over `back`."""
        source, back = self.supply(parameters)
        head = (source - back if drive is None else drive) - self.heads(area, area_rate, inner, parameters)
        if self.sealed:
            rest = self.at_seal(area, parameters)
            still, (source, back) = self.steady(area, rest)[0] / rest["density"], self.supply(rest)
            return jnp.append(still + self.front * (head - source + back), 0.0)
        return self._outlet_behind(head + self.static / parameters["density"])

    @jax.jit
    def held(self, area, area_rate, inner, parameters):
        psi = self.psi(area, area_rate, inner, parameters)
        if self.sealed:
            past = inner[0] - self.displaced(area, area_rate, self._blend(parameters))
            return -jnp.append(self.front * psi, past)
        return -self._outlet_behind(psi)

    def scales(self, area, parameters):
        return jnp.full(self.count + 1, parameters["density"])

    @staticmethod
    def _outlet_behind(values):
        """Values (m + 1,) from those at the stations (m,): that at the outlet, which must vanish, behind a zero."""
        return jnp.concatenate([jnp.zeros(1), values[1:], values[:1]])

    # -- the flange, where a line may stand in front

    def supply(self, parameters):
        """Enthalpy at the far end of a line, m2/s2, and what of it stands against the flow at rest; traceable."""
        return parameters["inlet"] / parameters["density"], self.back / parameters["density"]

    def flange(self, inner, parameters):
        """Velocity of the flange, m/s, that mass flows with at the density around the jet, and half the square of that
        of the fluid; traceable.
        """
        return inner[0], 0.5 * inner[0] ** 2

    @property
    def drive_share(self):
        """Derivative (m + 1,) of `sources` by the enthalpy at the flange."""
        return jnp.append(self.front, 0.0) if self.sealed else self._outlet_behind(jnp.ones(self.count))

    @jax.jit
    def speeds_of(self, area, area_rate, inner, parameters):
        return self.speeds(area, area_rate, inner[0], self._blend(parameters))

    def _blend(self, parameters):
        return parameters["storage"] if self.unsteady else 0.0

    # -- the steady flow, in closed form

    def steady_start(self, area, parameters):
        open_ = above_floor(area, self.floor)
        ratio = jnp.maximum((open_[-1] / open_[0]) ** 2 - 1.0, 0.1)
        return jnp.sqrt(2.0 * jnp.abs(parameters["inlet"] - self.back) / (parameters["density"] * ratio))[None] + 1e-3

    @jax.jit
    def steady(self, area, parameters):
        """Bernoulli's pressures, which depend on ratios of areas only; heads go with the square of the discharge. The
        flow of a viscous fluid is searched for.

        An inlet velocity that no pressure holds back is infinite.
        """
        if self.viscous:
            return solve_steady(self.without_drives(), area, parameters)
        open_ = above_floor(area, self.floor)
        total = open_**-2.0
        still = jnp.zeros_like(area)
        ratio = (open_[-1] / open_[0]) ** 2 - 1.0
        inlet, kinetic = parameters["inlet"] - self.back, total[-1]
        if self.losses:
            unit = self.stream(area, still, 1.0 / open_, 1.0 / open_[-1:])
            lost = 2.0 * self.term_heads(unit, parameters, self.losses)
            total, ratio = total + lost, ratio + lost[0] * open_[-1] ** 2
        pressure = inlet * (total[0] - total) / (total[0] - kinetic) + self.static
        speed = jnp.sqrt(2.0 * inlet / (parameters["density"] * jnp.where(ratio > 0, ratio, 1.0)))
        return pressure, jnp.where(ratio > 0, speed, jnp.inf)[None]

    # -- still fluid in front of a seal

    def shut(self, seal: int | None) -> Channel:
        if seal is None:
            return self
        return self.changed(sealed=True, front=(np.arange(self.count) >= seal).astype(float))

    @property
    def spans(self):
        """Halves (m,) of the lengths before the stations, from the seal on, and what stands at each, m."""
        half = 0.5 * self.step * self.front[:-1]
        before = jnp.append(0.0, half)
        return before, jnp.append(half, 0.0) + before

    @jax.jit
    def displaced(self, area, area_rate, storage):
        """Inlet velocity, m/s, of what the wall displaces in front of the seal; traceable."""
        open_, opening = jax.jvp(lambda a: above_floor(a, self.floor), (area,), (area_rate,))
        return storage * jnp.sum(self.spans[1] * opening) / open_[-1]

    @jax.jit
    def at_seal(self, area, parameters):
        """Parameters with the inlet pressure, Pa, that fluid at rest in front of a seal has: that of a pump that
        delivers nothing; traceable.
        """
        none = jnp.zeros_like(area)
        stream = self.stream(area, none, none, none[:1])
        gained = -sum(term.head(stream, parameters) for term in self.terms if term.drives)
        return {**parameters, "inlet": parameters["inlet"] + parameters["density"] * gained}

    def work_lengths(self, area: np.ndarray) -> np.ndarray:
        """Lengths (m,), m, over which pressures of moving fluid in front of the seal do work on areas (m,).

        With the discharges Q_k that the wall displaces, by trapezoids, the kinetic energy is rho/2 sum_k l_k Q_k^2/A_k,
        and pressures follow from it, so that they feed no motion.
        """
        return np.asarray(_work_lengths(self, area))

    def with_displaced(self, area, area_rate, inner):
        if not self.sealed:
            return inner
        found = np.array(inner, float)
        found[0] = self.displaced(area, area_rate, self.storage if self.unsteady else 0.0)
        return found

    def without_drives(self) -> Channel:
        """Copy of the channel with only those terms that act on steady flow."""
        return self.changed(terms=self.losses, sealed=False, front=1.0)

    def with_velocity(self, inner, velocity):
        return np.array([velocity])

    def reversed(self) -> Channel:
        return self.changed(reversible=True)


@jax.jit
def _work_lengths(channel, area):
    return channel.spans[1] * jax.grad(lambda a: above_floor(a, channel.floor).sum())(area)


@partial(jax.jit, static_argnames="count")
def _trial(term, count, size, parameters):
    """Head and momentum (m,) of a term in a stream of some size."""
    area = jnp.linspace(2.0, 5.0, count)
    speed = size / area
    opening, step = size * jnp.linspace(0.1, 0.3, count), jnp.ones(count - 1)
    stream = Stream(area, opening, speed, speed[-1:], area, step=step)
    return term.head(stream, parameters), term.momentum(stream, parameters)


def outward_head(speed, velocity):
    """Bernoulli's head (m,) of speeds (m,) with the inlet velocity."""
    return 0.5 * (speed**2 - velocity**2)


def reversible_head(speed, velocity):
    """Head (m,) of a flow that may run backwards, as a whole or in a part of the passage.

    Drawn in through the lips, the fluid starts from rest outside, where the pressure vanishes, gains speed at the cost
    of pressure as far as sections get narrower, and wherever they widen it goes on as a jet whose velocity head is
    lost. Bernoulli's law would give that head back at the inlet, so that a reversed flow gained pressure where it
    should lose it, and ran away.
    """
    out, back = jnp.maximum(speed, 0.0), jnp.minimum(speed, 0.0)
    gained = jnp.maximum(jnp.diff(back * back), 0.0)
    lost = jnp.concatenate([jnp.cumsum(gained[::-1])[::-1], jnp.zeros(1)])
    outside = jnp.zeros_like(speed).at[0].set(back[0] ** 2)  # what stands for the outlet is the still water outside
    return 0.5 * (out * out - out[-1] ** 2 - lost - outside)


def _of_channel(name: str) -> property:
    """Attribute that a law around a channel takes from it."""
    return property(lambda law: getattr(law.channel, name))


class AroundChannel(FlowLaw):
    """Flow law that extends a channel, as by an elastic line or a compressible fluid."""

    channel: Channel  #: Gives the law its stations, levels, terms and blend of the continuity laws.
    count, step, terms, storage, unsteady = map(_of_channel, ("count", "step", "terms", "storage", "unsteady"))
    back, level, static, sealed = map(_of_channel, ("back", "level", "static", "sealed"))

    def shut(self, seal: int | None) -> AroundChannel:
        return self.changed(channel=self.channel.shut(seal))

    def at_seal(self, area, parameters):
        return self.channel.at_seal(area, parameters)

    def work_lengths(self, area):
        return self.channel.work_lengths(area)
