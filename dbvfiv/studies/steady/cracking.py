"""The pressure at which a valve begins to open.

Its lips leave a gap at rest, so no pressure divides shut from open. What is called cracking here is a passage at the
lips that has grown to a stated multiple of that at rest.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq

from ...case.quantity import head_of
from ...model import ValveModel
from ...model.equilibria import LoadPath, SteadyOptions
from ...model.state import SteadyState

#: Kind of the note of a record that holds it.
NOTE = "cracking"
#: Relative accuracy of the pressure.
_ACCURACY = 1e-5


@dataclass(frozen=True)
class Cracking:
    """Cracking pressure: that at which the passage has grown to a multiple of its area at rest.

    Attributes
    ----------
    area_ratio : float
        The multiple.
    pressure : float or None, Pa
        Driving pressure there, over the pressure downstream; None where no state is open so far.
    head : float or None, m
        The same as a head of the fluid.
    """

    area_ratio: float
    pressure: float | None
    head: float | None

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers."""
        return asdict(self)

    def sentence(self, highest: float) -> str:
        """Sentence on the cracking pressure; `highest` is the highest pressure among the states, Pa."""
        grown = f"{self.area_ratio:g} times the passage at rest"
        if self.pressure is None:
            return f"Cracking: not up to {highest / 1e3:.4g} kPa, where the lips leave less than {grown}."
        return (
            f"Cracking pressure: {self.pressure:.4g} Pa ({1e3 * self.head:.3g} mm of the fluid) over that downstream, "
            f"where the lips leave {grown}; they leave a gap at rest, so some fluid passes before."
        )


def find_cracking(model: ValveModel, states: Iterable[SteadyState], area_ratio: float) -> Cracking:
    """Cracking pressure between rest and the states found.

    Parameters
    ----------
    model : ValveModel
        With a flow.
    states : iterable of SteadyState
    area_ratio : float
        Passage at the lips over that at rest.

    Raises
    ------
    SolveError
        If a state on the way is not found.
    """
    rest = model.rows.areas(model.nodal(model.rest()))[0]
    wanted = np.log(area_ratio * rest)
    open_ = [state for state in states if np.log(max(state.station_area[0], rest)) >= wanted]
    if not open_:
        return Cracking(area_ratio, None, None)
    upper = min(open_, key=lambda state: state.pressure)
    path = LoadPath(model, SteadyOptions.of(model.case))
    back = model.flow.back

    def missing(drive: float) -> float:
        """Logarithm of the passage over the one wanted, at a pressure over that downstream."""
        if drive == 0.0 and model.weight is None:
            return -np.log(area_ratio)
        return float(np.log(max(path.go_to(back + drive).station_area[0], rest * 1e-6)) - wanted)

    if missing(0.0) >= 0.0:  # the weight alone has opened it
        return Cracking(area_ratio, 0.0, 0.0)
    drive = brentq(missing, 0.0, upper.pressure - back, xtol=1e-12, rtol=_ACCURACY)
    return Cracking(area_ratio, float(drive), head_of(float(drive), model.case.fluid.density))
