"""Onset curves of a stability map, made of the onsets of its columns.

Every point of them is an onset of a column, where the steady state is an equilibrium of its own and the eigenvalue was
corrected with the full matrices; columns are added until the curves are known between them too (`Web`).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..stability.correction import ACCURATE
from .column import MapColumn, MapPlan
from .web import Web


@dataclass(frozen=True)
class OnsetCurve:
    """A curve in the plane of the map on which a mode is neutral.

    Attributes
    ----------
    law : int
        Number of the continuity law.
    x, y : (k,) arrays
        SI values.
    frequency : (k,) array, Hz
    exact : bool
        Every point is neutral by the full matrices, and no piece of the curve between them, nor its ends, is a guess.
    mismatch : float
        Largest growth rate, by the full matrices, over the size of the eigenvalue at its points; NaN if a point was not
        corrected.
    reason : str
        Why it is not exact.
    """

    law: int
    x: np.ndarray
    y: np.ndarray
    frequency: np.ndarray
    exact: bool = False
    mismatch: float = float("nan")
    reason: str = ""

    def points(self) -> list[list[float]]:
        """[[x, y], ...]."""
        return [[float(a), float(b)] for a, b in zip(self.x, self.y)]


def linked(plan: MapPlan, columns: tuple[MapColumn, ...]) -> tuple[OnsetCurve, ...]:
    """Curves through the onsets of columns."""
    webs = (Web.of(plan, columns, law) for law in range(len(plan.laws)))
    return tuple(_curve(plan, web, chain) for web in webs for chain in _chains(web))


def doubts(plan: MapPlan, curves) -> Iterator[str]:
    """Sentences about curves that are not exact."""
    for curve in curves:
        if not curve.exact:
            yield (
                f"The onset curve near {plan.x.parameter} = {curve.x[0]:.6g}, {plan.y.parameter} = {curve.y[0]:.6g} "
                f"is not exact: {curve.reason}."
            )


def _chains(web: Web) -> list[list[tuple[int, int]]]:
    """Onsets, (column, number) each, in the order of the curves they lie on."""
    beside: dict[tuple[int, int], list[tuple[int, int]]] = {
        (i, k): [] for i, rows in enumerate(web.onsets) for k in range(len(rows))
    }
    for i, links in enumerate(web.ahead):
        for k, m in links.items():
            beside[i, k].append((i + 1, m))
            beside[i + 1, m].append((i, k))
    for tip in web.tips:
        first, second = (tip.column, tip.first), (tip.column, tip.second)
        beside[first].append(second)
        beside[second].append(first)
    left = dict.fromkeys(beside)
    ends = [node for node, others in beside.items() if len(others) < 2]
    chains = []
    for start in (*ends, *beside):  # what has no end is closed
        if start not in left:
            continue
        chain, node = [], start
        while node is not None:
            del left[node]
            chain.append(node)
            node = next((other for other in beside[node] if other in left), None)
        if len(chain) > 2 and start in beside[chain[-1]]:
            chain.append(start)
        chains.append(chain)
    return chains


def _curve(plan: MapPlan, web: Web, chain) -> OnsetCurve:
    across = np.array([web.columns[i].value for i, _ in chain])
    onsets = [web.onsets[i][k] for i, k in chain]
    along = np.array([onset.along for onset in onsets])
    x, y = (along, across) if plan.transposed else (across, along)
    mismatch = float(np.max([onset.residual for onset in onsets]))
    reason = _reason(web, chain, mismatch)
    frequency = np.array([onset.frequency for onset in onsets])
    return OnsetCurve(onsets[0].law, x, y, frequency, not reason, mismatch, reason)


def _reason(web: Web, chain, mismatch: float) -> str:
    if not mismatch <= ACCURATE:
        return "not all of its points were corrected with the full matrices"
    for i, k in chain:
        if not (web.is_known(i, k, 1) and web.is_known(i, k, -1)):
            return f"it is not known between the columns beside {web.columns[i].value:.6g}"
    return ""
