"""Hexahedra between the sections of a domain, with named patches."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .domain import Domain

#: Patches and what they are to OpenFOAM.
PATCHES = {
    "inlet": "patch",
    "outlet": "patch",
    "centre": "symmetryPlane",
    "side": "symmetryPlane",
    "inner": "wall",
    "outer": "wall",
    "lip": "wall",
    "flange": "wall",
    "upstream": "wall",
    "downstream": "wall",
}
#: Nodes closer than this are one, m.
_SAME = 1e-9


@dataclass(frozen=True)
class Block:
    """Cells between sections `first` and `last` of one part of the pattern.

    Attributes
    ----------
    nodes : (l + 1, m + 1, n + 1) int array
        From the outlet on; columns; rings or, of the core, cells along the opening.
    first : int
        Number of its first section.
    """

    nodes: np.ndarray
    first: int

    @property
    def shape(self) -> tuple[int, int, int]:
        """Cells in each direction."""
        return tuple(n - 1 for n in self.nodes.shape)

    @property
    def cells(self) -> np.ndarray:
        """(l m n, 8) nodes of the hexahedra."""
        n = self.nodes
        corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
        ends = [n[k : n.shape[0] - 1 + k] for k in (0, 1)]
        pick = lambda a, i, j: a[:, i : a.shape[1] - 1 + i, j : a.shape[2] - 1 + j]  # noqa: E731
        return np.stack([pick(a, i, j) for a in ends for i, j in corners], axis=-1).reshape(-1, 8)

    def side(self, axis: int, end: int) -> np.ndarray:
        """(k, 4) quadrilaterals at one end of a direction."""
        n = np.take(self.nodes, end, axis=axis)
        return np.stack([n[:-1, :-1], n[1:, :-1], n[1:, 1:], n[:-1, 1:]], axis=-1).reshape(-1, 4)


@dataclass(frozen=True)
class FlowMesh:
    """Hexahedra of a domain.

    Attributes
    ----------
    domain : Domain
    points : (np, 3) array, m
    blocks : dict of str to Block
        ``core``, ``layer``, ``wall`` and ``outside``.
    """

    domain: Domain
    points: np.ndarray
    blocks: dict[str, Block]

    @classmethod
    def of(cls, domain: Domain) -> FlowMesh:
        """Mesh a domain.

        Raises
        ------
        ValueError
            If a cell is turned inside out.
        """
        sections, last = domain.sections, len(domain.stations)
        ranges = {"core": (0, last), "layer": (0, last), "wall": (0, domain.lip + 1), "outside": (0, domain.flange + 1)}
        grids = {name: np.stack([getattr(s, name) for s in sections[a:b]]) for name, (a, b) in ranges.items()}
        everything = np.concatenate([grid.reshape(-1, 3) for grid in grids.values()])
        _, kept, number = np.unique(np.round(everything / _SAME), axis=0, return_index=True, return_inverse=True)
        blocks, begin, number = {}, 0, number.reshape(-1)
        for name, grid in grids.items():
            count = grid[..., 0].size
            nodes = number[begin : begin + count].reshape(grid.shape[:3])
            blocks[name] = Block(nodes, ranges[name][0])
            begin += count
        mesh = cls(domain, everything[kept], blocks)
        corner = mesh.corner_volumes()
        if not np.all(corner > 0):
            where = 1e3 * mesh.points[mesh.cells[np.argmin(corner.min(axis=1))]].mean(axis=0)
            raise ValueError(
                f"{np.count_nonzero((corner <= 0).any(axis=1))} of {len(corner)} cells of the fluid are turned inside "
                f"out, the worst at (x, y, z) = ({where[0]:.1f}, {where[1]:.1f}, {where[2]:.1f}) mm."
            )
        return mesh

    @cached_property
    def cells(self) -> np.ndarray:
        """(nc, 8) nodes, block after block."""
        return np.concatenate([block.cells for block in self.blocks.values()])

    @cached_property
    def centres(self) -> np.ndarray:
        """(nc, 3) m, means of the corners."""
        return self.points[self.cells].mean(axis=1)

    @cached_property
    def station(self) -> np.ndarray:
        """(nc,) section at the downstream end of each cell."""
        parts = []
        for block in self.blocks.values():
            l, m, n = block.shape
            parts.append(np.repeat(block.first + np.arange(l), m * n))
        return np.concatenate(parts)

    @cached_property
    def part(self) -> np.ndarray:
        """(nc,) number of the block of each cell."""
        return np.repeat(np.arange(len(self.blocks)), [len(block.cells) for block in self.blocks.values()])

    def beside(self, name: str, ring: int) -> np.ndarray:
        """(l, around) numbers of the cells of a ring of a block, by section and column; -1 is the outermost."""
        names = list(self.blocks)
        start = sum(len(self.blocks[other].cells) for other in names[: names.index(name)])
        shape = self.blocks[name].shape
        return start + np.arange(np.prod(shape)).reshape(shape)[:, :, ring]

    def corner_volumes(self) -> np.ndarray:
        """(nc, 8) volumes spanned by the three edges at each corner, m3: positive where a cell is sound."""
        p = self.points[self.cells]
        edges = [(1, 3, 4), (2, 0, 5), (3, 1, 6), (0, 2, 7), (7, 5, 0), (4, 6, 1), (5, 7, 2), (6, 4, 3)]
        return np.stack(
            [
                np.einsum("ci,ci->c", np.cross(p[:, a] - p[:, i], p[:, b] - p[:, i]), p[:, c] - p[:, i])
                for i, (a, b, c) in enumerate(edges)
            ],
            axis=1,
        )

    @cached_property
    def volumes(self) -> np.ndarray:
        """(nc,) m3."""
        return self.corner_volumes().mean(axis=1)

    @cached_property
    def patches(self) -> dict[str, np.ndarray]:
        """(k, 4) quadrilaterals of each of `PATCHES`."""
        core, layer, wall, outside = (self.blocks[name] for name in ("core", "layer", "wall", "outside"))
        lip, flange, around = self.domain.lip, self.domain.flange, self.domain.pattern.around
        face, behind, pipe = layer.side(2, -1), outside.side(2, 0), outside.side(2, -1)
        return {
            "inlet": np.concatenate([core.side(0, -1), layer.side(0, -1)]),
            "outlet": np.concatenate([block.side(0, 0) for block in self.blocks.values()]),
            "centre": np.concatenate([core.side(1, 0), *(b.side(1, 0) for b in (layer, wall, outside))]),
            "side": np.concatenate([core.side(2, 0), *(b.side(1, -1) for b in (layer, wall, outside))]),
            "inner": face[lip * around : flange * around],
            "outer": behind[lip * around :],
            "lip": wall.side(0, -1),
            "flange": outside.side(0, -1),
            "upstream": face[flange * around :],
            "downstream": pipe,
        }
