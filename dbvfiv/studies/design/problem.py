"""A design as a problem of optimisation: what a valve does at the heads asked, and its exact derivatives.

The margin at a head is the least damping ratio zeta of its modes as the smooth aggregate

    -ln( sum_i exp(-rho zeta_i) ) / rho

(Kreisselmeier and Steinhauser, IFAC Proc. 12(7), 1979, 113): all modes in reach count, so it stays smooth where they
change places, and it is never above the least one, by at most ln(modes) / rho below it. Where damping does not order
the modes, as loss factors do not, those up to one frequency count in all designs, on every mesh: `modes.max_frequency`,
or the end of the band of the first valve whose modes are asked.

Where the case has uncertain inputs x with standard deviations s, whose medians lie a off the numbers of the case, 95 %
of valves have at least the margin less

    1.645 |L' (s g)| - a g,    g = d margin / dx,    L L' their correlation,

to first order. A variable that is an input lies as far off in all designs, and the pressure is that asked. Changes of
this with the design are left out of gradients: the search takes it as it was at the last optimum and repeats itself
(sequential optimisation and reliability assessment, Du and Chen, J. Mech. Des. 126, 2004, 225).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from eigen.search import leading_modes
from eigen.spectrum import Spectrum

from ...case.parameters import DESIGN, PARAMETERS, Mu
from ...case.quantity import Quantity
from ...case.statement import BEHIND, OF_THE_WALL, SEALS, Statement, parse_span, parse_statement
from ...errors import CaseError, SolveError
from ...model.closed import ClosedValve, close_valve
from ...model.leading import BandOrigin
from ...model.sizes import ValveSizes
from ...observer import Observer
from ..case import Case
from ..inputs import Input, correlation_of, inputs_of
from ..stability.derivatives import Neighbourhood, spans_about
from ..stability.place import design_value, key_of, redesigned, require_parameter
from ..stability.verdict import oscillates
from ..stability.walk import StabilityWalk, name_state_in_failures

#: rho: four modes of equal damping take 0.14 % of critical off the margin.
SHARPNESS = 1000.0
#: Damping ratio above the least one from which on a mode has no weight: exp(-14) is 1e-6.
REACH = 14.0 / SHARPNESS
#: Step of differences of a valve under back pressure, over the range of a variable.
STEP = 1e-4
#: Step of differences of a reserve, over the range of a variable: what it is made of are derivatives by differences.
BESIDE = 1e-3
#: Standard deviations from the mean that 95 % of a normal distribution stay below.
QUANTILE = 1.645
#: Names of what `Neighbourhood` gives for a quantity.
_PERFORMANCE = {"flow": "flow", "opening": "opening", "loss coefficient": "loss_coefficient", "mass": "mass"}


@dataclass(frozen=True)
class Variable:
    """A number that may change."""

    name: str  #: Of a parameter of the table, or a key of the case.
    #: low, high and start: SI; angles in degrees.
    low: float
    high: float
    start: float
    unit: str


def variables_of(case: Case) -> tuple[Variable, ...]:
    """Variables of a case. Raises CaseError for a name that is no number of the case, or bounds that cannot be read or
    do not hold its value.
    """
    found = []
    for name, text in case.design.variables.items():
        key = f"design.variables.{name}"
        if name in ("pressure", "drive.pressure", "storage", "strain", "materials.strain_level"):
            raise CaseError(f"{key} is given, and {name} is no number that a designer chooses.", key=key)
        quantity, own = _value(case, name, key)
        try:
            low, high = parse_span(text, quantity, case.fluid.density)
        except ValueError as error:
            raise CaseError(f"{key} is given as {text!r}, {error}; it must be LOW:HIGH.", key=key) from None
        if name == "angle" and low <= 0:
            raise CaseError(
                f"{key} is given as {text!r}, and plies at 0 degrees have no angle to go on from; give a lower bound "
                "above 0, such as 1 deg.",
                key=key,
            )
        if not low <= own <= high:
            raise CaseError(
                f"{key} is given as {text!r}, and the case has {own:g} {quantity.si}".rstrip()
                + ", which is not between them: a search begins at the case.",
                key=key,
            )
        found.append(Variable(name, low, high, own, quantity.si))
    for one in found:
        for other in found:
            if other is not one and _changes_with(case, other, one):
                key = f"design.variables.{other.name}"
                raise CaseError(f"{key} is given beside {one.name}, with which it changes; name one of them.", key=key)
    return tuple(found)


def _value(case: Case, name: str, key: str) -> tuple[Quantity, float]:
    if name not in PARAMETERS:
        return key_of(case, name, key)
    require_parameter(case, name)
    own = design_value(case, name) if name in DESIGN else getattr(Mu.of(case), name)
    if own is None:
        raise CaseError(f"{key} is given, and the valve has no one value of {name}; name keys of layers.", key)
    return PARAMETERS[name].quantity, own


def _changes_with(case: Case, one: Variable, other: Variable) -> bool:
    """True where a number is not the same once another one changes."""
    end = other.high if other.high > other.start else other.low
    try:
        changed = redesigned(case, {other.name: 0.5 * (other.start + end)})
    except CaseError:
        return False
    return _value(changed, one.name, one.name)[1] != one.start


def statements_of(case: Case) -> tuple[Statement, ...]:
    """Aim and constraints of a case, the aim first. Raises CaseError if variables or aim are missing, or nothing has a
    head.
    """
    if not case.design.variables:
        raise CaseError(
            'Nothing may change: give design.variables, such as { thickness = "0.7:1.4" }.', "design.variables"
        )
    if not case.design.aim:
        raise CaseError("Nothing is aimed at: give design.aim, such as 'loss coefficient at 2 m down'.", "design.aim")
    density = case.fluid.density
    found = [parse_statement(case.design.aim, True, density)]
    found += [parse_statement(text, False, density) for text in case.design.constraints]
    shut = (case.closure.shut_fraction,)
    found = [replace(one, bounds=shut) if one.text.startswith(SEALS) else one for one in found]
    if all(one.quantity in OF_THE_WALL for one in found):
        raise CaseError("Aim and constraints name no head, at which the valve must open.", key="design.aim")
    return tuple(found)


@dataclass(frozen=True)
class AtHead:
    """Performance of a valve at a pressure: values by quantity, and their derivatives (n,) by the variables; how much
    of the margin 5 % of valves with uncertain inputs lack, below 0 where their medians add more.
    """

    values: dict[str, float]
    slopes: dict[str, np.ndarray]
    reserve: float = 0.0


class DesignProblem:
    """Valves of a case between the bounds of its variables.

    Parameters
    ----------
    known : mapping, optional
        Found earlier, by values of the variables, pressure and whether modes were asked: what the valve does, or the
        sentence why it does not.
    keep : callable, optional
        Called with the key, what is found under it, as soon as it is, and `band`.
    band : float, optional
        Frequency, Hz, up to which modes count in margins; without it that of the first state that has one.
    """

    def __init__(
        self,
        case: Case,
        known: Mapping[tuple, AtHead | str] = {},
        keep: Callable = lambda key, found, band: None,
        band: float | None = None,
    ):
        self.case, self.variables = case, variables_of(case)
        self.known: dict[tuple, AtHead | str] = dict(known)
        self.inputs: list[Input] = inputs_of(case) if case.uncertainty.inputs else []
        self._keep = keep
        self.band = case.modes.max_frequency if band is None else band

    def values_at(self, share: np.ndarray) -> tuple[float, ...]:
        """Values of the variables from their shares (n,) of the way between the bounds."""
        return tuple(float(one.low + (one.high - one.low) * x) for one, x in zip(self.variables, share))

    @property
    def start(self) -> np.ndarray:
        """Shares (n,) of the case itself."""
        return self.shares_of([one.start for one in self.variables])

    def shares_of(self, values: Sequence[float]) -> np.ndarray:
        """Shares (n,) of values of the variables."""
        return np.array([(value - one.low) / (one.high - one.low) for one, value in zip(self.variables, values)])

    def case_at(self, values: Sequence[float]) -> Case:
        """Case with other values of the variables. Raises CaseError for values that do not go together."""
        case = self.case
        for one, value in zip(self.variables, values):
            if value != one.start:
                case = redesigned(case, {one.name: value})
        return case

    def walk(self, case: Case) -> StabilityWalk:
        """Walk of a case whose modes are listed up to the frequency of the study, where there is one yet."""
        return StabilityWalk(case.replace({"modes.max_frequency": self.band}) if self.band else case, Observer())

    def at(self, values: tuple[float, ...], pressure: float, margin: bool) -> AtHead:
        """Performance of the valve with these values at a pressure. Raises SolveError if it does nothing that can be
        told: no steady state, or one that diverges.
        """
        key = (values, pressure, margin)
        if key not in self.known:
            try:
                found: AtHead | str = self._solved(values, pressure, margin)
            except (SolveError, CaseError, ValueError) as error:
                found = str(error)
            self._keep(key, found, self.band)
            self.known[key] = found
        found = self.known[key]
        if isinstance(found, str):
            raise SolveError(found)
        return found

    def without_reserve(self, values: tuple[float, ...], pressure: float) -> AtHead:
        """Performance with the margin that 95 % of valves with uncertain inputs have; its derivatives with those of the
        reserve, differences to the inside of the bounds. Raises SolveError.
        """
        here, slopes = self.at(values, pressure, True), []
        for i, one in enumerate(self.variables):
            step = BESIDE * (one.high - one.low)
            step = step if values[i] + step <= one.high else -step
            beside = self.at((*values[:i], values[i] + step, *values[i + 1 :]), pressure, True)
            slopes.append((beside.reserve - here.reserve) / step)
        margin = {"margin": here.values["margin"] - here.reserve}
        return AtHead(here.values | margin, here.slopes | {"margin": here.slopes["margin"] - np.array(slopes)})

    def opening(self, values: tuple[float, ...], pressure: float) -> float | None:
        """Opening, m2, that was found with these values at a pressure; None where none was."""
        for margin in (True, False):
            found = self.known.get((values, pressure, margin))
            if isinstance(found, AtHead):
                return found.values.get("opening")
        return None

    def _closed(self, values: tuple[float, ...], pressure: float) -> AtHead:
        """Gap left and mass under a back pressure; states beside lie along the tangent's solution."""
        model, q = close_valve(self.case_at(values), pressure)
        hood, slopes = Neighbourhood(model, q, pressure, Mu.of(model.case)), []
        names = (*BEHIND, *OF_THE_WALL)

        def measured(model: ClosedValve, q: np.ndarray) -> np.ndarray:
            return np.array([model.passage(q).left, ValveSizes.of(model).wall_mass])

        def slope(number: int, low: float, high: float) -> np.ndarray:
            """From a difference between two values of a variable."""
            own, apart = values[number], high - low
            ends = [ClosedValve(self.case_at((*values[:number], x, *values[number + 1 :]))) for x in (low, high)]
            moved = hood.tangent([(end, pressure) for end in ends], apart)
            places = [q if moved is None else q + (x - own) * moved for x in (low, high)]
            below, above = map(measured, ends, places)
            return (above - below) / apart

        for number, (one, own) in enumerate(zip(self.variables, values)):
            spans = spans_about(self.case, one.name, own, STEP * (one.high - one.low))
            near, *far = (slope(number, *span) for span in spans)
            slopes.append(2 * near - far[0] if far else near)
        return AtHead(dict(zip(names, map(float, measured(model, q)))), dict(zip(names, np.array(slopes).T)))

    def _solved(self, values: tuple[float, ...], pressure: float, margin: bool) -> AtHead:
        if pressure < 0:
            return self._closed(values, -pressure)
        walk = self.walk(self.case_at(values))
        place = Mu.of(walk.case).at(pressure=pressure)
        q, model = walk.equilibrium(place), walk.built(place).model  # from rest: it depends on no other state
        modes = self._modes(walk, place) if margin else ()
        linear = walk.family(place).linear if margin else None
        eigenvalues = np.array([mode.eigenvalue for mode in modes])
        margin_here, coefficients = smooth_margin(eigenvalues)
        beside = Neighbourhood(model, q, pressure, place, modes, self.case.sensitivity.step, linear, coefficients[None])
        found = {name: beside.performance[theirs] for name, theirs in _PERFORMANCE.items()}
        if not np.isfinite(found["loss coefficient"]):
            raise SolveError(f"Nothing flows at {pressure:.6g} Pa.")
        slopes, reserve = {name: [] for name in found}, 0.0
        if margin:
            found["margin"], slopes["margin"] = margin_here, []

        def of_margin(slope) -> float:
            return slope.derivative.real if modes else 0.0

        for one, value in zip(self.variables, values):
            slope = beside.slope(one.name)
            turn = slope.value / value if value else 1.0  # of a factor that the changed case has taken over
            for name, theirs in _PERFORMANCE.items():
                slopes[name].append(turn * slope.performance[theirs])
            if margin:
                slopes["margin"].append(turn * of_margin(slope))
        if margin and self.inputs:
            by = np.array([of_margin(beside.slope(one.name)) for one in self.inputs])
            steps = by * [one.distribution.spread for one in self.inputs]
            reserve = QUANTILE * float(np.linalg.norm(correlation_of(self.case, self.inputs).T @ steps))
            apart = [0.0 if one.name == "pressure" else one.distribution.median - one.own for one in self.inputs]
            reserve -= float(by @ apart)
        told = {name: np.array(slope) for name, slope in slopes.items()}
        return AtHead(found, told, reserve)

    def _modes(self, walk: StabilityWalk, place: Mu):
        """Modes that the margin depends on, with left vectors. Raises NotValidError if the constants of a rubber with
        loss factors are unstable at this state. Raises SolveError if a motion grows without oscillating.
        """
        walk.require_valid(place)
        search = walk.search(place)
        if search.origin is not BandOrigin.NONE:
            self.band = self.band or search.band
        found = margin_spectrum(walk, place, left=True)
        growing = [value for value in found.eigenvalues if abs(value.imag) <= 1e-9 * abs(value) and value.real > 0]
        if growing:
            raise SolveError(f"The state at {place.pressure:.6g} Pa diverges, by {growing[0].real:.4g} 1/s.")
        ratios = found.damping_ratio
        near = ratios <= np.nanmin(ratios, initial=np.inf) + REACH
        return [found.mode(i) for i in np.flatnonzero(near & (ratios < 1.0))]


