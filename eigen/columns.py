"""Parameter lines at one steady state: leading eigenvalues and counts at many conditions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from .certificate import Certificate, certified_spectrum
from .factor import SingularShiftError, Workspace
from .operator import Condition, CoupledPencil, PencilFamily
from .reduced_counts import CellCounts, count_unstable, uncounted
from .reduction import FamilyReduction, ReducedFamily, StaticSolver
from .search import leading_modes

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
        From any condition at the same state to its leading eigenvalues on the small model, sorted by growth rate.
    nearest : callable or None
        From a condition and a place to the eigenvalue of the small model next to it.
    corrected : callable or None
        From a condition and an eigenvalue of the small model to Newton's correction of it by the full matrices.
    cell : callable or None
        From any further condition at the same state to a column of this one cell.
    pencil : callable or None
        From any condition at the same state to its pencil on the small model.
    leading : list of arrays
        Leading eigenvalues of the cells.
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
    eigenvalues: Callable[[Condition], np.ndarray] | None = None
    nearest: Callable[[Condition, complex], complex] | None = None
    corrected: Callable[[Condition, complex], complex] | None = None
    cell: Callable[[Condition], Column] | None = None
    pencil: Callable[[Condition], CoupledPencil] | None = None
    leading: list[np.ndarray] = field(default_factory=list)

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
        small = {name: getattr(self, name) for name in ("eigenvalues", "nearest", "corrected", "cell", "pencil")}
        return replace(out, error=self.error, **small)

    @property
    def certified(self) -> np.ndarray:
        """Cells for which both counts agree and the leading eigenvalue is accurate."""
        return np.array([self.certificate(i).agrees for i in range(len(self.unstable))], bool)

    def certificate(self, cell: int) -> Certificate:
        """Certificate of a cell."""
        accurate = self.how[cell] == DIRECT or self.error <= TOLERANCE
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
#: Conditions at least at which they are taken where the loss factors differ.
LOSSES = 4
#: Leading vectors taken at each condition: where damping orders the modes, and for a band.
MOST, MOST_IN_BAND = 4, 12


class ColumnSolver:
    """Solves families of one pattern after another."""

    def __init__(self):
        self._static, self._stiffened = StaticSolver(), StaticSolver()
        self._workspace, self._structures = Workspace(), Workspace()
        self._last: FamilyReduction | None = None
        self._counter: tuple[ReducedFamily, ReducedFamily, ReducedFamily] | None = None

    def reduction(self, family: PencilFamily) -> FamilyReduction:
        """Small models of a family; the last one is kept."""
        if self._last is None or self._last.family is not family:
            self._last = FamilyReduction(family, self._static, self._stiffened, self._structures)
        return self._last

    def solve(
        self, family: PencilFamily, conditions, snapshots: int = 3, edges: bool = False, spectra=None, count: int = 2
    ) -> Column:
        """All conditions at one state.

        Parameters
        ----------
        family : PencilFamily
        conditions : sequence of Condition
        snapshots : int
            Conditions at which leading vectors are taken into the second space; fewer than three conditions are solved
            with the full pencil.
        edges : bool
            Count only beside changes of the number of unstable eigenvalues along the list; no other cell gets a
            certificate.
        spectra : sequence of Spectrum, optional
            Of the full pencils of fewer than three conditions, where they are known.
        count : int
            Leading modes of each condition that the second space is made for.

        Raises
        ------
        SingularShiftError
            If the stiffness is singular, or a full pencil has no usable shift.
        """
        conditions = [Condition(*c) for c in conditions]
        if not family.forces.shape[1]:
            return self._uncoupled(family, conditions)
        reduction = self.reduction(family)
        if len(conditions) < 3:
            return self._directly(reduction, conditions, spectra)
        first, fine, error = _accurate(reduction, conditions, snapshots, count)
        column = self._on(first, fine, conditions, error, edges)

        def eigenvalues(condition):
            condition = Condition(*condition)
            return family.reach(condition).leading(fine.eigenvalues([condition])[0])[:KEPT]

        def nearest(condition, place):
            return fine.nearest(Condition(*condition), place)

        def corrected(condition, eigenvalue):
            condition = Condition(*condition)
            return complex(reduction.correction(fine.near(condition, eigenvalue), condition)[0])

        def cell(condition):
            return self._on(first, fine, [Condition(*condition)], error)

        def pencil(condition):
            return fine.pencil(Condition(*condition))

        return replace(column, eigenvalues=eigenvalues, nearest=nearest, corrected=corrected, cell=cell, pencil=pencil)

    def _on(self, first: ReducedFamily, fine: ReducedFamily, conditions, error: float, edges: bool = False) -> Column:
        """Cells on a small model, counted on that of the first stage; those without a certificate directly."""
        family = first.family
        values = fine.eigenvalues(conditions)
        leading = [family.reach(c).leading(row) for row, c in zip(values, conditions)]
        counted = _beside_changes(leading) if edges else np.arange(len(conditions))
        counts = uncounted(family, conditions)

        def count(counter, cells, within_band=False):
            asked = [conditions[i] for i in cells], [leading[i] for i in cells]
            return count_unstable(counter, *asked, within_band=within_band)

        joint = error <= TOLERANCE and any(conditions[i].loss for i in counted)
        counter = self._joint(first, fine) if joint else first
        if len(counted):
            counts.enter(counted, count(counter, counted))
        column = _column(leading, values, counts, error)
        doubtful = counted[~column.certified[counted]]
        if len(doubtful) and joint and self._counter[1] is not fine:
            counts.enter(doubtful, count(self._joint(first, fine, anew=True), doubtful))
            doubtful = doubtful[~column.certified[doubtful]]
        if len(doubtful) and joint:
            # a mode that is all but neutral has to be met to a fraction of its growth rate
            found = count(ReducedFamily(family, fine.V, CLOSE, base=first), doubtful, within_band=True)
            listed = [_listed(values[i], *region) for i, *region in zip(doubtful, found.line, found.band)]
            agree = found.certain & (found.number == listed) & np.isfinite(column.growth_rate[doubtful])
            counts.enter(doubtful[agree], found.select(agree))
            column.unstable[doubtful[agree]] = np.array(listed)[agree]
            doubtful = doubtful[~column.certified[doubtful]]
        return self._repaired(column, family, conditions, doubtful)

    def _joint(self, first: ReducedFamily, fine: ReducedFamily, anew: bool = False) -> ReducedFamily:
        """Space of a count where stiffness relaxes: static responses alone say little of that; with the vectors that a
        list rests on, of this column or of the one before at the same state, they are enough.
        """
        if anew or self._counter is None or self._counter[0] is not first:
            self._counter = first, fine, ReducedFamily(first.family, fine.V, JOINT, base=first)
        return self._counter[2]

    def direct(self, family: PencilFamily, condition, count: int = 6):
        """Leading modes of the full pencil, an `eigen.Spectrum`.

        Raises
        ------
        SingularShiftError
            If no usable shift was found.
        """
        condition = Condition(*condition)
        found = leading_modes(family.pencil(condition), count, family.search(condition), workspace=self._workspace)
        return _modes_of(family, condition, found)

    def _directly(self, reduction: FamilyReduction, conditions, spectra=None) -> Column:
        family = reduction.family
        if spectra:
            spectra = [_modes_of(family, c, found) for c, found in zip(conditions, spectra)]
        else:
            spectra = [self.direct(family, c) for c in conditions]
        banded = any(_is_banded(family, c) for c in conditions)
        first = reduction.wide if banded else reduction.coarse
        counts = count_unstable(first, conditions, [s.eigenvalues[:1] for s in spectra])
        column = _counted(counts)
        for i, spectrum in enumerate(spectra):
            _enter(column, i, spectrum)
        return self._recounted(column, family, conditions, np.flatnonzero(~column.certified))

    def _uncoupled(self, family: PencilFamily, conditions) -> Column:
        """A structure that nothing couples: its full spectra and counts, each once for every damping."""
        column, known = _counted(uncounted(family, conditions)), {}
        for i, condition in enumerate(conditions):
            key = condition.damping
            if key not in known:
                asked = family.pencil(condition), 6, family.search(condition)
                known[key] = certified_spectrum(*asked, workspace=self._workspace)
            found = known[key]
            _enter(column, i, _modes_of(family, condition, found.spectrum))
            _vouch(column, i, found.certificate)
        return column

    def _repaired(self, column: Column, family, conditions, cells) -> Column:
        for i in cells:
            try:
                spectrum = self.direct(family, conditions[i])
            except (SingularShiftError, np.linalg.LinAlgError):
                continue  # stays without a certificate
            if len(spectrum):
                _enter(column, i, spectrum)
        open_cells = [i for i in cells if not column.certificate(i).agrees]
        return self._recounted(column, family, conditions, open_cells)

    def _recounted(self, column: Column, family, conditions, cells) -> Column:
        """Cells that still lack agreement, with a count of their own on a basis of structural modes, made finer as far
        as it takes.
        """
        for i in cells:
            pencil, options = family.pencil(conditions[i]), family.search(conditions[i])
            try:
                found = certified_spectrum(pencil, 6, options, workspace=self._workspace)
            except (SingularShiftError, np.linalg.LinAlgError):
                continue
            if len(found.spectrum):
                _enter(column, i, found.spectrum)
                _vouch(column, i, found.certificate)
        return column


def _modes_of(family: PencilFamily, condition: Condition, spectrum):
    """The modes of a spectrum, without relaxations of the stiffness."""
    if condition.loss == 0:
        return spectrum
    return spectrum.select(np.flatnonzero(family.reach(condition).is_mode(spectrum.eigenvalues)))


def _accurate(reduction: FamilyReduction, conditions, snapshots: int, count: int):
    """Both small models, and the error of leading eigenvalues on the second: with vectors corrected again and more of
    them as far as it takes, which is far cheaper than every cell with the full pencil.
    """
    family, losses = reduction.family, [c.loss for c in conditions]
    mixed = len(set(losses)) > 1
    least = max(snapshots, LOSSES) if mixed else snapshots
    for number in (least, 2 * least + 1, 4 * least + 3):
        places = spread(conditions, number)
        taken = [conditions[i] for i in places]
        banded = any(_is_banded(family, c) for c in taken)
        first, most = (reduction.wide, MOST_IN_BAND) if banded else (reduction.coarse, MOST)
        most = max(most, count)
        checked = between(places)
        if mixed:  # few corrections leave most where most relaxes, and of the quick modes that lead where least does
            checked += [int(np.argmax(losses)), int(np.argmin(losses))]
        fine = reduction.fine(first, taken, most)
        error = _error(reduction, fine, conditions, checked)
        if error > TOLERANCE:
            fine = reduction.deeper(fine, taken, most)
            error = _error(reduction, fine, conditions, checked)
        if error <= TOLERANCE:
            break
    return first, fine, error


def _is_banded(family: PencilFamily, condition: Condition) -> bool:
    """True where all modes of a band are close to neutral, as they are where only it makes modes leading."""
    return condition.loss == 0 and np.isfinite(family.reach(condition).band)


def _beside_changes(leading) -> np.ndarray:
    """Cells whose neighbour has another number of unstable eigenvalues."""
    number = np.array([int((row.real > 0).sum()) for row in leading])
    change = np.flatnonzero(np.diff(number))
    return np.unique(np.concatenate([change, change + 1]))


def _error(reduction: FamilyReduction, fine: ReducedFamily, conditions, places) -> float:
    """Relative change of leading eigenvalues under a correction with the full matrices, at conditions the space was
    not made for.
    """
    worst = 0.0
    for i in places:
        pairs = fine.pairs(conditions[i], 2)
        if pairs.values.size:
            change = np.abs(reduction.correction(pairs, conditions[i])) / np.maximum(np.abs(pairs.values), 1.0)
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


def _vouch(column: Column, cell: int, own) -> None:
    """Put the certificate of a full pencil into a cell."""
    column.unstable[cell], column.counted[cell], column.certain[cell] = own.unstable, own.counted, own.certain
    column.line[cell], column.band[cell] = own.line, own.band


def _counted(counts: CellCounts) -> Column:
    """Cells of which nothing but the counts is known."""
    blank = Column.blank(len(counts.number))
    how = np.full(len(counts.number), DIRECT)
    known = {"counted": counts.number, "certain": counts.certain, "line": counts.line, "band": counts.band}
    return replace(blank, unstable=np.zeros(len(how), int), how=how, **known)


def _listed(values: np.ndarray, line: float, band: float) -> int:
    """Number of unstable eigenvalues of a cell."""
    return int(((values.real > line) & (np.abs(values.imag) <= 2 * np.pi * band)).sum())


def _column(leading, values, counts: CellCounts, error: float) -> Column:
    first = [row[0] if len(row) else complex(np.nan, np.nan) for row in leading]
    return Column(
        growth_rate=np.array([value.real for value in first]),
        frequency=np.array([value.imag / (2 * np.pi) for value in first]),
        second=np.array([row[1].real if len(row) > 1 else np.nan for row in leading]),
        unstable=np.array([_listed(*row) for row in zip(values, counts.line, counts.band)]),
        counted=counts.number,
        certain=counts.certain,
        error=error,
        how=np.full(len(leading), REDUCED),
        line=counts.line,
        band=counts.band,
        leading=[row[:KEPT] for row in leading],
    )


def spread(conditions, number: int) -> list[int]:
    """Indices of conditions spread over the list."""
    return sorted({int(round(x)) for x in np.linspace(0, len(conditions) - 1, min(number, len(conditions)))})


def between(places: list[int]) -> list[int]:
    """The middle of the widest gap between places, the first of several."""
    if len(places) < 2:
        return places
    gaps = [(b - a, -a, (a + b) // 2) for a, b in zip(places[:-1], places[1:])]
    return [max(gaps)[2]]
