"""Motions other than a valve's, for the stepper: a shell under pressure and equations with one unknown."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import scipy.sparse as sp

from dbvfiv.flow.stepping import Flow, FluidState
from dbvfiv.model.linear import CoupledFactor
from dbvfiv.model.preset import PressedShell
from dbvfiv.model.relaxing import WallRelaxation
from dbvfiv.shell import Shell, WallMemory

NONE = np.zeros(1)


class Drive:
    """A pressure in place of a fluid, and its step."""

    compressed = quiet_inward = False

    def __init__(self, inlet: float = 0.0):
        self.inlet = inlet

    def momenta(self, speed):
        return NONE

    def jets(self, at):
        return at.speed

    def state(self, flow) -> FluidState:
        return FluidState(*9 * (NONE,))


class Motion:
    """What the stepper asks of any motion without a fluid; the load is a force that the positions fix."""

    fluid = Drive()
    outside = None
    wall = None
    contact = None
    resolution = 0.0

    def __init__(self, size: int, alpha: float = 0.0, beta: float = 0.0):
        self.size, self.mu = size, SimpleNamespace(alpha=alpha, beta=beta, density=0.0)

    def begin_step(self, state, h, theta, rate, inlet):
        return Drive(inlet)

    def drop_factors(self):
        pass

    def momentum(self, q, v):
        return self.inertia(q, np.zeros_like(v), v)

    def load(self, q, v, q_new, v_new, step) -> Flow:
        return Flow(step.inlet, *6 * (NONE,), step=step, force=self.pressure_force(q, step.inlet))

    def pressure_force(self, q, pressure):
        return np.zeros(self.size)

    def force_rate(self, q, v):
        return (
            np.zeros(self.size)
            if not np.any(v)
            else (self.internal_force(q + 1e-6 * v) - self.internal_force(q - 1e-6 * v)) / 2e-6
        )

    def turn(self, dq):
        return 0.0

    def length(self, dq):
        return float(np.max(np.abs(dq)))


class PointMotion(Motion):
    """a + damping(q) v + force(q) = 0 with one unknown."""

    def __init__(self, force, stiffness, damping=lambda q: 0.0 * q, damping_slope=lambda q: 0.0 * q, beta: float = 0.0):
        super().__init__(1, beta=beta)
        self._force, self._stiffness, self._damping, self._slope = force, stiffness, damping, damping_slope

    def internal_force(self, q, step=None):
        return self._force(q)

    def inertia(self, q, v, a):
        return a + self._damping(q) * v

    def linearise(self, q_new, v_new, q, v, load, weights, q_load=None, v_load=None, step=None):
        now = weights.theta
        viscous = now * (weights.velocity * self._damping(q) + self._slope(q) * v)
        self._matrix = weights.inertia + viscous + weights.force * self._stiffness(q_new)

    def solve(self, force):
        return force / self._matrix

    def accelerations(self, q, v, inlet, inner=None, memory=None):
        load = self.load(q, v, q, v, Drive(inlet))
        return -self._force(q) - self.mu.beta * self._stiffness(q) * v - self._damping(q) * v, load


class ShellMotion(Motion):
    """A shell under one uniform follower pressure; its layers relax if they have a series."""

    def __init__(self, shell: Shell, alpha: float = 0.0, beta: float = 0.0):
        super().__init__(shell.size, alpha, beta)
        self.shell = shell
        branches = WallRelaxation.of(shell.section).branches(1.0)
        self.wall = WallMemory(shell, branches.strengths, branches.times) if branches else None
        pattern = shell.dofs.matrix(np.ones(len(shell.dofs.pattern[1])))
        self._factor = CoupledFactor(pattern, sp.csr_matrix((shell.size, 0)), sp.csr_matrix((0, shell.size)))
        self._pressed = PressedShell(shell, 1.0)

    def internal_force(self, q, step=None):
        return self.shell.force(q, step)

    def pressure_force(self, q, pressure):
        return self._pressed.pressure_force(self.shell.dofs.expand(q), pressure)

    def inertia(self, q, v, a):
        return self.shell.inertia(q, v, a)

    def _refactor(self, values):
        none = np.zeros(0)
        self._factor.refactor(values, none, none, np.zeros((0, 0)))

    def linearise(self, q_new, v_new, q, v, load, weights, q_load=None, v_load=None, step=None):
        shell = self.shell
        _, values = shell.force_and_tangent(q_new, step=step)
        values = weights.force * values + weights.inertia * shell.mass(q)
        pressure = weights.load * weights.theta * load.inlet
        self._refactor(self._pressed.follower_stiffness(shell.dofs.expand(q), pressure, values))

    def solve(self, force):
        return self._factor.solve(force)

    def accelerations(self, q, v, inlet, inner=None, memory=None):
        load = self.load(q, v, q, v, Drive(inlet))
        self._refactor(self.shell.mass(q))
        force = self.internal_force(q, None if memory is None else self.wall.held(memory))
        return self._factor.solve(load.force - force - self.inertia(q, v, 0 * v)), load

    def energy(self, q, v) -> float:
        """Kinetic and strain energy, J."""
        shell = self.shell
        return shell.kinetic_energy(q, v) + shell.energy(q)
