"""Modes and sweeps from Python: what `Valve` and `State` offer, once for both."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from .case.parameters import PARAMETERS, SWEPT
from .errors import CaseError, SolveError

if TYPE_CHECKING:
    from .api import Valve
    from .model.state import SteadyState
    from .observer import Observer
    from .results.modes import ModesResults
    from .results.state import State
    from .results.sweep import SweepResults

#: Keyword arguments and the keys of the case that they stand for.
KEYS = {name: PARAMETERS[name].key for name in SWEPT} | {
    "continuity": "fluid.continuity",
    "in_vacuo": "modes.in_vacuo",
    "max_frequency": "modes.max_frequency",
}


def changed(valve: Valve, given: dict[str, Any], more: dict[str, Any]) -> Valve:
    """The valve with what was given as arguments put into its case; None stands for nothing given.

    Raises
    ------
    CaseError
    """
    unknown = [name for name in given if name not in KEYS]
    if unknown:
        raise CaseError(f"{unknown[0]!r} is given, which is nothing to choose here; known are {', '.join(KEYS)}.")
    changes = {KEYS[name]: value for name, value in given.items() if value is not None} | {
        k: v for k, v in more.items() if v is not None
    }
    return valve.replace(changes) if changes else valve


def modes_of(valve: Valve, start: State | None, output: str | Path | None, observer: Observer | None) -> ModesResults:
    """Leading modes of a valve at its drive.pressure, or at a state found before.

    Raises
    ------
    CaseError, SolveError
    """
    from .observer import Observer
    from .record.header import Header
    from .results.modes import ModesResults
    from .studies.modes import run_modes

    observer = observer or Observer()
    state, warnings = state_of(valve, start, observer)
    found = run_modes(valve.model, state, observer=observer)
    result = ModesResults.of(found, Header.of("modes", valve.case, valve.name), warnings)
    if output is not None:
        result.save(output)
    return result


def state_of(valve: Valve, start: State | None, observer: Observer) -> tuple[SteadyState, tuple[str, ...]]:
    """The equilibrium at drive.pressure, and warnings: from a state found before, at rest, or by load steps."""
    from .model.equilibria import find_equilibria
    from .model.state import describe_state
    from .studies.modes import rest_state

    model, pressure = valve.model, valve.case.drive.pressure
    if start is not None:
        kept = ("converged", "iterations", "load_steps", "residual", "rounding", "reason")
        # flow and jet follow the density of this case
        return describe_state(
            model, start.q, start.pressure, **{name: getattr(start, name) for name in kept}
        ), start.results.warnings
    if pressure == 0:
        return rest_state(model), ()
    result = find_equilibria(model, [pressure], observer=observer)
    if result.failures:
        raise SolveError(result.failures[0])
    if not result.states:
        raise KeyboardInterrupt
    return result.states[0], result.warnings


def sweep_of(valve: Valve, start: State | None, output: str | Path | None, observer: Observer | None) -> SweepResults:
    """Modes tracked along the parameter of sweep.over.

    Raises
    ------
    CaseError, SolveError
    """
    from .observer import Observer
    from .record.header import Header
    from .results.sweep import SweepResults
    from .studies.sweep import run_sweep

    observer = observer or Observer()
    axis = valve.case.sweep.axis
    state, warnings = (None, ()) if axis.parameter == "pressure" else state_of(valve, start, observer)
    header = Header.of("sweep", valve.case, valve.name)

    def keep(found):
        result = SweepResults.of(found, header, warnings)
        if output is not None:
            result.save(output)
        return result

    return keep(run_sweep(valve.model, axis, state=state, observer=observer, keep=keep if output is not None else None))
