"""The mesh of the part that is computed, as results keep it, and its mirror images joined to the whole valve."""

from __future__ import annotations

from dataclasses import MISSING, Field, dataclass, field, fields
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from ..case.part import PARTS, QUARTER, Part
from ..flow.elastic_line import LineChannel
from ..texts import shortly
from .table import TEXT, Column, read_array, write_array

if TYPE_CHECKING:
    from ..model.valve import ValveModel


def _kept(units: str, words: str, dtype: str = "f8", default: Any = MISSING) -> Any:
    """Field of a mesh that a file keeps; one with a default is left out of files where it is that."""
    look = {"default_factory": lambda: np.zeros(0, dtype)} if default is None else {"default": default}
    return field(metadata={"column": (units, words, dtype)}, **look)


@shortly
@dataclass(frozen=True)
class MeshData:
    """Mesh of the part of the valve that is computed: nn nodes, ne elements, m rows, nl layers; the metadata of each
    field say what it holds.
    """

    nodes: np.ndarray = _kept("m", "Mid-surface at rest, x y z of each node (nn, 3)")
    quads: np.ndarray = _kept("", "Nodes of each element (ne, 4), counter-clockwise seen from outside", "i4")
    rows: np.ndarray = _kept(
        "", "Node numbers: rows from lip to flange, columns from x = 0, of a half from y = 0, to y = 0", "i4"
    )
    z: np.ndarray = _kept("m", "Axial position of the rows (m,), the flow stations, from the lip")
    directors: np.ndarray = _kept("", "Unit vectors (nn, 3) through the wall at rest")
    frames: np.ndarray = _kept("", "Two unit vectors at each node (nn, 2, 3) that rotations turn the director towards")
    free: np.ndarray = _kept("", "Which of the five unknowns of each node (nn, 5) no support holds", "bool")
    thickness: np.ndarray = _kept("m", "Wall thickness of each element (ne,)")
    layer_names: tuple[str, ...] = _kept("", "Materials of the layers (nl,), inside to outside", TEXT)
    layer_angles: np.ndarray = _kept("deg", "Angle of material axis 1 from the valve's axis (nl,)")
    layer_fractions: np.ndarray = _kept("", "Share of each layer in the wall (nl,)")
    relaxing: tuple[str, ...] = _kept("", "Groups of layers that relax alike, by their materials", TEXT, ())
    branch_group: np.ndarray = _kept("", "Which of them each Maxwell branch belongs to, from 0", "i4", None)
    branch_time: np.ndarray = _kept("s", "Its relaxation time", default=None)
    branch_strength: np.ndarray = _kept("", "Its modulus over that of the long-term response", default=None)
    line_places: np.ndarray = _kept(
        "", "Where the velocities in an elastic line are, from its far end (0) to the flange (1)", default=None
    )
    gas_unknowns: np.ndarray = _kept("", "Number of unknowns of a fluid that is compressed", "i4", None)
    face_nodes: np.ndarray = _kept("", "Nodes whose inner face may touch the closing plane", "i4", None)
    part_name: tuple[str, ...] = _kept("", "Part of the valve that the mesh is", TEXT, (QUARTER.name,))

    def differs_from(self, model: ValveModel) -> str:
        """Words for the mesh where a state on it is none of a model's; empty where the model has as many nodes, no
        further away than the wall is thick, and the same supports.
        """
        nodes, own = self.nodes, model.mesh.nodes
        if nodes.shape != own.shape:
            return f"a mesh of {len(nodes)} nodes and this case's has {len(own)}"
        distance = float(np.linalg.norm(nodes - own, axis=1).max())
        if distance > self.thickness.min():
            return f"another valve, whose nodes lie up to {1e3 * distance:.3g} mm from those of this case"
        alike = np.array_equal(self.free, model.shell.dofs.free)
        return "" if alike else "a valve with other supports than this case's"

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
            gas_unknowns=np.array([model.flow.inner] if model.flow.compressed else [], np.int32),
            face_nodes=np.zeros(0, np.int32) if model.contact is None else model.contact.nodes.astype(np.int32),
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


_COLUMNS = {Column(f.name, *f.metadata["column"]): f for f in fields(MeshData)}


def write_mesh(file: h5py.File, mesh: MeshData) -> None:
    """Write a mesh into a result file."""
    group = file.create_group("mesh")
    for column, declared in _COLUMNS.items():
        value = getattr(mesh, column.name)
        usual = isinstance(value, tuple) and value == declared.default
        if not _is_optional(declared) or (len(value) and not usual):
            write_array(group, column, value)


def read_mesh(file: h5py.File) -> MeshData:
    """Read the mesh of a result file."""
    group = file["mesh"]
    held = [column for column, declared in _COLUMNS.items() if not _is_optional(declared) or column.name in group]
    return MeshData(**{column.name: read_array(group, column) for column in held})


def _is_optional(declared: Field) -> bool:
    return declared.default is not MISSING or declared.default_factory is not MISSING


@dataclass(frozen=True)
class WholeValve:
    """The valve in space and where its nodes and elements come from."""

    points: np.ndarray  #: (np, 3) m, at rest.
    quads: np.ndarray  #: (nq, 4) int; counter-clockwise seen from outside.
    node: np.ndarray  #: (np,) int; node of the part behind each point.
    cell: np.ndarray  #: (nq,) int; element of the part behind each quadrilateral.
    sign: np.ndarray  #: (np, 3); mirror signs of vectors at each point.

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
