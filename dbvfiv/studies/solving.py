"""Context that turns refusals of an eigenvalue search into a sentence that names the state."""

from __future__ import annotations

import numpy as np

from eigen import SingularShiftError

from ..errors import SolveError


class solving:
    """Turns what an eigenvalue search refuses into a sentence that names the pressure."""

    def __init__(self, pressure: float):
        self.pressure = pressure

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind, error, _trace) -> None:
        if isinstance(error, (SingularShiftError, np.linalg.LinAlgError)):
            said = str(error).rstrip(".")
            raise SolveError(f"The modes at {self.pressure:.6g} Pa were not found: {said}.") from error
