"""Parameter lines at one steady state: leading eigenvalues and counts at many conditions."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from .certificate import Certificate, certified_spectrum
from .count import Count
from .factor import SingularShiftError, Workspace
from .family import PencilFamily, ReducedFamily
from .operator import CoupledPencil
from .reduction import FamilyReduction, StaticSolver
from .search import leading_modes
from .spectrum import Spectrum

#: Estimated relative error of an eigenvalue above which a cell is treated directly.
TOLERANCE = 1e-6
#: How a cell was found.
REDUCED, DIRECT, MISSING = 0, 1, 2


@dataclass(frozen=True)
class Column:
    """Cells of one state.

    Attributes
    ----------
    growth_rate, frequency : (cells,) arrays, 1/s, Hz
        Of the leading mode; NaN if none was found.
    second : (cells,) array, 1/s
        Growth rate of the next mode.
    unstable : (cells,) int array
        Eigenvalues right of `line` up to `band`, conjugates counted apart, by the spectrum.
    counted : (cells,) int array
        As many as `unstable`, by the argument principle; -1 where nobody asked.
    certain : (cells,) bool array
        That count followed the phase everywhere.
    error : float
        Largest estimated relative error of leading eigenvalues among the checked cells.
    how : (cells,) int array
        `REDUCED` or `DIRECT`.
    line, band : (cells,) arrays, 1/s, Hz
        Region counted.
    eigenvalues : callable or None
        From any parameter point at the same state to its leading eigenvalues on the reduced model, sorted by growth
        rate.
    nearest : callable or None
        From a parameter point and a place to the eigenvalue of the reduced model next to it.
    corrected : callable or None
        From a parameter point and an eigenvalue of the reduced model to Newton's correction of it by the full matrices.
    cell : callable or None
        From any further parameter point at the same state to a column of this one cell.
    at : callable or None
        From any parameter point at the same state to its operator on the reduced model.
    leading : list of arrays
        Leading eigenvalues of the cells.
    tolerance : float
        Error up to which cells that were found on a reduced model are accurate enough.
    """

    growth_rate: np.ndarray
    frequency: np.ndarray
    second: np.ndarray
    unstable: np.ndarray
    counted: np.ndarray
    certain: np.ndarray
    error: float
    how: np.ndarray
    line: np.ndarray
    band: np.ndarray
    eigenvalues: Callable[[Hashable], np.ndarray] | None = None
    nearest: Callable[[Hashable, complex], complex] | None = None
    corrected: Callable[[Hashable, complex], complex] | None = None
    cell: Callable[[Hashable], Column] | None = None
    at: Callable[[Hashable], CoupledPencil] | None = None
    leading: list[np.ndarray] = field(default_factory=list)
    tolerance: float = TOLERANCE

    @classmethod
    def blank(cls, cells: int) -> Column:
        """Cells that nobody solved."""
        nothing = (np.full(cells, np.nan) for _ in range(3))
        none, unsure = np.full(cells, -1), np.zeros(cells, bool)
        region = np.zeros(cells), np.full(cells, np.inf)
        empty = [np.zeros(0, complex)] * cells
        return cls(*nothing, none, none.copy(), unsure, 0.0, np.full(cells, MISSING), *region, leading=empty)

    @classmethod
    def joined(cls, parts: Sequence[Column]) -> Column:
        """Cells of several columns as one, which has no small model."""
        own = [field.name for field in fields(cls) if isinstance(getattr(parts[0], field.name), np.ndarray)]
        cells = {name: np.concatenate([getattr(part, name) for part in parts]) for name in own}
        leading = [row for part in parts for row in part.leading]
        return cls(**cells, error=max(part.error for part in parts), leading=leading)

    def spread(self, cells: Sequence[int], number: int) -> Column:
        """Column of more cells: these at the given places, the others blank, neither listed nor counted."""
        out = Column.blank(number)
        for own in fields(self):
            values = getattr(self, own.name)
            if isinstance(values, np.ndarray):
                getattr(out, own.name)[list(cells)] = values
        for i, row in zip(cells, self.leading):
            out.leading[i] = row
        small = {name: getattr(self, name) for name in ("eigenvalues", "nearest", "corrected", "cell", "at")}
        return replace(out, error=self.error, **small)

    @property
    def certified(self) -> np.ndarray:
        """Cells for which both counts agree and the leading eigenvalue is accurate."""
        return np.array([self.certificate(i).agrees for i in range(len(self.unstable))], bool)

    def certificate(self, cell: int) -> Certificate:
        """Certificate of a cell."""
        accurate = self.how[cell] == DIRECT or self.error <= self.tolerance
        known = bool(np.isfinite(self.growth_rate[cell]))
        return Certificate(
            int(self.unstable[cell]),
            int(self.counted[cell]),
            bool(self.certain[cell] and accurate and known),
            float(self.line[cell]),
            float(self.band[cell]),
        )


#: Directions weaker than these are left out where two spaces are put together: at first, and where counts disagree.
JOINT, CLOSE = 3e-3, 1e-5
#: Leading eigenvalues kept of a cell.
KEPT = 8
#: Points at least at which they are taken where the relaxations differ.
LOSSES = 4
#: Leading vectors taken at each point: where damping orders the modes, and for a band.
MOST, MOST_IN_BAND = 4, 12
#: Leading modes that are found and corrected beside another operator.
BESIDE = 6
#: Share of a band up to which eigenvalues are counted, clear of those at its end.
INSIDE = 0.999


class ColumnSolver:
    """Solves families of one pattern after another."""

    def __init__(self):
        self._static, self._stiffened = StaticSolver(), StaticSolver()
        self._workspace, self._structures = Workspace(), Workspace()
        self._last: FamilyReduction | None = None
        self._counter: tuple[ReducedFamily, ReducedFamily, ReducedFamily] | None = None

    def reduction(self, family: PencilFamily) -> FamilyReduction:
        """Reduced models of a family; the last one is kept."""
        if self._last is None or self._last.family is not family:
            self._last = FamilyReduction(family, self._static, self._stiffened, self._structures)
        return self._last

    def solve(
        self, family: PencilFamily, points, snapshots: int = 3, edges: bool = False, spectra=None, count: int = 2
    ) -> Column:
        """All parameter points at one state.

        Parameters
        ----------
        family : PencilFamily
        points : sequence of hashable
        snapshots : int
            Points at which leading vectors are taken into the second space; fewer than three points are solved with
            the full operator.
        edges : bool
            Count only beside changes of the number of unstable eigenvalues along the list; no other cell gets a
            certificate.
        spectra : sequence of Spectrum, optional
            Of the full operators of fewer than three points, where they are known.
        count : int
            Leading modes of each point that the second space is made for.

        Raises
        ------
        SingularShiftError
            If the stiffness is singular, or a full operator has no usable shift.
        """
        points = list(points)
        if not family.forces.shape[1]:
            return self._uncoupled(family, points)
        reduction = self.reduction(family)
        if len(points) < 3:
            return self._directly(reduction, points, spectra)
        first, fine, error = _accurate(reduction, points, snapshots, count)
        return replace(
            self._on(first, fine, points, error, edges),
            eigenvalues=lambda mu: fine.leading(mu)[:KEPT],
            nearest=lambda mu, place: complex(fine.near(mu, [place]).values[0]),
            corrected=lambda mu, value: complex(reduction.correction(fine.near(mu, [value]), mu)[0]),
            cell=lambda mu: self._on(first, fine, [mu], error),
            at=fine.at,
        )

    def beside(self, reduction: FamilyReduction, mu: Hashable, error: float, safety: float) -> Column:
        """One parameter point of an operator next to another one, see `FamilyReduction.beside`.

        Parameters
        ----------
        error : float
            Relative error of eigenvalues that is known to come from elsewhere.
        safety : float
            The cell is accurate enough where all leading growth rates are farther from zero than so many errors.

        Returns
        -------
        Column
            Leading eigenvalues are corrected with the full matrices; what that changes counts as their error. Listed
            as unstable are those corrected, counted all of the reduced model. Without a certificate where growth rates
            are not clear of the error.
        """
        family, model = reduction.family, reduction.coarse
        values = model.eigenvalues(mu)
        places = family.reach(mu).leading(values)[:BESIDE]
        change = reduction.correction(model.near(mu, places), mu)
        leading = places + change
        doubt = np.maximum(np.abs(change), error * np.abs(leading)) / np.abs(leading.real)
        column = _column(family, [mu], [leading], [leading], float(doubt.max(initial=0.0)))
        column.counted[0] = _listed(values, 0.0, column.band[0])
        column.certain[0] = bool(np.isfinite(leading).all())
        return replace(column, tolerance=1.0 / safety)

    def _on(self, first: ReducedFamily, fine: ReducedFamily, points, error: float, edges: bool = False) -> Column:
        """Cells on a reduced model, counted on that of the first stage; those without a certificate directly."""
        family = first.family
        values = [fine.eigenvalues(mu) for mu in points]
        leading = [family.reach(mu).leading(row) for row, mu in zip(values, points)]
        column = _column(family, points, leading, values, error)
        counted = _beside_changes(leading) if edges else np.arange(len(points))

        def count(counter, cells, within_band=False):
            for i in cells:
                found = _counted(counter, points[i], leading[i], within_band)
                agrees = found.certain and found.number == _listed(values[i], found.line, found.band)
                if not within_band or (agrees and len(leading[i])):
                    _take(column, i, found, values[i])

        joint = error <= TOLERANCE and any(family.relaxation(points[i]) is not None for i in counted)
        count(self._joint(first, fine) if joint else first, counted)
        doubtful = counted[~column.certified[counted]]
        if len(doubtful) and joint and self._counter[1] is not fine:
            count(self._joint(first, fine, anew=True), doubtful)
            doubtful = doubtful[~column.certified[doubtful]]
        if len(doubtful) and joint:
            # a mode that is all but neutral has to be met to a fraction of its growth rate
            count(ReducedFamily(family, fine.V, CLOSE, base=first), doubtful, within_band=True)
            doubtful = doubtful[~column.certified[doubtful]]
        return self._repaired(column, family, points, doubtful)

    def _joint(self, first: ReducedFamily, fine: ReducedFamily, anew: bool = False) -> ReducedFamily:
        """Space of a count of a viscoelastic wall: static responses alone say little of that; with the vectors that a
        list rests on, of this column or of the one before at the same state, they are enough.
        """
        if anew or self._counter is None or self._counter[0] is not first:
            self._counter = first, fine, ReducedFamily(first.family, fine.V, JOINT, base=first)
        return self._counter[2]

    def direct(self, family: PencilFamily, mu: Hashable, count: int = 6) -> Spectrum:
        """Leading modes of the full operator.

        Raises
        ------
        SingularShiftError
            If no usable shift was found.
        """
        found = leading_modes(family.at(mu), count, family.search(mu), workspace=self._workspace)
        return _modes_of(family, mu, found)

    def _directly(self, reduction: FamilyReduction, points, spectra=None) -> Column:
        family, column = reduction.family, Column.blank(len(points))
        first = reduction.wide if any(_is_banded(family, mu) for mu in points) else reduction.coarse
        for i, mu in enumerate(points):
            spectrum = _modes_of(family, mu, spectra[i]) if spectra else self.direct(family, mu)
            _take(column, i, _counted(first, mu, spectrum.eigenvalues), np.zeros(0))
            _enter(column, i, spectrum)
        return self._recounted(column, family, points, np.flatnonzero(~column.certified))

    def _uncoupled(self, family: PencilFamily, points) -> Column:
        """A structure that nothing couples: its full spectra and counts, each once for every damping."""
        column, known = Column.blank(len(points)), {}
        for i, mu in enumerate(points):
            key = family.structure(mu)
            if key not in known:
                known[key] = certified_spectrum(family.at(mu), 6, family.search(mu), workspace=self._workspace)
            _enter(column, i, _modes_of(family, mu, known[key].spectrum))
            _vouch(column, i, known[key].certificate)
        return column

    def _repaired(self, column: Column, family, points, cells) -> Column:
        for i in cells:
            try:
                spectrum = self.direct(family, points[i])
            except (SingularShiftError, np.linalg.LinAlgError):
                continue  # stays without a certificate
            if len(spectrum):
                _enter(column, i, spectrum)
        return self._recounted(column, family, points, [i for i in cells if not column.certificate(i).agrees])

    def _recounted(self, column: Column, family, points, cells) -> Column:
        """Cells that still lack agreement, with a count of their own on a basis of structural modes, made finer as far
        as it takes.
        """
        for i in cells:
            try:
                found = certified_spectrum(family.at(points[i]), 6, family.search(points[i]), workspace=self._workspace)
            except (SingularShiftError, np.linalg.LinAlgError):
                continue
            if len(found.spectrum):
                _enter(column, i, found.spectrum)
                _vouch(column, i, found.certificate)
        return column


def _modes_of(family: PencilFamily, mu: Hashable, spectrum: Spectrum) -> Spectrum:
    """The modes of a spectrum, without relaxations of the stiffness."""
    if family.relaxation(mu) is None:
        return spectrum
    return spectrum.select(np.flatnonzero(family.reach(mu).is_mode(spectrum.eigenvalues)))


def _accurate(reduction: FamilyReduction, points, snapshots: int, count: int):
    """Both reduced models, and the error of leading eigenvalues on the second: with vectors corrected again and more of
    them as far as it takes, which is far cheaper than every cell with the full operator.
    """
    family = reduction.family
    losses = [0.0 if own is None else own.strengths.sum() for own in map(family.relaxation, points)]
    mixed = len(set(losses)) > 1
    least = max(snapshots, LOSSES) if mixed else snapshots
    for number in (least, 2 * least + 1, 4 * least + 3):
        places = spread(points, number)
        taken = [points[i] for i in places]
        banded = any(_is_banded(family, mu) for mu in taken)
        first, most = (reduction.wide, MOST_IN_BAND) if banded else (reduction.coarse, MOST)
        most = max(most, count)
        checked = between(places)
        if mixed:  # few corrections leave most where most relaxes, and of the quick modes that lead where least does
            checked += [int(np.argmax(losses)), int(np.argmin(losses))]
        fine = reduction.fine(first, taken, most)
        error = _error(reduction, fine, points, checked)
        if error > TOLERANCE:
            fine = reduction.deeper(fine, taken, most)
            error = _error(reduction, fine, points, checked)
        if error <= TOLERANCE:
            break
    return first, fine, error


def _is_banded(family: PencilFamily, mu: Hashable) -> bool:
    """True where all modes of a band are close to neutral, as they are where only it makes modes leading."""
    return family.relaxation(mu) is None and np.isfinite(family.reach(mu).band)


def _counted(reduced: ReducedFamily, mu: Hashable, leading: np.ndarray, within_band: bool = False) -> Count:
    """Count of unstable eigenvalues: in the band, or of a viscoelastic wall, which damps all, over all frequencies."""
    band = _counted_band(reduced.family, mu, within_band)
    number = max(2, int((leading.real > 0).sum()) + 1)
    return reduced.count(mu, leading[:number], None if np.isinf(band) else band)


def _counted_band(family: PencilFamily, mu: Hashable, within_band: bool = False) -> float:
    """Frequency up to which eigenvalues are counted, Hz."""
    whole = family.relaxation(mu) is not None and not within_band
    return np.inf if whole else INSIDE * family.reach(mu).band / (2 * np.pi)


def _beside_changes(leading) -> np.ndarray:
    """Cells whose neighbour has another number of unstable eigenvalues."""
    number = np.array([int((row.real > 0).sum()) for row in leading])
    change = np.flatnonzero(np.diff(number))
    return np.unique(np.concatenate([change, change + 1]))


def _error(reduction: FamilyReduction, fine: ReducedFamily, points, places) -> float:
    """Relative change of leading eigenvalues under a correction with the full matrices, at points the space was not
    made for.
    """
    worst = 0.0
    for i in places:
        pairs = fine.pairs(points[i], 2)
        if pairs.values.size:
            change = np.abs(reduction.correction(pairs, points[i])) / np.maximum(np.abs(pairs.values), 1.0)
            worst = max(worst, float(change.max()))
    return worst


def _enter(column: Column, cell: int, spectrum) -> None:
    """Put a direct spectrum into a cell."""
    column.how[cell] = DIRECT
    if not len(spectrum):
        return
    column.growth_rate[cell], column.frequency[cell] = spectrum.growth_rate[0], spectrum.frequency[0]
    column.second[cell] = spectrum.growth_rate[1] if len(spectrum) > 1 else np.nan
    inside = np.flatnonzero(spectrum.frequency <= column.band[cell])
    column.leading[cell] = spectrum.eigenvalues[:KEPT]
    column.unstable[cell] = spectrum.select(inside).count_right_of(column.line[cell])
    # where all listed are unstable there may be more, whatever was counted on a reduced model
    column.certain[cell] &= bool(spectrum.growth_rate[-1] <= column.line[cell])


def _vouch(column: Column, cell: int, own) -> None:
    """Put the certificate of a full pencil into a cell."""
    column.unstable[cell], column.counted[cell], column.certain[cell] = own.unstable, own.counted, own.certain
    column.line[cell], column.band[cell] = own.line, own.band


def _take(column: Column, cell: int, count: Count, values: np.ndarray) -> None:
    """Put a count into a cell, and the number of unstable eigenvalues listed in its region."""
    column.counted[cell], column.certain[cell] = count.number, count.certain
    column.line[cell], column.band[cell] = count.line, count.band
    column.unstable[cell] = _listed(values, count.line, count.band)


def _listed(values: np.ndarray, line: float, band: float) -> int:
    """Number of eigenvalues right of a line up to a band, Hz, conjugates counted apart."""
    inside = (values.real > line) & (values.imag <= 2 * np.pi * band)
    return int(np.where(values.imag > 0, 2, 1)[inside].sum())


def _column(family: PencilFamily, points, leading, values, error: float) -> Column:
    """Cells that nobody counted."""
    column = Column.blank(len(leading))
    column.how[:] = REDUCED
    for i, (mu, row) in enumerate(zip(points, leading)):
        column.leading[i], column.band[i] = row[:KEPT], _counted_band(family, mu)
        column.unstable[i] = _listed(values[i], 0.0, column.band[i])
        if len(row):
            column.growth_rate[i], column.frequency[i] = row[0].real, row[0].imag / (2 * np.pi)
        column.second[i] = row[1].real if len(row) > 1 else np.nan
    return replace(column, error=error)


def spread(points, number: int) -> list[int]:
    """Indices of points spread over the list."""
    return sorted({int(round(x)) for x in np.linspace(0, len(points) - 1, min(number, len(points)))})


def between(places: list[int]) -> list[int]:
    """The middle of the widest gap between places, the first of several."""
    if len(places) < 2:
        return places
    gaps = [(b - a, -a, (a + b) // 2) for a, b in zip(places[:-1], places[1:])]
    return [max(gaps)[2]]
