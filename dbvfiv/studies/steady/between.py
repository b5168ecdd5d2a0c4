"""Flow of a run between its states."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.interpolate import PchipInterpolator

from ...model.state import SteadyState


def flow_at(states: Sequence[SteadyState], pressure: np.ndarray, rest: float, name: str = "mass_flow") -> np.ndarray:
    """A column of states at pressures: their own where they are there, else between them, NaN beyond them.

    Flows go with powers of what drives them, so a monotone cubic runs through their logarithms.

    Parameters
    ----------
    states : sequence of SteadyState
    pressure : (k,) array, Pa
    rest : float, Pa
        Where nothing flows.
    name : str
        A column that is positive where something flows.
    """
    known = {state.pressure: getattr(state, name) for state in states}
    found = np.array([known.get(p, np.nan) for p in pressure])
    points = np.array(sorted((p, flow) for p, flow in known.items() if p > rest and flow > 0))
    asked = np.isnan(found) & (np.asarray(pressure) > rest)
    if len(points) > 1 and asked.any():
        curve = PchipInterpolator(np.log(points[:, 0] - rest), np.log(points[:, 1]), extrapolate=False)
        found[asked] = np.exp(curve(np.log(np.asarray(pressure)[asked] - rest)))
    return found
