"""Fluid-induced vibration of duckbill valves.

A quarter model of a layered rubber valve (large-rotation shell), the flow
through it (one streamline, incompressible) and the coupled states of the two:
equilibria, modes, onset of flutter, time histories and closure.

Importing the package sets JAX to double precision (see ``dbvfiv.runtime``).
"""

from . import runtime

runtime.prepare()

__version__ = "0.1.0"
__all__ = ["load", "load_result", "resume"]


def __getattr__(name: str):
    """Load the Python interface when it is first asked for: the command line's help does without numpy."""
    if name == "load":
        from .api import load as found
    elif name == "load_result":
        from .results import load_result as found
    elif name == "resume":
        from .resuming import resume as found
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = found
    return found
