"""Cells between two of which the modes are known: their own are looked for where those of both lead.

Along a line of conditions that hardly differ, some of the cells are solved from nothing, and the modes of those between
start from what lies between the modes of their neighbours. What two modes that meet, or one that comes from elsewhere,
leave in doubt is for the caller to solve from nothing as well.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

#: Fewest cells of a line.
LEAST = 8
#: Largest ratio of the inertia of two cells that are solved, and largest distance of them along the line.
RATIO, STEP = 1.5, 3
#: Relative distance within which eigenvalues of two such cells are those of one mode.
ALIKE = 0.2


class Mode(NamedTuple):
    """An eigenvalue with its right and left vectors, (n,) each."""

    value: complex
    right: np.ndarray
    left: np.ndarray


def solved_cells(conditions) -> np.ndarray:
    """Cells to be solved from nothing: all where the conditions follow each other too far apart, or differ in more than
    the inertia.
    """
    every = np.arange(len(conditions))
    inertia = np.array([c.inertia for c in conditions])
    if len(conditions) < LEAST or len({(c.law, c.damping) for c in conditions}) > 1 or not (inertia > 0).all():
        return every
    widest = np.abs(np.diff(np.log(inertia))).max()
    step = min(STEP, int(np.log(RATIO) / max(widest, 1e-300)))
    return every if step < 2 else np.union1d(every[::step], every[-1:])


def in_between(first: list[Mode], second: list[Mode], share: float) -> list[Mode]:
    """Modes to start from, a share of the way from one cell to another: between where one has its like there, and all
    that have none.
    """
    others, out = list(second), []
    for mode in first:
        distance = [abs(mode.value - other.value) for other in others]
        nearest = int(np.argmin(distance)) if distance else -1
        if distance and distance[nearest] <= ALIKE * abs(mode.value):
            other = others.pop(nearest)
            vectors = mode if share < 0.5 else other
            mode = vectors._replace(value=(1.0 - share) * mode.value + share * other.value)
        out.append(mode)
    return out + others
