"""Options, frozen and checked once, in sentences; and the errors of this package."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import isfinite


class ContinuationError(Exception):
    """Base class of the errors of this package."""


class DerivativeMissing(ContinuationError, NotImplementedError):
    """The system does not supply a derivative that the analysis needs."""


class SingularSystem(ContinuationError):
    """A linear system stayed singular after bordering and repair."""


class NotConverged(ContinuationError):
    """An iteration ended without a solution; ``result`` holds what there is.

    Attributes
    ----------
    reason : str
        One word or short phrase, e.g. ``"diverged"``.
    result : object
        The unfinished result, for diagnosis only.
    """

    def __init__(self, message: str, reason: str = "", result=None):
        super().__init__(message)
        self.reason = reason
        self.result = result


class NotABifurcation(ContinuationError):
    """A point handed over as a bifurcation does not qualify as one."""


class OutOfDomain(ContinuationError):
    """Model cannot be evaluated at a state; models raise it, and the step is then tried shorter."""


def require(condition: bool, sentence: str) -> None:
    """Raise ``ValueError(sentence)`` unless the condition holds."""
    if not condition:
        raise ValueError(sentence)


@dataclass(frozen=True)
class NewtonOptions:
    """Newton's method for equilibria.

    Attributes
    ----------
    tolerance : float
        The norm of the residual (largest entry, or the system's own ``residual_norm``)
        below which a state counts as an equilibrium.
    max_iterations : int
        Corrections at most.
    line_search : bool
        Halve a correction until the residual falls (Armijo); helps from poor guesses.
    min_damping : float
        Smallest fraction of a correction the line search tries.
    divergence : float
        Give up when the residual exceeds this multiple of the first one.
    reuse_rate : float
        Keep the factorisation as long as each correction shrinks the residual at least by
        this factor; 0 renews it every time (full Newton).
    """

    tolerance: float = 1e-10
    max_iterations: int = 15
    line_search: bool = False
    min_damping: float = 1e-4
    divergence: float = 1e6
    reuse_rate: float = 0.0

    def __post_init__(self):
        require(self.tolerance > 0, f"The Newton tolerance must be positive, not {self.tolerance}.")
        require(self.max_iterations >= 1, "Newton needs at least one iteration.")
        require(0 < self.min_damping <= 1, "The smallest damping must lie in (0, 1].")
        require(self.divergence > 1, "The divergence factor must exceed 1.")
        require(0 <= self.reuse_rate < 1, "The reuse rate must lie in [0, 1).")


@dataclass(frozen=True)
class ContinuationOptions:
    """Options of a branch or curve.

    Lengths are measured in ``ds^2 = sum w_i (du_i / state_scale)^2 + sum (dmu / scale)^2``
    with weights ``w_i = 1/n`` unless the system has its own ``state_weights``.

    Attributes
    ----------
    step, min_step, max_step : float
        First, smallest and largest arclength step.
    max_points : int
        Points to add at most.
    limits : mapping of str to (float, float)
        Range of each parameter; the branch ends exactly on the limit it meets.
    method : {"arclength", "natural"}
        Natural continuation steps in the parameter and cannot pass a fold.
    direction : {+1, -1}
        Sign of the first step in the parameter.
    target_iterations : int
        Corrections a comfortable step takes; fewer lengthen the step, more shorten it.
    max_angle : float
        Largest angle (rad, in the scaled metric) between tangents at consecutive points.
    growth, shrink : float
        Largest lengthening of an accepted step, shortening of a refused one.
    state_scale : float
        Unit of the state in the arclength.
    parameter_scales : mapping of str to float
        Unit of each parameter in the arclength.  By default a fifth of the range of its limits, so that the
        first step goes over 1 % of the range and the longest over 10 %; 1 without limits and for orbits.
    folds, branch_points : bool
        Look for folds and simple branch points.
    eigenvalues : int
        Eigenvalues to ask of the spectrum at each point; 0 asks for none, and then Hopf
        points are not seen.
    near : complex or None
        Where to look for them; None leaves it to the spectrum.
    stability_tolerance : float
        An eigenvalue counts as unstable when its real part exceeds this.
    locate : bool
        Locate what was detected by Newton's method; otherwise it is only bracketed.
    location_tolerance : float
        Relative size of the last correction of a located point.
    max_subdivisions : int
        How often an interval with a contradictory count of eigenvalues is halved.
    stop_at : frozenset of str
        Kinds of special points that end the branch, e.g. ``frozenset({"hopf"})``.
    detect_closed : bool
        End when the branch comes back to its first point.
    newton : NewtonOptions
    """

    step: float = 0.05
    min_step: float = 1e-7
    max_step: float = 0.5
    max_points: int = 200
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    method: str = "arclength"
    direction: int = 1
    target_iterations: int = 4
    max_angle: float = 0.35
    growth: float = 1.5
    shrink: float = 0.5
    state_scale: float = 1.0
    parameter_scales: Mapping[str, float] = field(default_factory=dict)
    folds: bool = True
    branch_points: bool = True
    eigenvalues: int = 0
    near: complex | None = None
    stability_tolerance: float = 0.0
    locate: bool = True
    location_tolerance: float = 1e-8
    max_subdivisions: int = 6
    stop_at: frozenset[str] = frozenset()
    detect_closed: bool = True
    newton: NewtonOptions = field(default_factory=NewtonOptions)

    def units(self, names) -> dict[str, float]:
        """Unit of each parameter in the arclength."""
        own = {name: 0.2 * (high - low) for name, (low, high) in self.limits.items() if isfinite(high - low)}
        return {name: float(self.parameter_scales.get(name, own.get(name, 1.0))) for name in names}

    def __post_init__(self):
        require(
            0 < self.min_step <= self.step <= self.max_step,
            "The steps must satisfy 0 < min_step <= step <= max_step, not "
            f"{self.min_step}, {self.step}, {self.max_step}.",
        )
        require(self.max_points >= 1, "A branch needs room for at least one more point.")
        require(
            self.method in ("arclength", "natural"),
            f"The method must be 'arclength' or 'natural', not {self.method!r}.",
        )
        require(self.direction in (1, -1), f"The direction is +1 or -1, not {self.direction}.")
        require(self.target_iterations >= 1, "The target number of iterations is at least 1.")
        require(0 < self.max_angle < 1.6, "The largest angle must lie between 0 and 1.6 rad.")
        require(self.growth >= 1, "The growth factor must be at least 1.")
        require(0 < self.shrink < 1, "The shrink factor must lie between 0 and 1.")
        require(self.state_scale > 0, "The unit of the state must be positive.")
        for name, scale in self.parameter_scales.items():
            require(scale > 0, f"The unit of the parameter {name!r} must be positive, not {scale}.")
        for name, (low, high) in self.limits.items():
            require(low < high, f"The limits of {name!r} must increase, not {low}, {high}.")
        require(self.eigenvalues >= 0, "The number of eigenvalues cannot be negative.")
        require(self.location_tolerance > 0, "The location tolerance must be positive.")
        require(self.max_subdivisions >= 0, "The number of subdivisions cannot be negative.")
