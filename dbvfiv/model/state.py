"""One steady state of the valve and what a user reads off it: areas, flow, opening of the lips, and hydraulic
results (heads, head loss, loss and flow coefficients K, Kv, Cv).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np

from ..case.quantity import GRAVITY, WATER, head_of
from ..errors import SolveError
from ..flow.gas import GasChannel
from ..geometry.valve_mesh import ValveMesh
from ..shell.mesh import nodal_thickness
from ..shell.shell import Shell
from ..texts import shortly
from .valve import ValveModel


@shortly
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
        `dbvfiv.model.state.LipCentre.opening`. Of a bill that is moulded shut by how much it is more than at rest.
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
    compressed : mapping or None
        Of a compressed fluid sound_speed, m/s, around the jet, and heat_capacity_ratio.
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
    compressed: Mapping[str, float] | None

    @property
    def is_sealed(self) -> bool:
        """True where the faces of a bill that is moulded shut let nothing pass."""
        return not self.mass_flow > 0

    def volume_flow_of(self, density: float) -> float:
        """Volume flow, m3/s, of a fluid of another density, kg/m3, at the same state: pressures stay, and the speeds go
        with the inverse root of the density.
        """
        return float(np.sqrt(self.mass_flow * self.volume_flow / density))

    def static_head(self, pressure: float) -> float:
        """Static head, m, of its fluid at a pressure, Pa, over that of the surroundings."""
        around, density = self.outlet_pressure, self.mass_flow / self.volume_flow
        return head_of(around, density) + _Flange.of(pressure - around, density, 0.0, self.compressed).head

    @property
    def hydraulics(self) -> Hydraulics | None:
        """Heads, loss and coefficients; None where nothing flows."""
        if not self.volume_flow > 0:
            return None
        return Hydraulics.of(
            self.flange_pressure - self.level_pressure,
            self.mass_flow / self.volume_flow,
            self.volume_flow,
            float(self.station_velocity[-1]),
            self.line_loss,
            around=self.outlet_pressure,
            jet_velocity=self.outlet_velocity,
            recovered=self.recovered_pressure,
            velocity=self.downstream_velocity,
            tail_loss=self.tail_loss,
            compressed=self.compressed,
        )


def describe_state(model: ValveModel, q: np.ndarray, pressure: float, **solution) -> SteadyState:
    """Steady state of a model from its unknowns; `solution` holds the fields from `converged` to `reason`. Raises
    SolveError if no finite steady flow belongs to the state: the lip is as wide as the flange.
    """
    nodal = model.nodal(q)
    area = model.rows.areas(nodal)
    density = model.case.fluid.density
    given = {"inlet": pressure, "density": density}
    inner = model.flow.steady_inner(area, given) if model.flow.has_fluid else np.zeros(1)
    velocity = float(inner[0])
    if not np.isfinite(velocity):
        raise SolveError(_boundless(model, area, pressure))
    open_ = model.is_open(area)
    speeds = model.flow.steady_velocities(area, pressure, density) * open_
    displacement = np.linalg.norm(nodal[:, :3], axis=1)
    where = int(np.argmax(displacement))
    lip = LipCentre(model.mesh, model.shell)
    mass_flow = model.mass_flow(area, pressure)
    station_pressure = model.flow.steady_pressure(area, pressure)
    line = model.line
    far = model.flow.far_velocity(inner) * open_
    outlet, recovered, tail_speed, tail_loss = _behind(model, area, far, float(speeds[0]))
    flange = station_pressure[-1] - np.broadcast_to(model.flow.static, area.shape)[-1] + outlet + model.flow.level
    return SteadyState(
        pressure=float(pressure),
        head=head_of(pressure, density),
        flange_pressure=float(pressure if line is None else flange),
        line_loss=0.0 if line is None else line.lost_head(float(area[-1]), far) / GRAVITY,
        outlet_pressure=outlet,
        recovered_pressure=recovered,
        downstream_velocity=tail_speed,
        tail_loss=tail_loss,
        level_pressure=model.flow.level,
        q=np.asarray(q),
        nodal=nodal,
        mass_flow=mass_flow,
        volume_flow=mass_flow / density,
        outlet_area=float(model.mesh.part.copies * area[0] * open_),
        outlet_velocity=float(speeds[0]),
        max_displacement=float(displacement[where]),
        max_displacement_position=tuple(float(value) for value in model.mesh.nodes[where]),
        lip_opening=lip.opening(q) if open_ else 0.0,
        lip_displacement=lip.displacement(q),
        station_area=area,
        station_velocity=speeds,
        station_pressure=station_pressure,
        stops=model.touching(q),
        compressed=model.case.fluid.compressed,
        **solution,
    )


def _behind(model: ValveModel, area: np.ndarray, velocity: float, jet: float) -> tuple[float, float, float, float]:
    """Pressure around the jet, its rise in a pipe behind the valve, Pa, speed there, m/s, and head lost there, m.
    Raises SolveError if the jet is wider than the pipe.
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


