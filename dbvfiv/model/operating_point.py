"""Operating point: intersection of the valve's flow curve over pressure with the pump curve."""

from __future__ import annotations

from scipy.optimize import brentq

from ..case.quantity import GRAVITY
from ..errors import SolveError
from ..observer import Observer
from .equilibria import LoadPath, SteadyOptions
from .valve import ValveModel

#: Where the search begins: this part of the pump's largest head; and how far it goes up at once.
_START, _UP = 1 / 64, 2.0
#: Relative accuracy of the pressure.
_TOLERANCE = 1e-12


def operating_pressure(model: ValveModel, observer: Observer | None = None) -> float:
    """Pressure, Pa, at the far end of the line at which the pump delivers what the valve takes: the lowest one.

    Raises
    ------
    SolveError
        If an equilibrium is not reached on the way, or the curves meet outside of the pump's table.
    """
    observer = Observer() if observer is None else observer
    pump, density = model.pump, model.case.fluid.density
    path = LoadPath(model, SteadyOptions.of(model.case), observer=observer)
    known: dict[float, float] = {}

    def beyond(pressure: float) -> float:
        """Excess of a pressure, Pa, over that of the pump at the flow that it drives."""
        if pressure not in known:
            observer.progress(f"looking for the operating point at {pressure:.6g} Pa")
            known[pressure] = path.go_to(pressure).volume_flow
        return pressure - density * GRAVITY * pump.head_and_slope(known[pressure])[0]

    unit = density * GRAVITY
    top = unit * float(pump.heads.max())
    low = _START * top
    if beyond(low) > 0:
        raise _outside(known[low], pump, "at the least of its heads that are tried")
    high = low
    while beyond(high) <= 0:
        low, high = high, min(_UP * high, top)
        if low == top:
            raise _outside(known[low], pump, "at all of its heads")
    pressure = float(brentq(beyond, low, high, xtol=_TOLERANCE * top, rtol=4 * _TOLERANCE))
    beyond(pressure)
    if not pump.holds(known[pressure]):
        raise _outside(known[pressure], pump, f"where the curves would meet, at {pressure / unit:.4g} m")
    return pressure


def _outside(flow: float, pump, where: str) -> SolveError:
    return SolveError(
        f"The valve takes {1e3 * flow:.4g} L/s {where}, and the pump's table goes from {1e3 * pump.flow[0]:.4g} to "
        f"{1e3 * pump.flow[-1]:.4g} L/s: there is no operating point within it."
    )
