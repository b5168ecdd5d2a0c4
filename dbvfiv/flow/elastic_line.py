"""A channel at the end of an elastic line: water hammer with friction (Wylie and Streeter 1993).

    du/dt + dh/dx + zeta u|u|/(2 L) = 0,      dh/dt + c^2 du/dx = 0,      0 < x < L

u is the velocity in the line, h its total pressure over the density, zeta = f L/D + K what the line loses in velocity
heads, spread evenly over its length. Convection of what the waves carry, of the order of u/c, is left out; with the
total pressure the momentum holds without it. At the far end h = P_0/rho + g^2/2 with g the velocity that the pressure
there is taken at: see `dbvfiv.flow.terms.line`. At the flange flow and total pressure are continuous.

With w = u A_line/A_in, which is the inlet velocity at the flange, and pi = h A_line/(A_in c) both equations carry the
same speed and the energy is rho A_line/2 (A_in/A_line)^2 (w^2 + pi^2) a length.

Elements are mixed: flow is continuous, of degree N, pressure of degree N - 1 in each. The derivative of every flow is a
pressure of the space, so there are no spurious modes, a flow without compression is uniform as in a rigid column, and
the two couplings are each other's transposes: energy is conserved (Joly 2003, in Topics in Computational Wave
Propagation). Flow is interpolated between Gauss-Lobatto points, pressure lives at the N Gauss points. Eigenvalues err
by the power 2 N of the length of an element.

Pipes in series meet with the same flow and the same total pressure: w is one function along all of them, and each has
its own pi. A rigid pipe among them is a length of no extent, whose inertance and loss stand at the node between its
neighbours.

Equation (T.13) of docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial import legendre

from .channel import AroundChannel, Channel
from .energy import LINE_BOOKS, LineInstant, line_books, line_energies, line_powers
from .gas import GasChannel
from .law import FlowParameter, Traceable
from .terms.line import Line, PiecedLine
from .terms.pump import Pump

#: Degree N of the flow.
DEGREE = 4


class Element(NamedTuple):
    """An element on 0..1."""

    nodes: np.ndarray  #: (N + 1,); where the flow's unknowns are.
    #: points and weights: (N,); Gauss's, where those of the pressure are.
    points: np.ndarray
    weights: np.ndarray
    slope: np.ndarray  #: (N, N + 1); derivative of the flow at the points from its unknowns.
    #: finer and value: (N + 1,) and (N + 1, N + 1); Gauss's weights for one point more, and the flow there from its
    #: unknowns: friction that is summed over the points of the pressure does not see a flow of degree N whose zeros
    #: they are, the quickest wave of an element.
    finer: np.ndarray
    value: np.ndarray
    mass: np.ndarray  #: (N + 1, N + 1); integral of the product of two shapes.


@cache
def element(degree: int = DEGREE) -> Element:
    """The element of a degree, at least 2."""
    inner = legendre.legroots(legendre.legder(np.eye(degree + 1)[degree]))
    nodes = 0.5 * (1.0 + np.concatenate([[-1.0], inner, [1.0]]))
    shapes = np.linalg.inv(legendre.legvander(2.0 * nodes - 1.0, degree))  # columns: series of each shape

    def at(places, order=0):
        series = shapes if not order else legendre.legder(shapes, scl=2.0)
        return legendre.legvander(2.0 * places - 1.0, degree - order) @ series

    points, weights = (0.5 * x for x in legendre.leggauss(degree))
    points = points + 0.5
    more, finer = (0.5 * x for x in legendre.leggauss(degree + 1))
    value = at(more + 0.5)
    return Element(nodes, points, weights, at(points, 1), finer, value, value.T @ (finer[:, None] * value))


def chain(count: int, degree: int = DEGREE) -> np.ndarray:
    """(count, N + 1) numbers of the nodes of elements in a row."""
    return degree * np.arange(count)[:, None] + np.arange(degree + 1)


#: Wavelengths that an element of degree 4 resolves: frequencies of waves are then 1.5e-4 too high, measured.
RESOLVED = 0.5
#: Up to which frequency waves are resolved by default, Hz, and the most elements that are taken for it.
FREQUENCY, MOST = 200.0, 16


def default_elements(length: float, wave_speed: float) -> int:
    """Elements that resolve waves up to 200 Hz in a line, from 2 to 16."""
    return int(np.clip(np.ceil(FREQUENCY * length / (RESOLVED * wave_speed)), 2, MOST))


class Segments(NamedTuple):
    """The elements of a line from the far end to the flange, and what stands at its nodes."""

    #: length, ratio, speed and lost: (e,); of each element: length, m; area of the inlet over its own; wave speed, m/s;
    #: what it loses of w|w|.
    length: Any
    ratio: Any
    speed: Any
    lost: Any
    #: inertance and loss: (k + 1,); of rigid pipes at the nodes: length times ratio, m; what they lose of w|w|.
    inertance: Any
    loss: Any

    @property
    def lost_before(self):
        """Loss (e,) of all that is before each element, of w|w|."""
        rigid = jnp.cumsum(self.loss)[:-1:DEGREE]
        return rigid + jnp.cumsum(self.lost) - self.lost


class ElasticLine(Traceable):
    """Waves in a line of equal elements, or in pipes in series, each with its own.

    Parameters
    ----------
    line : Line or PiecedLine
        Length, section, losses and far end.
    wave_speed : float or sequence of float or None, m/s
        Of each pipe; None for a rigid one. That of the first elastic one is a parameter; with another value the others
        change in proportion.
    elements : int or sequence of int or None, optional
        Of each pipe.
    pump : Pump, optional
        At the far end.
    """

    DATA = ("line", "wave_speed", "speeds", "pump")
    STATIC = ("elements", "counts")

    def __init__(
        self,
        line: Line | PiecedLine,
        wave_speed: float | Sequence[float | None],
        elements: int | Sequence[int | None] | None = None,
        pump: Pump | None = None,
    ):
        speeds = (wave_speed,) if np.isscalar(wave_speed) else tuple(wave_speed)
        given = (elements,) * len(speeds) if elements is None or np.isscalar(elements) else tuple(elements)
        self.line, self.pump = line, pump
        self.speeds = tuple(float(speed or 0.0) for speed in speeds)
        self.wave_speed = next(speed for speed in self.speeds if speed)
        self.counts = tuple(
            0 if not speed else default_elements(part.length, speed) if count is None else int(count)
            for part, speed, count in zip(line.parts, self.speeds, given, strict=True)
        )
        self.elements = sum(self.counts)

    @property
    def size(self) -> int:
        """Number of the line's own unknowns: velocities but that at the flange, then pressures."""
        return 2 * DEGREE * self.elements

    @property
    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions of the velocities and of the pressures along the line, from the far end (0) to the flange (1).

        The last velocity is that at the flange.
        """
        one, ends = element(), np.zeros((self.elements, 2))
        first, distance = 0, 0.0
        for part, count in zip(self.line.parts, self.counts):
            cuts = distance + part.length * np.arange(count + 1) / max(count, 1)
            ends[first : first + count] = np.stack([cuts[:-1], cuts[1:]], axis=1)
            first, distance = first + count, distance + part.length
        start, width = ends[:, :1] / distance, np.diff(ends, axis=1) / distance
        return np.append((start + width * one.nodes[:-1]).ravel(), 1.0), (start + width * one.points).ravel()

    def segments(self, inlet_area, parameters) -> Segments:
        """Elements and nodes for the part's area of the inlet, m2; traceable."""
        stretch = parameters["pipe_length"] / self.line.length
        faster = parameters["wave_speed"] / self.wave_speed
        columns = []
        inertance, loss = jnp.zeros(DEGREE * self.elements + 1), jnp.zeros(DEGREE * self.elements + 1)
        for part, speed, count in zip(self.line.parts, self.speeds, self.counts):
            diameter, ratio = part.section(inlet_area)
            length = stretch * part.length
            lost = 0.5 * part.lost(diameter, length) * ratio**2
            if count:
                own = (length / count, ratio, faster * speed, lost / count)
                columns += [jnp.stack([jnp.asarray(value, float) for value in own])] * count
            else:
                node = DEGREE * len(columns)
                inertance, loss = inertance.at[node].add(ratio * length), loss.at[node].add(lost)
        return Segments(*jnp.stack(columns, axis=1), inertance, loss)

    def far_head(self, velocity, source, inlet_area, parameters, steady: bool = False):
        """Total pressure at the far end over the density, m2/s2, from the velocity there referred to the flange and the
        enthalpy of what drives the flow.
        """
        head = source + 0.5 * self.line.far_speed(velocity, inlet_area) ** 2
        if self.pump is None or steady:
            return head
        return head + self.pump.gain(velocity, inlet_area, parameters)

    def held(self, velocity, pressure, inlet_area, parameters):
        """Momentum (k + 1,) at the nodes, m2/s, and compression (k,) at the points, whose rates the equations contain;
        linear, traceable.

        Parameters
        ----------
        velocity : (k + 1,) array
            w, that of the flange last.
        pressure : (k,) array
            pi, m/s.
        """
        one, nodes, segments = element(), chain(self.elements), self.segments(inlet_area, parameters)
        length, ratio = segments.length[:, None], segments.ratio[:, None]
        momentum = (segments.inertance * velocity).at[nodes].add(ratio * length * (velocity[nodes] @ one.mass.T))
        return momentum, (ratio * one.weights * length * pressure.reshape(self.elements, -1)).ravel()

    def sources(self, velocity, pressure, source, inlet_area, parameters):
        """Momentum but for the flange's pressure, m2/s2, at all nodes (k + 1,), and continuity, m2/s2, at the points
        (k,), without rates; traceable. Arguments as `held` and `far_head` have them.
        """
        one, nodes, segments = element(), chain(self.elements), self.segments(inlet_area, parameters)
        ratio, speed = segments.ratio[:, None], segments.speed[:, None]
        push = ratio * speed * ((one.weights * pressure.reshape(self.elements, -1)) @ one.slope)
        momentum = self.friction(velocity, inlet_area, parameters).at[nodes].add(-push)
        momentum = momentum.at[0].add(-self.far_head(velocity[0], source, inlet_area, parameters))
        return momentum, (ratio * one.weights * speed * (velocity[nodes] @ one.slope.T)).ravel()

    def friction(self, velocity, inlet_area, parameters):
        """Friction (k + 1,) at the nodes, m2/s2; traceable."""
        one, nodes, segments = element(), chain(self.elements), self.segments(inlet_area, parameters)
        flows = velocity[nodes] @ one.value.T
        spread = segments.lost[:, None] * ((one.finer * flows * jnp.abs(flows)) @ one.value)
        return (segments.loss * velocity * jnp.abs(velocity)).at[nodes].add(spread)

    def steady_pressure(self, velocity, source, inlet_area, parameters):
        """pi (k,) of the steady flow with an inlet velocity."""
        segments = self.segments(inlet_area, parameters)
        lost = segments.lost_before[:, None] + segments.lost[:, None] * element().points
        head = self.far_head(velocity, source, inlet_area, parameters, steady=True)
        head = head - lost * velocity * jnp.abs(velocity)
        return (head / (segments.ratio * segments.speed)[:, None]).ravel()


