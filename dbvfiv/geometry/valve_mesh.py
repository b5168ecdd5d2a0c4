"""Graded mesh of the part of the valve that is computed, with its rows, symmetry planes and flow areas at rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..case.mesh import Mesh
from ..case.part import QUARTER, Part, part_of
from ..case.valve import Valve
from ..case.wall import Extent
from ..errors import CaseError
from .divisions import column_division, grading, inverse_grading, row_division
from .surface import surface_of
from .wall_area import wall_deduction


@dataclass(frozen=True)
class ValveMesh:
    """Nodes on rows of constant z, from the lip (row 0) to the flange (last row).

    Attributes
    ----------
    nodes : (nn, 3) array, m
    quads : (ne, 4) int array
        Oriented so that the normal points out of the valve.
    rows : (rows, columns) int array
        Node numbers; column 0 on x = 0, of a half on y = 0, the last column on y = 0.
    columns : (columns,) array
        Position of the columns in the parameter of the grading, 0 at the centre, 1 at the side edge; negative on the
        other side of the centre.
    z : (rows,) array, m
    thickness : (ne,) array, m
    element_z : (ne,) array, m
        Axial position of the element centres.
    element_columns : (ne, 2) array
        Distance in that parameter of the two sides of each element from the centre, the nearer one first.
    rest_area : (rows,) array, m2
        Area between mid-surface and symmetry planes at rest, of the surface itself, not of the polygon through the
        nodes.
    wall_deduction : (rows,) array, m2
        Area taken by the wall (Th. 4.12-4.14), less the initial gap.
    perimeter : (rows,) array, m
        Arc of the inner face. A face inside a section of length L that turns by a right angle and takes the area T off
        it has the length (L^2 - pi T)^(1/2) (Steiner);
        where it turns by two, (L^2 - 2 pi T)^(1/2).
    missed_rows, missed_columns : arrays
        Breaks, in m and in the parameter of the grading, inside elements because there are too few of them.
    part : Part
        Of the valve, that is meshed.
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
    perimeter: np.ndarray
    missed_rows: np.ndarray
    missed_columns: np.ndarray
    part: Part = QUARTER

    @property
    def centre_line(self) -> np.ndarray:
        """(rows,) nodes in the middle of the lips and behind it, from the lip on."""
        return self.rows[:, self.part.centre(self.rows.shape[1])]

    @property
    def mirrored(self) -> np.ndarray | None:
        """(ne,) elements on the far side of the centre, where plies lie as in the mirror image of the quarter; None
        where there are none.
        """
        if self.part.is_quarter:
            return None
        return np.tile(self.columns[1:] <= 0.0, self.shape[1])

    @property
    def shape(self) -> tuple[int, int]:
        """Elements around and along."""
        return self.rows.shape[1] - 1, self.rows.shape[0] - 1


def valve_mesh(valve: Valve, mesh: Mesh, column_breaks=(), parts: Sequence[Extent] = ()) -> ValveMesh:
    """Mesh a valve.

    Parameters
    ----------
    column_breaks : sequence of float
        Where load or supports change along the section, in the parameter of the grading.
    parts : sequence of Extent
        Parts of the wall, beside its patches, that rows and columns should end at.

    Raises
    ------
    ValueError
        If the mesh has fewer elements along than the surface has pieces.
    CaseError
        If patches of the wall leave no flow area.
    """
    part = part_of(valve, mesh)
    surface = surface_of(valve, part)
    parts = (*valve.patches, *parts)
    edges = dict.fromkeys(s for part in parts for s in part.section_edges if 0.0 < s < 1.0)
    column_breaks = (*column_breaks, *(inverse_grading(s, mesh.grading) for s in edges))
    along, across = row_division(valve, mesh, surface, parts), column_division(mesh, surface, column_breaks)
    z, columns = along.positions, across.positions
    if not part.is_quarter:
        columns = np.concatenate([-columns[:0:-1], columns])
    s = _shares(columns, mesh.grading)
    points = np.stack([surface.section(level, s) for level in z])
    for column, across_plane in part.edges:
        points[:, column, across_plane] = 0.0
    count = len(columns)
    rows = np.arange(len(z) * count, dtype=np.int32).reshape(len(z), count)
    quads = np.stack([rows[:-1, :-1], rows[1:, :-1], rows[1:, 1:], rows[:-1, 1:]], axis=-1).reshape(-1, 4)
    rest_area, taken = np.array([surface.area(level) for level in z]), wall_deduction(valve, z, surface)
    if valve.patches and np.any(taken >= rest_area):
        place = z[np.argmax(taken >= rest_area)]
        raise CaseError(
            f"valve.patches leave no flow area at z = {place:.4g} m; the wall must be thinner there.", "valve.patches"
        )
    middle = 0.5 * (z[1:] + z[:-1])
    element_z = np.repeat(middle, count - 1)
    return ValveMesh(
        nodes=points.reshape(-1, 3),
        quads=quads,
        rows=rows,
        columns=columns,
        z=z,
        thickness=_element_thickness(
            valve, element_z, np.abs(_shares(0.5 * (columns[1:] + columns[:-1]), mesh.grading))
        ),
        element_z=element_z,
        element_columns=np.tile(np.sort(np.abs([columns[:-1], columns[1:]]), axis=0).T, (mesh.along, 1)),
        rest_area=rest_area,
        wall_deduction=taken,
        perimeter=np.sqrt(np.array([surface.length(level) for level in z]) ** 2 - 2.0 * part.turn * taken),
        missed_rows=along.missed,
        missed_columns=across.missed,
        part=part,
    )


def _shares(columns: np.ndarray, ratio: float) -> np.ndarray:
    """Normalised arc lengths of columns, with the sign of their side."""
    return np.copysign(grading(np.abs(columns), ratio), columns)


def _element_thickness(valve: Valve, element_z: np.ndarray, across: np.ndarray) -> np.ndarray:
    """(ne,) thickness at the element centres, m; `across` (k,) are their shares of the section from
    the centre."""
    if not valve.patches:
        return np.array([valve.thickness_at(level) for level in element_z])
    shares = np.tile(across, len(element_z) // len(across))
    return np.array([valve.thickness_at(level, share) for level, share in zip(element_z, shares)])
