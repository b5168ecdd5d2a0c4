"""Quantities computed at every step: rows of `dbvfiv.studies.transient.keeping.HISTORY`."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...flow.gas_stepping import BOOKS, GasState
from ...flow.line_stepping import LineState
from ...model.state import LipCentre
from ...motion.equations import ValveMotion
from ...motion.stepper import StepResult


class Reader:
    """Makes rows of the history of one run and keeps the books of energy.

    Parameters
    ----------
    motion : ValveMotion
    energy : float
        Energy at the start, J of the part.
    work, dissipation, contact_loss, numerical_loss : float
        What went in and out since, J of the part.
    """

    def __init__(
        self,
        motion: ValveMotion,
        energy: float,
        work: float = 0.0,
        dissipation: float = 0.0,
        contact_loss: float = 0.0,
        numerical_loss: float = 0.0,
    ):
        self.motion, self.energy, self.work, self.dissipation = motion, energy, work, dissipation
        self.contact_loss, self.numerical_loss = contact_loss, numerical_loss
        model = motion.model
        index = model.shell.dofs.index
        self._copies = model.mesh.part.copies
        self._lip = LipCentre(model.mesh, model.shell)
        centre = index[model.mesh.centre_line, 1]
        self._centre, self._moves = np.maximum(centre, 0), centre >= 0
        self._inlet_area = float(model.mesh.rest_area[-1] - model.mesh.wall_deduction[-1])

    def first(self, state, inlet: float) -> dict[str, Any]:
        """Row of the start."""
        motion = self.motion
        load = motion.load(state.q, state.v, state.q, state.v, motion.instant(state, inlet), state.speed)
        return self._row(state, load, 0.0, 0)

    def row(self, result: StepResult, h: float) -> dict[str, Any]:
        """Row of a step."""
        self.work += result.work
        self.dissipation += result.dissipation
        self.contact_loss += result.contact_loss
        self.numerical_loss += result.numerical_loss
        return self._row(result.state, result.load, h, result.residuals)

    def _row(self, state, load, h: float, evaluations: int) -> dict[str, Any]:
        motion, model = self.motion, self.motion.model
        kinetic, strain, stop = motion.energies(state.q, state.v)
        density = motion.mu.density
        area = load.area
        throat = int(np.argmin(area))
        out = density * load.speed[0] * float(self.motion.model.flow.open_area(area[0]))
        outside = motion.outside_energy(state.q, state.v)
        weight = model.weight_energy(state.q)
        renewed = 0.0 if motion.outside is None else motion.outside.renewed
        stored = kinetic + outside + strain + stop + weight
        lost = self.dissipation + self.contact_loss + self.numerical_loss
        balance = stored - self.energy - self.work + lost - renewed
        memory, by_group = state.memory, {}
        if memory is not None:
            balance += memory.work.sum()
            by_group = {"branch_energy": self._copies * memory.stored, "branch_loss": self._copies * memory.loss}
        if state.line is not None:
            by_group |= self._of_line(state.line)
        entered = density * load.speed[-1] * self._inlet_area
        if state.gas is not None:
            out, entered, fastest = motion.fluid.readings(area, state.gas.inner)
            by_group |= self._of_gas(load, state.gas) | {"mach": fastest}
        if model.contact is not None:
            by_group |= self._of_faces(state.q)
        return by_group | {
            "time": state.time,
            "inlet_pressure": load.inlet,
            "mass_flow": self._copies * out,
            "inlet_mass_flow": self._copies * entered,
            "outlet_area": self._copies * area[0],
            "smallest_area": self._copies * area[throat],
            "throat": float(model.mesh.z[throat]),
            "inlet_velocity": load.speed[-1],
            "outlet_velocity": load.speed[0],
            "lip_opening": self._lip.opening(state.q),
            "lip_displacement": self._lip.displacement(state.q),
            "lip_velocity": self._lip.displacement(state.v),
            "stops": model.touching(state.q),
            "kinetic_energy": self._copies * kinetic,
            "outside_energy": self._copies * outside,
            "outside_renewed": self._copies * renewed,
            "strain_energy": self._copies * strain,
            "stop_energy": self._copies * stop,
            "weight_energy": self._copies * weight,
            "pressure_work": self._copies * self.work,
            "dissipation": self._copies * self.dissipation,
            "numerical_loss": self._copies * self.numerical_loss,
            "balance": self._copies * balance,
            "step": h,
            "evaluations": evaluations,
            "station_pressure": load.pressure,
            "station_area": area,
            "centre_line": np.where(self._moves, state.q[self._centre], 0.0),
        }

    def _of_gas(self, load, gas: GasState) -> dict[str, float]:
        kept = {f"gas_{name}": self._copies * float(value) for name, value in zip(BOOKS, gas.books, strict=True)}
        return kept | {"gas_energy": self._copies * self.motion.fluid.energy(load.area, gas.inner)}

    def _of_faces(self, q: np.ndarray) -> dict[str, Any]:
        contact = self.motion.model.contact.state(q)
        return {
            "contact_loss": self._copies * self.contact_loss,
            "contact_force": self.motion.model.mesh.part.walls * contact.total,
            "penetration": contact.penetration,
        }

    def _of_line(self, line: LineState) -> dict[str, Any]:
        kinetic, elastic = self.motion.waves.energies(line)
        supply, lost, work = self._copies * line.books
        return {
            "line_kinetic_energy": self._copies * kinetic,
            "line_elastic_energy": self._copies * elastic,
            "line_supply": supply,
            "line_dissipation": lost,
            "line_work": work,
        }
