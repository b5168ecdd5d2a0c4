"""Options, frozen and checked once; errors; and the reasons why branches end and iterations fail, as sentences."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from math import isfinite, isnan
from numbers import Integral, Real

#: Kinds of special points.
KINDS = (
    "fold", "branch point", "hopf", "zero eigenvalue", "stability change",
    "cusp", "bogdanov-takens", "generalised hopf", "zero-hopf",
    "fold of cycles", "period doubling", "torus",
)  # fmt: skip


class Said(str):
    """Sentence of a `Reason` with its details filled in; ``kind`` is the reason."""

    kind: Reason


class Reason(Enum):
    """Why a branch ended, a step was refused or an iteration failed; each member is its sentence.

    Called with its details a member gives the sentence as a `Said`.

    Examples
    --------
    >>> Reason.LIMIT(name="D", value=0.3)
    'ended on the limit D = 0.3'
    >>> Reason.LIMIT(name="D", value=0.3).kind is Reason.LIMIT
    True
    """

    RUNNING = "is still running"
    LIMIT = "ended on the limit {name} = {value:.6g}"
    STOPPED = "stopped at: {kind}"
    CLOSED = "came back to its first point"
    POINTS = "used up its points"
    VANISHED = "shrinks to nothing beyond {name} = {value:.6g}"
    SMALLEST_STEP = "failed with its smallest step: {why}"
    NO_CYCLE = "found no further cycle: {why}"
    INTERRUPTED = "was interrupted"
    ERROR = "met an error: {why}"

    CONVERGED = "converged"
    ITERATIONS = "the iterations were used up"
    DIVERGED = "the residual grew too far"
    NOT_FINITE = "the residual is not finite"
    SINGULAR = "a linear system is singular"
    DOMAIN = "outside the domain of the model: {why}"
    TURNED = "the tangent turns too far"
    JUMPED = "the corrections went far from the prediction"
    DOUBTFUL = "a {kind} was seen and not located"
    LOST_AT_LIMIT = "the curve was lost at its limit"
    KNOWN_BRANCH = "the corrector fell back to the known branch"
    HARMONICS = (
        "{count} harmonics are too few: the last two hold {share:.2g} of the motion "
        "(max_harmonics allows more, tail a larger share)"
    )
    REST = "the guess shrank to an equilibrium"
    NOT_NORMAL = "the first orbit is not where the normal form has it"

    def __call__(self, **details) -> Said:
        said = Said(self.value.format(**details))
        said.kind = self
        return said


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
    reason : Reason or None
    result : object
        The unfinished result, for diagnosis only.
    """

    def __init__(self, message: str, reason: Reason | None = None, result=None):
        super().__init__(message)
        self.reason = reason
        self.result = result


class NotABifurcation(ContinuationError):
    """A point handed over as a bifurcation does not qualify as one."""


class NotAParameter(ContinuationError, KeyError):
    """A name that no parameter of the system has."""

    __str__ = Exception.__str__  # KeyError puts quotes around its sentence

    @classmethod
    def named(cls, name, mu) -> NotAParameter:
        """The error for a name and the parameters that there are."""
        return cls(f"The parameter {name!r} is not one of: {', '.join(sorted(map(str, mu)))}.")


class OutOfDomain(ContinuationError):
    """Model cannot be evaluated at a state; models raise it, and the step is then tried shorter."""


def require(condition: bool, sentence: str) -> None:
    """Raise ``ValueError(sentence)`` unless the condition holds."""
    if not condition:
        raise ValueError(sentence)


