"""The mesh of the part that is computed, as results keep it, and its mirror images joined to the whole valve."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import h5py
import numpy as np

from ..case.part import PARTS, QUARTER, Part
from ..flow.elastic_line import LineChannel
from ..flow.gas import GasChannel
from .table import TEXT, Column, read_array, write_array

if TYPE_CHECKING:
    from ..model import ValveModel


_COLUMNS = (
    Column("nodes", "m", "Mid-surface at rest, x y z of each node"),
    Column("quads", "", "Four nodes of each element, counter-clockwise seen from outside", "i4"),
    Column(
        "rows", "", "Node numbers: rows from lip to flange, columns from x = 0, of a half from y = 0, to y = 0", "i4"
    ),
    Column("z", "m", "Axial position of the rows (flow stations), from the lip"),
    Column("directors", "", "Unit vectors through the wall at rest"),
    Column("frames", "", "Two unit vectors at each node that the rotation unknowns turn the director towards"),
    Column("free", "", "Which of the five unknowns of each node are free", "bool"),
    Column("thickness", "m", "Wall thickness of each element"),
    Column("layer_names", "", "Materials of the layers, inside to outside", TEXT),
    Column("layer_angles", "deg", "Angle of material axis 1 from the valve's axis"),
    Column("layer_fractions", "", "Share of each layer in the wall"),
)
#: There where the wall relaxes.
_RELAXING = (
    Column("relaxing", "", "Groups of layers that relax alike, by their materials", TEXT),
    Column("branch_group", "", "Which of them each Maxwell branch belongs to, from 0", "i4"),
    Column("branch_time", "s", "Its relaxation time"),
    Column("branch_strength", "", "Its modulus over that of the slow law"),
)
#: There where waves run in the line.
_LINE = (
    Column("line_places", "", "Where the velocities in an elastic line are, from its far end (0) to the flange (1)"),
)
#: There where the fluid in the valve is compressed.
_GAS = (Column("gas_unknowns", "", "Number of unknowns of a fluid that is compressed", "i4"),)
#: There where inner faces touch.
_FACES = (Column("face_nodes", "", "Nodes whose inner face may touch the closing plane", "i4"),)
#: There where more than a quarter is computed.
_PART = (Column("part_name", "", "Part of the valve that the mesh is", TEXT),)


@dataclass(frozen=True)
class MeshData:
    """Mesh of the part of the valve that is computed.

    Attributes
    ----------
    nodes : (nn, 3) m
    quads : (ne, 4) int
    rows : (m, columns) int
        Node numbers, the lip first; column 0 on x = 0, of a half on y = 0, the last on y = 0.
    z : (m,) m
    directors : (nn, 3)
    frames : (nn, 2, 3)
    free : (nn, c) bool
        Unknowns that no support holds: displacements and rotations.
    thickness : (ne,) m
    layer_names : (nl,) tuple of str, inside to outside
    layer_angles : (nl,) degrees
    layer_fractions : (nl,)
    relaxing : (g,) tuple of str
        Groups of layers that relax alike; none where the case leaves the wall elastic.
    branch_group, branch_time, branch_strength : (b,) arrays
        Maxwell branches: group, relaxation time (s), and modulus over that of the slow law.
    line_places : (k + 1,) array
        Where the velocities in an elastic line are; empty without one.
    gas_unknowns : (1,) int array
        Number of unknowns of a fluid that is compressed; empty without one.
    face_nodes : (k,) int array
        Nodes whose inner face may touch the closing plane; none where the lips have stops.
    part_name : (1,) tuple of str
        Part of the valve that the mesh is.
    """

    nodes: np.ndarray
    quads: np.ndarray
    rows: np.ndarray
    z: np.ndarray
    directors: np.ndarray
    frames: np.ndarray
    free: np.ndarray
    thickness: np.ndarray
    layer_names: tuple[str, ...]
    layer_angles: np.ndarray
    layer_fractions: np.ndarray
    relaxing: tuple[str, ...] = ()
    branch_group: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))
    branch_time: np.ndarray = field(default_factory=lambda: np.zeros(0))
    branch_strength: np.ndarray = field(default_factory=lambda: np.zeros(0))
    line_places: np.ndarray = field(default_factory=lambda: np.zeros(0))
    gas_unknowns: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))
    face_nodes: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32))
    part_name: tuple[str, ...] = (QUARTER.name,)

    @classmethod
    def of(cls, model: ValveModel) -> MeshData:
        """Mesh of a model."""
        surface, section = model.shell.mesh, model.shell.section
        branches = model.relaxation.branches(model.case.damping.loss_factor)
        group, time = np.nonzero(branches.strengths)
        return cls(
            nodes=model.mesh.nodes,
            quads=model.mesh.quads,
            rows=model.mesh.rows,
            z=model.mesh.z,
            directors=surface.directors,
            frames=surface.frames,
            free=model.shell.dofs.free,
            thickness=surface.thickness,
            layer_names=tuple(layer.name or f"layer {i + 1}" for i, layer in enumerate(section.layers)),
            layer_angles=np.array([layer.angle for layer in section.layers], float),
            layer_fractions=np.asarray(section.fractions),
            relaxing=branches.groups if branches else (),
            branch_group=group.astype(np.int32),
            branch_time=branches.times[time],
            branch_strength=branches.strengths[group, time],
            line_places=model.flow.line.places[0] if isinstance(model.flow, LineChannel) else np.zeros(0),
            gas_unknowns=np.array([model.flow.inner] if isinstance(model.flow, GasChannel) else [], np.int32),
            face_nodes=np.zeros(0, np.int32) if model.contact is None else model.contact.plane.nodes.astype(np.int32),
            part_name=(model.mesh.part.name,),
        )

    @property
    def part(self) -> Part:
        """Part of the valve that the mesh is."""
        return PARTS[self.part_name[0]]

    @property
    def centre_line(self) -> np.ndarray:
        """(m,) nodes in the middle of the lips and behind it, from the lip on."""
        return self.rows[:, self.part.centre(self.rows.shape[1])]

    def extent(self, row: int, axis: int) -> float:
        """Extent of the whole valve's mid-surface at rest, m, along x (0) or y (1), at a row."""
        places = self.nodes[self.rows[row], axis]
        return float(np.ptp([signs[axis] * places for signs in self.part.images]))

    @property
    def shape(self) -> tuple[int, int]:
        """Elements around and along."""
        return self.rows.shape[1] - 1, self.rows.shape[0] - 1

    @property
    def nodal_shape(self) -> tuple[int, int]:
        """(nn, c): nodes and unknowns of each."""
        return self.free.shape

    def restrict(self, nodal: np.ndarray) -> np.ndarray:
        """Free unknowns (n,) of nodal ones (nn, c)."""
        return nodal[self.free]

    def layer_titles(self) -> tuple[str, ...]:
        """Names of the layers that tell equal materials apart by their angle: "CR", "fibre +54°"."""
        repeated = {name for name in self.layer_names if self.layer_names.count(name) > 1}
        return tuple(
            f"{name} {angle:+g}°" if name in repeated or angle else name
            for name, angle in zip(self.layer_names, self.layer_angles)
        )

    def element_rows(self) -> np.ndarray:
        """(ne,) row between lip and flange that each element begins at; elements are numbered row by row."""
        return np.repeat(np.arange(self.shape[1]), self.shape[0])


