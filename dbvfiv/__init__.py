"""Fluid-induced vibration of duckbill valves.

A quarter model of a layered rubber valve (large-rotation shell), the flow
through it (one streamline, incompressible) and the coupled states of the two:
equilibria, modes, onset of flutter, time histories and closure.
"""

__version__ = "0.1.0"
