"""Inlet pressure as a function of time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..case.model import Case
from ..case.tables import read_drive_table


@dataclass(frozen=True)
class Drive:
    """Pressure through points in time, linear between them and constant beyond; applied at once before the first point.

    Attributes
    ----------
    times : tuple of float, s
    pressures : tuple of float, Pa

    Examples
    --------
    >>> Drive((0.0, 0.1), (0.0, 6e3))(0.05)
    3000.0
    """

    times: tuple[float, ...]
    pressures: tuple[float, ...]

    def __call__(self, time: float) -> float:
        return float(np.interp(time, self.times, self.pressures))

    def constant_after(self, time: float) -> bool:
        """True where the pressure is constant from a time, s, on."""
        return (
            all(p == self.pressures[-1] for t, p in zip(self.times, self.pressures) if t > time)
            and self(time) == self.pressures[-1]
        )

    @classmethod
    def of(cls, case: Case) -> Drive:
        """Drive of a case: constant, a ramp, or a table."""
        transient = case.transient
        if transient.drive_table is not None:
            times, pressures = zip(*read_drive_table(transient.drive_table))
            return cls(times, pressures)
        if transient.ramp > 0:
            return cls((0.0, transient.ramp), (0.0, case.drive.pressure))
        return cls((0.0,), (case.drive.pressure,))
