"""From the part that is computed to the whole valve: its mirror images joined along the planes of symmetry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .mesh import MeshData


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
