"""Cells of a map in which the wall runs away by itself."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ...case.parameters import PARAMETERS
from .column import MapColumn, MapPlan


def runs_away(plan: MapPlan, growth: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Where what grows fastest does not oscillate in a wall with loss factors.

    Parameters
    ----------
    plan : MapPlan
    growth, frequency : arrays of one shape, 1/s, Hz
        Of the leading mode.
    """
    relaxes = plan.case.damping.loss_factor > 0 or "loss_factor" in (plan.x.parameter, plan.y.parameter)
    return (np.asarray(growth) > 0) & (np.asarray(frequency) == 0) & relaxes


def of_the_wall(plan: MapPlan, columns: Iterable[MapColumn]) -> list[str]:
    """A sentence about columns with such cells."""
    own, cells, rates = [], 0, []
    for column in columns:
        if column.failure or column.level:
            continue
        away = runs_away(plan, column.cells["growth_rate"], column.cells["frequency"])
        if away.any():
            own.append(column.value)
            cells += int(away.sum())
            rates.append(float(column.cells["growth_rate"][away].max()))
    if not own:
        return []
    parameter = PARAMETERS[plan.across.parameter]
    first, last = (f"{value / parameter.scale:.4g}" for value in (min(own), max(own)))
    where = f"{plan.across.parameter} = {first} and {last} {parameter.shown_unit}".rstrip()
    return [
        f"In {cells} cells, of columns between {where}, the wall runs away by itself, at up to {max(rates):.3g} 1/s "
        "without oscillating: loss factors make rubber stiffer the faster it is strained, which is no hold where its "
        "constants have lost stability (materials.strain_level, or a fit over a wider range). Such cells are unstable "
        "whether the valve flutters or not; onset curves are those of flutter there too."
    ]
