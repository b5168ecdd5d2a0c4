"""One state under back pressure and what a user reads off it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...model.state import LipCentre
from ...shell.recovery import layer_fields
from .balance import force_balance
from .model import ClosureModel
from .opening import Opening, opening
from .stiffness import StiffnessSpectrum


@dataclass(frozen=True)
class ClosureState:
    """An equilibrium under back pressure. Areas and forces are those of the whole valve, fields those of the
    part that is computed.

    Attributes
    ----------
    pressure : float, Pa
        Outside.
    closed : bool
        Some section is shut: less than `closure.shut_fraction` of the lip's opening at rest is left.
    sealed_length : float, m
        Length along the axis on which sections are shut.
    lip_seal : float, m
        The part of it that begins at the lip.
    joint_seal : float, m
        The rest, at the joint of duckbill and saddle and on the saddle.
    sealed_area : float, m2
        Area over which the inner faces press on each other.
    contact_force : float, N
        With which the two walls press on each other (on the stops, with held lips).
    largest_contact_pressure : float, Pa
    contact_nodes : int
    contact_front : float, m
        How far from the lip the walls have met along the centre line, to within `valve.initial_gap`; 0 if nowhere.
    penetration : float, m
        Deepest penetration of contact points beyond the plane.
    overlap : float, m
        Deepest overlap of the inner faces; larger than the penetration where the supports do not look at the faces.
    least_opening : float, m2
        Smallest passage left.
    least_opening_position : float, m
    lip_opening : float, m
        Full clear opening between the inner faces of both lips at x = z = 0; never below zero, see
        `dbvfiv.model.state.LipCentre.opening`.
    lip_displacement : float, m
        Displacement in y of the mid-surface of one lip there.
    max_displacement : float, m
    max_displacement_position : (3,) tuple, m, at rest
    largest_strain : float
        Largest elongation or shortening of any layer in its plane.
    largest_strain_layer : str
    largest_stress : float, Pa
        Largest von Mises stress of any layer.
    largest_stress_layer : str
    lowest_stiffness_eigenvalue : float, 1/s2
        Of the tangent stiffness against the mass matrix; not positive at and beyond buckling.
    lowest_symmetric_eigenvalue : float, 1/s2
    asymmetry : float
        Of the tangent stiffness.
    stable : bool
    beyond_limit : bool
        The state lies beyond a limit point, so a valve loaded by rising pressure jumps before it gets here.
    force_balance, energy_balance : float
        Relative errors, see `balance`.
    converged, iterations, load_steps, multiplier_updates, residual, rounding, reason
        How it was found.
    nodal : (nn, c) array, m and rad
        Displacements and rotations of all nodes, c = 5.
    opening : (rows,) array, m2
        Passage of the computed part at each row.
    contact_pressure, gap : (nn,) arrays, Pa, m
    stiffness_eigenvalues : (k,) array, 1/s2
        Real parts, ascending.
    before_limit : bool
        Not asked for: the last state before a limit.
    """

    pressure: float
    closed: bool
    sealed_length: float
    lip_seal: float
    joint_seal: float
    sealed_area: float
    contact_force: float
    largest_contact_pressure: float
    contact_nodes: int
    contact_front: float
    penetration: float
    overlap: float
    least_opening: float
    least_opening_position: float
    lip_opening: float
    lip_displacement: float
    max_displacement: float
    max_displacement_position: tuple[float, float, float]
    largest_strain: float
    largest_strain_layer: str
    largest_stress: float
    largest_stress_layer: str
    lowest_stiffness_eigenvalue: float
    lowest_symmetric_eigenvalue: float
    asymmetry: float
    stable: bool
    beyond_limit: bool
    force_balance: float
    energy_balance: float
    converged: bool
    iterations: int
    load_steps: int
    multiplier_updates: int
    residual: float
    rounding: float
    reason: str
    nodal: np.ndarray
    opening: np.ndarray
    contact_pressure: np.ndarray
    gap: np.ndarray
    stiffness_eigenvalues: np.ndarray
    before_limit: bool = False


def describe_closure(
    model: ClosureModel, q: np.ndarray, pressure: float, spectrum: StiffnessSpectrum, **known
) -> ClosureState:
    """State of a model from its unknowns; `known` holds how it was found, the energy balance and whether it lies beyond
    a limit point.
    """
    pressed, part = model.pressed, model.mesh.part
    nodal = pressed.nodal(q)
    state, passage = pressed.contact_state(q), opening(model, q)
    fraction = model.case.closure.shut_fraction
    intervals = passage.shut_intervals(fraction)
    length, lip = passage.shut_length(fraction), passage.lip_seal(fraction)
    pressures = np.zeros(len(nodal))
    pressures[pressed.contact.nodes] = state.pressure
    gap = np.zeros(len(nodal))
    gap[model.mesh.rows] = passage.gap
    layers = layer_fields(pressed.shell, q)
    strain = np.maximum(layers.stretch[:, :, 1] - 1, 1 - layers.stretch[:, :, 0]).max(axis=0)
    stress = layers.von_mises.max(axis=0)
    displacement = np.linalg.norm(nodal[:, :3], axis=1)
    where = int(np.argmax(displacement))
    centre = LipCentre(model.mesh, pressed.shell)
    return ClosureState(
        pressure=float(pressure),
        closed=bool(intervals),
        sealed_length=length,
        lip_seal=lip,
        joint_seal=length - lip,
        sealed_area=float(part.walls * pressed.contact.area[state.touching].sum()),
        contact_force=part.walls * state.total,
        largest_contact_pressure=float(state.pressure.max(initial=0.0)),
        contact_nodes=int(np.count_nonzero(state.touching)),
        contact_front=contact_front(passage, model),
        penetration=state.penetration,
        overlap=face_overlap(model, nodal),
        least_opening=float(part.copies * passage.area.min()),
        least_opening_position=float(passage.z[passage.narrowest]),
        lip_opening=centre.opening(q),
        lip_displacement=centre.displacement(q),
        max_displacement=float(displacement[where]),
        max_displacement_position=tuple(float(value) for value in model.mesh.nodes[where]),
        largest_strain=float(strain.max()),
        largest_strain_layer=layers.names[int(np.argmax(strain))],
        largest_stress=float(stress.max()),
        largest_stress_layer=layers.names[int(np.argmax(stress))],
        lowest_stiffness_eigenvalue=spectrum.lowest,
        lowest_symmetric_eigenvalue=float(spectrum.symmetric_values[0]),
        asymmetry=spectrum.asymmetry,
        stable=bool(spectrum.lowest > 0),
        force_balance=force_balance(pressed, q, pressure).error,
        nodal=nodal,
        opening=passage.area,
        contact_pressure=pressures,
        gap=gap,
        stiffness_eigenvalues=spectrum.values.real,
        **known,
    )


def face_overlap(model: ClosureModel, nodal: np.ndarray) -> float:
    """Deepest overlap of the inner faces, m, for nodal unknowns (nn, c); rows held shut by supports are left out."""
    face = model.face
    gap = face.gap(nodal, model.shell.directors(nodal)[0])
    movable = np.ones(len(nodal), bool)
    movable[model.mesh.rows[model.held].ravel()] = False
    return float(max(0.0, -gap[movable[face.nodes]].min(initial=0.0)))


def contact_front(passage: Opening, model: ClosureModel) -> float:
    """Distance from the lip, m, up to which the walls have met along the centre line, to within the initial gap.

    It is linear between rows.
    """
    # just less than the gap that lifted rows have at rest
    gap = (
        np.where(model.held, 0.0, passage.gap[:, model.mesh.part.centre(passage.gap.shape[1])])
        - 0.999 * model.case.valve.initial_gap
    )
    met = np.flatnonzero(gap <= 0)
    if not len(met):
        return 0.0
    last = int(met[-1])
    if last + 1 == len(gap):
        return float(passage.z[last])
    a, b = gap[last], gap[last + 1]
    return float(passage.z[last] + (passage.z[last + 1] - passage.z[last]) * a / (a - b))
