"""A point of a curve while the run is on: with its linearisation and the monitors' notes."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from continuation.branch import CurvePoint
from continuation.problem import Local


@dataclass
class Here:
    """A point on the curve with its linearisation and what the monitors made of it.

    Attributes
    ----------
    z, tangent : ndarray
    local : Local
    tests : dict of str to float
    unstable : int
    eigenvalues : ndarray, complex
    data : dict
        Private to the monitors.
    """

    z: np.ndarray
    tangent: np.ndarray
    local: Local
    iterations: int = 0
    step: float = 0.0
    tests: dict = field(default_factory=dict)
    unstable: int = -1
    eigenvalues: np.ndarray = field(default_factory=lambda: np.empty(0, complex))
    data: dict = field(default_factory=dict)

    def point(self) -> CurvePoint:
        return CurvePoint(
            self.z,
            self.tangent,
            self.step,
            self.iterations,
            float(self.local.size),
            dict(self.tests),
            self.unstable,
            self.eigenvalues,
        )