class LineChannel(AroundChannel):
    """A passage behind an elastic line.

    Its unknowns are those of the passage, the velocities in the line from the far end and the pressures in it, each as
    `ElasticLine` has them. Mass and energy are continuous at the flange: what leaves the line with the density around
    the jet enters the passage, with its total enthalpy, whether the fluid is compressed there or not.

    Parameters
    ----------
    channel : Channel or GasChannel
        Without the line.
    rigid : Channel or GasChannel
        With its rigid column, which has the same steady flow.
    """

    DATA = ("channel", "rigid", "line", "floor")

    def __init__(self, channel: Channel | GasChannel, rigid: Channel | GasChannel, line: ElasticLine):
        self.channel, self.rigid, self.line = channel, rigid, line
        self.floor, self.density = channel.floor, channel.density

    @property
    def inner(self) -> int:
        return self.channel.inner + self.line.size

    @property
    def compressed(self) -> bool:
        """True where the fluid in the passage is compressed."""
        return self.channel.compressed

    @property
    def terms(self):
        """Loss and inertance terms of the rigid column of fluid."""
        return self.rigid.terms

    @property
    def parameters(self) -> tuple[FlowParameter, ...]:
        own = FlowParameter("wave_speed", "m/s", "of the line in front", self.line.wave_speed)
        return (*self.rigid.parameters, own)

    def at_unit_density(self) -> dict[str, float]:
        return self.rigid.at_unit_density()

    def resolved(self, given) -> float:
        """Frequency up to which the elements resolve waves, Hz, under given parameters."""
        values = self.values({"inlet": 0.0, "density": 1.0} | dict(given))
        line = self.line
        stretch, faster = values["pipe_length"] / line.line.length, values["wave_speed"] / line.wave_speed
        pipes = [pipe for pipe in zip(line.counts, line.speeds, line.line.parts) if pipe[0]]
        own = min(RESOLVED * n * faster * speed / (stretch * part.length) for n, speed, part in pipes)
        return min(own, self.channel.resolved(given))

    def split(self, inner, parameters):
        """Unknowns of the passage, velocities (k + 1,), that of the flange last, and pressures (k,) of the line from
        the law's unknowns; traceable.
        """
        own, velocity, pressure = jnp.split(inner, [self.channel.inner, self.channel.inner + self.line.size // 2])
        return own, jnp.append(velocity, self.channel.flange(own, parameters)[0]), pressure

    def flange(self, inner, parameters):
        """As that of the passage, whose unknowns are the first."""
        return self.channel.flange(inner[: self.channel.inner], parameters)

    def far_velocity(self, inner, given=None) -> float:
        return float(inner[self.channel.inner])

    # -- the definition

    @jax.jit
    def held(self, area, area_rate, inner, parameters):
        own, velocity, pressure = self.split(inner, parameters)
        momentum, stored = self.line.held(velocity, pressure, area[-1], parameters)
        passage = self.channel.held(area, area_rate, own, parameters) - self.channel.drive_share * momentum[-1]
        return jnp.concatenate([passage, momentum[:-1], stored])

    @jax.jit
    def sources(self, area, area_rate, inner, parameters):
        own, velocity, pressure = self.split(inner, parameters)
        source, back = self.channel.supply(parameters)
        momentum, stretch = self.line.sources(velocity, pressure, source, area[-1], parameters)
        drive = -momentum[-1] - self.channel.flange(own, parameters)[1] - back
        rest = self.at_seal(area, parameters) if self.sealed else parameters
        passage = self.channel.sources(area, area_rate, own, rest, drive)
        return jnp.concatenate([passage, momentum[:-1], stretch])

    def scales(self, area, parameters):
        line = jnp.full(self.line.size, parameters["density"])
        return jnp.concatenate([self.channel.scales(area, parameters), line])

    @jax.jit
    def speeds_of(self, area, area_rate, inner, parameters):
        return self.channel.speeds_of(area, area_rate, inner[: self.channel.inner], parameters)

    def with_velocity(self, inner, velocity):
        if self.compressed and velocity:
            return inner
        own, waves = np.split(np.array(inner, float), [self.channel.inner])
        waves[: self.line.size // 2] = velocity
        return np.append(self.channel.with_velocity(own, velocity), waves)

    def still(self, area, given):
        """At the pressure behind the valve, up to which nothing flows."""
        values, found = self.values(given), super().still(area, given)
        back = self.channel.supply(values)[1]
        found[-(self.line.size // 2) :] = self.line.steady_pressure(0.0, back, area[-1], values)
        return found

    def is_soft(self, density):
        return self.channel.is_soft(density)

    def at_seal(self, area, parameters):
        return self.rigid.at_seal(area, parameters)

    def with_displaced(self, area, area_rate, inner):
        return self.channel.with_displaced(area, area_rate, inner)

    def own_velocities(self, inner):
        return self.channel.own_velocities(inner[: self.channel.inner])

    def own_densities(self, inner):
        return self.channel.own_densities(inner[: self.channel.inner])

    def reversed(self) -> LineChannel:
        return self.changed(channel=self.channel.reversed())

    @jax.jit
    def steady(self, area, parameters):
        """Steady flow of the rigid column of fluid, with a uniform velocity in the line."""
        source, _ = self.channel.supply(parameters)
        p, own = self.rigid.steady(area, parameters)
        velocity = self.channel.flange(own, parameters)[0]
        pressure = self.line.steady_pressure(velocity, source, area[-1], parameters)
        return p, jnp.concatenate([own, jnp.full(self.line.size // 2, velocity), pressure])

    # -- its energy, see `dbvfiv.flow.energy`

    @property
    def book_names(self) -> tuple[str, ...]:
        """Names for the passage and for the line."""
        return (*self.channel.book_names, *LINE_BOOKS)

    @property
    def energy_names(self) -> tuple[str, ...]:
        """Names for the passage and for the line."""
        return (*self.channel.energy_names, "line_kinetic_energy", "line_elastic_energy")

    def first_carried(self, motion, parameters):
        def at_flange(inner):
            return self.line.held(*self.split(inner, parameters)[1:], motion.area[-1], parameters)[0][-1]

        own = motion._replace(inner=motion.inner[: self.channel.inner])
        rate = jax.jvp(at_flange, (motion.inner,), (motion.inner_rate,))[1]
        source, _ = self.channel.supply(parameters)
        waves = LineInstant(*self.split(motion.inner, parameters)[1:], source)
        powers = line_powers(self.line, waves, rate, motion.area[-1], parameters)
        return jnp.concatenate([self.channel.first_carried(own, parameters), powers, rate[None]])

    def step_books(self, step, parameters):
        inner, count = self.channel.inner, self.count + self.channel.inner

        def of_passage(at):
            return at._replace(
                inner=at.inner[:inner], held=at.held[:count], rate=at.rate[:count], carried=at.carried[:-4]
            )

        own, carried = self.channel.step_books(
            step._replace(old=of_passage(step.old), new=of_passage(step.new)), parameters
        )
        source, _ = self.channel.supply(parameters)
        ends = [LineInstant(*self.split(at.inner, parameters)[1:], source) for at in (step.old, step.new)]
        books, last = line_books(self.line, ends, step, step.new.area[-1], parameters)
        return jnp.concatenate([own, books]), jnp.concatenate([carried, last])

    def energies(self, area, inner, parameters):
        own, *waves = self.split(inner, parameters)
        line = line_energies(self.line, LineInstant(*waves), area[-1], parameters)
        return jnp.concatenate([self.channel.energies(area, own, parameters), line])

    def readings(self, area, inner, parameters):
        """Readings of a compressed fluid in the passage; see `GasChannel.readings`."""
        return self.channel.readings(area, inner[: self.channel.inner], parameters)
