"""Numbers of a closure result at any back pressure on its way."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .result import ClosureResult


#: Columns of the path that states have under another name.
_OF_STATES = {"lowest_eigenvalue": "lowest_stiffness_eigenvalue"}


def value_at(result: ClosureResult, pressure: np.ndarray, name: str) -> np.ndarray:
    """A column of the path (k,) at back pressures (k,), Pa: of states where they are, between the load steps by a
    straight line, from the first to the last one before arclength takes over; NaN beyond.

    Parameters
    ----------
    result : ClosureResult
    pressure : (k,) array, Pa
    name : str
        Of `columns.POINT`.
    """
    known: dict[float, float] = {}
    for point in result.walk:
        if point.arclength or point.pressure <= max(known, default=0.0):
            break
        known[point.pressure] = getattr(point, name)
    # of a state that was asked for the contact is renewed until it holds; load steps do with less
    own = _OF_STATES.get(name, name)
    known |= {state.pressure: getattr(state, own) for state in result.states if not state.beyond_limit}
    if not known:
        return np.full(len(pressure), np.nan)
    places, values = np.array(sorted(known.items())).T
    return np.interp(pressure, places, values, left=np.nan, right=np.nan)
