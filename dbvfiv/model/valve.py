"""The coupled valve: one contract for equilibria, spectra, branches and time histories.

State q (n,): free displacements (m) and rotations (rad) of the part of the valve that is computed. Row areas and
station pressures are functions of it, so the equilibrium is

    r(q; P) = f_shell(q) + f_stops(q) + f_contact(q) - G(q) p(A(q); P) = 0

with the columns of G the forces of unit station pressures. The tangent is K - G D J: K holds shell, stops or contact of
the inner faces, and the follower stiffness of the present pressures, J the derivative of the areas, D that of the
pressures.
"""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ..case.model import Case
from ..contact import PlaneContact
from ..errors import SolveError
from ..flow.rows import RowAreas
from ..flow.terms.line import Line, PiecedLine
from ..flow.terms.pump import Pump
from ..flow.terms.tail import Tail
from ..shell.pressure import Weight, station_forces
from ..shell.section import Section
from ..shell.shell import StepWall
from .build import build_flow, build_shell, build_weight, loaded_share
from .linear import CoupledFactor
from .load_steps import Loading
from .newton import EquilibriumSolver, NewtonOptions
from .outside import OutsideFluid
from .preset import PressedShell
from .relaxing import WallRelaxation
from .supports import HELD_LIPS, face_contact, held_rows, lip_stops

#: Faces that meet change the residual from one step to the next: its norm has to fall.
_AT_REST = NewtonOptions(1e-10, 200, "l2")


@dataclass(frozen=True)
class Tangent:
    """Residual and exact linearisation of the equilibrium at one state."""

    residual: np.ndarray  #: (n,) N, N m.
    structure: np.ndarray  #: (nnz,) values of the structure's own tangent: material, geometric, stops; symmetric.
    #: (nnz,) values of K: structure and contact of faces less follower stiffness of the pressures.
    stiffness: np.ndarray
    forces: np.ndarray  #: (nnz of G,) values of G.
    areas_slope: np.ndarray  #: (nnz of J,) values of J.
    pressure_slope: np.ndarray  #: (m, m) D, Pa/m2.
    #: area and pressure: (m,) m2, Pa.
    area: np.ndarray
    pressure: np.ndarray


#: Distance of a face from where it parts or meets, over the rounding of the contact law, below which it grazes.
GRAZING = 0.1


