"""A channel at the end of an elastic line: water hammer with friction (Wylie and Streeter 1993).

    du/dt + dh/dx + zeta u|u|/(2 L) = 0,      dh/dt + c^2 du/dx = 0,      0 < x < L

u is the velocity in the line, h its total pressure over the density, zeta = f L/D + K what the line loses in velocity
heads, spread evenly over its length. Convection of what the waves carry, of the order of u/c, is left out; with the
total pressure the momentum holds without it. At the far end h = P_0/rho + g^2/2 with g the velocity that the pressure
there is taken at: see `dbvfiv.flow.terms.line`. At the flange flow and total pressure are continuous.

With w = u A_line/A_in, which is the inlet velocity at the flange, and pi = h A_line/(A_in c) both equations carry the
same speed and the energy is rho A_line/2 (A_in/A_line)^2 (w^2 + pi^2) a length. Elements: `line_elements`.

Pipes in series meet with the same flow and the same total pressure: w is one function along all of them, and each has
its own pi. A rigid pipe among them is a length of no extent, whose inertance and loss stand at the node between its
neighbours.

Equation (T.13) of docs/theory.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np

from .channel import AroundChannel, Channel
from .law import FlowMotion, FlowParameter, Traceable
from .line_elements import DEGREE, chain, element
from .line_stepping import LineFluid
from .terms.line import Line, PiecedLine
from .terms.pump import Pump

#: Wavelengths that an element of degree 4 resolves: frequencies of waves are then 1.5e-4 too high, measured.
RESOLVED = 0.5
#: Up to which frequency waves are resolved by default, Hz, and the most elements that are taken for it.
FREQUENCY, MOST = 200.0, 16


def default_elements(length: float, wave_speed: float) -> int:
    """Elements that resolve waves up to 200 Hz in a line, from 2 to 16."""
    return int(np.clip(np.ceil(FREQUENCY * length / (RESOLVED * wave_speed)), 2, MOST))


class Segments(NamedTuple):
    """The elements of a line from the far end to the flange, and what stands at its nodes.

    Attributes
    ----------
    length, ratio, speed, lost : (e,) arrays
        Of each element: length, m; area of the inlet over its own; wave speed, m/s; what it loses of w|w|.
    inertance, loss : (k + 1,) arrays
        Of rigid pipes at the nodes: length times ratio, m; what they lose of w|w|.
    """

    length: Any
    ratio: Any
    speed: Any
    lost: Any
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

    def far_head(self, velocity, inlet_area, parameters, steady: bool = False):
        """Total pressure at the far end over the density, m2/s2, from the velocity there referred to the flange."""
        speed = self.line.section(inlet_area)[1] * velocity
        gained = jnp.minimum(speed, 0.0) if self.line.reservoir else speed
        head = parameters["inlet"] / parameters["density"] + 0.5 * gained**2
        if self.pump is None or steady:
            return head
        return head + self.pump.gain(velocity, inlet_area, parameters)

    def equations(self, velocity, rate, pressure, pressure_rate, inlet_area, parameters):
        """Momentum but for the flange's pressure, m2/s2, at all nodes; continuity, m2/s2, at the points; traceable.

        Parameters
        ----------
        velocity, rate : (k + 1,) arrays
            w and its rate, that of the flange last.
        pressure, pressure_rate : (k,) arrays
            pi and its rate, m/s and m/s2.
        """
        one, nodes, segments = element(), chain(self.elements), self.segments(inlet_area, parameters)
        length, ratio, speed, lost = (column[:, None] for column in segments[:4])
        w, w_rate = velocity[nodes], rate[nodes]
        at, flows = pressure.reshape(self.elements, -1), w @ one.value.T
        local = ratio * (length * (w_rate @ one.mass.T) - speed * ((one.weights * at) @ one.slope))
        local = local + lost * ((one.weights * flows * jnp.abs(flows)) @ one.value)
        momentum = (segments.inertance * rate + segments.loss * velocity * jnp.abs(velocity)).at[nodes].add(local)
        momentum = momentum.at[0].add(-self.far_head(velocity[0], inlet_area, parameters))
        stretched = length * pressure_rate.reshape(self.elements, -1) + speed * (w @ one.slope.T)
        return momentum, (ratio * one.weights * stretched).ravel()

    def steady_pressure(self, velocity, inlet_area, parameters):
        """pi (k,) of the steady flow with an inlet velocity."""
        segments = self.segments(inlet_area, parameters)
        lost = segments.lost_before[:, None] + segments.lost[:, None] * element().points
        head = self.far_head(velocity, inlet_area, parameters, steady=True) - lost * velocity * jnp.abs(velocity)
        return (head / (segments.ratio * segments.speed)[:, None]).ravel()


class LineChannel(AroundChannel):
    """A channel behind an elastic line.

    Its unknowns are the inlet velocity, the velocities in the line from the far end and the pressures in it, each as
    `ElasticLine` has them.

    Parameters
    ----------
    channel : Channel
        Without the line.
    rigid : Channel
        With its rigid column, which has the same steady flow.
    line : ElasticLine
    """

    DATA = ("channel", "rigid", "line", "floor")
    inner_names: ClassVar[tuple[str, ...]] = ("inlet velocity", "velocities in the line", "pressures in the line")

    def __init__(self, channel: Channel, rigid: Channel, line: ElasticLine):
        self.channel, self.rigid, self.line = channel, rigid, line
        self.floor, self.density = channel.floor, channel.density

    @property
    def inner(self) -> int:
        return 1 + self.line.size

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
        return min(RESOLVED * n * faster * speed / (stretch * part.length) for n, speed, part in pipes)

    def split(self, inner):
        """Velocities (k + 1,), that of the flange last, and pressures (k,) of the line from the law's unknowns."""
        k = self.line.size // 2
        velocity = jnp.concatenate([inner[1 : k + 1], inner[:1]])
        return velocity, inner[k + 1 :]

    def equations(self, motion: FlowMotion, parameters):
        (velocity, pressure), (rate, pressure_rate) = self.split(motion.inner), self.split(motion.inner_rate)
        momentum, continuity = self.line.equations(velocity, rate, pressure, pressure_rate, motion.area[-1], parameters)
        density, inlet = parameters["density"], motion.inner[0]
        static = density * (-momentum[-1] - 0.5 * inlet**2)
        own = motion._replace(inner=motion.inner[:1], inner_rate=motion.inner_rate[:1])
        p, outlet = self.channel.equations(own, parameters | {"inlet": static})
        return p, jnp.concatenate([outlet, density * momentum[:-1], density * continuity])

    def steady(self, area, parameters):
        """Steady flow of the rigid column of fluid, with a uniform velocity in the line."""
        p, velocity = self.rigid.steady(area, parameters)
        k = self.line.size // 2
        pressure = self.line.steady_pressure(velocity[0], area[-1], parameters)
        return p, jnp.concatenate([velocity, jnp.full(k, velocity[0]), pressure])

    def stepping(self, density: float) -> LineFluid:
        return LineFluid(self.channel, density, self.line)
