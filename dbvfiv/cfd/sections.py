"""Sections of the flow domain: quadrilaterals in a quarter of a pipe with the wall of the valve in it.

Every section has the same pattern. Round a core of `top` by `side` cells run rings of `top + side` columns: the layer
at the inner face, the wall's thickness (fluid only downstream of the lip), and what lies between outer face and pipe.
The corner of the core looks at the tip where the passage is a slit and at half the arc where it is round.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import PchipInterpolator

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
    """Cells of a section.

    Attributes
    ----------
    top, side : int
        Of the core: beside the centre line x = 0 across the lips, and along the opening.
    layer, wall, outside : int
        Rings at the inner face, behind the lip and up to the pipe.
    growth : float
        Of the layer's cells away from the inner face.
    """

    top: int = 26
    side: int = 12
    layer: int = 9
    wall: int = 5
    outside: int = 14
    growth: float = 1.35

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
    """Nodes of a section, m.

    Attributes
    ----------
    core : (top + 1, side + 1, 3) array
        From the axis.
    layer, wall, outside : (around + 1, rings + 1, 3) arrays
        From the core, inner face and outer face outwards; columns from x = 0 to y = 0.
    """

    core: np.ndarray
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
    pattern : Pattern
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