class ValveModel(PressedShell):
    """The coupled valve of a case. Raises ValueError if the case's geometry cannot be meshed.

    Parameters
    ----------
    section : Section, optional
        Wall in place of the one the case describes.
    closed_by : str, optional
        Of a valve that is pressed from outside, `dbvfiv.model.supports.CONTACT` or `HELD_LIPS`.
    """

    def __init__(self, case: Case, section: Section | None = None, closed_by: str | None = None):
        self.case = case
        self.mesh, self.shell = build_shell(case, section)
        if closed_by == HELD_LIPS:
            free = self.shell.dofs.free.copy()
            free[self.mesh.rows[held_rows(case, self.mesh)].ravel(), 1] = False
            self.shell = self.shell.with_free(free)
        dofs = self.shell.dofs
        self.rows = RowAreas(self.mesh, dofs.index)
        self.stops = lip_stops(case, self.mesh, dofs.index)
        self.contact: PlaneContact | None = face_contact(case, self.mesh, self.shell, closed_by)
        self.station_of_node = np.empty(len(self.mesh.nodes), np.int64)
        self.station_of_node[self.mesh.rows] = np.arange(len(self.mesh.rows))[:, None]
        self.loaded = loaded_share(self.mesh, case)
        self.flow = build_flow(case, self.mesh)
        self.weight: Weight | None = build_weight(case, self.shell)
        self.outside = OutsideFluid(case, self.mesh, self.shell) if case.outside.is_there else None
        self.relaxation = WallRelaxation.of(self.shell.section)
        self._stop_slots = dofs.diagonal_slots[self.stops.unknowns]

    def with_section(self, section: Section) -> ValveModel:
        """Model of the same valve with other layers; of a bill that is moulded shut its shape without stress changes,
        so that it is made anew.
        """
        if self.shell.stress_free is not None:
            return ValveModel(self.case, section)
        found = copy(self)
        found.shell = self.shell.with_section(section)
        found.weight = build_weight(self.case, found.shell)
        found.relaxation = WallRelaxation.of(section)
        return found

    # -- layout

    def __repr__(self) -> str:
        return f"<ValveModel: {self.size} unknowns, {self.case.fluid.continuity}>"

    @property
    def line(self) -> Line | PiecedLine | None:
        """The pipe in front of the valve, or the pipes, if there is one."""
        return self._term(Line, PiecedLine)

    @property
    def tail(self) -> Tail | None:
        """The pipe behind the valve, if there is one."""
        return self._term(Tail)

    def _term(self, *kinds: type):
        return next((term for term in getattr(self.flow, "terms", ()) if isinstance(term, kinds)), None)

    @property
    def pump(self) -> Pump | None:
        """The pump that feeds it, if there is one."""
        return self._term(Pump)

    @property
    def stations(self) -> int:
        """Number of flow stations m."""
        return len(self.mesh.z)

    def rest(self) -> np.ndarray:
        """Unknowns (n,) of the wall at rest without load: zeros, or of a bill that is moulded shut those with which its
        faces hold each other. Raises SolveError if they do not.
        """
        return self._rest.copy()

    @cached_property
    def _rest(self) -> np.ndarray:
        drawn = np.zeros(self.size)
        if self.shell.stress_free is None:
            return drawn
        found = EquilibriumSolver(Loading(self, self.flow.back), _AT_REST).solve(drawn, 0.0)
        if not found.converged:
            raise SolveError(f"The bill that is moulded shut has no equilibrium at rest: {found.reason}.")
        return found.q

    @cached_property
    def _preset_force(self) -> float:
        """Norm of the force, N, that a bill that is moulded shut needs in the shape it is drawn in."""
        return 0.0 if self.shell.stress_free is None else float(np.linalg.norm(self.shell.force(np.zeros(self.size))))

    # -- statics

    def residual(self, q: np.ndarray, pressure: float, share: float = 1.0) -> np.ndarray:
        """Unbalanced force (n,) at an inlet pressure, Pa; `share` of what loads the wall, its weight included."""
        nodal = self.nodal(q)
        p = share * self.flow.steady_pressure(self.rows.areas(nodal), pressure)
        return self.internal_force(q, share=share) + self.contact_force(q) - self.pressure_force(nodal, p)

    def tangent(self, q: np.ndarray, pressure: float, share: float = 1.0) -> Tangent:
        """Residual and linearisation at an inlet pressure, Pa; `share` as `residual` has it."""
        nodal = self.nodal(q)
        area = self.rows.areas(nodal)
        p, slope = (share * part for part in self.flow.steady_operator(area, pressure))
        force, structure = self.structure(q, share=share)
        force += self.contact_force(q) - self.pressure_force(nodal, p)
        return Tangent(
            residual=force,
            structure=structure,
            stiffness=self.stiffness(q, p, structure),
            forces=self.station_forces(nodal).data,
            areas_slope=self.rows.jacobian(nodal).data,
            pressure_slope=slope,
            area=area,
            pressure=p,
        )

    def internal_force(self, q: np.ndarray, step: StepWall | None = None, share: float = 1.0) -> np.ndarray:
        """Force (n,) of shell and stops, and of a share of the weight; `step` for a wall in motion."""
        force = self.shell.force(q, step)
        force[self.stops.unknowns] += self.stops.force(q)
        if self.weight is not None:
            force += share * self.weight.force(self.shell, q)
        return force

    def structure(
        self, q: np.ndarray, step: StepWall | None = None, share: float = 1.0
    ) -> tuple[np.ndarray, np.ndarray]:
        """`internal_force` (n,) and values (nnz,) of its tangent."""
        force, data = self.shell.force_and_tangent(q, step=step)
        force[self.stops.unknowns] += self.stops.force(q)
        data[self._stop_slots] += self.stops.tangent(q)
        if self.weight is not None:
            force += share * self.weight.force(self.shell, q)
            self.weight.add_tangent(self.shell, q, data, share)
        return force, data

    def contact_force(self, q: np.ndarray) -> np.ndarray | float:
        """Force (n,) of the contact of inner faces, which is no part of `internal_force`; 0 without."""
        return 0.0 if self.contact is None else self.contact.force(q)

    def add_contact(self, q: np.ndarray, data: np.ndarray) -> None:
        """Add its tangent to values (nnz,)."""
        if self.contact is not None:
            self.contact.add_tangent(q, data)

    def contact_reach(self, q: np.ndarray, shape: np.ndarray) -> float:
        """Amplitude of a motion (nn, c), complex, up to which no face parts or meets, over that of the motion;
        infinite without contact of faces. The motion is taken to first order.
        """
        if self.contact is None:
            return np.inf
        plane = self.contact
        nodal = self.nodal(q)
        directors, first, _ = self.shell.directors(nodal)
        columns = [plane.axis, 3, 4]
        moved = np.abs(np.sum(plane.slope(first) * shape[plane.nodes][:, columns], axis=1))
        room = np.abs(plane.gap(nodal, directors) - plane.law.rounding)
        return float(np.min(room / np.maximum(moved, 1e-300), initial=np.inf))

    def grazing(self, q: np.ndarray) -> tuple[int, dict[str, sp.csr_matrix]]:
        """Number of faces that are about to part or have just met, and changes (n, n) of the stiffness in which they
        are "parted", and "held" as by faces that press firmly; none without such faces.

        Where they part the law's stiffness is none and rises over its rounding, so that smaller motions see little
        contact and larger ones a firm one for half of the time.
        """
        if self.contact is None:
            return 0, {}
        plane, nodal = self.contact, self.nodal(q)
        directors, first, _ = self.shell.directors(nodal)
        gap, law = plane.gap(nodal, directors), plane.law
        near = np.abs(gap - law.rounding) < GRAZING * law.rounding
        if not near.any():
            return 0, {}
        slope, stiffness = plane.slope(first), law.respond(gap)[2]
        found = {}
        for name, wanted in (("parted", 0.0), ("held", law.penalty)):
            values = np.zeros(len(self.shell.dofs.pattern[1]))
            change = plane.area * np.where(near, wanted - stiffness, 0.0)
            plane.add_blocks(values, change[:, None, None] * slope[:, :, None] * slope[:, None, :])
            found[name] = self.shell.dofs.matrix(values)
        return int(np.count_nonzero(near)), found

    def touching(self, q: np.ndarray) -> int:
        """Number of stops, or of nodes with their inner face, in contact."""
        return self.stops.touching(q) if self.contact is None else self.contact.touching(q)

    def weight_energy(self, q: np.ndarray) -> float:
        """Potential of the wall's weight over that at rest, J of the part; zero without gravity."""
        return 0.0 if self.weight is None else self.weight.energy(self.shell, q)

    def support_energy(self, q: np.ndarray) -> float:
        """Energy of stops or contact, J of the part."""
        return self.stops.energy(q) if self.contact is None else self.contact.energy(q)

    def relaxing_stiffness(self, q: np.ndarray) -> tuple[sp.csr_matrix, ...]:
        """K_g (n, n): material part of the tangent of each group of `relaxation`."""
        return tuple(self.shell.dofs.matrix(values) for values in self.shell.relaxing_tangents(q))

    def nodal_pressure(self, p: np.ndarray) -> np.ndarray:
        """Pressures (nn,) at the nodes, Pa, from those at the stations (m,), Pa."""
        return p[self.station_of_node]

    def stiffness(self, q: np.ndarray, p: np.ndarray, structure: np.ndarray) -> np.ndarray:
        """Values (nnz,) of K: structure and contact of faces less the follower stiffness of pressures (m,), Pa."""
        values = self.follower_stiffness(self.nodal(q), p, structure)
        self.add_contact(q, values)
        return values

    def station_forces(self, nodal: np.ndarray) -> sp.csr_matrix:
        """G (n, m): forces of unit station pressures on the deformed wall."""
        surface = self.shell.mesh
        out = np.empty((surface.element_count, 4, 3, 4))
        station_forces(surface.quads, surface.nodes, nodal, self.station_of_node, self.loaded, out)
        slots, indices, indptr = self._force_pattern
        keep = slots >= 0
        data = np.bincount(slots[keep], weights=out.ravel()[keep], minlength=len(indices))
        return sp.csr_matrix((data, indices, indptr), shape=(self.size, self.stations), copy=False)

    def forces_on_areas(self, nodal: np.ndarray, lengths: np.ndarray) -> sp.csr_matrix:
        """Forces (n, m), stored as `station_forces`, of unit pressures that do work on the areas over lengths (m,),
        m, of a bill that is moulded shut.
        """
        _, indices, indptr = self._force_pattern
        slope = self.rows.jacobian(nodal).tocoo()
        data = np.bincount(self._area_slots, slope.data * lengths[slope.row], minlength=len(indices))
        return sp.csr_matrix((data, indices, indptr), shape=(self.size, self.stations), copy=False)

    @cached_property
    def _area_slots(self) -> np.ndarray:
        """Places of the entries of the areas' Jacobian among those of `station_forces`."""
        _, indices, indptr = self._force_pattern
        slope = self.rows.jacobian(self.nodal(np.zeros(self.size))).tocoo()
        keys = np.repeat(np.arange(self.size), np.diff(indptr)) * self.stations + indices
        return np.searchsorted(keys, slope.col * self.stations + slope.row)

    @cached_property
    def _force_pattern(self):
        quads = self.shell.mesh.quads
        rows = np.broadcast_to(self.shell.dofs.index[quads][:, :, :3, None], (len(quads), 4, 3, 4)).ravel()
        columns = np.broadcast_to(self.station_of_node[quads][:, None, None, :], (len(quads), 4, 3, 4)).ravel()
        carried = np.repeat(self.loaded > 0, 48)
        keep = (rows >= 0) & carried
        keys = rows[keep] * self.stations + columns[keep]
        if self.shell.stress_free is None:
            unique = np.unique(keys)
        else:  # of `forces_on_areas` too: nodes of a row that carry no pressure
            areas = self.rows.jacobian(self.nodal(np.zeros(self.size))).tocoo()
            unique = np.union1d(keys, areas.col.astype(np.int64) * self.stations + areas.row)
        slots = np.full(rows.shape, -1, np.int64)
        slots[keep] = np.searchsorted(unique, keys)
        indptr = np.searchsorted(unique // self.stations, np.arange(self.size + 1)).astype(np.int32)
        return slots, (unique % self.stations).astype(np.int32), indptr

    def factor(self) -> CoupledFactor:
        """A new factorisation object for tangents of this model; see `refactor`."""
        return CoupledFactor(
            self.shell.dofs.matrix(np.ones(len(self.shell.dofs.pattern[1]))),
            self.station_forces(self.nodal(np.zeros(self.size))),
            self.rows.jacobian(self.nodal(np.zeros(self.size))),
        )

    @staticmethod
    def refactor(factor: CoupledFactor, tangent: Tangent) -> None:
        """Factor the coupled tangent of the equilibrium."""
        factor.refactor(tangent.stiffness, tangent.forces, tangent.areas_slope, tangent.pressure_slope)

    def matrices(self, tangent: Tangent) -> tuple[sp.csr_matrix, sp.csr_matrix, sp.csr_matrix]:
        """K (n, n), G (n, m) and J (m, n) of a tangent."""
        _, indices, indptr = self._force_pattern
        g = sp.csr_matrix((tangent.forces, indices, indptr), shape=(self.size, self.stations), copy=False)
        return self.shell.dofs.matrix(tangent.stiffness), g, self.rows.matrix(tangent.areas_slope)

    def apply(self, tangent: Tangent, direction: np.ndarray) -> np.ndarray:
        """Product (n,) of the coupled tangent K - G D J with a direction (n,)."""
        k, g, j = self.matrices(tangent)
        return k @ direction - g @ (tangent.pressure_slope @ (j @ direction))

    def apply_transposed(self, tangent: Tangent, direction: np.ndarray) -> np.ndarray:
        """Product (n,) of the transpose of the coupled tangent with a direction (n,)."""
        k, g, j = self.matrices(tangent)
        return k.T @ direction - j.T @ (tangent.pressure_slope.T @ (g.T @ direction))

    @property
    def load_unit(self) -> float:
        """Pressure, Pa, in which loads are counted: that which closes a preset wall; 1 mm of water without one."""
        return max(self.shell.closing_pressure, 10.0)

    @property
    def length_unit(self) -> float:
        """Displacement, m, in which curves of equilibria are measured: the gap of the lips, by which faces part."""
        return 2.0 * self.case.valve.initial_gap

    def pressure_derivative(self, q: np.ndarray, pressure: float) -> np.ndarray:
        """Derivative (n,) of the residual by the inlet pressure."""
        nodal = self.nodal(q)
        return -self.pressure_force(nodal, self.flow.steady_slope(self.rows.areas(nodal), pressure))

    def force_scale(self, q: np.ndarray, pressure: float) -> float:
        """Norm of the pressure forces, of the weight and of the preset, N: what residuals are measured against."""
        nodal = self.nodal(q)
        p = self.flow.steady_pressure(self.rows.areas(nodal), pressure)
        own = 0.0 if self.weight is None else np.linalg.norm(self.weight.force(self.shell, q))
        return float(np.linalg.norm(self.pressure_force(nodal, p)) + own + self._preset_force)

    # -- what faces that are moulded shut leave open

    @cached_property
    def _film(self) -> np.ndarray:
        """Areas (m,), m2, that rough faces in contact leave, of a bill that is moulded shut: those at rest, a trace of
        faces that cross there.
        """
        return np.maximum(self.rows.areas(self.nodal(self.rest())), np.finfo(float).tiny)

    @cached_property
    def lens(self) -> float:
        """Height at rest, m, of the middle of one lip over where its face meets the other; 0 of lips that touch at rest
        or rest on stops.
        """
        left = (1.0 - self.case.film_share) * self.case.valve.initial_gap
        return max(0.0, self.room - left) if self.mesh.stands_apart else 0.0

    @cached_property
    def room(self) -> float:
        """Way, m, that the middle of one lip has from rest to where its face meets the other; 0 of lips that rest on
        stops, or are moulded shut.
        """
        if self.contact is None or self.case.valve.is_preset:
            return 0.0
        middle = int(np.searchsorted(self.contact.nodes, self.mesh.centre_line[0]))
        return max(0.0, float(self.contact.start[middle]))

    @property
    def parting(self) -> float:
        """Section in which the faces of a bill that is moulded shut just part, over that at rest, where they press on
        each other; 1 without a preset.
        """
        if self.shell.stress_free is None:
            return 1.0
        law = self.contact.law
        return 1.0 + (law.rounding - law.gap_at(self.shell.closing_pressure)) / self.case.valve.initial_gap

    def is_open(self, area: np.ndarray) -> bool:
        """True where the narrowest of sections (m,), m2, is wider than what faces in contact leave, which carries no
        flow.
        """
        narrowest = int(np.argmin(area))
        return self.shell.stress_free is None or bool(area[narrowest] > self.parting * self._film[narrowest])

    def seal(self, area: np.ndarray) -> int | None:
        """Last station, from the outlet on, of sections (m,), m2, that faces in contact shut; None where none is."""
        if self.is_open(area):
            return None
        moulded = self._film <= self.parting * self._film.min()
        return int(max(np.argmin(area), np.flatnonzero(moulded & (area <= self.parting * self._film)).max(initial=0)))

    def mass_flow(self, area: np.ndarray, pressure: float) -> float:
        """Steady mass flow of the whole valve, kg/s; none where its faces shut a section."""
        if not self.is_open(area):
            return 0.0
        velocity = self.flow.inlet_velocity(area, pressure, self.case.fluid.density)
        density = self.flow.inlet_density(area, pressure, self.case.fluid.density)
        return self.mesh.part.copies * density * velocity * self.mesh.inlet_passage
