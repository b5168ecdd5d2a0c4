"""Points of a path along back pressures, and its restart data."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .buckling import Buckling


@dataclass(frozen=True)
class PathPoint:
    """One equilibrium on the way; areas and forces of the whole valve.

    Attributes
    ----------
    pressure : float, Pa
    max_displacement : float, m
    contact_force : float, N
    least_opening : float, m2
    sealed_length, lip_seal : float, m
    contact_front, overlap : float, m
    lowest_eigenvalue : float, 1/s2
        NaN on stretches followed by arclength.
    arclength : bool
        Found by arclength.
    """

    pressure: float
    max_displacement: float
    contact_force: float
    least_opening: float
    sealed_length: float
    lip_seal: float
    contact_front: float
    overlap: float
    lowest_eigenvalue: float
    arclength: bool = False


@dataclass(frozen=True)
class PathRestart:
    """Restart data of a path: continues from a reached state as if it had never stopped.

    Attributes
    ----------
    pressure : float, Pa
    q, slope : (n,) arrays
        Unknowns and their derivative by the pressure.
    multiplier : (k,) array, Pa
    step : float, Pa
        Load step to try next.
    beyond_limit : bool
    eigenvalue : float, 1/s2
        Lowest stiffness eigenvalue there.
    energy : tuple of float
        See `EnergyLedger.totals`.
    buckling : tuple of Buckling
        Found so far.
    """

    pressure: float
    q: np.ndarray
    slope: np.ndarray
    multiplier: np.ndarray
    step: float
    beyond_limit: bool
    eigenvalue: float
    energy: tuple[float, ...]
    buckling: tuple[Buckling, ...] = ()