def write_mesh(file: h5py.File, mesh: MeshData) -> None:
    """Write a mesh into a result file."""
    group = file.create_group("mesh")
    fluid = (*(_LINE if len(mesh.line_places) else ()), *(_GAS if len(mesh.gas_unknowns) else ()))
    faces = _FACES if len(mesh.face_nodes) else ()
    part = () if mesh.part.is_quarter else _PART
    for column in (*_COLUMNS, *(_RELAXING if mesh.relaxing else ()), *fluid, *faces, *part):
        write_array(group, column, getattr(mesh, column.name))


def read_mesh(file: h5py.File) -> MeshData:
    """Read the mesh of a result file."""
    group = file["mesh"]
    further = (*_RELAXING, *_LINE, *_GAS, *_FACES, *_PART)
    columns = (*_COLUMNS, *(column for column in further if column.name in group))
    return MeshData(**{column.name: read_array(group, column) for column in columns})


@dataclass(frozen=True)
class WholeValve:
    """The valve in space and where its nodes and elements come from.

    Attributes
    ----------
    points : (np, 3) m, at rest
    quads : (nq, 4) int
        Counter-clockwise seen from outside.
    node : (np,) int
        Node of the part behind each point.
    cell : (nq,) int
        Element of the part behind each quadrilateral.
    sign : (np, 3)
        Mirror signs of vectors at each point.
    """

    points: np.ndarray
    quads: np.ndarray
    node: np.ndarray
    cell: np.ndarray
    sign: np.ndarray

    @classmethod
    def of(cls, mesh: MeshData, quarter: bool = False) -> WholeValve:
        """All images, or with `quarter` the part alone that was computed."""
        images = mesh.part.images[:1] if quarter else mesh.part.images
        in_plane = np.zeros((2, len(mesh.nodes)), bool)  # across x, across y
        for column, across in mesh.part.edges:
            in_plane[across, mesh.rows[:, column]] = True
        number = {image: np.full(len(mesh.nodes), -1) for image in images}
        nodes, signs, quads, count = [], [], [], 0
        for sx, sy in images:
            own = number[sx, sy]
            # nodes in a plane of symmetry belong to the image that came first
            for shared, other in zip(in_plane, ((-sx, sy), (sx, -sy))):
                if other in number:
                    own[shared & (own < 0)] = number[other][shared & (own < 0)]
            new = np.flatnonzero(own < 0)
            own[new] = count + np.arange(len(new))
            count += len(new)
            nodes.append(new)
            signs.append(np.broadcast_to([sx, sy, 1.0], (len(new), 3)))
            corners = own[mesh.quads]
            quads.append(corners if sx * sy > 0 else corners[:, ::-1])
        node, sign = np.concatenate(nodes), np.concatenate(signs)
        return cls(
            points=mesh.nodes[node] * sign,
            quads=np.concatenate(quads),
            node=node,
            cell=np.tile(np.arange(len(mesh.quads)), len(images)),
            sign=sign,
        )

    def vectors(self, field: np.ndarray) -> np.ndarray:
        """Vectors (np, 3) at the points from vectors (nn, 3) at the part's nodes."""
        return field[self.node] * self.sign

    def cells(self, field: np.ndarray) -> np.ndarray:
        """Element values (nq, ...) from those of the part (ne, ...)."""
        return field[self.cell]
