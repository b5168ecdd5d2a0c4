"""The state of a result file that a command is about."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ...case.pressures import read_pressures
from ...errors import CaseError
from ...studies.session import load_result

if TYPE_CHECKING:
    from ...studies.state import State


def chosen_state(file: Path, pressure: str | None) -> State:
    """The steady state nearest to a pressure ("36 kPa", "36kPa"), that of the highest without one.

    Raises
    ------
    CaseError
        If the file holds no steady states, or the pressure cannot be read.
    """
    result = load_result(file)
    if result.kind != "steady":
        raise CaseError(
            f"{str(file)!r} holds a result of kind {result.kind!r}; one of `dbvfiv steady` is needed, which has states."
        )
    if not result.states:
        raise CaseError(f"{str(file)!r} holds no state.")
    if pressure is None:
        return max(result.states, key=lambda state: state.pressure)
    return result.nearest(read_pressures([pressure], "--state")[0])
