"""The coupled equations of motion as a time step sees them: residual at a weighted instant and its iteration matrix.

    M(q) a + h(q, v) + alpha M v + beta w + F - G(q) p = 0,     p_outlet = 0

F is the internal force of shell and stops and w its rate, both treated as unknowns of first order, so that stiffness damping beta K_s(q) v = beta dF/dt is
consistent with the tangent without an evaluation of it.
"""
from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..flow import Channel
from ..model import ValveModel
from ..model.dynamics import Conditions
from ..model.linear import CoupledFactor
from .kernels import inertia_force, kinetic_energy, strain_energy


@dataclass(frozen=True)
class Weights:
    """Derivatives of what enters the equations at the weighted instant with respect to the new unknowns.

    Attributes
    ----------
    position, velocity, acceleration : float
        Of q, v and a with respect to the new q: -, 1/s, 1/s2.
    force : float
        Of F + beta w with respect to the new F.
    speed, speed_rate : float
        Of U and its rate with respect to the new U: -, 1/s.
    """

    position: float
    velocity: float
    acceleration: float
    force: float
    speed: float
    speed_rate: float


@dataclass
class Weighted:
    """Forces at the weighted instant.

    Attributes
    ----------
    inertia : (n,) array
        M a + h.
    damping : (n,) array
        alpha M v.
    load : (n,) array
        G p.
    outlet : float
        Pressure at the outlet, Pa, to vanish; zero if U is no unknown.
    pressure, area : (m,) arrays
    speed : float
        Inlet velocity that goes with them, m/s.
    """

    inertia: np.ndarray
    damping: np.ndarray
    load: np.ndarray
    outlet: float
    pressure: np.ndarray
    area: np.ndarray
    speed: float


