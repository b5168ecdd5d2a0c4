"""Cells of a map solved again with the full pencil."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..stability.walk import StabilityWalk
from .column import MapColumn, MapPlan

#: Largest accepted |difference| / |eigenvalue|.
ACCEPTED = 1e-6


@dataclass(frozen=True)
class Check:
    """One cell, solved directly.

    Attributes
    ----------
    x, y : float
    law : int
        Number of the continuity law.
    growth_rate, frequency : float
        Of the full pencil, 1/s and Hz.
    error : float
        |difference of the leading eigenvalue| over its size.
    unstable : int
    agrees : bool
        Error within `ACCEPTED` and the same number of unstable eigenvalues.
    """

    x: float
    y: float
    law: int
    growth_rate: float
    frequency: float
    error: float
    unstable: int
    agrees: bool


def check_cells(plan: MapPlan, columns: tuple[MapColumn, ...], walk: StabilityWalk, number: int) -> tuple[Check, ...]:
    """Check cells spread over the map by a sequence that fills the plane evenly."""
    usable = [column for column in columns if not column.failure and column.level == 0]
    if not usable:
        return ()
    cells, laws = len(plan.along.values), len(plan.laws)
    # steps of the golden section in both directions (Roberts' sequence)
    picks = sorted(
        (int((0.5 + 0.7548776662 * i) % 1 * len(usable)), int((0.5 + 0.5698402910 * i) % 1 * cells), i % laws)
        for i in range(number)
    )
    return tuple(_check(plan, usable[i], j, law, walk) for i, j, law in picks)


def _check(plan: MapPlan, column: MapColumn, j: int, law: int, walk: StabilityWalk) -> Check:
    along = plan.along.values[j]
    spectrum = walk.spectrum(plan.place(column.value, along, plan.laws[law]), 4)
    kept = complex(column.cells["growth_rate"][law, j], 2 * np.pi * column.cells["frequency"][law, j])
    true = complex(spectrum.eigenvalues[0]) if len(spectrum) else complex(np.nan)
    error = abs(kept - true) / max(abs(true), 1.0)
    unstable = spectrum.unstable_count
    agrees = error <= ACCEPTED and unstable == int(column.cells["unstable"][law, j])
    x, y = (along, column.value) if plan.transposed else (column.value, along)
    return Check(x, y, law, true.real, true.imag / (2 * np.pi), float(error), unstable, bool(agrees))
