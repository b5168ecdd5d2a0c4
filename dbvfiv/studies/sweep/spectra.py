"""Spectra along one parameter, from the steady states and columns that every study of stability shares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from eigen import Column, CoupledPencil, SearchOptions, Spectrum, Workspace, leading_modes
from eigen.pairs import with_left_vectors

from ...case.parameters import Mu
from ...errors import NotValidError
from ...model.state import SteadyState
from ..stability.place import condition_of
from ..stability.verdict import Verdict
from ..stability.walk import StabilityWalk

#: Values at which the vectors of a reduced-order model are made.
SNAPSHOTS = 6
#: Fewest values of one steady state that a reduced-order model is made for.
FEW = 3


@dataclass(frozen=True)
class Check:
    """Verification of eigenvalues and their count at one value of the parameter.

    Attributes
    ----------
    value : float
    error : float
        Largest relative correction of the leading eigenvalues by the full matrices; largest residual where the value is
        solved in full.
    unstable_count, unstable_count_independent : int
        Both eigenvalues of a pair count.
    agrees : bool
        The counts are equal and the independent one is certain.
    accurate : bool
        The error is within the tolerance.
    """

    value: float
    error: float
    unstable_count: int
    unstable_count_independent: int
    agrees: bool
    accurate: bool

    @property
    def holds(self) -> bool:
        return self.agrees and self.accurate


class SpectraAlong:
    """Spectra along one parameter.

    Where the steady state stays, they come from one reduced-order model of it, as long as its error, estimated with the
    full matrices, is within the tolerance; everywhere else each value has its own steady state and its own full solve.

    Parameters
    ----------
    walk : StabilityWalk
    start : Mu
        Parameter point with all that is not varied.
    parameter : str
    options : SweepOptions
    """

    def __init__(self, walk: StabilityWalk, start: Mu, parameter: str, options):
        self.walk, self.start, self.parameter, self.options = walk, start, parameter, options
        self.moves = walk.is_moved_by(parameter)
        self._column: Column | None = None
        self._cells: dict[float, int] = {}
        #: Relative errors of the reduced-order model at the values where it was checked.
        self.errors: dict[float, float] = {}
        self._reduced: dict[CoupledPencil, Mu] = {}
        self._full: dict[CoupledPencil, Mu] = {}
        self._single: dict[float, Column] = {}
        self._workspace = Workspace()

    def place(self, value: float) -> Mu:
        """Parameter point at a value."""
        return self.start.at(**{self.parameter: float(value)})

    def refusal(self, value: float) -> str:
        """Reason why the constants of the rubber do not hold at a value; empty where they do.

        Raises
        ------
        SolveError
            If there is no steady state.
        """
        place = self.place(value)
        try:
            self.walk.equilibrium(place)
            self.walk.require_valid(place)
        except NotValidError as error:
            return str(error)
        return ""

    def prepare(self, values: Sequence[float]) -> None:
        """Make the reduced-order model, where there is one steady state for all values."""
        if self.moves or len(values) < FEW:
            return
        places = [self.place(value) for value in values]
        wanted = self.options.count + self.options.margin
        self._column = self.walk.column(places, min(len(places), SNAPSHOTS), count=wanted)
        self._cells = {float(value): i for i, value in enumerate(values)}
        if self._column.pencil is not None:
            self.errors = {value: self._error(value) for value in self.checked(values)}

    def checked(self, values: Sequence[float]) -> list[float]:
        """Values at which a sweep is checked: both ends and between."""
        places = np.linspace(0, len(values) - 1, min(self.options.checks, len(values)))
        return [float(values[i]) for i in np.unique(places.astype(int))]

    def _error(self, value: float) -> float:
        """Largest relative correction, by the full matrices, of the leading eigenvalues of the reduced-order model."""
        condition = condition_of(self.place(value))
        leading = self._column.eigenvalues(condition)[: self.options.count]
        return max((abs(self._column.corrected(condition, x)) / max(abs(x), 1.0) for x in leading), default=0.0)

    @property
    def is_reduced(self) -> bool:
        """True where spectra come from a reduced-order model that is accurate enough."""
        return bool(self.errors) and max(self.errors.values()) <= self.options.tolerance

    def pencil(self, value: float) -> CoupledPencil:
        """Pencil at a value, of the reduced-order model or in full."""
        place = self.place(value)
        if self.is_reduced:
            pencil = self._column.pencil(condition_of(place))
            self._reduced[pencil] = place
        else:
            pencil = self.walk.family(place).pencil(condition_of(place))
            self._full[pencil] = place
        return pencil

    def solve(self, pencil: CoupledPencil, count: int) -> Spectrum:
        """Leading modes of a pencil that `pencil` gave, with left vectors."""
        if pencil in self._full:
            options = replace(self._search(self._full[pencil]), left=True)
            return leading_modes(pencil, count, options, workspace=self._workspace)
        options = self._search(self._reduced[pencil])
        # the linear form of a viscoelastic wall is several times as large
        krylov = pencil.relaxation is not None and count < pencil.n
        asked = SearchOptions(options.max_frequency, tolerance=options.tolerance, method="auto" if krylov else "dense")
        if krylov:
            return with_left_vectors(pencil, leading_modes(pencil, count, asked))
        return leading_modes(pencil, count, replace(asked, left=True))

    def _search(self, place: Mu) -> SearchOptions:
        return replace(self.walk.search(place).options, tolerance=self.options.search.tolerance)

    def notes(self, values: Sequence[float]) -> tuple[str, ...]:
        """Sentences on the region searched, of the widest one."""
        searches = [self.walk.search(self.place(value)) for value in (values if self.moves else values[:1])]
        return max(searches, key=lambda search: search.band).notes

    def _cell(self, value: float, spectrum: Spectrum) -> tuple[Column, int]:
        """Column with the counts of a value, and its cell."""
        if self._column is not None and value in self._cells:
            return self._column, self._cells[value]
        if value not in self._single:
            self._single[value] = self.walk.column([self.place(value)], spectra=[spectrum])
        return self._single[value], 0

    def check(self, value: float, spectrum: Spectrum) -> Check:
        """Error of the leading eigenvalues at a value, and both counts of unstable ones."""
        column, cell = self._cell(value, spectrum)
        own = column.certificate(cell)
        if self.is_reduced:
            error, allowed = self.errors[value], self.options.tolerance
        else:
            error, allowed = float(spectrum.residual.max(initial=0.0)), self.options.search.tolerance
        return Check(value, error, own.unstable, own.counted, own.agrees, error <= allowed)

    def verdict(self, value: float, spectrum: Spectrum) -> Verdict:
        """Verdict on a value."""
        return self.walk.verdict_of(self.place(value), *self._cell(value, spectrum))

    def states(self, values: Sequence[float]) -> tuple[SteadyState, ...]:
        """Steady state of each value; a single one where it stays."""
        return tuple(self.walk.state(self.place(value)) for value in (values if self.moves else values[:1]))