class ValveMotion:
    """The equations of a `ValveModel`.

    Parameters
    ----------
    model : ValveModel
    conditions : Conditions, optional
        Density and damping; those of the model's case by default.
    """

    def __init__(self, model: ValveModel, conditions: Conditions | None = None):
        self.model = model
        self.conditions = Conditions.of(model.case) if conditions is None else conditions
        self.moving_fluid = isinstance(model.flow, Channel) and model.flow.unsteady
        self.size = model.size
        shell = model.shell
        self._quads = shell.mesh.quads
        self._integrals = shell._integrals
        self._factor: CoupledFactor | None = None
        free = shell.dofs.free
        scale = np.ones(free.shape)
        scale[:, 3:] = 0.5 * float(np.mean(shell.geometry.thickness))
        self._scale = scale[free]

    # -- forces ---------------------------------------------------------------------------------------------------------------------

    def internal_force(self, q: np.ndarray) -> np.ndarray:
        """Force (n,) of shell and stops."""
        force = self.model.shell.force(q)
        force[self.model.stops.unknowns] += self.model.stops.force(q)
        return force

    def force_rate(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Rate (n,) of the internal force: K_s(q) v."""
        if not np.any(v):
            return np.zeros(self.size)
        return self.model.shell.dofs.matrix(self.model.structure(q)[1]) @ v

    def weighted(self, q, v, a, speed: float, speed_rate: float, inlet: float) -> Weighted:
        """Forces at positions, velocities, accelerations (n,), inlet velocity and its rate, for an inlet pressure, Pa."""
        model, alpha, density = self.model, self.conditions.alpha, self.conditions.density
        nodal, nodal_rate = model.nodal(q), model.nodal(v)
        inertia, damping = self._inertia(nodal, nodal_rate, model.nodal(a))
        area = model.rows.areas(nodal)
        outlet = 0.0
        if self.moving_fluid:
            area_rate = model.rows.second(self._position(nodal), nodal_rate)
            area_acceleration = model.rows.second(self._position(nodal), model.nodal(a)) + model.rows.second(nodal_rate, nodal_rate)
            p = model.flow.pressure(area, area_rate, area_acceleration, speed, speed_rate, inlet, density).copy()
            outlet = float(p[0])
            p[0] = 0.0
        else:
            p = model.flow.steady_pressure(area, inlet)
            speed = model.flow.inlet_velocity(area, inlet, density) if inlet > 0 else 0.0
        load = model.pressure_force(nodal, p)
        return Weighted(inertia, alpha * damping if alpha else np.zeros_like(load), load, outlet, p, area, speed)

    def _position(self, nodal):
        """Deformed positions as a nodal field: the areas are quadratic in it, so their rate is its second derivative form."""
        out = nodal.copy()
        out[:, :3] += self.model.shell.mesh.nodes
        return out

    def _inertia(self, nodal, rate, acceleration):
        _, d1, d2 = self.model.shell.directors(nodal)
        inertia = np.zeros_like(nodal)
        inertia_force(self._quads, self._integrals, d1, d2, rate, acceleration, inertia)
        damping = None
        if self.conditions.alpha:
            damping = np.zeros_like(nodal)
            inertia_force(self._quads, self._integrals, d1, np.zeros_like(d2), np.zeros_like(rate), rate, damping)
            damping = self.model.shell.dofs.restrict(damping)
        return self.model.shell.dofs.restrict(inertia), damping

    def length(self, dq: np.ndarray) -> float:
        """Largest displacement in a change (n,) of the unknowns, m; rotations count by the path of the wall's face."""
        return float(np.max(np.abs(dq * self._scale)))

    # -- linear algebra -------------------------------------------------------------------------------------------------------------

    def linearise(self, q_new, q, v, a, speed: float, speed_rate: float, inlet: float, weights: Weights) -> None:
        """Factor the iteration matrix at the new positions and the weighted state.

        Raises
        ------
        SingularMatrix
        """
        model = self.model
        nodal = model.nodal(q)
        found = self.weighted(q, v, a, speed, speed_rate, inlet)
        _, structure = model.structure(q_new)
        values = weights.force * structure
        mass = weights.acceleration + self.conditions.alpha * weights.velocity
        if mass:
            values += mass * model.mass(q)
        values = model.follower_stiffness(nodal, weights.position * found.pressure, values)
        forces = model.station_forces(nodal).data
        slope = model.rows.jacobian(nodal).data
        if not self.moving_fluid:
            _, gradient = model.flow.steady_operator(found.area, inlet)
            self._solver(0).refactor(values, forces, slope, weights.position * gradient)
            return
        rate, acceleration = self._area_rates(nodal, model.nodal(v), model.nodal(a))
        parts = model.flow.operators(found.area, inlet, self.conditions.density, rate, acceleration, speed, speed_rate)
        by_area = weights.position * parts.area0 + weights.velocity * parts.area1 + weights.acceleration * parts.area2
        by_speed = weights.speed * parts.velocity0 + weights.speed_rate * parts.velocity1
        row, corner = by_area[0].copy(), by_speed[0]
        by_area, by_speed = by_area.copy(), by_speed.copy()
        by_area[0], by_speed[0] = 0.0, 0.0
        self._solver(1).refactor(values, forces, slope, by_area, by_speed, row, corner)

    def _area_rates(self, nodal, rate, acceleration):
        rows = self.model.rows
        x = self._position(nodal)
        return rows.second(x, rate), rows.second(x, acceleration) + rows.second(rate, rate)

    def solve(self, force: np.ndarray, outlet: float) -> tuple[np.ndarray, float]:
        """Changes of q (n,) and U that the last factored matrix gives for a force (n,) and an outlet pressure."""
        dq, du = self._factor.solve_with_inner(force, np.array([outlet]) if self.moving_fluid else np.zeros(0))
        return dq, float(du[0]) if self.moving_fluid else 0.0

    @property
    def factorisations(self) -> int:
        return 0 if self._factor is None else self._factor.factorisations

    def _solver(self, inner: int) -> CoupledFactor:
        if self._factor is None:
            model = self.model
            rest = model.nodal(model.rest())
            pattern = model.shell.dofs.matrix(np.ones(len(model.shell.dofs.pattern[1])))
            self._factor = CoupledFactor(pattern, model.station_forces(rest), model.rows.jacobian(rest), inner)
        return self._factor

    # -- energies -------------------------------------------------------------------------------------------------------------------

    def energies(self, q: np.ndarray, v: np.ndarray) -> tuple[float, float, float]:
        """Kinetic, strain and stop energy of the quarter model, J."""
        shell = self.model.shell
        nodal = self.model.nodal(q)
        d, d1, _ = shell.directors(nodal)
        kinetic = kinetic_energy(self._quads, self._integrals, d1, self.model.nodal(v))
        if shell.metric == "first-order":
            strain = strain_energy(self._quads, shell.mesh.nodes, nodal, d, *shell._reference, *shell._wall)
        else:
            strain = shell.energy(q)
        return float(kinetic), float(strain), self.model.stops.energy(q)
