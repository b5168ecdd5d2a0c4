"""What a branch of periodic motions is made of: options, cycles, special points."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from continuation.cycles import Cycle
from continuation.hill import Exponents
from continuation.options import require

#: Kinds of special points.
FOLD, DOUBLING, TORUS = "fold", "period doubling", "torus"


@dataclass(frozen=True)
class CycleBranchOptions:
    """Options of a branch of cycles.

    Attributes
    ----------
    step : float
        First step in arclength, with the parameter over `scale` and the motion over `motion_scale`.
    min_step, max_step : float
    scale : float
        Of the parameter.
    motion_scale : float
        Of the motion: root of the sum of squares of its coefficients in units of the system's scales.
    limits : tuple of float
        Range of the parameter.
    values : tuple of float
        Values of the parameter at which a cycle is wanted.
    max_points : int
    exponents : int
        Floquet exponents kept; 0 for none.
    tail : float
        Largest share that the last two harmonics may have in a motion.
    max_harmonics : int
    located : float
        Relative accuracy of special points in arclength over the step.
    """

    step: float = 0.05
    min_step: float = 1e-4
    max_step: float = 0.3
    scale: float = 1.0
    motion_scale: float = 1.0
    limits: tuple[float, float] = (-np.inf, np.inf)
    values: tuple[float, ...] = ()
    max_points: int = 200
    exponents: int = 4
    tail: float = 1e-3
    max_harmonics: int = 24
    located: float = 1e-2

    def __post_init__(self):
        require(0 < self.min_step <= self.step <= self.max_step, "Steps must satisfy 0 < min_step <= step <= max_step.")
        require(self.scale > 0 and self.motion_scale > 0, "Scales must be positive.")
        require(0 < self.tail < 1, "The share of the last harmonics lies between 0 and 1.")


@dataclass(frozen=True, eq=False)
class CyclePoint:
    """A cycle on a branch.

    Attributes
    ----------
    cycle : Cycle
    value : float
        Of the parameter.
    arclength : float
    exponents : Exponents or None
    asked : bool
        Whether it lies at a value that was asked for.
    tests : dict
        Values of the events' functions.
    """

    cycle: Cycle
    value: float
    arclength: float
    exponents: Exponents | None
    asked: bool = False
    tests: dict = field(default_factory=dict)

    @property
    def motion(self):
        return self.cycle.motion


@dataclass(frozen=True, eq=False)
class SpecialCycle:
    """A special point.

    Attributes
    ----------
    kind : str
    point : CyclePoint
        The cycle nearest to it that was computed.
    value : float
        Of the parameter, by interpolation.
    frequency : float
        Of the perturbation that becomes neutral, Hz; zero for a fold.
    located : bool
        Whether it was found as closely as asked for.
    """

    kind: str
    point: CyclePoint
    value: float
    frequency: float = 0.0
    located: bool = True
