"""One steady state of the valve and what a user reads off it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..case.quantity import GRAVITY, head_of
from ..errors import SolveError
from .hydraulics import Behind, Hydraulics, hydraulics_of
from .lip import LipCentre
from .valve import ValveModel


@dataclass(frozen=True)
class SteadyState:
    """An equilibrium; flow and areas are those of the whole valve, station data those of the part that is computed.
    Pressures are static ones, over that of the surroundings.

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
    outlet_pressure : float, Pa
        Around the jet and on the outer side of the wall, over that of the surroundings.
    recovered_pressure : float, Pa
        By which it rises where the jet has widened to a pipe behind the valve; 0 without one.
    downstream_velocity : float, m/s
        In that pipe; 0 without one.
    tail_loss : float, m
        Head lost in that pipe.
    level_pressure : float, Pa
        Weight of the fluid between flange and lips where these are higher, negative where they are lower; heads are
        referred to the level of the lips.
    q : (n,) array
        Free displacements (m) and rotations (rad).
    nodal : (nn, c) array
        Displacements and rotations of all nodes, c = 5.
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
    station_area, station_velocity, station_pressure : (m,) arrays, m2 (of the part), m/s, Pa
        Pressures as the wall sees them, over `outlet_pressure`.
    stops : int
        Lip stops in contact, or nodes whose inner face is.
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
    outlet_pressure: float
    recovered_pressure: float
    downstream_velocity: float
    tail_loss: float
    level_pressure: float
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
        behind = Behind(
            self.outlet_pressure,
            self.outlet_velocity,
            self.recovered_pressure,
            self.downstream_velocity,
            self.tail_loss,
        )
        pressure = self.flange_pressure - self.level_pressure
        return hydraulics_of(pressure, density, self.volume_flow, velocity, self.line_loss, behind)


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
        raise SolveError(_boundless(model, area, pressure))
    speeds = model.flow.steady_velocities(area, pressure, density)
    displacement = np.linalg.norm(nodal[:, :3], axis=1)
    where = int(np.argmax(displacement))
    lip = LipCentre(model.mesh, model.shell)
    mass_flow = model.mass_flow(area, pressure)
    station_pressure = model.flow.steady_pressure(area, pressure)
    line = model.line
    outlet, recovered, tail_speed, tail_loss = _behind(model, area, velocity, float(speeds[0]))
    flange = station_pressure[-1] - np.broadcast_to(model.flow.static, area.shape)[-1] + outlet + model.flow.level
    return SteadyState(
        pressure=float(pressure),
        head=head_of(pressure, density),
        flange_pressure=float(pressure if line is None else flange),
        line_loss=0.0 if line is None else line.lost_head(float(area[-1]), velocity) / GRAVITY,
        outlet_pressure=outlet,
        recovered_pressure=recovered,
        downstream_velocity=tail_speed,
        tail_loss=tail_loss,
        level_pressure=model.flow.level,
        q=np.asarray(q),
        nodal=nodal,
        mass_flow=mass_flow,
        volume_flow=mass_flow / density,
        outlet_area=float(model.mesh.part.copies * area[0]),
        outlet_velocity=float(speeds[0]),
        max_displacement=float(displacement[where]),
        max_displacement_position=tuple(float(value) for value in model.mesh.nodes[where]),
        lip_opening=lip.opening(q),
        lip_displacement=lip.displacement(q),
        station_area=area,
        station_velocity=speeds,
        station_pressure=station_pressure,
        stops=model.touching(q),
        **solution,
    )


def _behind(model: ValveModel, area: np.ndarray, velocity: float, jet: float) -> tuple[float, float, float, float]:
    """Pressure around the jet, its rise in a pipe behind the valve, Pa, speed there, m/s, and head lost there, m.

    Raises
    ------
    SolveError
        If the jet is wider than the pipe.
    """
    tail, density = model.tail, model.case.fluid.density
    downstream = model.flow.back - model.flow.level
    if tail is None:
        return downstream, 0.0, 0.0, 0.0
    if area[0] > tail.section:
        copies = model.mesh.part.copies
        raise SolveError(
            f"The passage at the lips, {1e4 * copies * area[0]:.4g} cm2, is wider than the pipe that it stands in, "
            f"{1e4 * copies * float(tail.section):.4g} cm2: downstream.pipe_diameter must be larger."
        )
    speed = float(tail.speed(area[-1], velocity))
    recovered = density * float(tail.gained(model.flow.open_area(area)[0], jet, speed))
    lost = float(tail.lost_head(speed))
    return downstream + density * lost - recovered, recovered, speed, lost / GRAVITY


def _boundless(model: ValveModel, area: np.ndarray, pressure: float) -> str:
    """Why no finite flow belongs to a state."""
    lips, flange = (f"{1e4 * model.mesh.part.copies * some:.4g} cm2" for some in (area[0], area[-1]))
    begin = f"At {pressure:.6g} Pa no finite steady flow belongs to the equilibrium: "
    if model.tail is not None and area[0] < area[-1]:
        return begin + (
            f"the pipe downstream gives back all the head that the jet takes, because the passage at the lips, {lips}, "
            f"is little smaller than that of the flange, {flange}, and the pipe is wider than both; give its losses "
            "(downstream.loss), or the pressure in a reservoir upstream."
        )
    return begin + (
        f"its passage at the lips, {lips}, is not smaller than that of the flange, {flange}, so no pressure would be "
        "left to hold the fluid back."
    )
