"""One steady state of the valve and what a user reads off it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..case.quantity import GRAVITY, head_of
from ..errors import SolveError
from .hydraulics import Hydraulics, hydraulics_of
from .lip import LipCentre
from .valve import QUARTERS, ValveModel


@dataclass(frozen=True)
class SteadyState:
    """An equilibrium; flow and areas are those of the whole valve, station data those of a quarter. Pressures are
    static ones, over that of the surroundings.

    Attributes
    ----------
    pressure : float, Pa
        At the flange; with a line in front at its far end, in the reservoir or static; of a uniform load, on the wall.
    head : float, m
        The same as a head of the fluid.
    flange_pressure : float, Pa
        At the flange, whatever is in front of it.
    line_loss : float, m
        Head lost in a line in front; 0 without one.
    q : (n,) array
        Free displacements (m) and rotations (rad).
    nodal : (nn, 5) array
        Displacements and rotations of all nodes.
    mass_flow : float, kg/s
    volume_flow : float, m3/s
    outlet_area : float, m2
    outlet_velocity : float, m/s
    max_displacement : float, m
    max_displacement_position : (3,) tuple, m
        Where it occurs, on the mid-surface at rest.
    lip_opening : float, m
        Full clear opening between the inner faces of both lips at x = z = 0; never below zero, see
        `dbvfiv.model.lip.LipCentre.opening`.
    lip_displacement : float, m
        Displacement in y of the mid-surface of one lip there.
    station_area, station_velocity, station_pressure : (m,) arrays, m2 (a quarter), m/s, Pa
    stops : int
        Lip stops in contact.
    converged : bool
    iterations : int
        Newton iterations over all load steps that led here.
    load_steps : int
    residual : float
        Unbalanced force over pressure force.
    rounding : float
        Relative residual that rounding alone explains.
    reason : str
    """

    pressure: float
    head: float
    flange_pressure: float
    line_loss: float
    q: np.ndarray
    nodal: np.ndarray
    mass_flow: float
    volume_flow: float
    outlet_area: float
    outlet_velocity: float
    max_displacement: float
    max_displacement_position: tuple[float, float, float]
    lip_opening: float
    lip_displacement: float
    station_area: np.ndarray
    station_velocity: np.ndarray
    station_pressure: np.ndarray
    stops: int
    converged: bool
    iterations: int
    load_steps: int
    residual: float
    rounding: float
    reason: str

    @property
    def hydraulics(self) -> Hydraulics | None:
        """Heads, loss and coefficients; None where nothing flows."""
        if not self.volume_flow > 0:
            return None
        density = self.mass_flow / self.volume_flow
        velocity = float(self.station_velocity[-1])
        return hydraulics_of(self.flange_pressure, density, self.volume_flow, velocity, self.line_loss)


def describe_state(model: ValveModel, q: np.ndarray, pressure: float, **solution) -> SteadyState:
    """Steady state of a model from its unknowns; `solution` holds the fields from `converged` to `reason`.

    Raises
    ------
    SolveError
        If no finite steady flow belongs to the state: the lip is as wide as the flange.
    """
    nodal = model.nodal(q)
    area = model.rows.areas(nodal)
    density = model.case.fluid.density
    velocity = model.flow.inlet_velocity(area, pressure, density)
    if not np.isfinite(velocity):
        raise SolveError(
            f"At {pressure:.6g} Pa no finite steady flow belongs to the equilibrium: its passage at the lips, "
            f"{1e4 * QUARTERS * area[0]:.4g} cm2, is not smaller than that of the flange, "
            f"{1e4 * QUARTERS * area[-1]:.4g} cm2, so no pressure would be left to hold the fluid back."
        )
    speeds = model.flow.velocities(area, velocity)
    displacement = np.linalg.norm(nodal[:, :3], axis=1)
    where = int(np.argmax(displacement))
    lip = LipCentre(model.mesh, model.shell)
    mass_flow = model.mass_flow(area, pressure)
    station_pressure = model.flow.steady_pressure(area, pressure)
    line = model.line
    return SteadyState(
        pressure=float(pressure),
        head=head_of(pressure, density),
        flange_pressure=float(pressure if line is None else station_pressure[-1]),
        line_loss=0.0 if line is None else line.lost_head(float(area[-1]), velocity) / GRAVITY,
        q=np.asarray(q),
        nodal=nodal,
        mass_flow=mass_flow,
        volume_flow=mass_flow / density,
        outlet_area=float(QUARTERS * area[0]),
        outlet_velocity=float(speeds[0]),
        max_displacement=float(displacement[where]),
        max_displacement_position=tuple(float(value) for value in model.mesh.nodes[where]),
        lip_opening=lip.opening(q),
        lip_displacement=lip.displacement(q),
        station_area=area,
        station_velocity=speeds,
        station_pressure=station_pressure,
        stops=model.stops.touching(q),
        **solution,
    )
