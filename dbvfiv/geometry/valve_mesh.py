"""Graded mesh of the quarter valve, with its rows, symmetry planes and flow areas at rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..case.mesh import Mesh
from ..case.valve import Valve
from .divisions import column_division, grading, row_division
from .surface import Surface, surface_of

#: Of the whole valve that a mesh is one of.
QUARTERS = 4


@dataclass(frozen=True)
class ValveMesh:
    """Nodes on rows of constant z, from the lip (row 0) to the flange (last row).

    Attributes
    ----------
    nodes : (nn, 3) array, m
    quads : (ne, 4) int array
        Oriented so that the normal points out of the valve.
    rows : (rows, columns) int array
        Node numbers; column 0 on x = 0, the last column on y = 0.
    columns : (columns,) array
        Position of the columns in the parameter of the grading, 0 at the centre, 1 at the side edge.
    z : (rows,) array, m
    thickness : (ne,) array, m
    element_z : (ne,) array, m
        Axial position of the element centres.
    element_columns : (ne, 2) array
        Grading parameter of the two sides of each element.
    rest_area : (rows,) array, m2
        Area between mid-surface and symmetry planes at rest, of the surface itself, not of the polygon through the
        nodes.
    wall_deduction : (rows,) array, m2
        Area taken by the wall (Th. 4.12-4.14), less the initial gap.
    missed_rows, missed_columns : arrays
        Breaks, in m and in the parameter of the grading, inside elements because there are too few of them.
    """

    nodes: np.ndarray
    quads: np.ndarray
    rows: np.ndarray
    columns: np.ndarray
    z: np.ndarray
    thickness: np.ndarray
    element_z: np.ndarray
    element_columns: np.ndarray
    rest_area: np.ndarray
    wall_deduction: np.ndarray
    missed_rows: np.ndarray
    missed_columns: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        """Elements around and along."""
        return self.rows.shape[1] - 1, self.rows.shape[0] - 1


def valve_mesh(valve: Valve, mesh: Mesh, column_breaks=()) -> ValveMesh:
    """Mesh a valve.

    Parameters
    ----------
    column_breaks : sequence of float
        Where load or supports change along the section, in the parameter of the grading.

    Raises
    ------
    ValueError
        If the mesh has fewer elements along than the surface has pieces.
    """
    surface = surface_of(valve)
    along, across = row_division(valve, mesh, surface), column_division(mesh, surface, column_breaks)
    z, columns = along.positions, across.positions
    s = grading(columns, mesh.grading)
    points = np.stack([surface.section(level, s) for level in z])
    points[:, 0, 0] = 0.0
    points[:, -1, 1] = 0.0
    count = mesh.around + 1
    rows = np.arange(len(z) * count, dtype=np.int32).reshape(len(z), count)
    quads = np.stack([rows[:-1, :-1], rows[1:, :-1], rows[1:, 1:], rows[:-1, 1:]], axis=-1).reshape(-1, 4)
    middle = 0.5 * (z[1:] + z[:-1])
    element_z = np.repeat(middle, mesh.around)
    return ValveMesh(
        nodes=points.reshape(-1, 3),
        quads=quads,
        rows=rows,
        columns=columns,
        z=z,
        thickness=np.array([valve.thickness_at(level) for level in element_z]),
        element_z=element_z,
        element_columns=np.tile(np.stack([columns[:-1], columns[1:]], axis=1), (mesh.along, 1)),
        rest_area=np.array([surface.area(level) for level in z]),
        wall_deduction=wall_deduction(valve, z, surface),
        missed_rows=along.missed,
        missed_columns=across.missed,
    )


def wall_deduction(valve: Valve, z: np.ndarray, surface: Surface) -> np.ndarray:
    """Part of the section taken by the wall (Th. 4.12-4.14, App. A): constant on duckbill, cuff and flange, linear
    over saddle and flare.

    Raises
    ------
    ValueError
        If the wall fills the section of the lip or of the flange that key points give.
    """
    place = np.asarray(z)
    share = np.clip((place - valve.duckbill_length) / valve.saddle_length, 0.0, 1.0)
    if valve.key_points is not None:
        duckbill, flange = _key_point_deductions(valve, surface)
        return duckbill + share * (flange - duckbill)
    duckbill = valve.duckbill_wall_area
    cuff, flange = (_round_deduction(radius, valve) for radius in (valve.cuff_radius, valve.flange_radius))
    taken = duckbill + share * (cuff - duckbill)
    if valve.flare_length > 0:
        begin = valve.duckbill_length + valve.saddle_length + valve.cuff_length
        taken = taken + np.clip((place - begin) / valve.flare_length, 0.0, 1.0) * (flange - cuff)
    return taken


def _round_deduction(radius: float, valve: Valve) -> float:
    """Area taken by the wall inside a quarter circle, m2 (Th. 4.14)."""
    inner = radius - valve.flange_wall_deduction
    return 0.25 * np.pi * (radius**2 - inner**2)


def _key_point_deductions(valve: Valve, surface: Surface) -> tuple[float, float]:
    """Areas taken by the wall at the lip and at the flange that key points give.

    A face at the distance h inside a section of length L that turns by a right angle takes h L - pi h^2/4, which is
    Th. 4.12 and 4.14 for the sections of App. A.
    """
    found = []
    half_walls = (valve.duckbill_wall_deduction, valve.flange_wall_deduction)
    for place, name, z, half in zip(("lip", "flange"), ("duckbill", "flange"), surface.breaks[[0, -1]], half_walls):
        points = surface.section(z, np.linspace(0.0, 1.0, 8001))
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        gap = valve.initial_gap * max(points[-1, 0] - half, 0.0) if place == "lip" else 0.0
        found.append(half * length - 0.25 * np.pi * half**2 - gap)
        if found[-1] >= surface.area(z):
            raise ValueError(
                f"The key points of the {place} leave no flow area inside a half wall of {half:g} m; it must be less, "
                f"see valve.{name}_wall_deduction."
            )
    return found[0], found[1]
