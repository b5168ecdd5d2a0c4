"""Fluid-induced vibration of duckbill valves.

A quarter model of a layered rubber valve (large-rotation shell), the flow
through it (one streamline, incompressible) and the coupled states of the two:
equilibria, modes, onset of flutter, time histories and closure.

Importing the package sets JAX to double precision (see ``dbvfiv.runtime``).
"""

from . import runtime

runtime.prepare()

__version__ = "0.1.0"
