"""The valve under back pressure: the one model of the valve, pressed from outside, and the passage left between its
walls.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.integrate import trapezoid

from ...contact import PlaneContact
from ...geometry import ValveMesh
from ...model import ValveModel
from ...model.state import LipCentre
from ...model.supports import CONTACT, HELD_LIPS, face_contact, held_rows
from ...model.symmetry import EQUILIBRIA
from ...shell import Shell
from ...shell.mesh import nodal_thickness
from ...shell.recovery import LayerFields, layer_fields
from ...texts import shortly
from ..case import Case

#: Keys of a case that is pressed from outside.
CLOSED = {
    "drive.kind": "uniform",
    "drive.side": "outside",
    "supports.contact": "faces",
    "gravity.direction": "none",
    "outside.fluid": "none",
}


@dataclass(frozen=True)
class Passage:
    """Passage between the inner faces, of the part that is computed, by mesh row from the lip.

    Attributes
    ----------
    z : (rows,) array, m
    area : (rows,) array, m2
        Between inner face and closing plane; overlapping faces count as shut.
    reference : float, m2
        Area at the lip at rest.
    shut_fraction : float
        A section is shut where less than this share of the reference is left.
    """

    z: np.ndarray
    area: np.ndarray
    reference: float
    shut_fraction: float

    @property
    def left(self) -> float:
        """Narrowest section over that of the lip at rest."""
        return float(self.area.min() / self.reference)

    @property
    def shut_length(self) -> float:
        """Length along the axis, m, that is shut."""
        return float(sum(b - a for a, b in self.shut_intervals))

    @property
    def lip_seal(self) -> float:
        """Length, m, that is shut from the lip on without a break."""
        shut = self.shut_intervals
        return shut[0][1] - self.z[0] if shut and shut[0][0] <= self.z[0] else 0.0

    @property
    def shut_intervals(self) -> list[tuple[float, float]]:
        """Intervals of z, m, that are shut.

        Between rows the roots of the areas are taken as linear, because walls that touch part from each other with at
        least the square of the distance.
        """
        excess = np.sqrt(self.area) - np.sqrt(self.shut_fraction * self.reference)
        cuts: list[tuple[float, float]] = []
        for a, b, fa, fb in zip(self.z[:-1], self.z[1:], excess[:-1], excess[1:]):
            if fa > 0 and fb > 0:
                continue
            start = a if fa <= 0 else a + (b - a) * fa / (fa - fb)
            stop = b if fb <= 0 else a + (b - a) * fa / (fa - fb)
            if cuts and abs(cuts[-1][1] - start) < 1e-12:
                cuts[-1] = (cuts[-1][0], stop)
            elif stop > start:
                cuts.append((start, stop))
        return [(float(a), float(b)) for a, b in cuts]


@shortly
@dataclass(frozen=True)
class InnerFace:
    """Inner face of the wall before the closing plane, and the passage between them.

    Attributes
    ----------
    mesh : ValveMesh
    shell : Shell
    plane : PlaneContact
        Contact of this face, for its gaps.
    initial_gap : float, m
        Least gap at the lip at rest of what a passage is measured against.
    shut_fraction : float
    """

    mesh: ValveMesh
    shell: Shell
    plane: PlaneContact
    initial_gap: float
    shut_fraction: float

    def gaps(self, nodal: np.ndarray) -> np.ndarray:
        """Gaps (nn,), m, of all nodes for nodal unknowns (nn, c), measured as the contact measures them: faces that
        touch leave none.
        """
        return self._points(nodal)[0]

    def passage(self, nodal: np.ndarray, held: np.ndarray | None = None) -> Passage:
        """Passage for nodal unknowns (nn, c); `held` (rows,) are rows shut by their supports."""
        gap, x = self._points(nodal)
        at_rest, x_rest = self._points(np.zeros_like(nodal))
        rows = self.mesh.rows
        area = _area(gap[rows], x[rows])
        if held is not None:
            area[held] = 0.0
        reference = float(_area(np.maximum(at_rest[rows[:1]], self.initial_gap), x_rest[rows[:1]])[0])
        return Passage(self.mesh.z, area, reference, self.shut_fraction)

    def _points(self, nodal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gap (nn,) and x position (nn,) of the inner face at all nodes; the clamped flange is no contact node but has
        a face all the same.
        """
        shell, plane = self.shell, self.plane
        depth, lift = 0.5 * nodal_thickness(shell.mesh), np.zeros(shell.mesh.node_count)
        depth[plane.nodes], lift[plane.nodes] = plane.depth, plane.lift
        directors = shell.directors(nodal)[0] if nodal.any() else shell.mesh.directors
        point = shell.mesh.nodes + nodal[:, :3] - depth[:, None] * directors
        gap = point[:, 1] + lift
        return np.where(gap < plane.law.rounding, np.minimum(gap, 0.0), gap), point[:, 0]


