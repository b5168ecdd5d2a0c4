"""Heads, loss and coefficients of steady states in print."""

from __future__ import annotations

from collections.abc import Sequence

from ...record.layout import Column, Shown
from ...record.table import printed_head, printed_row
from ..state import State

_COLUMNS = tuple(
    Column(name, "", "", shown=shown)
    for name, shown in (
        ("pressure", Shown("pressure", "static kPa", 10, lambda s: f"{s.pressure / 1e3:.6g}")),
        ("total_head", Shown("total head", "m", 10, lambda s: f"{s.hydraulics.total_head:.4g}")),
        ("head_loss", Shown("loss", "m", 8, lambda s: f"{s.hydraulics.head_loss:.4g}")),
        ("flange_velocity", Shown("at the flange", "m/s", 13, lambda s: f"{s.hydraulics.flange_velocity:.4g}")),
        ("loss_coefficient", Shown("K", "", 8, lambda s: f"{s.hydraulics.loss_coefficient:.4g}")),
        ("discharge_coefficient", Shown("Cd", "", 7, lambda s: f"{s.hydraulics.discharge_coefficient:.4f}")),
        ("kv", Shown("Kv", "m3/h", 8, lambda s: f"{s.hydraulics.kv:.4g}")),
        ("cv", Shown("Cv", "gpm", 8, lambda s: f"{s.hydraulics.cv:.4g}")),
    )
)


def lines(states: Sequence[State]) -> list[str]:
    """Table of the states that flow, and what it supposes."""
    flowing = [state for state in states if state.hydraulics is not None]
    if not flowing:
        return []
    rows = [printed_row(_COLUMNS, state) for state in flowing]
    return [*printed_head(_COLUMNS), *rows, "Free discharge: the energy of the jet is lost, nothing is recovered."]
