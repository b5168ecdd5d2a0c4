"""The flow domain along the axis: a pipe upstream, the valve, its jet and a pipe downstream, meshed by hexahedra.

Every section has the same pattern. Round a core of `top` by `side` cells run rings of `top + side` columns: the layer
at the inner face, the wall's thickness (fluid only downstream of the lip), and what lies between outer face and pipe.
The corner of the core looks at the tip where the passage is a slit and at half the arc where it is round.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import PchipInterpolator

from ..exchange.bodies import WallFaces

#: The tip is closed where the passage is lower than this share of its height at the centre line: cells need an angle.
TIP = 0.05
#: The wall that closes it slants outwards by this share of its height, as far as the passage goes on.
SLANT = 0.5
#: Height over half width of a passage up to which it is a slit to the mesh, and from which it is round.
SLIT, ROUND = 0.55, 0.95
#: Size of the core over that of the passage, across and along the opening; of a slit and of a round section.
CORE_SLIT, CORE_ROUND = np.array([0.97, 0.6]), np.array([0.62, 0.62])
#: By how much more of the passage the core reaches at its corner, which keeps that corner convex; of a round section.
#: It is there in full from this roundness on.
BULGE, BULGED = 0.12, 0.25
#: Cells at the tip end of the core over those at the centre line, in length.
TIPWARDS = 0.35


@dataclass(frozen=True)
class Pattern:
    """Cells of a section."""

    #: top and side: of the core: beside the centre line x = 0 across the lips, and along the opening.
    top: int = 26
    side: int = 12
    #: layer, wall and outside: rings at the inner face, behind the lip and up to the pipe.
    layer: int = 9
    wall: int = 5
    outside: int = 14
    growth: float = 1.35  #: Of the layer's cells away from the inner face.

    def refined(self, factor: float) -> Pattern:
        """More cells in both directions, of the same spread."""
        count = [max(2, round(factor * n)) for n in (self.top, self.side, self.layer, self.wall, self.outside)]
        return Pattern(*count, growth=self.growth ** (1.0 / factor))

    @property
    def around(self) -> int:
        """Columns of the rings."""
        return self.top + self.side


@dataclass(frozen=True)
class Section:
    """Nodes of a section, m."""

    core: np.ndarray  #: (top + 1, side + 1, 3); from the axis.
    #: layer, wall and outside: (around + 1, rings + 1, 3); from the core, inner face and outer face outwards; columns
    #: from x = 0 to y = 0.
    layer: np.ndarray
    wall: np.ndarray
    outside: np.ndarray


def section_nodes(inner: np.ndarray, outer: np.ndarray, radius: float, pattern: Pattern) -> Section:
    """Nodes between the faces of the wall and in a pipe.

    Parameters
    ----------
    inner, outer : (columns, 3) arrays, m
        Sections of both faces, from x = 0 to y = 0.
    radius : float, m
        Of the pipe.
    """
    face, behind, roundness = _perimeters(inner, outer, pattern)
    core = _core_edge(face, pattern, roundness)
    near = _near_corner(pattern)
    even = ((1.0 - roundness) * near**8)[:, None]  # thin cells at a tip that moves along the axis would be slanted
    grow = (1.0 - even) * _graded(pattern.layer, 1.0 / pattern.growth) + even * _graded(pattern.layer, 1.0)
    out = _graded(pattern.outside, 1.18 ** (14.0 / pattern.outside))
    angle = _pipe_angles(behind)
    pipe = np.column_stack([radius * np.sin(angle), radius * np.cos(angle), behind[:, 2]])
    pipe[0, 0] = pipe[-1, 1] = 0.0
    return Section(
        _core(core, pattern),
        _ring(core, face, grow),
        _ring(face, behind, _graded(pattern.wall, 1.3)),
        _ring(behind, pipe, out),
    )


def _perimeters(inner, outer, pattern):
    """Nodes (around + 1, 3) on both faces, and how round the passage is, 0..1."""
    place = np.arange(len(inner), dtype=float)
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(inner, axis=0), axis=1))])
    arc += np.arange(len(arc)) * 1e-12 * arc[-1]
    curve, column = PchipInterpolator(arc, inner), PchipInterpolator(arc, place)
    fine = np.linspace(0.0, arc[-1], 2001)
    low = TIP * inner[0, 1]
    cut = fine[np.argmax(curve(fine)[:, 1] <= low)]
    end = curve(cut)
    length = cut + end[1]
    roundness = np.clip((inner[0, 1] / end[0] - SLIT) / (ROUND - SLIT), 0.0, 1.0)
    roundness = roundness**2 * (3.0 - 2.0 * roundness)
    corner = (1.0 - roundness) * cut + roundness * 0.5 * length
    shrink = 1.0 - (1.0 - TIPWARDS) * (1.0 - roundness)
    top = corner * _graded(pattern.top, shrink ** (1.0 / max(1, pattern.top - 1)))
    side = corner + (length - corner) * np.linspace(0.0, 1.0, pattern.side + 1)
    at = np.concatenate([top, side[1:]])
    face = curve(np.minimum(at, cut))
    past = at > cut
    face[past] = end
    face[past, 1] = length - at[past]
    face[past, 0] += min(SLANT, (inner[-1, 0] - end[0]) / end[1]) * (at[past] - cut)
    share = np.clip((at - cut) / (length - cut), 0.0, 1.0)
    columns = column(np.minimum(at, cut)) * (1.0 - share) + share * place[-1]
    behind = PchipInterpolator(place, outer)(columns)
    for nodes in (face, behind):
        nodes[0, 0] = nodes[-1, 1] = 0.0
    return face, behind, float(roundness)


def _graded(count: int, step: float) -> np.ndarray:
    """Shares 0..1 of cells each of which is `step` times as long as the one before."""
    sizes = step ** np.arange(count)
    return np.concatenate([[0.0], np.cumsum(sizes)]) / sizes.sum()


def _near_corner(pattern):
    """(around + 1,) 0 at the centre line, 1 from the corner on."""
    return np.concatenate([np.linspace(0.0, 1.0, pattern.top + 1), np.ones(pattern.side)])


def _core_edge(face, pattern, roundness):
    """Nodes (around + 1, 3) of the edge of the core."""
    top = pattern.top
    size = np.tile((1.0 - roundness) * CORE_SLIT + roundness * CORE_ROUND, (top + 1, 1))
    size += (BULGE * min(1.0, roundness / BULGED) * _near_corner(pattern)[: top + 1] ** 2)[:, None]
    edge = face.copy()
    edge[: top + 1, :2] *= np.minimum(size, CORE_SLIT[0])
    end = face[-1] * [(1.0 - roundness) * CORE_SLIT[0] + roundness * CORE_ROUND[0], 0.0, 1.0]
    down = np.linspace(0.0, 1.0, pattern.side + 1)[:, None]
    edge[top:] = (1.0 - down) * edge[top] + down * end
    edge[0, 0] = edge[-1, 1] = 0.0
    return edge


def _core(edge, pattern):
    """Transfinite interpolation between the axis and the edge of the core."""
    top, right = edge[: pattern.top + 1], edge[pattern.top :][::-1]  # to the corner, and up to it
    bottom = np.column_stack([top[:, 0] / top[-1, 0] * right[0, 0], np.zeros(len(top)), top[:, 2]])
    left = np.column_stack(
        [np.zeros(len(right)), right[:, 1] / right[-1, 1] * top[0, 1], np.full(len(right), top[0, 2])]
    )
    bottom[-1], left[-1] = right[0], top[0]
    bottom[0, 2] = left[0, 2] = top[0, 2]
    a = (top[:, 0] / top[-1, 0])[:, None, None]
    b = (right[:, 1] / right[-1, 1])[None, :, None]
    nodes = (1 - b) * bottom[:, None] + b * top[:, None] + (1 - a) * left[None] + a * right[None]
    corners = (1 - a) * (1 - b) * bottom[0] + a * (1 - b) * bottom[-1] + (1 - a) * b * top[0] + a * b * top[-1]
    nodes -= corners
    nodes[0, :, 0] = 0.0
    nodes[:, 0, 1] = 0.0
    nodes[:, -1], nodes[-1] = top, right
    return nodes


def _ring(inside, outside, shares):
    """Nodes (around + 1, rings + 1, 3) on straight lines at shares of them, (rings + 1,) or (around + 1, rings + 1);
    the ends are the given ones to the last digit.
    """
    nodes = inside[:, None] + np.atleast_2d(shares)[..., None] * (outside - inside)[:, None]
    nodes[:, 0], nodes[:, -1] = inside, outside
    return nodes


def _pipe_angles(behind):
    """Angles (around + 1,) of nodes on the pipe, from the y axis: half as the outer face is seen from the axis, half in
    shares of its arc.
    """
    seen = np.arctan2(behind[:, 0], behind[:, 1])
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(behind[:, :2], axis=0), axis=1))])
    return 0.5 * seen + 0.5 * (0.5 * np.pi * arc / arc[-1])


#: Lengths of pipe before the flange and behind the lip, in its diameters.
UPSTREAM, DOWNSTREAM = 5.0, 12.0
#: Without a pipe downstream: radius of the room, in radii of the flange.
ROOM = 5.0
#: Axial length of cells beside the lip and inside the valve, over the length of the valve.
AT_LIP, INSIDE = 0.006, 0.02
#: Growth of axial cells away from the valve, and their greatest length over the diameter.
STRETCH, LONGEST = 1.07, 0.22
#: Distance behind the lip, in diameters of the pipe, over which the section of the mesh widens from slit to round.
WIDENING = 4.0
#: Size to which inner and outer face are continued far behind the lip, over the radius of the pipe.
FAR_INNER, FAR_OUTER = 0.5, 0.68


@dataclass(frozen=True)
class Domain:
    """Region of fluid that is meshed: valve, and the pipe or room around it."""

    faces: WallFaces
    radius: float  #: m; radius of the downstream pipe, or of the room.
    free: bool = False  #: True for a room (free discharge), False for a pipe.
    fineness: float = 1.0  #: Cells in each direction over the usual number.

    @cached_property
    def pattern(self) -> Pattern:
        """Cells of the sections."""
        base = Pattern(outside=20) if self.free else Pattern()
        return base.refined(self.fineness)

    @cached_property
    def bore(self) -> float:
        """Radius of the passage at the flange, m."""
        return float(self.faces.inner[-1, 0, 1])

    @cached_property
    def rows(self) -> np.ndarray:
        """Mean axial place (rows,) of the rows of the inner face, m."""
        return self.faces.inner[..., 2].mean(axis=1)

    @cached_property
    def stations(self) -> np.ndarray:
        """Axial places of the sections from the outlet to the inlet, m, relative to lip and flange within the valve."""
        lip, flange = self.rows[0], self.rows[-1]
        length = flange - lip
        inside = lip + length * _outward(AT_LIP / self.fineness, 1.12, INSIDE / self.fineness, 1.0)
        growth = 1.0 + (STRETCH - 1.0) / self.fineness
        down = 2.0 * self.radius if not self.free else 2.0 * self.bore
        behind = _outward(AT_LIP * length / self.fineness, growth, LONGEST * down / self.fineness, DOWNSTREAM * down)
        up = 2.0 * self.bore
        before = _outward(inside[-1] - inside[-2], growth, 2 * LONGEST * up / self.fineness, UPSTREAM * up)
        return np.concatenate([(lip - behind)[::-1], inside[1:-1], flange + before])

    @cached_property
    def lip(self) -> int:
        """Number of the section at the lip."""
        return int(np.argmin(np.abs(self.stations - self.rows[0])))

    @cached_property
    def flange(self) -> int:
        """Number of the section at the flange."""
        return int(np.argmin(np.abs(self.stations - self.rows[-1])))

    @cached_property
    def sections(self) -> list[Section]:
        """Nodes of all sections, the outlet's first."""
        inner, outer = (PchipInterpolator(self.rows, grid) for grid in (self.faces.inner, self.faces.outer))
        found = []
        for number, z in enumerate(self.stations):
            if number < self.lip:
                found.append(self._behind(z))
            elif number <= self.flange:
                found.append(section_nodes(inner(z), outer(z), self.radius, self.pattern))
            else:
                found.append(_moved(found[self.flange], z - self.stations[self.flange]))
        return found

    def _behind(self, z: float) -> Section:
        """A section behind the lip: both faces widen to circles."""
        inner, outer, distance = self.faces.inner[0], self.faces.outer[0], self.rows[0] - z
        share = np.clip(distance / (WIDENING * 2.0 * self.radius), 0.0, 1.0)
        share = share**2 * (3.0 - 2.0 * share)
        slope = max(0.0, 1.0 - distance / (0.5 * self.radius))  # of the lip, which is not quite plane
        faces = []
        for lip, size in ((inner, FAR_INNER), (outer, FAR_OUTER)):
            arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(lip[:, :2], axis=0), axis=1))])
            angle = 0.5 * np.pi * arc / arc[-1]
            circle = size * self.radius * np.column_stack([np.sin(angle), np.cos(angle)])
            circle[-1, 1] = 0.0
            points = np.empty_like(lip)
            points[:, :2] = (1.0 - share) * lip[:, :2] + share * circle
            points[:, 2] = z + slope * (lip[:, 2] - self.rows[0])
            faces.append(points)
        return section_nodes(*faces, self.radius, self.pattern)


def _outward(first: float, growth: float, longest: float, length: float) -> np.ndarray:
    """Places from 0 to `length` of steps that grow from `first` to `longest`."""
    steps = [first]
    while sum(steps) < length:
        steps.append(min(longest, growth * steps[-1]))
    return np.concatenate([[0.0], np.cumsum(steps)]) * length / sum(steps)


def _moved(section: Section, way: float) -> Section:
    step = np.array([0.0, 0.0, way])
    return replace(section, core=section.core + step, layer=section.layer + step)


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
    """Cells between sections `first` and `last` of one part of the pattern."""

    #: (l + 1, m + 1, n + 1); from the outlet on; columns; rings or, of the core, cells along the opening.
    nodes: np.ndarray
    first: int  #: Number of its first section.

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
    """Hexahedra of a domain."""

    domain: Domain
    points: np.ndarray  #: (np, 3), m.
    blocks: dict[str, Block]  #: ``core``, ``layer``, ``wall`` and ``outside``.

    @classmethod
    def of(cls, domain: Domain) -> FlowMesh:
        """Mesh a domain. Raises ValueError if a cell is turned inside out."""
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
