"""Supports of the valve: clamped flange, symmetry planes, one-sided lip stops or contact of the inner faces.

Faces touch the closing plane. Each node's touching point lies half a wall inside the mid-surface along the current
director, so contact forces act on rotations as well. The faces of the duckbill are those that the fluid knows: its
passage at rest has the half gap `valve.initial_gap`, whatever wall and lip radius leave, and the faces meet where
`fluid.area_floor` of it is left, so that lips that lie on each other leave the passage that a shut valve has, and none
below zero. Faces of a bill that is moulded shut touch in the shape it is drawn in, and press on each other there with
the pressure that it was cured for. Elsewhere, and in a valve that is closed from outside, the gap is that of the
geometry. Points that start closer to the plane than this gap, or beyond it, as where the wall folds at the side edge,
are measured from where they start plus the gap.

A closed valve may also have lips that are held (Th. 3.6): they keep y = 0 in the duckbill, and the mid-surface of the
saddle cannot cross the plane.

The force is no part of the structure's: neither stiffness damping nor loss factors act on it. Equations (T.26) and, of
contact in a time step, (T.27) of docs/theory.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..case.model import Case
from ..contact import ContactLaw, PlaneContact, tributary_area
from ..geometry.valve_mesh import ValveMesh
from ..shell.mesh import nodal_thickness
from ..shell.shell import Shell


def held_rows(case: Case, mesh: ValveMesh) -> np.ndarray:
    """(rows,) true for rows of the duckbill, which supports of Th. 3.6 hold shut."""
    return mesh.z <= case.valve.duckbill_length * (1 + 1e-9)


@dataclass(frozen=True)
class LipStops:
    """One-sided springs against y displacements below zero, as the links of App. A act: on displacement and not on y,
    for each joins a node to a fixed copy of it 10 mm below (Th. 3.5.5 has them reach the plane y = 0).
    """

    unknowns: np.ndarray  #: (k,); numbers of the free unknowns that the stops act on.
    stiffness: float | np.ndarray  #: float or (k,), N/m.

    def energy(self, q: np.ndarray) -> float:
        return 0.5 * float(np.sum(self.stiffness * np.minimum(q[self.unknowns], 0.0) ** 2))

    def force(self, q: np.ndarray) -> np.ndarray:
        """Internal force (k,) on the unknowns with a stop."""
        return self.stiffness * np.minimum(q[self.unknowns], 0.0)

    def tangent(self, q: np.ndarray) -> np.ndarray:
        """Diagonal stiffness (k,)."""
        return np.where(q[self.unknowns] < 0.0, self.stiffness, 0.0)

    def touching(self, q: np.ndarray) -> int:
        """Number of stops in contact."""
        return int(np.count_nonzero(q[self.unknowns] < 0.0))


def lip_stops(case: Case, mesh: ValveMesh, index: np.ndarray) -> LipStops:
    """Stops on the duckbill nodes of the inner half of the columns, or of all; none where faces touch instead."""
    supports, joint = case.supports, case.valve.duckbill_length
    if not supports.lip_stop or case.faces_touch:
        return LipStops(np.zeros(0, int), supports.lip_stop_stiffness)
    limit = 0.5 if supports.lip_stop_columns == "inner-half" else 1.0 + 1e-9
    rows = mesh.z <= joint * (1 + 1e-9)
    nodes = mesh.rows[np.ix_(rows, np.abs(mesh.columns) < limit - 1e-9)].ravel()
    unknowns = index[nodes, 1]
    moving = unknowns >= 0
    stiffness = supports.lip_stop_stiffness
    if not mesh.part.is_quarter:  # two quarters meet in the middle of the lips, each with its stop
        stiffness = np.where(np.isin(nodes, mesh.centre_line), 2.0 * stiffness, stiffness)[moving]
    return LipStops(unknowns[moving].astype(int), stiffness)


#: Half width of the rounded kink of the contact law over the initial gap, and that over it where contact spreads row by
#: row.
ROUNDING, SPREADING_ROUNDING = 0.01, 1 / 3


#: What closes a valve that is pressed from outside: contact of the faces, or the supports of Th. 3.6.
CONTACT, HELD_LIPS = "contact", "held-lips"


def face_contact(case: Case, mesh: ValveMesh, shell: Shell, closed_by: str | None = None) -> PlaneContact | None:
    """Contact of the inner faces of a case, as drawn of a closed valve; None where it has stops."""
    every, area, gap = np.arange(shell.mesh.node_count), tributary_area(shell), case.valve.initial_gap
    preset = case.valve.is_preset
    law = ContactLaw(case.face_stiffness, (SPREADING_ROUNDING if case.contact_spreads else ROUNDING) * gap)
    if closed_by == HELD_LIPS:
        return PlaneContact(shell, every, 0.0, area, law)
    if not case.faces_touch:
        return None
    depth, gap = 0.5 * nodal_thickness(shell.mesh), np.full(len(every), gap)
    if preset:
        moulded = mesh.nodes[:, 2] <= case.valve.moulded_length * (1 + 1e-9)
        gap = np.where(moulded, law.gap_at(shell.closing_pressure), law.rounding)
    elif closed_by is None:
        gap *= 1.0 - case.film_share
    if preset or closed_by is None:
        at_lips = mesh.nodes[:, 2] <= case.valve.duckbill_length * (1 + 1e-9)
        depth = np.where(at_lips, depth + _inside(case, gap), depth)
    return PlaneContact(shell, every, depth, area, law, least_gap=gap)


def _inside(case: Case, gap: np.ndarray) -> np.ndarray:
    """Distance (nn,), m, of the faces in contact inside those of the duckbill's wall without patches."""
    valve = case.valve
    return valve.duckbill_wall_deduction - gap - 0.5 * valve.thickness_at(0.0)
