"""From a case to the shell and the flow it describes."""

from __future__ import annotations

import numpy as np

from ..case.model import Case
from ..case.quantity import GRAVITY
from ..errors import CaseError
from ..fit.cards import law_from_case, relaxation_from_case
from ..flow.channel import Channel
from ..flow.elastic_line import ElasticLine, LineChannel
from ..flow.gas import GasChannel
from ..flow.law import FlowLaw, UniformLoad
from ..flow.terms import terms_of
from ..flow.terms.line import Line, PiecedLine
from ..flow.terms.pump import Pump
from ..geometry.divisions import grading
from ..geometry.valve_mesh import ValveMesh, valve_mesh
from ..materials.laws import OrthotropicPly
from ..shell.mesh import ShellMesh
from ..shell.pressure import Weight
from ..shell.section import Layer, Section, Zones
from ..shell.shell import Shell
from .preset import pressure_for_overlap, stress_free_shape
from .symmetry import equilibria_of


def build_section(case: Case) -> Section:
    """Wall of a case, inside to outside, with its shear-correction factors."""
    layers = []
    for layer in case.layers:
        law = law_from_case(case, layer.material)
        ply = isinstance(law, OrthotropicPly)
        factor = case.shell.shear_correction_plies if ply else case.shell.shear_correction_rubber
        relaxation = relaxation_from_case(case, layer.material)
        layers.append(Layer(law, layer.thickness, layer.angle, factor, layer.material, relaxation))
    return Section(tuple(layers), case.mesh.layer_points)


def build_shell(case: Case, section: Section | None = None) -> tuple[ValveMesh, Shell]:
    """Mesh and shell of a case; `section` in place of the case's own wall."""
    fillers = [layer.enlarged(case.valve.scale) for layer in case.layers if layer.is_limited]
    mesh = valve_mesh(case.valve, case.mesh, (1.0 - case.drive.unloaded_edge, 0.5), fillers)
    surface = ShellMesh.build(
        mesh.nodes,
        mesh.quads,
        mesh.thickness,
        material_axis=(0.0, 0.0, 1.0),
        planes=[(mesh.rows[:, column], across) for column, across in mesh.part.edges],
        mirrored=mesh.mirrored,
    )
    section = section or build_section(case)
    zones = layer_zones(case, mesh) if fillers else None
    choices = (case.shell.metric, case.mesh.element, zones, case.shell.mass)
    shell = Shell(surface, section, equilibria_of(mesh.part).free_unknowns(mesh), *choices)
    return mesh, _preset(case, mesh, shell) if case.valve.is_preset else shell


def _preset(case: Case, mesh: ValveMesh, shell: Shell) -> Shell:
    """The shell of a bill that is moulded shut, without stress in another shape."""
    valve, loaded = case.valve, moulded_share(mesh, case)
    opening = (mesh.rest_area - mesh.wall_deduction) / mesh.perimeter * (mesh.z < valve.moulded_length)
    widest = int(np.argmax(opening))
    if opening[widest] > 2.0 * valve.initial_gap:
        raise CaseError(
            f"The faces of a bill that is moulded shut touch as drawn, and at z = {1e3 * mesh.z[widest]:.4g} mm these "
            f"leave {2e3 * opening[widest]:.3g} mm; the wall must be thicker there, or valve.lip_radius smaller.",
            "valve.lip_radius",
        )
    pressure = valve.sealing_pressure
    if valve.sealing_force:
        pressure = valve.sealing_force / valve.moulded_length
    elif valve.overlap:
        pressure = pressure_for_overlap(shell, loaded, int(mesh.centre_line[0]), valve.overlap)
    elif valve.cracking_head:
        pressure = case.fluid.density * GRAVITY * valve.cracking_head
    return shell.preset(stress_free_shape(shell, loaded, pressure), pressure)


def moulded_share(mesh: ValveMesh, case: Case) -> np.ndarray:
    """(ne,) share of each element of a bill that is moulded shut that the other lip presses on evenly."""
    begin, end = (
        mesh.z[np.searchsorted(mesh.z, mesh.element_z, side) - shift] for side, shift in (("left", 1), ("right", 0))
    )
    return loaded_share(mesh, case) * np.clip((case.valve.moulded_length - begin) / (end - begin), 0.0, 1.0)


def loaded_share(mesh: ValveMesh, case: Case) -> np.ndarray:
    """(ne,) share of each element that carries pressure: none beside the side edge of the duckbill (App. A)."""
    limit = 1.0 - case.drive.unloaded_edge
    left, right = mesh.element_columns.T
    share = np.clip((limit - left) / (right - left), 0.0, 1.0)
    return np.where(mesh.element_z < case.valve.duckbill_length, np.round(share, 12), 1.0)


def layer_zones(case: Case, mesh: ValveMesh) -> Zones:
    """Zones of a case's elements by the layers that cover their centres."""
    layers = [layer.enlarged(case.valve.scale) for layer in case.layers]
    shares = grading(mesh.element_columns.mean(axis=1), case.mesh.grading)
    return Zones.of([[layer.covers(z, s) for layer in layers] for z, s in zip(mesh.element_z, shares)])


def build_weight(case: Case, shell: Shell) -> Weight | None:
    """Weight of the wall of a case in the fluids on its sides; None without gravity."""
    if not case.gravity.is_there:
        return None
    inside = case.fluid.density
    displaced = 0.5 * (inside + case.outside.density(inside)) if case.drive.kind == "flow" else 0.0
    return Weight(shell, np.array([0.0, 0.0, case.gravity.along]), displaced)


def _levels(case: Case, mesh: ValveMesh) -> dict[str, np.ndarray]:
    """Pressures of the fluids' levels, Pa, over those at the lips, as `Channel` takes them; none without gravity."""
    if not case.gravity.is_there:
        return {}
    height = mesh.z - mesh.z[0]
    inside = case.fluid.density * (case.gravity.along * height)
    return {"levels": inside, "levels_outside": case.outside_level(height)}


def build_flow(case: Case, mesh: ValveMesh) -> FlowLaw:
    """Flow law of a case on the stations of its mesh."""
    if case.drive.kind == "uniform":
        return UniformLoad(len(mesh.z), 1.0 if case.drive.side == "inside" else -1.0)
    storage = 1.0 if case.fluid.continuity == "storage" else 0.0
    # lips on stops stay where they are at rest, lens and all; faces come down to their gap
    shut = mesh.lip_gap if case.faces_touch else mesh.lip_passage
    terms, floor = terms_of(case), case.film_share * shut
    given = {"back": case.downstream.pressure, "perimeter": mesh.perimeter, "density": case.fluid.density}
    given |= _levels(case, mesh)
    bowed = case.mesh.inertia == "parabolic"

    def passage(terms) -> Channel | GasChannel:
        own = {"reversible": True} if case.is_compressed else {"bowed": bowed}
        found = Channel(mesh.z, floor, storage, case.fluid.unsteady, terms, **own, **given)
        if not case.is_compressed:
            return found
        return GasChannel(found, case.fluid.sound_speed, case.fluid.heat_capacity_ratio, case.boiling_pressure)

    if not case.has_waves:
        return passage(terms)
    line = next(term for term in terms if isinstance(term, (Line, PiecedLine)))
    pump = next((term for term in terms if isinstance(term, Pump)), None)
    rest = [term for term in terms if term not in (line, pump)]
    pipes = case.upstream.pipes
    waves = ElasticLine(line, [pipe.wave_speed for pipe in pipes], [pipe.elements for pipe in pipes], pump)
    return LineChannel(passage(rest), passage(terms), waves)
