"""The inner face of the wall as fluid meets it: without the folds that half a wall beyond the radius makes.

At the side edge half the wall may exceed the radius of the mid-surface; the inner face then turns over itself or passes
through the plane y = 0 before it ends. Fluid meets what lies in front of such folds only.
"""

from __future__ import annotations

import numpy as np

from ..errors import CaseError


def trim_section(points: np.ndarray) -> np.ndarray:
    """The part of a section that bounds the passage.

    Parameters
    ----------
    points : (k, 3) array, m
        From the centre line (x = 0) to the side edge (y = 0).

    Returns
    -------
    (m, 3) array, m
        From x = 0, y > 0 to y = 0, x never falling: loops are left out, what lies beyond the first crossing of y = 0 is
        cut off, and so is what an overhang hides from y = 0.

    Raises
    ------
    ValueError
        If no passage is left: the section begins at or below y = 0.
    """
    points = np.asarray(points, float)
    if not points[0, 1] > 0.0:
        raise ValueError("The inner faces meet at the centre line.")
    path = _without_loops(points)
    below = np.flatnonzero(path[1:, 1] <= 0.0)
    if len(below):
        last = int(below[0]) + 1
        a, b = path[last - 1], path[last]
        share = a[1] / (a[1] - b[1]) if a[1] > b[1] else 1.0
        path = np.concatenate([path[:last], [a + share * (b - a)]])
    path[-1, 1] = 0.0
    kept = np.concatenate([[True], path[1:, 0] > np.maximum.accumulate(path[:-1, 0])])
    if not kept[-1]:  # the end lies under an overhang, so the widest point takes its place
        end = path[-1].copy()
        end[0] = path[kept][-1, 0]
        if path[kept][-1, 1] > 0.0:
            return np.concatenate([path[kept], [end]])
    return path[kept]


def _without_loops(points: np.ndarray) -> np.ndarray:
    """A plane path (k, 3) with each loop replaced by the point at which it begins and ends; crossings in x and y."""
    found, i = [points[0]], 0
    while i < len(points) - 1:
        start, step = found[-1], points[i + 1] - found[-1]
        crossing = _last_crossing(start, step, points, i + 2)
        if crossing is None:
            found.append(points[i + 1])
            i += 1
        else:
            share, i = crossing
            found.append(start + share * step)
    return np.array(found)


def _last_crossing(start, step, points, first):
    """Share of the step from `start` at which the last later piece of the path crosses it, and that piece."""
    for j in range(len(points) - 2, first - 1, -1):
        other, way = points[j], points[j + 1] - points[j]
        turn = step[0] * way[1] - step[1] * way[0]
        if turn == 0.0:
            continue
        gap = other - start
        share = (gap[0] * way[1] - gap[1] * way[0]) / turn
        along = (gap[0] * step[1] - gap[1] * step[0]) / turn
        if 0.0 < share < 1.0 and 0.0 <= along < 1.0:
            return share, j
    return None


def passage_grid(inner: np.ndarray) -> np.ndarray:
    """Inner face of the passage, row by row.

    Parameters
    ----------
    inner : (rows, columns, 3) array, m
        Inner face of the wall, from the lip, columns from x = 0 to y = 0.

    Returns
    -------
    (rows, columns, 3) array, m
        Rows that need no trimming keep their points; the others are divided anew in the shares of arc length of their
        points before.

    Raises
    ------
    CaseError
        If the passage is shut somewhere.
    """
    rows = []
    for row in np.asarray(inner, float):
        try:
            path = trim_section(row)
        except ValueError:
            raise CaseError(
                f"The inner faces of the lips meet at z = {1e3 * row[0, 2]:.4g} mm (x = 0), so this state has no open "
                "passage; a higher pressure opens one."
            ) from None
        rows.append(path if len(path) == len(row) and np.array_equal(path[:-1], row[:-1]) else _divided(path, row))
    return np.array(rows)


def _divided(path: np.ndarray, row: np.ndarray) -> np.ndarray:
    length = _arc(path)
    wanted = _arc(row) / _arc(row)[-1] * length[-1]
    points = np.column_stack([np.interp(wanted, length, path[:, i]) for i in range(3)])
    points[0], points[-1] = path[0], path[-1]
    return points


def _arc(path: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
