"""An elastic line by itself: its one station's "area" is the velocity that is given at the flange."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np

from dbvfiv.flow import FlowLaw, FlowParameter
from dbvfiv.flow.elastic_line import ElasticLine
from dbvfiv.flow.energy import LINE_BOOKS, LineInstant, line_books, line_energies, line_powers
from dbvfiv.flow.stepping import MovingFluid


class Waves(FlowLaw):
    """Unknowns: velocities but that at the flange, and pressures; the "pressure" is the total one at the flange."""

    DATA = ("line", "inlet_area")
    count, book_names, energy_names = 1, LINE_BOOKS, ("kinetic", "elastic")

    def __init__(self, line: ElasticLine, inlet_area: float):
        self.line, self.inlet_area = line, float(inlet_area)

    @property
    def inner(self):
        return self.line.size

    @property
    def parameters(self):
        given = {"inlet": 0.0, "density": 1.0, "pipe_length": self.line.line.length, "wave_speed": self.line.wave_speed}
        return tuple(FlowParameter(name, "", "", value) for name, value in given.items())

    def _at(self, area, inner, parameters):
        velocity, pressure = jnp.split(inner, 2)
        source = parameters["inlet"] / parameters["density"]
        return LineInstant(jnp.append(velocity, area[-1]), pressure, source)

    def held(self, area, area_rate, inner, parameters):
        at = self._at(area, inner, parameters)
        momentum, stored = self.line.held(at.velocity, at.pressure, self.inlet_area, parameters)
        return jnp.concatenate([-momentum[-1:], momentum[:-1], stored])

    def sources(self, area, area_rate, inner, parameters):
        momentum, stretch = self.line.sources(*self._at(area, inner, parameters), self.inlet_area, parameters)
        return jnp.concatenate([-momentum[-1:], momentum[:-1], stretch])

    def scales(self, area, parameters):
        return jnp.full(1 + self.inner, parameters["density"])

    def first_carried(self, motion, parameters):
        k = self.inner // 2
        rates = jnp.append(motion.inner_rate[:k], motion.area_rate), motion.inner_rate[k:]
        rate = self.line.held(*rates, self.inlet_area, parameters)[0][-1]
        at = self._at(motion.area, motion.inner, parameters)
        return jnp.append(line_powers(self.line, at, rate, self.inlet_area, parameters), rate)

    def step_books(self, step, parameters):
        ends = [self._at(at.area, at.inner, parameters) for at in (step.old, step.new)]
        return line_books(self.line, ends, step, self.inlet_area, parameters)

    def energies(self, area, inner, parameters):
        return line_energies(self.line, self._at(area, inner, parameters), self.inlet_area, parameters)

    def steady_inner(self, area, given):
        """Unknowns of the steady flow of the velocity at the flange."""
        values = self.values(given)
        source = values["inlet"] / values["density"]
        pressure = self.line.steady_pressure(area[-1], source, self.inlet_area, values)
        return np.append(np.full(len(pressure), area[-1]), pressure)


def march(waves: MovingFluid, flange, step: float, count: int, inlet: float, inner=None, theta=0.5, rate=1.0):
    """Total pressures at the flange, Pa, where the steps meet their equations, and states; the velocity there is
    `flange(t)`, its rate at the start by a difference.
    """
    at = lambda t: (np.array([flange(t)]), np.zeros(1))  # noqa: E731
    first = at(0.0)[0], (at(1e-6)[0] - at(0.0)[0]) / 1e-6
    inner = waves.law.steady_inner(first[0], {"inlet": inlet, "density": waves.density}) if inner is None else inner
    states, pressures = [waves.moving(first, np.zeros(1), inner, inlet)], []
    for i in range(count):
        old, new = at(i * step), at((i + 1) * step)
        mid = (old[0] + theta * (new[0] - old[0]), np.zeros(1))
        flow = waves.step(states[-1], old, step, theta, rate, inlet).at(mid, new)
        pressures.append(flow.pressure[0])
        states.append(flow.state())
    return np.array(pressures), states


def unbalanced(waves: MovingFluid, states) -> float:
    """Largest energy that is in none of the books, over the largest that the line holds."""
    held = np.array([sum(waves.energies(s.area, s.inner).values()) for s in states])
    books = np.array([s.books for s in states])
    return np.abs(held - held[0] - (books[:, 0] - books[:, 1:].sum(axis=1))).max() / held.max()