def parted_width(model: ValveModel, q: np.ndarray) -> tuple[float, float]:
    """Widths, m, of the whole lip that has parted, and that is pressed at rest, of a bill that is moulded shut."""
    row, where = model.mesh.rows[0], np.full(len(model.mesh.nodes), -1)
    where[model.contact.nodes] = np.arange(model.contact.count)
    known = where[row] >= 0
    width = np.abs(np.gradient(model.mesh.nodes[row, 0]))
    width[[0, -1]] *= 0.5  # half an element belongs to a node at an end
    pressed = model.contact.state(model.rest()).touching[where[row]] & known
    parted = pressed & ~model.contact.state(q).touching[where[row]]
    copies = 2.0 if model.mesh.part.is_quarter else 1.0
    return copies * float(width[parted].sum()), copies * float(width[pressed].sum())


class LipCentre:
    """The node in the middle of the lip.

    Parameters
    ----------
    shell : Shell
        On this mesh.
    """

    def __init__(self, mesh: ValveMesh, shell: Shell):
        node = mesh.centre_line[0]
        surface = shell.mesh
        self.half_wall = 0.5 * float(nodal_thickness(surface)[node])
        self._height = float(surface.nodes[node, 1])
        self._director, self._frame = surface.directors[node], surface.frames[node]
        self._unknowns = shell.dofs.index[node]
        drawn = 2.0 * (self._height - self.half_wall * float(self._director[1]))
        # faces that are moulded shut, or that cross as drawn, touch in that shape
        self._shut = drawn if shell.stress_free is not None else min(drawn, 0.0)

    def displacement(self, q: np.ndarray) -> float:
        """Displacement in y, m, of the mid-surface of one lip, from the free unknowns (n,); below zero where the lip
        lies beyond its place at rest.
        """
        return float(self._local(q)[1])

    def opening(self, q: np.ndarray) -> float:
        """Full clear opening, m: the distance between the inner faces of both lips, never below zero.

        The inner face lies half a wall h/2 inside the mid-surface along the director d, so with the height Y of the
        mid-surface at rest and its displacement v the opening is 2 (Y + v - h/2 d_y). At rest it is what the shape
        leaves between the faces, 2 (Y - h/2): 0.38 mm in the 12-inch valve, whose mid-surface is 6.19 mm high and whose
        wall is 12 mm thick; none where the lip radius is half the wall. `valve.initial_gap`, which keeps the flow
        section open at rest, is no part of it. Of a bill that is moulded shut, and of walls too thick for the shape, by
        how much it is more than that.
        """
        local = self._local(q)
        turn = float(np.hypot(*local[3:]))
        across = np.cos(turn) * self._director[1] + np.sinc(turn / np.pi) * float(local[3:] @ self._frame[:, 1])
        return max(0.0, 2.0 * (self._height + float(local[1]) - self.half_wall * float(across)) - self._shut)

    def _local(self, q: np.ndarray) -> np.ndarray:
        """Displacements and rotations (5,) of the node."""
        return np.where(self._unknowns >= 0, np.asarray(q)[np.maximum(self._unknowns, 0)], 0.0)


class _Flange(NamedTuple):
    """A fluid at the flange, against that around the jet."""

    head: float  #: m; static.
    density: float = 1.0  #: At the flange, over that around the jet.
    jet: float = 1.0  #: In a jet that is faster than sound, over that around it.
    kept: float = 0.0  #: m; static head of such a jet.

    @classmethod
    def of(cls, over: float, density: float, jet: float, compressed: Mapping[str, float] | None) -> _Flange:
        """From the pressure over that around the jet, Pa, the density there, kg/m3, and the speed of the jet, m/s."""
        if compressed is None:
            return cls(head_of(over, density))
        given = {"density": density, **compressed}
        sigma = np.array([GasChannel.compression(over, given), GasChannel.outlet(jet, given)])
        inside, kept = (float(head) / GRAVITY for head in GasChannel.isentropic(sigma, given))
        return cls(inside, *map(float, np.exp(sigma / compressed["sound_speed"])), kept)


#: Kv in m3/h at 1 bar over Cv in US gallons a minute at 1 psi (IEC 60534-1).
CV_OVER_KV = 1.156


