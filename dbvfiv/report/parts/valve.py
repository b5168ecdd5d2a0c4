"""The valve and its wall."""

from __future__ import annotations

import numpy as np

from ...drawing.deformed import deformed
from ...drawing.described import valve_figure
from ...record.mesh import MeshData
from .. import live
from ..content import Part, Table, picture
from ..gather import Gathered


def part(found: Gathered) -> Part:
    """Measures, layers, and the valve in space at its driving pressure."""
    state = None if found.steady is None or not found.steady.states else _chosen(found)
    mesh = next(iter(found.results.values())).mesh if found.results else None
    sentences, tables = [], []
    if mesh is not None:
        width, height = (1e3 * mesh.extent(0, axis) for axis in (0, 1))
        inlet = 2e3 * np.hypot(mesh.nodes[mesh.rows[-1], 0], mesh.nodes[mesh.rows[-1], 1]).max()
        sentences = [
            f"{1e3 * np.ptp(mesh.z):.0f} mm long; at the lip {width:.0f} mm wide and {height:.1f} mm high over the "
            f"middle of the wall, at the flange {inlet:.0f} mm across.",
            f"The wall is {_range(mesh.thickness * 1e3)} mm thick, of {len(mesh.layer_names)} layers, inside to "
            "outside:",
        ]
        tables = [_layers(found, mesh)]
    pictures = []
    if state is not None:
        caption = f"The valve at {state.pressure / 1e3:.4g} kPa, true to scale; on a screen it can be turned."
        pictures = [picture("deformed", caption, lambda: deformed(state), live.valve(state))]
    if found.results:
        model = next(iter(found.results.values())).model
        told = "As the case describes it: faces, measures, wall and layers."
        pictures.insert(0, picture("described", told, lambda: valve_figure(model)))
    return Part("valve", "The valve", tuple(sentences), tuple(tables), tuple(pictures))


def _chosen(found: Gathered):
    return found.steady.nearest(found.case.drive.pressure)


def _range(values: np.ndarray) -> str:
    low, high = values.min(), values.max()
    return f"{low:.4g}" if high - low < 1e-6 * high else f"{low:.4g} to {high:.4g}"


def _layers(found: Gathered, mesh: MeshData) -> Table:
    rows = []
    for i, name in enumerate(mesh.layer_names):
        share = mesh.layer_fractions[i]
        angle = mesh.layer_angles[i]
        rows.append((str(i + 1), name, _range(mesh.thickness * share * 1e3), f"{angle:g}"))
    return Table(("layer", "material", "thickness, mm", "angle from the valve's axis, degrees"), tuple(rows))
