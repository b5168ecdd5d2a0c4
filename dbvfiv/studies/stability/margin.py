"""Critical damping factor: how far the damping of the wall may fall before a stable state flutters."""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from ...case.parameters import PARAMETERS, Mu
from .place import condition_of
from .verdict import FLUTTERS, STABLE, Verdict, oscillates
from .walk import StabilityWalk

#: Factors asked, from that of the case outwards; below a twentieth a wall is as good as undamped.
LOWER, HIGHER = np.geomspace(1.0, 0.05, 9), np.geomspace(1.0, 10.0, 7)
#: Relative accuracy of the factor.
ACCURACY = 1e-4


def critical_damping_factor(walk: StabilityWalk, place: Mu, verdict: Verdict) -> float:
    """Factor on the loss factors, or on beta, at which flutter begins, next to 1.

    It lies below 1 where the state is stable and above where it flutters.

    Parameters
    ----------
    walk : StabilityWalk
    place : Mu
    verdict : Verdict
        On the place.

    Returns
    -------
    float
        NaN where the wall has no such damping, the verdict is another, or no factor in reach makes the difference.

    Raises
    ------
    SolveError
        If there is no steady state.
    """
    name = "loss_factor" if place.loss_factor > 0 else "beta"
    own = place[name]
    if own <= 0 or verdict.outcome not in (STABLE, FLUTTERS):
        return np.nan
    factors = LOWER if verdict.outcome == STABLE else HIGHER
    factors = factors[own * factors <= PARAMETERS[name].high]
    places = [place.at(**{name: own * factor}) for factor in factors]
    column = walk.column(places, len(places), edges=True)

    def growth(values) -> float:
        values = np.asarray(values)
        modes = values[oscillates(values)]
        return float(modes.real.max()) if modes.size else np.nan

    def at(factor: float) -> float:
        return growth(column.eigenvalues(condition_of(place.at(**{name: own * factor}))))

    rates = [growth(row) for row in column.leading]
    for a, b, low, high in zip(factors[:-1], factors[1:], rates[:-1], rates[1:]):
        if not (np.isfinite(low) and np.isfinite(high)):
            return np.nan
        if low * high <= 0:
            found = brentq(at, min(a, b), max(a, b), rtol=ACCURACY) if column.eigenvalues else np.nan
            return float(f"{found:.8g}")  # rounding of factorisations would part a resumed run from a whole one
    return np.nan
