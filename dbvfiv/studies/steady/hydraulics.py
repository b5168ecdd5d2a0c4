"""Heads, loss and coefficients of steady states in print."""

from __future__ import annotations

from collections.abc import Sequence

from ...record.table import Column, Shown, printed_head, printed_row
from ..case import Case
from ..state import State

#: Of the line in front; where there is one.
_LINE = (
    Column("supply_head", "", "", shown=Shown("supply", "m", 8, lambda s: f"{s.hydraulics.supply_head:.4g}")),
    Column("line_loss", "", "", shown=Shown("line loss", "m", 9, lambda s: f"{s.hydraulics.line_loss:.4g}")),
)
#: Of the pipe behind; where there is one.
_TAIL = (
    Column("recovered", "", "", shown=Shown("recovered", "m", 9, lambda s: f"{s.hydraulics.recovered_head:.4g}")),
    Column("tail_loss", "", "", shown=Shown("pipe loss", "m", 9, lambda s: f"{s.hydraulics.tail_loss:.4g}")),
)
_VALVE = tuple(
    Column(name, "", "", shown=shown)
    for name, shown in (
        ("pressure", Shown("pressure", "static kPa", 10, lambda s: f"{s.flange_pressure / 1e3:.6g}")),
        ("total_head", Shown("total head", "m", 10, lambda s: f"{s.hydraulics.total_head:.4g}")),
        ("head_loss", Shown("loss", "m", 8, lambda s: f"{s.hydraulics.head_loss:.4g}")),
        ("flange_velocity", Shown("at the flange", "m/s", 13, lambda s: f"{s.hydraulics.flange_velocity:.4g}")),
        ("loss_coefficient", Shown("K", "", 8, lambda s: f"{s.hydraulics.loss_coefficient:.4g}")),
        ("discharge_coefficient", Shown("Cd", "", 7, lambda s: f"{s.hydraulics.discharge_coefficient:.4f}")),
        ("kv", Shown("Kv", "m3/h", 8, lambda s: f"{s.hydraulics.kv:.4g}")),
        ("cv", Shown("Cv", "gpm", 8, lambda s: f"{s.hydraulics.cv:.4g}")),
    )
)


def lines(case: Case, states: Sequence[State]) -> list[str]:
    """Table of the states that flow, and what it supposes."""
    flowing = [state for state in states if state.hydraulics is not None]
    if not flowing:
        return []
    columns = (*(_LINE if case.has_line else ()), *_VALVE, *(_TAIL if case.has_tail else ()))
    rows = [printed_row(columns, state) for state in flowing]
    said = [_discharge(case)]
    if case.downstream.pressure:
        said[0] += f" Downstream are {case.downstream.pressure / 1e3:.4g} kPa, and heads are over the surroundings."
    if case.has_line:
        said.insert(
            0, "Supply: total head at the far end of the line; what follows the line loss is of the valve alone."
        )
    return [*printed_head(columns), *rows, *said]


def _discharge(case: Case) -> str:
    if not case.has_tail:
        return "Free discharge: the energy of the jet is lost, nothing is recovered."
    pipe = f"a pipe of {1e3 * case.downstream.pipe_diameter:.4g} mm"
    if case.downstream.expansion_loss is None:
        return (
            f"Into {pipe}: the jet widens and loses head as Borda and Carnot have it; K and Kv are up to behind that."
        )
    lost = f"{case.downstream.expansion_loss:g} of its velocity head"
    return f"Into {pipe}: the jet widens and loses {lost}; K and Kv are up to behind that."
