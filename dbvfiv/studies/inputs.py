"""Uncertain inputs of a case: those that it names, or the shipped ones of what it is made of; and samples of them."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np

from eigen.columns import ColumnSolver

from ..case.describe import quantity_of, toml_name
from ..case.distribution import ALLOWED, FORMS, Distribution
from ..case.load import key_path
from ..case.parameters import PARAMETERS, Mu
from ..case.quantity import Quantity
from ..errors import CaseError
from ..materials.shipped import shipped_loss, shipped_loss_names
from .case import Case
from .stability.place import (
    design_value,
    is_surrounding,
    limits_of,
    number_of,
    plain_number,
    redesigned,
    require_parameter,
)
from .stability.verdict import lowered
from .stability.walk import StabilityWalk

#: Hardness of a compound lies within 5 Shore A of what was ordered (trade practice with ISO 48-4), a fifth of its shear
#: modulus (Gent, Rubber Chem. Technol. 31, 1958, 896); read as 95 %.
HARDNESS = 1.2 ** (1 / 1.96)
#: ISO 3302-1:2014, class M3, dimensions across the mould's closure: up to, mm, and tolerance, mm; beyond, a share.
CLOSURE = ((4.0, 0.40), (6.3, 0.40), (10.0, 0.50), (16.0, 0.60), (25.0, 0.80), (40.0, 1.0), (63.0, 1.3), (100.0, 1.6))
CLOSURE_BEYOND = 0.013
#: How keys end that parameters of the design set.
HELD_BY = {
    "sealing": ("valve.sealing_pressure", "valve.sealing_force", "valve.overlap"),
    "angle": (".angle",),
    "strain": (".strain_level",),
    "thickness": ("valve.thickness_factor",),
}
#: Confidence of intervals.
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Input:
    """One uncertain number."""

    name: str  #: Of a parameter of the table, or a key of the case.
    distribution: Distribution  #: SI; angles in degrees.
    quantity: Quantity
    source: str  #: Why it is as uncertain as that.
    surrounding: bool  #: Whether steady states and structure stay as they are.
    own: float | None = None  #: Number of the case; None where it has no one.
    limits: tuple[float, float] = (-np.inf, np.inf)  #: Least and largest number that there can be.

    @property
    def title(self) -> str:
        """Name for figures and tables."""
        if self.name in PARAMETERS:
            return PARAMETERS[self.name].title
        material = key_path(self.name)
        if material[0] == "materials" and len(material) == 3:
            return f"{material[1]}: {material[2].replace('_', ' ')}"
        return self.name

    def summary(self) -> dict[str, str]:
        """Texts for JSON."""
        words = self.distribution.words(self.quantity)
        return {"parameter": self.name, "distribution": words, "source": self.source}

    def words(self) -> str:
        """The input as a sentence."""
        return f"{self.name} = {self.distribution.words(self.quantity)}: {self.source}"


def inputs_of(case: Case, over: Sequence[str] = (), by: str = "uncertainty.over") -> list[Input]:
    """Uncertain inputs of a case, without those over which their effect is asked, which none may be that it names; `by`
    says what moves these. Raises CaseError for a name that is no number of the case, a distribution that cannot be
    read, or one of which more than `ALLOWED` lies where the number cannot be.
    """
    asked = case.uncertainty
    varied = over or ([asked.axis.parameter] if asked.axis is not None else [])
    if asked.inputs:
        found = [_input(case, name, text, "given") for name, text in asked.inputs.items()]
    else:
        found = [_input(case, name, text, source) for name, text, source in _shipped(case)]
    moved = [one for one in found if one.name in varied]
    if moved and asked.inputs:
        raise CaseError(
            f"uncertainty.inputs holds {moved[0].name!r}, which {by} moves; one of them has to go.",
            key="uncertainty.inputs",
        )
    found = [one for one in found if one not in moved]
    names = [one.name for one in found]
    if twice := next((name for name in names if names.count(name) > 1), None):
        raise CaseError(
            f"uncertainty.inputs holds {twice} twice, by its name and by its key {PARAMETERS[twice].key}; one of them "
            "has to go.",
            key="uncertainty.inputs",
        )
    for key, name in product(names, (*varied, *names)):
        if key.endswith(HELD_BY.get(name, ())):
            said = f"uncertainty.inputs holds {key}, which {name} sets too; one of them has to go."
            raise CaseError(said, key="uncertainty.inputs")
    if not found:
        raise CaseError(
            "Nothing of this case is known to be uncertain; give uncertainty.inputs, such as "
            '{ loss_factor = "lognormal(1.3)" }.',
            key="uncertainty.inputs",
        )
    return found


def correlation_of(case: Case, inputs: Sequence[Input]) -> np.ndarray:
    """Lower triangle (d, d) that turns independent standard normal scores into those of the inputs. Raises CaseError
    for a name that is no input, or correlations that no numbers can have.
    """
    names = [one.name for one in inputs]
    matrix = np.eye(len(names))
    for *pair, value in case.uncertainty.correlation:
        first, second = map(parameter_of, pair)
        unknown = next((name for name in (first, second) if name not in names), None)
        if unknown or first == second:
            raise CaseError(
                f"uncertainty.correlation names {unknown or first!r}"
                + (", which is no input" if unknown else " twice")
                + f"; the inputs are {', '.join(names)}.",
                key="uncertainty.correlation",
            )
        i, j = names.index(first), names.index(second)
        if matrix[i, j]:
            raise CaseError(
                f"uncertainty.correlation holds the pair {first} and {second} twice; one of them has to go.",
                key="uncertainty.correlation",
            )
        matrix[i, j] = matrix[j, i] = value
    try:
        return np.linalg.cholesky(matrix)
    except np.linalg.LinAlgError:
        raise CaseError(
            "uncertainty.correlation is given such that no numbers can be correlated so: the matrix of the "
            f"correlations has the eigenvalue {np.linalg.eigvalsh(matrix)[0]:.3g}, and all must be greater than 0.",
            key="uncertainty.correlation",
        ) from None


def quasi_random(count: int, dimension: int, seed: int) -> np.ndarray:
    """Scores (count, dimension) of a scrambled Sobol sequence; the first are those of a shorter one."""
    from scipy.special import ndtri
    from scipy.stats import qmc

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # counts that are no power of two are balanced a little less
        return ndtri(np.clip(qmc.Sobol(dimension, seed=seed).random(count), 1e-12, 1 - 1e-12))


@dataclass(frozen=True)
class Probability:
    """Probability of an outcome with its interval."""

    value: float  #: Among the decided samples.
    #: low and high: interval of `CONFIDENCE`; undecided samples count as not being of the outcome for the lower end, as
    #: being of it for the upper one.
    low: float
    high: float


def counted(hits: int, undecided: int, count: int) -> Probability:
    """Probability of an outcome that some of `count` samples have, by Clopper and Pearson (Biometrika 26, 1934,
    404-413), which holds for independent samples and is too wide for quasi-random ones.
    """
    from scipy.stats import beta

    tail, most = 0.5 * (1 - CONFIDENCE), hits + undecided
    low = float(beta.ppf(tail, hits, count - hits + 1)) if hits else 0.0
    high = float(beta.ppf(1 - tail, most + 1, count - most)) if most < count else 1.0
    decided = count - undecided
    return Probability(hits / decided if decided else float("nan"), low, high)


@dataclass(frozen=True)
class Plan:
    """Inputs of a case, and places where their effect is asked."""

    case: Case
    #: Parameters over which the inputs are asked; that of `uncertainty.over` where none is named.
    moved: tuple[str, ...] = ()
    by: str = "uncertainty.over"  #: What moves these.

    @cached_property
    def inputs(self) -> list[Input]:
        return inputs_of(self.case, self.moved, self.by)

    @cached_property
    def _turn(self) -> np.ndarray:
        return correlation_of(self.case, self.inputs)

    @property
    def parameter(self) -> str:
        """Parameter of the range; the pressure where there is none."""
        return self.case.uncertainty.parameter

    @property
    def values(self) -> tuple[float, ...]:
        """Values of the range, SI; without one the pressure of the case, or the median of those that are an input."""
        axis = self.case.uncertainty.axis
        if axis is not None:
            return axis.values
        medians = (one.distribution.median for one in self.inputs if one.name == "pressure")
        return (float(next(medians, self.case.drive.pressure)),)

    @property
    def law(self) -> float:
        """Blend of the flow models of the case."""
        return Mu.of(self.case).storage

    @property
    def is_surrounding(self) -> bool:
        """True where no input moves a steady state, so that all samples share those of the case."""
        return all(one.surrounding for one in self.inputs)

    def scores_of(self, independent: np.ndarray) -> np.ndarray:
        """Scores (n, d) of the inputs, correlated as the case says."""
        return independent @ self._turn.T

    def numbers(self, independent: np.ndarray) -> np.ndarray:
        """Values (n, d) of the inputs, SI, from independent standard normal scores."""
        scores = self.scores_of(independent)
        return np.column_stack([one.distribution.at(scores[:, i]) for i, one in enumerate(self.inputs)])

    def point(self, case: Case, row: np.ndarray, **moved: float) -> Mu:
        """Parameter point of a sample, with some parameters moved."""
        named = {one.name: x for one, x in zip(self.inputs, row) if one.name in PARAMETERS}
        return Mu.of(case).at(**(named | moved))

    def place(self, case: Case, row: np.ndarray, value: float) -> Mu:
        """Parameter point of a sample at a value of the range; without a range a pressure may be an input."""
        is_input = any(one.name == self.parameter for one in self.inputs)
        return self.point(case, row, **({} if is_input else {self.parameter: value}))

    def redescribed(self, row: np.ndarray) -> Case:
        """Case of a sample without the parameters of the table. Raises CaseError for numbers that do not match."""
        keys = {one.name: float(x) for one, x in zip(self.inputs, row) if one.name not in PARAMETERS}
        return redesigned(self.case, keys)

    def walk(self, row: np.ndarray, solver: ColumnSolver) -> StabilityWalk:
        """Walk of a sample, which keeps the symbolic factorisations of a solver. Raises CaseError, SolveError for
        numbers that do not go together.
        """
        return StabilityWalk(self.redescribed(row), solver=solver)


def parameter_of(name: str) -> str:
    """Parameter that a key of the case holds, so that nothing has two names; those of the design count from what the
    case has, and their keys do not.
    """
    return next((row.name for row in PARAMETERS.values() if row.key == name and not row.design), name)


def _input(case: Case, name: str, text: str, source: str) -> Input:
    key, name = f"uncertainty.inputs.{name}", parameter_of(name)
    if name in PARAMETERS:
        row = PARAMETERS[name]
        try:
            require_parameter(case, name)
        except CaseError as error:
            raise CaseError(f"{key} is given, but {lowered(str(error))}", key=key) from None
        own = design_value(case, name) if row.design else getattr(Mu.of(case), name)
        quantity, limits = row.quantity, (row.low, row.high)
    else:
        field, value = number_of(case, name, key)
        quantity = quantity_of(field)
        own, limits = plain_number(case, name, value), limits_of(field, name)
    try:
        distribution = Distribution.parse(text, quantity, own, case.fluid.density)
    except ValueError as error:
        raise CaseError(f"{key} is given as {text!r}, {error}; {FORMS}.", key=key) from None
    outside = distribution.share_outside(*limits)
    if outside > ALLOWED:
        raise CaseError(
            f"{key} is given as {text!r}, of which {outside:.2g} lies where {name} cannot be: it must be within "
            f"{quantity.amount(limits[0], 'g')} to {quantity.amount(limits[1], 'g')}; choose a narrower one, or a "
            "lognormal one.",
            key=key,
        )
    surrounding = name in PARAMETERS and is_surrounding(case, name)
    return Input(name, distribution, quantity, source, surrounding, own, limits)


def _shipped(case: Case) -> Iterator[tuple[str, str, str]]:
    """Names, distributions and sources of what is uncertain in any case."""
    used = list(dict.fromkeys(layer.material for layer in case.layers))
    for name in used:
        kind = "fibre" if name == "fibre" else case.materials.card(name).kind
        if kind in ("fibre", "halpin-tsai", "orthotropic", "isotropic"):
            source = "an estimate: share of fibres and bond between them"
            yield f"materials.{toml_name(name)}.stiffness_factor", "lognormal(1.1)", source
        else:
            source = "hardness within 5 Shore A of what was ordered, a fifth of the shear modulus (Gent 1958)"
            yield f"materials.{toml_name(name)}.stiffness_factor", f"lognormal({HARDNESS:.4g})", source
    yield from _losses(case, used)
    wall = 1e3 * case.valve.thickness_at(0.0)
    tolerance = next((t for upto, t in CLOSURE if wall <= upto), CLOSURE_BEYOND * wall)
    spread = tolerance / wall / 1.96
    source = f"ISO 3302-1, class M3: +-{tolerance:.2g} mm across the closure of the mould on {wall:.3g} mm"
    yield "thickness", _normal("thickness", 1.0, spread, f"lognormal({1 + spread:.3g})"), source
    angle, most = design_value(case, "angle"), PARAMETERS["angle"].high
    if angle is not None and angle <= most:
        ends = max(angle - 3.46, 0.0), min(angle + 3.46, most)  # of the same standard deviation before they are cut
        yield (
            "angle",
            _normal("angle", angle, 2.0, "uniform({:g}, {:g})".format(*ends)),
            "an estimate: plies laid by hand",
        )
    if case.has_line and not case.upstream.pieces and case.upstream.length:
        yield "pipe_length", "normal(2 %)", "an estimate: drawings against the pipe as laid"
    if case.has_waves and not case.upstream.pieces:
        yield "wave_speed", "lognormal(1.1)", "an estimate: air in the water and stiffness of the pipe"


def _normal(name: str, mean: float, spread: float, other: str) -> str:
    """Text of a normal distribution of a parameter, or another one where too much of it lies where that cannot be."""
    row, text = PARAMETERS[name], f"normal({mean:g}, {spread:.3g})"
    return other if Distribution.parse(text, row.quantity).share_outside(row.low, row.high) > ALLOWED else text


def _losses(case: Case, used: Sequence[str]) -> Iterator[tuple[str, str, str]]:
    if not case.damping.relaxes:
        for name in ("alpha", "beta"):
            if getattr(case.damping, name):
                yield name, "lognormal(1.3)", "an estimate: damping that no test of the valve has settled"
        return
    for name in used:
        data = case.materials.loss(name)
        if data is None or data.loss_factor is None:
            continue
        key = f"materials.{toml_name(name)}.loss_factor"
        if data.loss_factor in shipped_loss_names():
            low, high = shipped_loss(data.loss_factor).range
            yield key, f"uniform({low:g}, {high:g})", "the range of published compounds"
        elif data.loss_factor:
            yield key, "lognormal(1.1)", "a measured loss factor; an estimate"
