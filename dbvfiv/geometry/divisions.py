"""Division of the mesh into rows and columns: on every break of shape, wall and load, finer at joints."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..case.mesh import Mesh
from ..case.valve import Valve
from .surface import Surface

#: Angles between two pieces of the surface up to which their joint counts for nothing and from which in full, rad.
NO_KINK, FULL_KINK = np.radians(5.0), np.radians(20.0)
#: Distance from a joint, over the length of the valve, over which the rows grow to their length away from it.
REACH = 0.04
#: Turn of the lip's section that counts as its bend, rad.
BEND = np.radians(5.0)
#: A break of the load this near the bend, in the parameter of the grading, stands for it too.
NEAR = 0.05
_FINE = 4001


@dataclass(frozen=True)
class Division:
    """Positions of rows or columns."""

    positions: np.ndarray  #: (n + 1,).
    missed: np.ndarray  #: (k,); breaks that no row or column could be put on.


def least_rows(surface: Surface) -> int:
    """Elements along that a surface needs at least, one for each of its pieces."""
    return len(surface.breaks) - 1


def row_division(valve: Valve, mesh: Mesh, surface: Surface, parts=()) -> Division:
    """Axial positions of the rows, m, from the lip to the flange; on the edges of parts of the wall too."""
    joints = surface.breaks
    given = valve.scale * np.asarray(mesh.row_positions, float)
    if len(given):
        given[[0, -1]] = joints[[0, -1]]
        if len(given) == mesh.along + 1:
            return Division(given, np.zeros(0))
        return divide(given[[0, -1]], (), mesh.along, (given, np.arange(len(given), dtype=float)))
    if mesh.rows == "uniform":
        return divide(joints, (), mesh.along)
    wall = [step.to for step in valve.wall_map] if valve.wall == "measured" else []
    asked = [valve.scale * z for z in mesh.breaks]
    patches = [z for part in parts for z in part.axial_edges]
    if valve.key_points is not None:  # supports and loads change there, whatever the points do
        asked += [valve.duckbill_length, valve.duckbill_length + valve.saddle_length]
    breaks = [z for z in (*asked, *wall, *patches) if joints[0] < z < joints[-1]]
    return divide(joints, breaks, mesh.along, _row_law(mesh, surface))


def column_division(mesh: Mesh, surface: Surface, breaks) -> Division:
    """Positions of the columns in the parameter of the grading, 0 at the centre, 1 at the side edge."""
    ends = np.array([0.0, 1.0])
    if mesh.columns == "uniform":
        return divide(ends, (), mesh.around)
    bend = inverse_grading(bend_of_lip(surface), mesh.grading)
    breaks = [c for c in breaks if 0.0 < c < 1.0]
    near = [c for c in breaks if abs(c - bend) < NEAR]
    bend = near[0] if near else bend
    if bend < 1.0 and not near:
        breaks.append(bend)
    if not bend < 1.0:
        return divide(ends, breaks, mesh.around)
    law = np.array([0.0, bend, 1.0]), np.array([0.0, bend, bend + (1.0 - bend) / mesh.column_grading])
    return divide(ends, breaks, mesh.around, law)


def bend_of_lip(surface: Surface) -> float:
    """Normalised arc length from the centre at which the section of the lip has turned by 5 degrees from its direction
    there; on the side where that is nearer."""
    s, found = np.linspace(0.0, 1.0, 2001), [1.0]
    middle = 0.5 * (s[1:] + s[:-1])
    for side in (1.0,) if surface.part.is_quarter else (1.0, -1.0):
        steps = np.diff(surface.section(surface.breaks[0], side * s)[:, :2], axis=0) * [side, 1.0]
        direction = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
        turned = np.abs(direction - direction[0])
        if (turned > BEND).any():
            k = int(np.argmax(turned > BEND))  # between two steps, so that it moves smoothly with the shape
            found.append(float(np.interp(BEND, turned[k - 1 : k + 1], middle[k - 1 : k + 1])))
    return min(found)


def grading(columns: np.ndarray, ratio: float) -> np.ndarray:
    """Normalised arc length at the column parameters: element lengths fall geometrically from 1 to `ratio`.

    A continuous law, so that meshes of twice the elements contain the nodes of the coarser ones.
    """
    if abs(ratio - 1.0) < 1e-9:
        return np.asarray(columns, float)
    return (1.0 - ratio ** np.asarray(columns, float)) / (1.0 - ratio)


def inverse_grading(s: float, ratio: float) -> float:
    """Column parameter at a normalised arc length."""
    return s if abs(ratio - 1.0) < 1e-9 else float(np.log1p(-s * (1.0 - ratio)) / np.log(ratio))


def divide(joints, breaks, count: int, law=None) -> Division:
    """Divide a line into `count` elements that end on all joints, and on breaks as far as elements suffice. Raises
    ValueError if there are fewer elements than pieces between joints.

    Parameters
    ----------
    joints : (j,) array
        Ascending; the first and the last are the ends of the line.
    breaks : sequence of float
        A break closer than half a mean element to a joint or to another break that was taken is left out, later ones
        before earlier ones.
    law : tuple of two (k,) arrays, optional
        Positions and the number of elements up to them, on any scale: how elements are spread. Evenly by default.
    """
    joints = np.asarray(joints, float)
    along = (lambda z: z) if law is None else (lambda z: np.interp(z, *law))
    back = (lambda n: n) if law is None else (lambda n: np.interp(n, law[1], law[0]))
    if count < len(joints) - 1:
        raise ValueError(
            f"mesh.along is {count}, but the surface has {len(joints) - 1} pieces and each needs an element."
        )
    total = along(joints[-1]) - along(joints[0])
    chosen, missed = list(joints), []
    for place in breaks:
        nearest = np.abs(along(np.array(chosen)) - along(place)).min()
        if nearest <= 1e-9 * total:
            continue
        if nearest >= (0.5 - 1e-9) * total / count and len(chosen) <= count:
            chosen.append(float(place))
        else:
            missed.append(float(place))
    ends = np.sort(chosen)
    numbers = along(ends)
    counts = _share(np.diff(numbers), count)
    parts = [
        np.concatenate([[z], back(np.linspace(a, b, n, endpoint=False)[1:])])
        for z, a, b, n in zip(ends[:-1], numbers[:-1], numbers[1:], counts)
    ]
    return Division(np.concatenate([*parts, ends[-1:]]), np.array(missed))


def _share(lengths: np.ndarray, count: int) -> np.ndarray:
    """Elements of each piece in proportion to its length, at least one; twice as many of them divide alike."""
    base = count
    while base % 2 == 0 and base // 2 >= max(24, len(lengths)):
        base //= 2
    share = base * lengths / lengths.sum()
    counts = np.maximum(1, np.floor(share + 1e-9).astype(int))
    while counts.sum() < base:
        counts[np.argmax(share - counts)] += 1
    while counts.sum() > base:
        counts[np.argmin(np.where(counts > 1, share - counts, np.inf))] -= 1
    return counts * (count // base)


def _row_law(mesh: Mesh, surface: Surface) -> tuple[np.ndarray, np.ndarray]:
    """Number of rows, up to a factor, from the lip to axial positions: (z, count), each (k,), z in m.

    `mesh.row_grading` is the length of a row at a full kink over that away from it. The lip may count as a full kink.
    """
    z = np.linspace(surface.breaks[0], surface.breaks[-1], _FINE)
    density, reach = np.ones_like(z), REACH * (z[-1] - z[0])
    lip = FULL_KINK if mesh.rows == "lip" else 0.0
    for joint, angle in zip(surface.breaks[:-1], [lip, *kinks(surface)]):
        share = min(1.0, max(0.0, (angle - NO_KINK) / (FULL_KINK - NO_KINK)))
        near = 1.0 + share * (1.0 / mesh.row_grading - 1.0) * np.exp(-np.abs(z - joint) / reach)
        density = np.maximum(density, near)
    return z, np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))]) * (z[1] - z[0])


def kinks(surface: Surface) -> np.ndarray:
    """Largest angle, rad, by which the surface turns along the axis at each of its inner joints."""
    s, found = np.linspace(surface.part.begin, 1.0, 32 * surface.part.quarters + 1), []
    for before, joint, after in zip(surface.breaks[:-2], surface.breaks[1:-1], surface.breaks[2:]):
        step = 1e-6 * min(joint - before, after - joint)
        if joint + step == joint or joint - step == joint:  # a piece too short to have a direction
            found.append(0.0)
            continue
        sides = [(surface.section(joint, s) - surface.section(joint - step, s)) / step]
        sides.append((surface.section(joint + step, s) - surface.section(joint, s)) / step)
        a, b = (side / np.linalg.norm(side, axis=1, keepdims=True) for side in sides)
        found.append(float(np.linalg.norm(np.cross(a, b), axis=1).max()))
    return np.arcsin(np.minimum(found, 1.0))
