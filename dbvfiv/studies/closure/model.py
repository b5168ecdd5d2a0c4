"""The valve under back pressure: shell, supports and contact of a case, and the opening left between its walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...contact import ContactLaw, PlaneContact, nodal_thickness, tributary_area
from ...geometry import ValveMesh
from ...model.build import build_shell
from ...model.pressed_shell import PressedShell
from ...model.supports import free_unknowns
from ...model.valve import loaded_share
from ...shell import Shell
from ..case import Case

#: Contacting inner faces, or the supports of Th. 3.6.
CONTACT, HELD_LIPS = "contact", "held-lips"
#: Half width of the rounded kink of the contact law over the depth that the reference pressure would press in.
ROUNDING = 0.3


@dataclass(frozen=True)
class ClosureModel:
    """The computed part of a valve, pressed from outside.

    Attributes
    ----------
    case : Case
    supports : str
        "contact": the inner faces touch the closing plane; "held-lips": the duckbill cannot move across the plane and
        one-sided stops keep the mid-surface of the saddle from crossing it (Th. 3.6).
    mesh : ValveMesh
    pressed : PressedShell
    face : PlaneContact
        The inner face, for measuring gaps with either supports; with contact the contact itself.
    held : (rows,) bool array
        Rows that are shut by the supports.
    """

    case: Case
    supports: str
    mesh: ValveMesh
    pressed: PressedShell
    face: PlaneContact
    held: np.ndarray

    @property
    def size(self) -> int:
        return self.pressed.size

    @property
    def shell(self) -> Shell:
        return self.pressed.shell

    @property
    def folded_start(self) -> np.ndarray:
        """Numbers of the nodes whose inner face starts nearer to the closing plane than the least gap, or beyond it."""
        return self.face.nodes[self.face.lifted]

    @property
    def nodes_beyond(self) -> np.ndarray:
        """Numbers of the nodes whose inner face starts beyond the closing plane."""
        return self.face.nodes[self.face.start < 0]


def closure_model(case: Case, supports: str | None = None, contact_depth: float | None = None) -> ClosureModel:
    """Model of a case under back pressure.

    Parameters
    ----------
    case : Case
    supports : "contact" or "held-lips", optional
        As the case says by default.
    contact_depth : float, m, optional
        Depth to which the largest pressure of the case presses the faces in before multipliers push them back; from the
        case by default.
    """
    supports = case.closure.supports if supports is None else supports
    depth = case.closure.contact_depth if contact_depth is None else contact_depth
    law = ContactLaw(max(case.closure.pressures) / depth, ROUNDING * depth)
    mesh, shell = build_shell(case)
    duckbill = mesh.z <= case.valve.duckbill_length * (1 + 1e-9)
    held = np.zeros(len(mesh.z), bool)
    if supports == HELD_LIPS:
        held = duckbill
        free = free_unknowns(mesh)
        free[mesh.rows[duckbill].ravel(), 1] = False
        shell = shell.with_free(free)
    area, half_wall = tributary_area(shell), 0.5 * nodal_thickness(shell)
    every = np.arange(shell.mesh.node_count)
    face = PlaneContact(shell, every, half_wall, area, law, axis=1, least_gap=case.valve.initial_gap)
    contact = face if supports == CONTACT else PlaneContact(shell, every, 0.0, area, law, axis=1)
    return ClosureModel(case, supports, mesh, PressedShell(shell, contact, -1.0, loaded_share(mesh, case)), face, held)