def _require_numbers(options, *names: str, whole: bool = False) -> None:
    for name in names:
        value = getattr(options, name)
        fits = isinstance(value, Integral if whole else Real) and not isinstance(value, bool) and not isnan(value)
        require(fits, f"The option {name} must be a {'whole ' if whole else ''}number, not {value!r}.")


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
    """

    tolerance: float = 1e-10
    max_iterations: int = 15

    def __post_init__(self):
        _require_numbers(self, "tolerance")
        _require_numbers(self, "max_iterations", whole=True)
        require(self.tolerance > 0, f"The Newton tolerance must be positive, not {self.tolerance}.")
        require(self.max_iterations >= 1, "Newton needs at least one iteration.")


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
    direction : {+1, -1}
        Sign of the first step in the parameter.
    max_angle : float
        Largest angle (rad, in the scaled metric) between tangents at consecutive points.
    state_scale : float or None
        Unit of the state in the arclength.  By default half the range of the state so far, the root of the mean square
        over its unknowns; at first its change over the unit of the parameter.  1 for orbits and with own weights.
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
    locate : bool
        Locate what was detected by Newton's method; otherwise it is only bracketed.
    location_tolerance : float
        Relative size of the last correction of a located point.
    stop_at : str or set of str
        Kinds of special points that end the branch, e.g. ``"fold"``, or names of events; ``"hopf"`` needs
        ``eigenvalues``. Kinds that a run does not look for are refused.
    newton : NewtonOptions
    """

    step: float = 0.05
    min_step: float = 1e-7
    max_step: float = 0.5
    max_points: int = 200
    limits: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    direction: int = 1
    max_angle: float = 0.35
    state_scale: float | None = None
    parameter_scales: Mapping[str, float] = field(default_factory=dict)
    folds: bool = True
    branch_points: bool = True
    eigenvalues: int = 0
    near: complex | None = None
    locate: bool = True
    location_tolerance: float = 1e-8
    stop_at: frozenset[str] = frozenset()
    newton: NewtonOptions = field(default_factory=NewtonOptions)

    def units(self, names) -> dict[str, float]:
        """Unit of each parameter in the arclength."""
        own = {name: 0.2 * (high - low) for name, (low, high) in self.limits.items() if isfinite(high - low)}
        return {name: float(self.parameter_scales.get(name, own.get(name, 1.0))) for name in names}

    def __post_init__(self):
        _require_numbers(self, "step", "min_step", "max_step", "direction", "max_angle", "location_tolerance")
        _require_numbers(self, "max_points", "eigenvalues", whole=True)
        for name in ("limits", "parameter_scales"):
            given = getattr(self, name)
            require(isinstance(given, Mapping), f"The option {name} goes by names of parameters, not {given!r}.")
        stop_at = (self.stop_at,) if isinstance(self.stop_at, str) else self.stop_at
        object.__setattr__(self, "stop_at", frozenset(stop_at))
        require(
            isinstance(self.newton, NewtonOptions), f"The option newton is NewtonOptions(...), not {self.newton!r}."
        )
        require(
            0 < self.min_step <= self.step <= self.max_step,
            "The steps must satisfy 0 < min_step <= step <= max_step, not "
            f"{self.min_step}, {self.step}, {self.max_step}.",
        )
        require(self.max_points >= 1, "A branch needs room for at least one more point.")
        require(self.direction in (1, -1), f"The direction is +1 or -1, not {self.direction}.")
        require(0 < self.max_angle < 1.6, "The largest angle must lie between 0 and 1.6 rad.")
        if self.state_scale is not None:
            _require_numbers(self, "state_scale")
            require(self.state_scale > 0, "The unit of the state must be positive.")
        for name, scale in self.parameter_scales.items():
            number = isinstance(scale, Real)
            require(number and scale > 0, f"The unit of the parameter {name!r} must be positive, not {scale!r}.")
        for name, pair in self.limits.items():
            pair = tuple(pair) if isinstance(pair, Iterable) else (pair,)
            numbers = len(pair) == 2 and all(isinstance(limit, Real) for limit in pair)
            require(numbers, f"The limits of {name!r} must be two numbers, not {self.limits[name]!r}.")
            low, high = pair
            require(low < high, f"The limits of {name!r} must increase, not {low}, {high}.")
        require(self.eigenvalues >= 0, "The number of eigenvalues cannot be negative.")
        require(self.location_tolerance > 0, "The location tolerance must be positive.")


@dataclass(frozen=True)
class OrbitOptions:
    """Discretisation of periodic orbits.

    Attributes
    ----------
    harmonics, max_harmonics : int
        Harmonics of the first series, and at most.
    tail : float
        Largest share that the last two harmonics may have in an orbit about its mean, its unknowns by how far each
        moves; the series is made longer until that holds.
    tolerance : float
        Error that the corrections leave, over the size of the orbit about its mean.
    exponents : int
        Leading Floquet exponents at most, 0 for none; there are n - 1 besides that of the shift in time.
    """

    harmonics: int = 8
    max_harmonics: int = 128
    tail: float = 1e-9
    tolerance: float = 1e-11
    exponents: int = 8

    def __post_init__(self):
        _require_numbers(self, "tail", "tolerance")
        _require_numbers(self, "harmonics", "max_harmonics", "exponents", whole=True)
        require(
            1 <= self.harmonics <= self.max_harmonics, "The harmonics must satisfy 1 <= harmonics <= max_harmonics."
        )
        require(0 < self.tail < 1, "The share of the last harmonics lies between 0 and 1.")
        require(0 < self.tolerance < 0.1, "The tolerance of orbits lies between 0 and 0.1.")
        require(self.exponents >= 0, "The number of Floquet exponents cannot be negative.")
