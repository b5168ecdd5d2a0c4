"""Graded mesh of the part of the valve that is computed, with its rows, symmetry planes and flow areas at rest.

The wall takes its part of the flow sections (Th. 4.12-4.14), patches included.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..case.mesh import Mesh
from ..case.part import QUARTER, Part, part_of
from ..case.valve import Valve
from ..case.wall import Extent
from ..errors import CaseError
from ..texts import shortly
from .divisions import column_division, grading, inverse_grading, row_division
from .surface import Surface, surface_of


@shortly
@dataclass(frozen=True)
class ValveMesh:
    """Nodes on rows of constant z, from the lip (row 0) to the flange (last row)."""

    nodes: np.ndarray  #: (nn, 3), m.
    quads: np.ndarray  #: (ne, 4); oriented so that the normal points out of the valve.
    rows: np.ndarray  #: (rows, columns); node numbers; column 0 on x = 0, of a half on y = 0, the last column on y = 0.
    #: (columns,); position of the columns in the parameter of the grading, 0 at the centre, 1 at the side edge;
    #: negative on the other side of the centre.
    columns: np.ndarray
    z: np.ndarray  #: (rows,), m.
    thickness: np.ndarray  #: (ne,), m.
    element_z: np.ndarray  #: (ne,), m; axial position of the element centres.
    #: (ne, 2); distance in that parameter of the two sides of each element from the centre, the nearer one first.
    element_columns: np.ndarray
    #: (rows,), m2; area between mid-surface and symmetry planes at rest, of the surface itself, not of the polygon
    #: through the nodes.
    rest_area: np.ndarray
    wall_deduction: np.ndarray  #: (rows,), m2; area taken by the wall (Th. 4.12-4.14), less the initial gap.
    #: m2; area at the lip that lips in touch leave: the passage at rest, or what the initial gap is of it where they
    #: stand apart there.
    lip_gap: float
    #: (rows,), m; arc of the inner face. A face inside a section of length L that turns by a right angle and takes the
    #: area T off it has the length (L^2 - pi T)^(1/2) (Steiner); where it turns by two, (L^2 - 2 pi T)^(1/2).
    perimeter: np.ndarray
    #: missed_rows and missed_columns: breaks, in m and in the parameter of the grading, inside elements because there
    #: are too few of them.
    missed_rows: np.ndarray
    missed_columns: np.ndarray
    part: Part = QUARTER  #: Of the valve, that is meshed.

    @property
    def centre_line(self) -> np.ndarray:
        """(rows,) nodes in the middle of the lips and behind it, from the lip on."""
        return self.rows[:, self.part.centre(self.rows.shape[1])]

    @property
    def stands_apart(self) -> bool:
        """True where the lips leave more than their gap at rest."""
        return self.lip_gap < self.lip_passage

    @property
    def lip_passage(self) -> float:
        """Area, m2, of the passage at the lip at rest."""
        return float(self.rest_area[0] - self.wall_deduction[0])

    @property
    def inlet_passage(self) -> float:
        """Area, m2, of the passage at the flange at rest."""
        return float(self.rest_area[-1] - self.wall_deduction[-1])

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
    """Mesh a valve. Raises ValueError if the mesh has fewer elements along than the surface has pieces. Raises
    CaseError if the wall leaves no flow area in a section.

    Parameters
    ----------
    column_breaks : sequence of float
        Where load or supports change along the section, in the parameter of the grading.
    parts : sequence of Extent
        Parts of the wall, beside its patches, that rows and columns should end at.
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
    if np.any(taken >= rest_area):
        place, key = z[np.argmax(taken >= rest_area)], "valve.patches" if valve.patches else None
        what = "The wall leaves" if key is None else f"{key} leave"
        raise CaseError(f"{what} no flow area at z = {place:.4g} m; the wall must be thinner there.", key)
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
        lip_gap=_lip_gap(valve, surface, float(rest_area[0] - taken[0])),
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
    shares = np.tile(across, len(element_z) // len(across))
    return np.array([valve.thickness_at(level, share) for level, share in zip(element_z, shares)])


#: Part of the gap by which the passage at rest exceeds it from which lips stand apart: areas of sections are rounded.
_APART = 1e-3


def _lip_gap(valve: Valve, surface: Surface, passage: float) -> float:
    """Area, m2, that lips in touch leave of the passage at rest; those of a bill that is moulded shut touch at rest."""
    slit = valve.initial_gap * _slit_width(valve, surface)
    return slit if 0.0 < (1.0 + _APART) * slit < passage and not valve.is_preset else passage


def _slit_width(valve: Valve, surface: Surface) -> float:
    """Width of the slit between the inner faces, m, of the part."""
    quarters, half = surface.part.quarters, valve.duckbill_wall_deduction
    if valve.key_points is None:
        return quarters * valve.lip.slit(half)
    other, edge = surface.section(surface.breaks[0], np.array([surface.part.begin, 1.0]))[:, 0]
    return max(edge - (0.0 if surface.part.is_quarter else other) - quarters * half, 0.0)


#: Pieces of a section over which a wall that varies around it is summed up.
_FINE = 1000


def wall_deduction(valve: Valve, z: np.ndarray, surface: Surface) -> np.ndarray:
    """Part of the section taken by the wall (Th. 4.12-4.14, App. A): constant on cuff, flange and an even duckbill,
    linear over a ruled saddle and flare; over smooth ones it grows as their sections do, which gain nothing at first.
    Raises ValueError if the wall fills the section of the lip or of the flange that key points give, if these leave a
    wider passage at the lip than at the flange, or if patches fill a section.
    """
    place, joint = np.asarray(z, float), valve.duckbill_length
    share = _grown(surface, place, joint, valve.saddle_length)
    quarters = surface.part.quarters
    if valve.key_points is not None:
        duckbill, cuff, flange = _key_point_deductions(valve, surface)
    else:
        duckbill = quarters * valve.duckbill_wall_area
        radii = valve.cuff_radius, valve.flange_radius
        cuff, flange = (quarters * _round_deduction(radius, valve) for radius in radii)
    taken = duckbill + share * (cuff - duckbill)
    if valve.flare_length > 0:
        begin = joint + valve.saddle_length + valve.cuff_length
        taken = taken + _grown(surface, place, begin, valve.flare_length) * (flange - cuff)
    lip, steps = valve.wall_at(0.0), valve.wall_map if valve.wall == "measured" else ()
    before = (0.0, *(step.to for step in steps))
    uneven = any(step.thickness != lip and begin < joint * (1 - 1e-6) for begin, step in zip(before, steps))
    return taken + (_varied(valve, place, surface, share) if uneven or valve.patches else 0.0)


def _grown(surface: Surface, z: np.ndarray, begin: float, length: float) -> np.ndarray:
    """Share (k,) of a transition that lies before the axial positions z (k,), m: of its length between straight
    rulings, else of what its section grows by.
    """
    line = np.clip((z - begin) / length, 0.0, 1.0)
    inside = (line > 0.0) & (line < 1.0)
    if not (surface.smooth and np.any(inside)):
        return line
    first, last = surface.area(begin), surface.area(begin + length)
    if last > first:
        line[inside] = np.clip([(surface.area(level) - first) / (last - first) for level in z[inside]], 0.0, 1.0)
    return line


def _round_deduction(radius: float, valve: Valve) -> float:
    """Area taken by the wall inside a quarter circle, m2 (Th. 4.14)."""
    inner = radius - valve.flange_wall_deduction
    return 0.25 * np.pi * (radius**2 - inner**2)


def _key_point_deductions(valve: Valve, surface: Surface) -> tuple[float, float, float]:
    """Areas taken by the wall at the lip, at the cuff and at the flange that key points give.

    A face at the distance h inside a section of length L that turns by a right angle takes h L - pi h^2/4, which is
    Th. 4.12 and 4.14 for the sections of App. A; where it turns by two, h L - pi h^2/2.
    """
    found = []
    lip, flange = surface.breaks[[0, -1]]
    cuff = flange if valve.flare_length == 0 else valve.duckbill_length + valve.saddle_length
    halves = {"duckbill": valve.duckbill_wall_deduction, "flange": valve.flange_wall_deduction}
    height = float(surface.section(lip, np.zeros(1))[0, 1])
    if valve.initial_gap > height:
        raise ValueError(
            f"The key points have the middle of a lip's wall {height:.4g} m above the slit, and valve.initial_gap is "
            f"{valve.initial_gap:g} m; it is the gap between faces at rest."
        )
    for place, name, z in (("lip", "duckbill", lip), ("cuff", "flange", cuff), ("flange", "flange", flange)):
        half = halves[name]
        gap = valve.initial_gap * _slit_width(valve, surface) if place == "lip" else 0.0
        found.append(half * surface.length(z) - 0.5 * surface.part.turn * half**2 - gap)
        # beyond its centre a face would turn inside out
        if surface.part.turn * half >= surface.length(z) or found[-1] >= surface.area(z):
            raise ValueError(
                f"The key points of the {place} leave no flow area inside a half wall of {half:g} m; it must be less, "
                f"see valve.{name}_wall_deduction."
            )
    inside = [
        1e4 * surface.part.copies * (surface.area(z) - taken) for z, taken in ((lip, found[0]), (flange, found[2]))
    ]
    if inside[0] >= inside[1]:
        raise ValueError(
            f"The key points leave {inside[0]:.4g} cm2 between the lips at rest; the passage there must be smaller "
            f"than that of the flange, {inside[1]:.4g} cm2."
        )
    return found[0], found[1], found[2]


def _varied(valve: Valve, z: np.ndarray, surface: Surface, share: np.ndarray) -> np.ndarray:
    """Areas (k,), m2, that patches, and steps of the wall within the duckbill, take off the sections at z beyond what
    an even wall does; share (k,) of the saddle lies before them.

    A half wall h(s) inside a section takes the integral of h ds - h^2/2 dtheta, theta being the direction of the
    section. Where the inner faces of both lips would cross they meet, as those of an even wall do.
    """
    edges = [s for patch in valve.patches for s in patch.section_edges]
    places = np.unique(np.round([*np.linspace(0.0, 1.0, _FINE + 1), *edges], 12))
    if not surface.part.is_quarter:
        places = np.concatenate([-places[:0:-1], places])
    middle = 0.5 * (places[1:] + places[:-1])
    halves = valve.duckbill_wall_deduction + share * (valve.flange_wall_deduction - valve.duckbill_wall_deduction)
    taken = []
    for level, even, left in zip(z, halves, 1.0 - share):
        points = surface.section(level, places)[:, :2]
        steps = np.diff(points, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        angle = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
        between = np.concatenate([angle[:1], 0.5 * (angle[1:] + angle[:-1]), angle[-1:]])
        turn = between[:-1] - between[1:]
        room = 0.5 * (points[1:, 1] + points[:-1, 1]) * lengths / np.maximum(steps[:, 0], 1e-9 * lengths)
        half = np.minimum(even + 0.5 * _added(valve, level, np.abs(middle), left), np.maximum(room, even))
        more = np.sum((half - even) * lengths - 0.5 * (half**2 - even**2) * turn)
        taken.append(float(more))
    return np.array(taken)


def _added(valve: Valve, z: float, shares: np.ndarray, left: float) -> np.ndarray:
    """Wall at shares (k,) of the section beyond an even one, m, `thickness_factor` left out: over that at the lip in
    the duckbill, over that without patches behind it, where a share `left` of its steps is left; the mean before and
    behind an axial position.
    """
    near, joint, lip = 1e-6 * valve.length, valve.duckbill_length, valve.wall_at(0.0)
    steps = left * (valve.wall_at(joint - near) - lip)
    places = [place for place in (z - near, z + near) if 0.0 < place < valve.length]
    even = [lip if place < joint else valve.wall_at(place) - steps for place in places]
    return np.mean([[valve.wall_at(place, s) - own for s in shares] for place, own in zip(places, even)], axis=0)