def margin_spectrum(walk: StabilityWalk, place: Mu, left: bool = False) -> Spectrum:
    """Leading modes, as many as it takes that those left out in the band have no weight in the margin. Raises
    SolveError if they were not found.
    """
    family, search, count = walk.family(place), walk.search(place), walk.case.modes.count
    while True:
        with name_state_in_failures(place.pressure):
            found = leading_modes(family.at(place), count, replace(search.options, left=left))
        if len(found) < count or np.isinf(search.band):
            return found
        # whatever is left out decays faster than the last one, and swings no faster than the band's end
        last, ratios = found.growth_rate[-1], found.damping_ratio
        if -last / np.hypot(last, 2 * np.pi * search.band) >= ratios.min() + REACH:
            return found
        count *= 2


def least_ratio(spectrum: Spectrum) -> float:
    """Least damping ratio of the modes that oscillate; NaN of none."""
    ratios = spectrum.damping_ratio[oscillates(spectrum.eigenvalues)]
    return float(ratios.min()) if len(ratios) else np.nan


def smooth_margin(eigenvalues: np.ndarray) -> tuple[float, np.ndarray]:
    """Smooth least damping ratio, 1 where nothing oscillates, and complex coefficients: the sum of their products with
    the derivatives of the eigenvalues has its derivative for its real part.
    """
    if not len(eigenvalues):
        return 1.0, np.zeros(0)
    least, shares = _smooth_least(-eigenvalues.real / np.abs(eigenvalues))
    of_ratios = -1j * eigenvalues.imag * eigenvalues.conj() / np.abs(eigenvalues) ** 3
    return least, shares / shares.sum() * of_ratios


def _smooth_least(values: np.ndarray) -> tuple[float, np.ndarray]:
    """Smooth least of values (k,), and shares (k,) that its derivatives by them go by."""
    shares = np.exp(-SHARPNESS * (values - values.min()))
    return float(values.min() - np.log(shares.sum()) / SHARPNESS), shares


def together(statement: Statement, found: Sequence[AtHead], reserves: Sequence[float] = ()) -> tuple[float, np.ndarray]:
    """Value of an aim over several heads and its derivatives (n,): their mean, of margins the smooth least one, each
    without its reserve.
    """
    values = np.array([one.values[statement.quantity] for one in found])
    if statement.quantity == "margin" and reserves:
        values = values - np.array(reserves)
    slopes = np.array([one.slopes[statement.quantity] for one in found])
    if statement.quantity != "margin" or len(values) == 1:
        return float(values.mean()), slopes.mean(axis=0)
    value, shares = _smooth_least(values)
    return value, shares @ slopes / shares.sum()
