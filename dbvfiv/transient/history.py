"""What is read off every step."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..model.lip import LipCentre
from ..model.valve import QUARTERS
from ..record.layout import Column
from .equations import Step, ValveMotion
from .stepper import StepResult

#: One number a step; of the whole valve.
SCALARS = (
    Column("time", "s", "Time"),
    Column("inlet_pressure", "Pa", "Static pressure at the flange"),
    Column("mass_flow", "kg/s", "Mass flow leaving at the lip"),
    Column("inlet_mass_flow", "kg/s", "Mass flow entering at the flange"),
    Column("outlet_area", "m^2", "Flow area at the lip; below zero where the lips cross"),
    Column("smallest_area", "m^2", "Smallest flow area of all rows"),
    Column("throat", "m", "Axial position of the smallest area, from the lip"),
    Column("inlet_velocity", "m/s", "Velocity at the flange"),
    Column("outlet_velocity", "m/s", "Jet velocity at the lip"),
    Column("lip_opening", "m", "Full clear opening between the inner faces of both lips at x = z = 0"),
    Column("lip_displacement", "m", "Displacement in y of the mid-surface of one lip at x = z = 0"),
    Column("lip_velocity", "m/s", "Rate of the lip displacement"),
    Column("stops", "", "Lip stops in contact, of a quarter"),
    Column("kinetic_energy", "J", "Kinetic energy of the wall"),
    Column("strain_energy", "J", "Strain energy of the wall"),
    Column("stop_energy", "J", "Energy of the lip stops"),
    Column("pressure_work", "J", "Work of the pressure on the wall since the start"),
    Column("dissipation", "J", "Energy lost to Rayleigh damping since the start"),
    Column(
        "balance", "J", "Energy gained since the start less work plus dissipation: what the scheme itself adds or takes"
    ),
    Column("step", "s", "Length of the step"),
    Column("evaluations", "", "Residuals evaluated in the step"),
)
#: One number a row of the mesh and step; of a quarter.
PROFILES = (
    Column(
        "station_pressure",
        "Pa",
        (
            "Pressure at each row, lip first, where the step meets the equations: halfway through it without "
            "numerical damping"
        ),
        "f4",
    ),
    Column("station_area", "m^2", "Flow area at each row", "f4"),
    Column("centre_line", "m", "Displacement in y of the line x = 0 at each row", "f4"),
)


class Reader:
    """Makes rows of the history of one run and keeps the books of energy.

    Parameters
    ----------
    motion : ValveMotion
    energy : float
        Energy at the start, J of a quarter.
    """

    def __init__(self, motion: ValveMotion, energy: float, work: float = 0.0, dissipation: float = 0.0):
        self.motion, self.energy, self.work, self.dissipation = motion, energy, work, dissipation
        model = motion.model
        index = model.shell.dofs.index
        self._lip = LipCentre(model.mesh, model.shell)
        centre = index[model.mesh.rows[:, 0], 1]
        self._centre, self._moves = np.maximum(centre, 0), centre >= 0
        self._inlet_area = float(model.mesh.rest_area[-1] - model.mesh.wall_deduction[-1])

    def first(self, state, inlet: float) -> dict[str, Any]:
        """Row of the start."""
        motion = self.motion
        load = motion.load(
            state.q, state.v, state.q, state.v, Step(1.0, state.speed, 0.0, state.psi_rate, inlet), state.speed
        )
        return self._row(state, load, 0.0, 0)

    def row(self, result: StepResult, h: float) -> dict[str, Any]:
        """Row of a step."""
        self.work += result.work
        self.dissipation += result.dissipation
        return self._row(result.state, result.load, h, result.residuals)

    def _row(self, state, load, h: float, evaluations: int) -> dict[str, Any]:
        motion, model = self.motion, self.motion.model
        kinetic, strain, stop = motion.energies(state.q, state.v)
        density = motion.conditions.density
        area = load.area
        throat = int(np.argmin(area))
        out = density * load.speed[0] * float(self.motion.model.flow.open_area(area[0]))
        balance = kinetic + strain + stop - self.energy - self.work + self.dissipation
        return {
            "time": state.time,
            "inlet_pressure": load.inlet,
            "mass_flow": QUARTERS * out,
            "inlet_mass_flow": QUARTERS * density * load.speed[-1] * self._inlet_area,
            "outlet_area": QUARTERS * area[0],
            "smallest_area": QUARTERS * area[throat],
            "throat": float(model.mesh.z[throat]),
            "inlet_velocity": load.speed[-1],
            "outlet_velocity": load.speed[0],
            "lip_opening": self._lip.opening(state.q),
            "lip_displacement": self._lip.displacement(state.q),
            "lip_velocity": self._lip.displacement(state.v),
            "stops": model.stops.touching(state.q),
            "kinetic_energy": QUARTERS * kinetic,
            "strain_energy": QUARTERS * strain,
            "stop_energy": QUARTERS * stop,
            "pressure_work": QUARTERS * self.work,
            "dissipation": QUARTERS * self.dissipation,
            "balance": QUARTERS * balance,
            "step": h,
            "evaluations": evaluations,
            "station_pressure": load.pressure,
            "station_area": area,
            "centre_line": np.where(self._moves, state.q[self._centre], 0.0),
        }


class History:
    """Rows in memory, one growing array for each column."""

    def __init__(self, stations: int):
        self._columns = {c.name: np.empty((1024,), c.dtype) for c in SCALARS}
        self._columns |= {c.name: np.empty((1024, stations), c.dtype) for c in PROFILES}
        self.rows = 0

    def append(self, row: dict[str, Any]) -> None:
        if self.rows == len(self._columns["time"]):
            for name, values in self._columns.items():
                self._columns[name] = np.concatenate([values, np.empty_like(values)])
        for name, values in self._columns.items():
            values[self.rows] = row[name]
        self.rows += 1

    def __getitem__(self, name: str) -> np.ndarray:
        return self._columns[name][: self.rows]

    def since(self, row: int) -> dict[str, np.ndarray]:
        """All columns from a row on."""
        return {name: values[row : self.rows] for name, values in self._columns.items()}

    def restore(self, columns: dict[str, np.ndarray]) -> None:
        """Take over the rows of an earlier run."""
        self.rows = len(columns["time"])
        for name in self._columns:
            kept = columns[name].astype(self._columns[name].dtype)
            self._columns[name] = (
                np.concatenate([kept, np.empty_like(kept[:1].repeat(1024, axis=0))])
                if len(kept)
                else self._columns[name]
            )
