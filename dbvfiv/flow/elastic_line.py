"""A channel at the end of an elastic line: water hammer with friction (Wylie and Streeter 1993).

    du/dt + dh/dx + zeta u|u|/(2 L) = 0,      dh/dt + c^2 du/dx = 0,      0 < x < L

u is the velocity in the line, h its total pressure over the density, zeta = f L/D + K what the line loses in velocity
heads, spread evenly over its length. Convection of what the waves carry, of the order of u/c, is left out; with the
total pressure the momentum holds without it. At the far end h = P_0/rho + g^2/2 with g the velocity that the pressure
there is taken at: see `dbvfiv.flow.terms.line`. At the flange flow and total pressure are continuous.

With w = u A_line/A_in, which is the inlet velocity at the flange, and pi = h A_line/(A_in c) both equations carry the
same speed and the energy is rho A_line/2 (A_in/A_line)^2 (w^2 + pi^2) a length. Elements: `line_elements`.
"""

from __future__ import annotations

from typing import ClassVar

import jax.numpy as jnp
import numpy as np

from .channel import Channel
from .law import FlowLaw, FlowMotion, FlowParameter, Traceable
from .line_elements import DEGREE, chain, element
from .line_stepping import LineFluid
from .terms.line import Line
from .terms.pump import Pump

#: Wavelengths that an element of degree 4 resolves: frequencies of waves are then 1.5e-4 too high, measured.
RESOLVED = 0.5
#: Up to which frequency waves are resolved by default, Hz, and the most elements that are taken for it.
FREQUENCY, MOST = 200.0, 16


def default_elements(length: float, wave_speed: float) -> int:
    """Elements that resolve waves up to 200 Hz in a line, from 2 to 16."""
    return int(np.clip(np.ceil(FREQUENCY * length / (RESOLVED * wave_speed)), 2, MOST))


class ElasticLine(Traceable):
    """Waves in a line of equal elements.

    Parameters
    ----------
    line : Line
        Its length, section, losses and far end.
    wave_speed : float, m/s
    elements : int, optional
    pump : Pump, optional
        At the far end.
    """

    DATA = ("line", "wave_speed", "pump")
    STATIC = ("elements",)

    def __init__(self, line: Line, wave_speed: float, elements: int | None = None, pump: Pump | None = None):
        self.line, self.wave_speed, self.pump = line, float(wave_speed), pump
        self.elements = default_elements(line.length, wave_speed) if elements is None else int(elements)

    @property
    def size(self) -> int:
        """Number of the line's own unknowns: velocities but that at the flange, then pressures."""
        return 2 * DEGREE * self.elements

    @property
    def places(self) -> tuple[np.ndarray, np.ndarray]:
        """Where velocities and pressures are, from the far end (0) to the flange (1); the flange's velocity is last."""
        one, starts = element(), np.arange(self.elements)[:, None]
        nodes = np.append((starts + one.nodes[:-1]).ravel(), self.elements)
        return nodes / self.elements, (starts + one.points).ravel() / self.elements

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
        one, count = element(), self.elements
        diameter, ratio = self.line.section(inlet_area)
        length, speed = parameters["pipe_length"] / count, parameters["wave_speed"]
        lost = 0.5 * self.line.lost(diameter, parameters["pipe_length"]) * ratio**2 / count
        nodes = chain(count)
        w, w_rate = velocity[nodes], rate[nodes]
        at, flows = pressure.reshape(count, -1), w @ one.value.T
        local = ratio * (length * (w_rate @ one.mass.T) - speed * ((one.weights * at) @ one.slope))
        local = local + lost * ((one.weights * flows * jnp.abs(flows)) @ one.value)
        momentum = jnp.zeros_like(velocity).at[nodes].add(local)
        momentum = momentum.at[0].add(-self.far_head(velocity[0], inlet_area, parameters))
        stretched = length * pressure_rate.reshape(count, -1) + speed * (w @ one.slope.T)
        return momentum, (ratio * one.weights * stretched).ravel()

    def steady_pressure(self, velocity, inlet_area, parameters):
        """pi (k,) of the steady flow with an inlet velocity."""
        diameter, ratio = self.line.section(inlet_area)
        lost = 0.5 * self.line.lost(diameter, parameters["pipe_length"]) * ratio**2 * velocity * jnp.abs(velocity)
        head = self.far_head(velocity, inlet_area, parameters, steady=True) - lost * self.places[1]
        return head / (ratio * parameters["wave_speed"])


class LineChannel(FlowLaw):
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
        self.floor = channel.floor

    @property
    def count(self) -> int:
        return self.channel.count

    @property
    def inner(self) -> int:
        return 1 + self.line.size

    @property
    def terms(self):
        """Those of the rigid column."""
        return self.rigid.terms

    @property
    def back(self) -> float:
        """That of the channel."""
        return self.channel.back

    @property
    def level(self) -> float:
        """That of the channel."""
        return self.channel.level

    @property
    def static(self):
        """That of the channel."""
        return self.channel.static

    @property
    def storage(self) -> float:
        """Blend of the continuity laws."""
        return self.channel.storage

    @property
    def parameters(self) -> tuple[FlowParameter, ...]:
        own = FlowParameter("wave_speed", "m/s", "of the line in front", self.line.wave_speed)
        return (*self.rigid.parameters, own)

    def resolved(self, given) -> float:
        """Frequency up to which the elements resolve waves, Hz, under given parameters."""
        values = self.values({"inlet": 0.0, "density": 1.0} | dict(given))
        return RESOLVED * self.line.elements * values["wave_speed"] / values["pipe_length"]

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
        """That of the rigid column, with a uniform velocity in the line."""
        p, velocity = self.rigid.steady(area, parameters)
        k = self.line.size // 2
        pressure = self.line.steady_pressure(velocity[0], area[-1], parameters)
        return p, jnp.concatenate([velocity, jnp.full(k, velocity[0]), pressure])

    def stepping(self, density: float) -> LineFluid:
        return LineFluid(self.channel, density, self.line)
