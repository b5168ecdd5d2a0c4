"""Answers at any parameter point in the time of a slider: steady state, leading eigenvalues and verdict, predicted by
the reduced operator of the state with its bound, and confirmed by the full one.

A reduced operator belongs to one steady state and holds for all of fluid, damping and pipe there. It is made where it
is first asked, and enriched where its error is too large: at the points asked for, and between answers at the corners
of the ranges.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np

from eigen.family import ReducedFamily
from eigen.reduction import OPTIONS, FamilyReduction
from eigen.spectrum import number_right_of

from .case.parameters import PARAMETERS, Mu
from .case.quantity import number_or_text
from .errors import CaseError, SolveError, is_accepted
from .model.build import build_flow
from .model.equilibria import redescribe
from .model.state import SteadyState
from .model.symmetry import asks_for_equilibria, chosen_symmetries, symmetry_named
from .studies.modes.search import critical_damping_factor
from .studies.session import Session
from .studies.stability.place import check_scan, is_surrounding, require_parameter
from .studies.stability.samples import Sample
from .studies.stability.verdict import UNDECIDED, Verdict
from .studies.stability.walk import StabilityWalk

#: Leading modes that a reduced operator takes where it is made; where it is enriched it takes those whose error it is
#: held to, as with four everywhere a space is half as large again and answers in twice the time.
TAKEN = 4
#: Share of its value in the case, and multiple of it, that a parameter is offered from and to.
OFFERED = {"pressure": (0.1, 2.5), "density": (0.5, 1.5), "pipe_length": (0.2, 5.0)}
#: The same of the damping.
DAMPED = (0.25, 3.0)
#: Steady states over the range of heads that are found between answers, so that none is far from one known.
HEADS = 6


@dataclass(frozen=True)
class Answer:
    """Answer at a parameter point."""

    place: Mu
    state: SteadyState
    verdict: Verdict
    eigenvalues: np.ndarray = field(default_factory=lambda: np.zeros(0, complex))  #: (k,), 1/s; by falling growth rate.
    #: Estimated relative error of the leading eigenvalues; 0 of the full operator, NaN where it was not estimated.
    bound: float = np.nan
    confirmed: bool = False  #: True of the full operator with its independent count.
    #: Of a confirmed answer those of the classes of motion it joins, by their names.
    classes: Mapping[str, Verdict] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()  #: Of a confirmed answer what is to be said of the rubber in its steady state.

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        names = ("pressure", "head", "mass_flow", "volume_flow", "outlet_area", "outlet_velocity", "lip_opening")
        return {
            "values": dict(self.place),
            "state": {name: float(getattr(self.state, name)) for name in names},
            "verdict": self.verdict.summary(),
            "eigenvalues": [[float(value.real), float(value.imag)] for value in self.eigenvalues],
            "bound": float(self.bound) if np.isfinite(self.bound) else None,
            "confirmed": self.confirmed,
            "warnings": list(self.warnings),
        }


class Explorer:
    """A valve asked at one parameter point after another. Raises CaseError, SolveError for a case without flow, or with
    a pump, whose pressure is no choice.

    Attributes
    ----------
    base : Mu
        Parameter point of the case.
    ranges : dict of (float, float), SI
        Parameters that can be moved, with the range that is offered.
    interrupted : callable
        Asked between the steps of `bounded`; where it says True the prediction is given without its bound.

    Examples
    --------
    >>> explorer = dbvfiv.load().explore()                                       # doctest: +SKIP
    >>> explorer.predict(density=900).verdict.outcome                            # doctest: +SKIP
    >>> explorer.confirm(density=900).verdict.sentence()                         # doctest: +SKIP
    """

    def __init__(self, session: Session):
        check_scan(session.case)
        if session.case.seeks_operating_point:
            raise CaseError("The head follows from the pump here, so it cannot be chosen; leave out upstream.pump.")
        self.model, self._session = session.model, session
        self.case = self.model.case
        self.walk = StabilityWalk(self.case, model=self.model)
        self.base = Mu.of(self.case)
        self.ranges = dict(self._offered())
        self.interrupted: Callable[[], bool] = lambda: False
        self._space: tuple[FamilyReduction, ReducedFamily, list[Mu]] | None = None
        self._heads = self._spread()

    def _offered(self) -> Iterator[tuple[str, tuple[float, float]]]:
        for name in ("pressure", "density", self.base.damping, "pipe_length"):
            own, (low, high) = self.base.get(name, 0.0), OFFERED.get(name, DAMPED)
            if own > 0 and self._can_ask(name):
                above = self.case.least_drive if name == "pressure" else 0.0
                highest = min(above + high * (own - above), PARAMETERS[name].high)
                if name == "loss_factor":
                    highest = self.model.relaxation.highest(own, highest)
                while name == "pressure" and not self._bears(highest):
                    highest = 0.5 * (highest + own)  # which it bears
                yield name, (above + low * (own - above), highest)

    def _bears(self, pressure: float) -> bool:
        return is_accepted(lambda: self._session.require_borne(self.model, pressure=pressure))

    def _can_ask(self, name: str) -> bool:
        return is_accepted(lambda: require_parameter(self.case, name))

    def moves(self, name: str) -> bool:
        """True where a parameter changes the steady state."""
        return not is_surrounding(self.case, name)

    def place(self, values: Mapping[str, float | str]) -> Mu:
        """Parameter point with some values changed, SI or texts with a unit; heads are those of the fluid of the case.
        Raises CaseError for a name or a value that cannot be asked.
        """
        found = {}
        for name, given in values.items():
            if name not in self.ranges:
                raise CaseError(f"{name!r} is given, which cannot be moved here; known are {', '.join(self.ranges)}.")
            row = PARAMETERS[name]
            try:
                found[name] = value = row.quantity.parse(number_or_text(given), self.case.fluid.density)
            except ValueError as error:
                raise CaseError(f"{name} is given as {given!r}, {error}.") from None
            if not (row.low < value <= row.high or (value == row.low and row.low_included)):
                least = f"from {row.low:g}" if row.low_included else f"above {row.low:g}"
                raise CaseError(f"{name} is given as {given!r}; it must lie {least} up to {row.high:g}.")
        if "pressure" in found:
            self._session.require_borne(self.model, pressure=found["pressure"])
        return self.base.at(**found)

    def state(self, place: Mu) -> SteadyState:
        """Steady state of a point, its flow in the fluid of the point. Raises SolveError."""
        found = self.walk.state(place)
        if place.density == self.base.density or self.moves("density"):
            return found
        seen = copy.copy(self.model)
        seen.case = self.case.replace({PARAMETERS["density"].key: place.density})
        seen.flow = build_flow(seen.case, seen.mesh)
        return redescribe(seen, found)

    def predict(self, **values: float | str) -> Answer:
        """Answer of the reduced operator, without its bound. Where the constants of a rubber are unstable the verdict
        says so. Raises CaseError, SolveError.
        """
        return self._asked(values, lambda place: np.nan)

    def _asked(self, values: Mapping[str, float | str], bound: Callable[[Mu], float]) -> Answer:
        place = self.place(values)
        state, refusal = self.state(place), self.walk.refusal(place)
        if refusal:
            return Answer(place, state, Verdict.not_valid(refusal))
        self._reduce(place)
        return self._predicted(place, state, bound(place))

    def _reduce(self, place: Mu) -> None:
        """Make the reduced operator of the state of a point, unless it is at hand."""
        family = self.walk.family(place)
        if self._space is None or self._space[0].family is not family:
            reduction = self.walk.built(place).solver.reduction(family)
            self._space = reduction, reduction.fine(reduction.first([place]), [place], TAKEN), self._corners(place)

    def bounded(self, **values: float | str) -> Answer:
        """Prediction with its bound, on a reduced operator that is enriched where this is too large. Raises CaseError,
        SolveError.
        """
        return self._asked(values, self._enriched)

    def prepare(self) -> bool:
        """Enrich the reduced operator at one more corner of the ranges, or find one more steady state; False where
        nothing is left to do.
        """
        if self._space is None:
            return False
        corners = self._space[2]
        if corners:
            place = corners[-1]
            if not self.walk.refusal(place):
                self._enriched(place)
            if not self.interrupted():
                corners.pop()
        elif self._heads:
            with suppress(SolveError):  # a head that is not reached is told where it is asked
                self.state(self.base.at(pressure=self._heads.pop()))
        return bool(corners or self._heads)

    def _spread(self) -> list[float]:
        """Heads over the range, Pa, dense at its ends; the lowest is taken first."""
        if "pressure" not in self.ranges:
            return []
        low, high = self.ranges["pressure"]
        if not 0.0 < low < high:  # where nothing flows
            return []
        share = 0.5 + 0.5 * np.cos(np.pi * np.arange(HEADS) / (HEADS - 1))
        return [float(value) for value in low * (high / low) ** share]

    def confirm(self, **values: float | str) -> Answer:
        """Answer of the full operator with its independent count, as `dbvfiv modes` gives it: on the motions that are
        predicted, and those of all classes that modes.symmetry asks for. Raises CaseError, SolveError.
        """
        place = self.place(values)
        state, refusal = self.state(place), self.walk.refusal(place)
        if refusal:
            return Answer(place, state, Verdict.not_valid(refusal), confirmed=True)
        motions = dict.fromkeys((self.walk.symmetry, *chosen_symmetries(self.case.modes.symmetry, self.case.part)))
        found = {motion.name: self._confirmed(self.walk.in_class(motion), place) for motion in motions}
        eigenvalues = np.concatenate([sample.eigenvalues for sample in found.values()])
        eigenvalues = eigenvalues[np.argsort(-eigenvalues.real, kind="stable")]
        verdicts = {name: sample.verdict for name, sample in found.items()}
        said = tuple(self.walk.about_rubbers(place))
        return Answer(place, state, Verdict.joined(verdicts), eigenvalues, 0.0, True, verdicts, said)

    def _confirmed(self, walk: StabilityWalk, place: Mu) -> Sample:
        """Sample of the motions of a class, by the full operator."""
        spectrum = walk.spectrum(place, self.case.modes.count)
        found = walk.sample(place, walk.cell(place, spectrum))
        # the count may have pointed to unstable modes beyond the band of the list
        return max(replace(found, eigenvalues=spectrum.eigenvalues), found, key=lambda sample: sample.pairs)

    def with_margin(self, answer: Answer) -> Answer:
        """A confirmed answer with the factor on the damping at which flutter begins or ends."""
        verdicts = {}
        for name, verdict in answer.classes.items():
            walk = self.walk.in_class(symmetry_named(name))
            factor, sought = critical_damping_factor(walk, answer.place, verdict)
            verdicts[name] = replace(verdict, critical_damping_factor=factor, damping_sought=sought)
        return replace(answer, verdict=Verdict.joined(verdicts), classes=verdicts) if verdicts else answer

    def _corners(self, place: Mu) -> list[Mu]:
        """Corners of the ranges that share the steady state of a point."""
        free = [name for name in self.ranges if not self.moves(name)]
        return [place.at(**dict(zip(free, ends))) for ends in product(*(self.ranges[name] for name in free))]

    def _enriched(self, place: Mu) -> float:
        """Bound at a point, once the reduced operator was enriched there as far as it takes; NaN where that was
        interrupted.
        """
        reduction, space, corners = self._space
        for enriched in (False, True):
            if self.interrupted():
                return np.nan
            if enriched:
                space = reduction.deeper(space, [place], OPTIONS.held)
                self._space = reduction, space, corners
            bound = np.nan if self.interrupted() else reduction.bound(space, place)
            if not bound > OPTIONS.tolerance:
                break
        return bound

    def _predicted(self, place: Mu, state: SteadyState, bound: float) -> Answer:
        _, space, _ = self._space
        values = np.asarray(space.leading(place))[: self.case.modes.count]
        unstable = number_right_of(values)
        alone = "" if asks_for_equilibria(self.case.modes.symmetry) else f" of class {self.walk.symmetry.name}"
        said = f"{unstable} unstable eigenvalues{alone} of the reduced operator; the full one has not confirmed them."
        found = replace(Verdict.of(values, unstable, unstable, True, proven=False, statement=said), certain=False)
        if values.size and abs(values[0].real) <= bound * abs(values[0]):
            found = replace(found, outcome=UNDECIDED, reason=f"The leading mode is neutral within {bound:.1g}. {said}")
        return Answer(place, state, found, values, bound)
