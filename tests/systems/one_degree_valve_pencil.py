"""One-degree valve, (m s^2 + c s + k)(s + r) - B s = 0, as a coupled pencil."""

from __future__ import annotations

from eigen import CoupledPencil


def one_degree_valve(B: float, r: float, m: float = 1.0, c: float = 0.1, k: float = 1.0) -> CoupledPencil:
    """The inner unknown U is the pressure lag of the fluid column: (s + r) U = B s q."""
    return CoupledPencil(M=[[m]], C=[[c]], K=[[k]], G=[[1.0]], J=[[1.0]], B0=[[1.0]], R1=[[-B]], S0=[[r]], S1=[[1.0]])