def _area(gap: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Area (rows,) under the gap of rows of points; where the face folds back on itself no width is counted."""
    height = np.maximum(gap, 0.0)
    step = np.maximum(np.diff(x, axis=1), 0.0)
    return np.sum(0.5 * (height[:, 1:] + height[:, :-1]) * step, axis=1)


def film_leak(
    pressure: float, z: np.ndarray, x: np.ndarray, gap: np.ndarray, copies: int, density: float, viscosity: float
) -> float:
    """Leak of the whole valve, m3/s, under a back pressure, Pa, through the gaps that are left.

    A laminar film between two faces that are twice the gap apart, ``12 mu integral dz / integral h^3 dx`` (Batchelor
    1967, section 4.2), and the head of the jet in the narrowest row (Bernoulli). Without viscosity the jet alone.

    Parameters
    ----------
    pressure : float, Pa
    z : (rows,) array, m
    x, gap : (rows, columns) arrays, m
        Points of the inner face and their distance from the closing plane.
    copies : int
        Parts between face and closing plane of which the whole valve consists.
    density : float, kg/m3
    viscosity : float, Pa s
    """
    area = copies * _area(gap, x)
    # Two faces, each before the plane, bound one film.
    conductance = 0.5 * copies * _area(8.0 * np.maximum(gap, 0.0) ** 3, x)
    if not area.min() > 0.0 or not conductance.min() > 0.0:
        return 0.0
    film = 12.0 * viscosity * float(trapezoid(1.0 / conductance, z))
    jet = density / (2.0 * area.min() ** 2)
    return float(2.0 * pressure / (film + np.sqrt(film**2 + 4.0 * jet * pressure)))


class ClosedValve(ValveModel):
    """The valve of a case, pressed from outside; nothing flows, and wall and fluid weigh nothing.

    Parameters
    ----------
    case : Case
        Its ``closure.supports`` are "contact": the inner faces touch the closing plane; or "held-lips": the duckbill
        cannot move across the plane and the mid-surface of the saddle cannot cross it (Th. 3.6).

    Attributes
    ----------
    face : InnerFace
        For measuring gaps with either supports.
    held : (rows,) bool array
        Rows that are shut by the supports.
    """

    def __init__(self, case: Case):
        self.supports = case.closure.supports
        super().__init__(case.replace(CLOSED), closed_by=self.supports)
        self.held = held_rows(case, self.mesh) & (self.supports == HELD_LIPS)
        faces = face_contact(self.case, self.mesh, self.shell, CONTACT)
        self.face = InnerFace(self.mesh, self.shell, faces, case.valve.initial_gap, case.closure.shut_fraction)

    @property
    def nodes_beyond(self) -> np.ndarray:
        """Numbers of the nodes whose inner face starts beyond the closing plane."""
        return self.face.plane.nodes[self.face.plane.start < 0]

    def passage(self, q: np.ndarray) -> Passage:
        """Passage of a state (n,)."""
        return self.face.passage(self.nodal(q), self.held)

    @property
    def reference_opening(self) -> float:
        """Passage between the inner faces of the lip at rest, whole valve, m2."""
        return self.mesh.part.copies * self.passage(np.zeros(self.size)).reference

    def start_warnings(self) -> Iterator[str]:
        """Warnings about where the inner face starts, and about supports that hold it."""
        plane, beyond = self.face.plane, self.nodes_beyond
        if len(beyond):
            z = self.mesh.nodes[plane.nodes[plane.lifted], 2]
            yield (
                f"The inner face starts beyond the closing plane at {len(beyond)} node{'s' * (len(beyond) > 1)}, by up "
                f"to {float(-plane.start.min()) * 1e3:.2g} mm, and nearer to it than the initial gap at {len(z)} "
                f"(z {z.min():.3f} to {z.max():.3f} m, of {plane.count} nodes): there half the wall is thicker than "
                "the mid-surface is high, and contact resists further closing by more than the initial gap only."
            )
        if self.supports == HELD_LIPS:
            yield (
                "The duckbill is held shut by its supports, as in Th. 3.6, so that nothing is found out about "
                "whether its lips seal."
            )
            if self.case.closure.symmetry != EQUILIBRIA:
                yield (
                    "closure.symmetry asks for all symmetry classes, but lips that are held shut cannot move "
                    "together, so with these supports only the class of the model is watched for buckling."
                )


class Pressed:
    """Equilibrium (n,) of a model at a back pressure, Pa, with the columns of a point or a state that follow from it.

    Attributes
    ----------
    nodal : (nn, c) array
    passage : Passage
    touch : ContactState
    """

    def __init__(self, model: ClosedValve, q: np.ndarray, pressure: float):
        part = model.mesh.part
        self.model, self.q, self.pressure, self.nodal = model, q, float(pressure), model.nodal(q)
        self.touch, self.passage = model.contact.state(q), model.passage(q)
        size, area = np.linalg.norm(self.nodal[:, :3], axis=1), self.passage.area
        self.max_displacement = float(size.max())
        self.max_displacement_position = model.mesh.nodes[np.argmax(size)]
        self.opening, self.least_opening = area, float(part.copies * area.min())
        self.least_opening_position = float(self.passage.z[np.argmin(area)])
        self.sealed_length, self.lip_seal = self.passage.shut_length, self.passage.lip_seal
        self.joint_seal, self.closed = self.sealed_length - self.lip_seal, bool(self.passage.shut_intervals)
        self.contact_force, self.penetration = part.walls * self.touch.total, self.touch.penetration

    def describe(self) -> None:
        """Add the columns that only states have."""
        model, plane, touch = self.model, self.model.contact, self.touch
        self.sealed_area = float(model.mesh.part.walls * plane.area[touch.touching].sum())
        self.largest_contact_pressure = float(touch.pressure.max(initial=0.0))
        self.contact_nodes = int(np.count_nonzero(touch.touching))
        self.contact_pressure, self.gap = np.zeros(len(self.nodal)), np.zeros(len(self.nodal))
        self.contact_pressure[plane.nodes] = touch.pressure
        self.gap[model.mesh.rows] = model.face.gaps(self.nodal)[model.mesh.rows]
        centre = LipCentre(model.mesh, model.shell)
        self.lip_opening, self.lip_displacement = centre.opening(self.q), centre.displacement(self.q)
        self.layers = layer_fields(model.shell, self.q)
        for name, values in zip(("largest_strain", "largest_stress"), layer_maxima(self.layers)):
            setattr(self, name, float(values.max()))
            setattr(self, f"{name}_layer", self.layers.names[int(np.argmax(values))])
        pressure = model.flow.steady_pressure(np.zeros(model.stations), self.pressure)
        self.force_balance = force_imbalance(model, self.q, model.nodal_pressure_force(self.nodal, pressure))

    @property
    def overlap(self) -> float:
        """Deepest overlap of the inner faces, m; rows held shut are left out."""
        plane, model = self.model.face.plane, self.model
        movable = np.ones(len(self.nodal), bool)
        movable[model.mesh.rows[model.held].ravel()] = False
        gap = plane.gaps(self.q)
        return float(max(0.0, -gap[movable[plane.nodes]].min(initial=0.0)))

    @property
    def contact_front(self) -> float:
        """Distance from the lip, m, up to which the walls have met along the centre line, to within the initial gap;
        linear between rows.
        """
        model, z = self.model, self.model.mesh.z
        # just less than the gap that lifted rows have at rest
        gap = np.where(model.held, 0.0, model.face.gaps(self.nodal)[model.mesh.centre_line])
        gap = gap - 0.999 * model.case.valve.initial_gap
        met = np.flatnonzero(gap <= 0)
        if not len(met):
            return 0.0
        last = int(met[-1])
        if last + 1 == len(gap):
            return float(z[last])
        a, b = gap[last], gap[last + 1]
        return float(z[last] + (z[last + 1] - z[last]) * a / (a - b))


def layer_maxima(layers: LayerFields) -> tuple[np.ndarray, np.ndarray]:
    """Largest elongation or shortening and largest von Mises stress, Pa, of each layer, (layers,) each."""
    strain = np.maximum(layers.stretch[:, :, 1] - 1, 1 - layers.stretch[:, :, 0])
    return strain.max(axis=0), layers.von_mises.max(axis=0)


def force_imbalance(model: Any, q: np.ndarray, load: np.ndarray) -> float:
    """Norm of the sum of a load (nn, c), N, contact and support forces over the sum of their norms.

    The supports give what the internal forces at held displacements ask for, so the check knows nothing of how the
    state was found.
    """
    nodal, plane = model.nodal(q), model.contact
    internal, contact = model.shell.with_free().force(nodal.ravel()).reshape(nodal.shape), np.zeros_like(nodal)
    contact[plane.nodes, plane.axis] = model.contact.state(q).force
    held = np.where(model.shell.dofs.free, 0.0, internal - load - contact)
    parts = [force[:, :3].sum(axis=0) for force in (load, contact, held)]
    total = sum(float(np.linalg.norm(part)) for part in parts)
    return float(np.linalg.norm(sum(parts))) / total if total > 0 else 0.0
