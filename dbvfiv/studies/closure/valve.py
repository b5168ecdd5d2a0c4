"""States of the valve under back pressure, their columns, and the leak through the gaps that are left."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.integrate import trapezoid

from ...model.closed import ClosedValve, area_under
from ...model.state import LipCentre
from ...shell.recovery import LayerFields, layer_fields


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
    area = copies * area_under(gap, x)
    # Two faces, each before the plane, bound one film.
    conductance = 0.5 * copies * area_under(8.0 * np.maximum(gap, 0.0) ** 3, x)
    if not area.min() > 0.0 or not conductance.min() > 0.0:
        return 0.0
    film = 12.0 * viscosity * float(trapezoid(1.0 / conductance, z))
    jet = density / (2.0 * area.min() ** 2)
    return float(2.0 * pressure / (film + np.sqrt(film**2 + 4.0 * jet * pressure)))


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