@shortly
@dataclass(frozen=True)
class Hydraulics:
    """Heads, head loss and coefficients of the valve in a steady flow.

    The whole head of a valve that discharges freely ends in its jet. In a downstream pipe the jet gives back a part.

    Examples
    --------
    >>> found = Hydraulics.of(1e5, 1000.0, 0.01, 1.0)
    >>> round(found.kv, 6), round(found.loss_coefficient, 6)
    (36.0, 201.0)
    """

    flange_velocity: float  #: m/s.
    #: m; total head at the flange, static and velocity head, of the fluid, over that of the surroundings. The static
    #: head of a compressed fluid is its enthalpy over that around the jet.
    total_head: float
    #: m; total head that ends in the valve and its jet: from the flange to the fluid at rest around a free discharge,
    #: or to the downstream pipe where the jet has widened.
    head_loss: float
    loss_coefficient: float  #: K, the loss over the velocity head at the flange; infinite without a flow.
    #: Flow over that of the flange's section at the jet velocity of the head that is lost; 1/sqrt(K).
    discharge_coefficient: float
    #: m3/h; flow of water at a static pressure of 1 bar between flange and fluid behind (IEC 60534-1), at this opening.
    kv: float
    cv: float  #: US gallons a minute; the same at 1 psi.
    line_loss: float  #: m; head lost by friction and fittings of an upstream pipe; 0 without one.
    supply_head: float  #: m; total head at the far end of the upstream pipe, or at the flange without one.
    jet_velocity: float  #: m/s.
    #: recovered_pressure and recovered_head: Pa, m; pressure and head that the jet gives back in a downstream pipe.
    recovered_pressure: float
    recovered_head: float
    tail_loss: float  #: m; head lost in the downstream pipe.
    downstream_head: float  #: m; static head at its far end, or around a free discharge, over that of the surroundings.

    @classmethod
    def of(
        cls,
        pressure: float,
        density: float,
        volume_flow: float,
        flange_velocity: float,
        line_loss: float = 0.0,
        *,
        around: float = 0.0,
        jet_velocity: float = math.nan,
        recovered: float = 0.0,
        velocity: float = 0.0,
        tail_loss: float = 0.0,
        compressed: Mapping[str, float] | None = None,
    ) -> Hydraulics:
        """Hydraulics of a flow, by default of a free discharge into the surroundings, whose pressure is 0.

        Parameters
        ----------
        pressure : float, Pa
            Static, at the flange.
        density : float, kg/m3
            Around the jet.
        volume_flow : float, m3/s
            At that density.
        flange_velocity : float, m/s
        line_loss : float, m
        around : float, Pa
            Static pressure around the jet.
        jet_velocity : float, m/s
            Not a number where it is not known.
        recovered : float, Pa
            Pressure rise where the jet has widened to a pipe; 0 where its energy is lost.
        velocity : float, m/s
            In that pipe; 0 without one.
        tail_loss : float, m
            Head lost in that pipe up to its far end.
        compressed : mapping, optional
            Of a compressed fluid sound_speed, m/s, around the jet, and heat_capacity_ratio.
        """
        inside = _Flange.of(pressure - around, density, jet_velocity, compressed)
        velocity_head = flange_velocity**2 / (2 * GRAVITY)
        total = head_of(around, density) + inside.head + velocity_head
        flows = velocity_head > 0
        static = around + recovered
        loss = total - head_of(static, density) - velocity**2 / (2 * GRAVITY)
        # water loses what the jet does, and flows through the flange as much as through the lips
        flow = volume_flow / inside.jet
        speeds = (flange_velocity * inside.density / inside.jet) ** 2 - (velocity / inside.jet) ** 2
        drop = density * (GRAVITY * (loss - inside.kept) - 0.5 * speeds)
        kv = 3600 * flow * math.sqrt(density / WATER * 1e5 / drop) if drop > 0 else math.nan
        return cls(
            flange_velocity=flange_velocity,
            total_head=total,
            head_loss=loss,
            loss_coefficient=loss / velocity_head if flows else math.inf,
            discharge_coefficient=flange_velocity / math.sqrt(2 * GRAVITY * loss) if flows and loss > 0 else 0.0,
            kv=kv,
            cv=CV_OVER_KV * kv,
            line_loss=line_loss,
            supply_head=total + line_loss,
            jet_velocity=jet_velocity,
            recovered_pressure=recovered,
            recovered_head=head_of(recovered, density),
            tail_loss=tail_loss,
            downstream_head=head_of(static, density) - tail_loss,
        )

    def summary(self) -> dict[str, float]:
        """Plain numbers, SI but for kv and cv."""
        return asdict(self)
