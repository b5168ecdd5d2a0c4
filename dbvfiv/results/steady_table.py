"""Steady states as lines of a table for people."""

from __future__ import annotations

from typing import Any

_COLUMNS = (
    ("pressure", "static kPa", 10, lambda s: f"{s.pressure / 1e3:.6g}"),
    ("head", "m", 8, lambda s: f"{s.head:.4g}"),
    ("mass flow", "kg/s", 10, lambda s: f"{s.mass_flow:.3f}"),
    ("flow", "L/s", 9, lambda s: f"{s.volume_flow * 1e3:.5g}"),
    ("lip area", "cm2", 9, lambda s: f"{s.outlet_area * 1e4:.3f}"),
    ("jet", "m/s", 7, lambda s: f"{s.outlet_velocity:.3f}"),
    ("lip opening", "mm", 12, lambda s: f"{s.lip_opening * 1e3:.3f}"),
    (
        "largest displacement",
        "mm at z",
        21,
        lambda s: f"{s.max_displacement * 1e3:.3f} at {s.max_displacement_position[2] * 1e3:.0f}",
    ),
    ("iterations", "", 11, lambda s: f"{s.iterations}"),
    ("residual", "", 9, lambda s: f"{s.residual:.1e}"),
)


def _line(cells: list[str]) -> str:
    return " ".join(cell.rjust(column[2]) for cell, column in zip(cells, _COLUMNS)).rstrip()


#: Names and units above the table.
HEAD = (_line([column[0] for column in _COLUMNS]), _line([column[1] for column in _COLUMNS]))


def row_of(state: Any) -> str:
    """One line for a state (of a study or of a result)."""
    return _line([column[3](state) for column in _COLUMNS])
