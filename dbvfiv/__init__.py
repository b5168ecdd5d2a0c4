"""Fluid-induced vibration of duckbill valves.

A quarter model of a layered rubber valve (large-rotation shell), the flow
through it (one streamline, incompressible) and the coupled states of the two:
equilibria, modes, onset of flutter, time histories and closure.

Importing the package sets JAX to double precision (see ``dbvfiv.runtime``).
"""

from importlib import import_module

from . import runtime

runtime.prepare()

__version__ = "0.1.0"
#: Public names and the modules that hold them.
_PUBLIC = {
    "Valve": "api",
    "load": "api",
    "load_result": "studies.session",
    "resume": "api",
    "CaseError": "errors",
    "SolveError": "errors",
    "Observer": "observer",
    "ClosureResult": "studies.closure.study",
    "CycleResult": "studies.cycle.study",
    "IdentifyResult": "studies.identify.study",
    "LevelsResult": "studies.levels.study",
    "MapResult": "studies.map.study",
    "ModesResult": "studies.modes.study",
    "OnsetResult": "studies.onset.study",
    "ResponseResult": "studies.response.study",
    "SensitivityResult": "studies.sensitivity.study",
    "State": "studies.state",
    "SteadyResult": "studies.steady.study",
    "SweepResult": "studies.sweep.study",
    "TransientResult": "studies.transient.study",
    "UncertaintyResult": "studies.uncertainty.study",
    "DesignResult": "studies.design.study",
}
__all__ = sorted(_PUBLIC)


def __getattr__(name: str):
    """Load the Python interface when it is first asked for: the command line's help does without numpy."""
    if name not in _PUBLIC:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; it offers {', '.join(__all__)}")
    found = getattr(import_module(f".{_PUBLIC[name]}", __name__), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
