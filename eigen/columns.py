"""Cells of one steady state: leading eigenvalues and counts at many parameter points, on a reduced operator where that
serves.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from .certificate import OPTIONS as CERTIFICATES
from .certificate import Certificate, CertifiedSpectrum, certified_spectrum
from .count import Count
from .factor import SingularShiftError, Workspace
from .family import PencilFamily, ReducedFamily
from .operator import CoupledPencil
from .pairs import acceptable, newton
from .reduction import OPTIONS, FamilyReduction
from .search import leading_modes
from .spectrum import Spectrum, number_right_of

#: How a cell was found.
REDUCED, DIRECT, MISSING = 0, 1, 2


@dataclass(frozen=True)
class Cell:
    """Leading eigenvalues at one parameter point, and both counts of the unstable ones.

    Attributes
    ----------
    leading : (k,) complex array, 1/s
        Sorted by growth rate, a conjugate pair given once.
    certificate : Certificate
        Its `counted` is -1 where nobody asked.
    how : int
        `REDUCED`, `DIRECT` or `MISSING`.
    open_above : bool
        Stable up to the end of the band, above which a count finds more.
    """

    leading: np.ndarray = field(default_factory=lambda: np.zeros(0, complex))
    certificate: Certificate = Certificate(-1, -1, False)
    how: int = MISSING
    open_above: bool = False

    @classmethod
    def of(cls, listed: np.ndarray, values: np.ndarray, found: Count | Certificate, certain: bool, how: int) -> Cell:
        """Cell of the leading ones of some eigenvalues and a count, which is certain if that is as well."""
        number = found.number if isinstance(found, Count) else found.counted
        certain = bool(certain and found.certain and len(listed))
        unstable = number_right_of(values, found.line, found.band)
        return cls(
            listed[: OPTIONS.kept], Certificate(unstable, number, certain, float(found.line), float(found.band)), how
        )


@dataclass(frozen=True)
class ReducedColumn:
    """Reduced operator of one state, accurate at the parameter points that it was made for.

    Attributes
    ----------
    solver : ColumnSolver
    reduction : FamilyReduction
    first, fine : ReducedFamily
        Its two stages.
    error : float
        Largest estimated relative error of leading eigenvalues at the points checked.
    """

    solver: ColumnSolver
    reduction: FamilyReduction
    first: ReducedFamily
    fine: ReducedFamily
    error: float

    def eigenvalues(self, mu: Hashable) -> np.ndarray:
        """Leading eigenvalues at a parameter point, sorted by growth rate."""
        return self.fine.leading(mu)[: OPTIONS.kept]

    def nearest(self, mu: Hashable, place: complex) -> complex:
        """Eigenvalue next to a place."""
        return complex(self.fine.near(mu, [place]).values[0])

    def corrected(self, mu: Hashable, values: Sequence[complex]) -> np.ndarray:
        """Newton's corrections (k,) of eigenvalues by the full matrices."""
        return self.reduction.correction(self.fine.near(mu, values), mu)

    def exact(self, mu: Hashable, value: complex) -> complex:
        """Eigenvalue of the full matrices next to one of this model, by inverse iteration with them; NaN where that
        does not converge.
        """
        pairs, tolerance = self.fine.near(mu, [value]), self.first.family.search(mu).tolerance
        start = complex(pairs.values[0]), pairs.q[:, 0], pairs.u[:, 0]
        found = newton(self.reduction.operator(mu), *start, workspace=self.solver.workspace, tolerance=tolerance)
        return found[0] if acceptable(*found[3:], tolerance) else complex(np.nan)

    def cell(self, mu: Hashable) -> Cell:
        """Cell of any further parameter point."""
        return self.solver.cells(self, [mu])[0]

    def at(self, mu: Hashable) -> CoupledPencil:
        """Operator on the reduced model."""
        return self.fine.at(mu)


@dataclass(frozen=True)
class Column:
    """Cells of one state, found when they are asked for, with the reduced operator that they come from if there is
    one.
    """

    find: Callable[[], Sequence[Cell]]
    model: ReducedColumn | None = None

    @cached_property
    def cells(self) -> tuple[Cell, ...]:
        """The cells, each with its count.

        Raises
        ------
        SingularShiftError
            If a full operator has no usable shift.
        """
        return tuple(self.find())

    @property
    def error(self) -> float:
        """Largest estimated relative error of leading eigenvalues of the reduced operator."""
        return 0.0 if self.model is None else self.model.error

    @property
    def leading(self) -> np.ndarray:
        """Leading eigenvalue of each cell (cells,), complex, 1/s; NaN where none was found."""
        missing = complex(np.nan, np.nan)
        return np.array([cell.leading[0] if len(cell.leading) else missing for cell in self.cells])

    @property
    def unstable(self) -> np.ndarray:
        """Unstable eigenvalues listed in each cell."""
        return np.array([cell.certificate.unstable for cell in self.cells])

    @property
    def certified(self) -> np.ndarray:
        """Mask of cells for which both counts agree and the leading eigenvalue is accurate."""
        return np.array([cell.certificate.agrees for cell in self.cells], bool)

    @property
    def how(self) -> np.ndarray:
        """Way (cells,) in which each cell was found, as `Cell.how` says."""
        return np.array([cell.how for cell in self.cells])


class ColumnSolver:
    """Solves families of one pattern after another."""

    def __init__(self):
        self._static, self._stiffened, self.workspace = Workspace(), Workspace(), Workspace()
        self._last: FamilyReduction | None = None
        self._counter: tuple[ReducedFamily, ReducedFamily, ReducedFamily] | None = None

    def reduction(self, family: PencilFamily) -> FamilyReduction:
        """Reduced models of a family; the last one is kept."""
        if self._last is None or self._last.family is not family:
            self._last = FamilyReduction(family, self._static, self._stiffened)
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
            If the stiffness is singular.
        """
        points = list(points)
        if not family.forces.shape[1]:
            return Column(lambda: self._uncoupled(family, points))
        reduction = self.reduction(family)
        if len(points) < 3:
            return Column(lambda: self._directly(reduction, points, spectra))
        model = ReducedColumn(self, reduction, *_accurate(reduction, points, snapshots, count))
        return Column(lambda: self.cells(model, points, edges), model)

    def cells(self, model: ReducedColumn, points: Sequence[Hashable], edges: bool = False) -> list[Cell]:
        """Cells on a reduced model, counted on its first stage; those without a certificate directly."""
        first, fine, family = model.first, model.fine, model.first.family
        values = [fine.eigenvalues(mu) for mu in points]
        leading = [family.reach(mu).leading(row) for row, mu in zip(values, points)]
        counts: dict[int, Count] = {}
        leading, trusted = _corrected(model, points, leading)
        nobody = [Certificate(-1, -1, False, 0.0, _counted_band(family, mu)) for mu in points]
        cells = [Cell.of(*own, False, REDUCED) for own in zip(leading, values, nobody)]

        def count(counter, chosen, within_band=False):
            for i in chosen:
                found = _counted(counter, points[i], leading[i], within_band)
                cell = Cell.of(leading[i], values[i], found, trusted[i], REDUCED)
                if not within_band or cell.certificate.agrees:
                    counts[i], cells[i] = found, cell
            return [i for i in chosen if not cells[i].certificate.agrees]

        counted = _beside_changes(leading) if edges else range(len(points))
        joint = model.error <= OPTIONS.tolerance and any(family.relaxation(points[i]) is not None for i in counted)
        doubtful = count(self._joint(first, fine) if joint else first, counted)
        if doubtful and joint and self._counter[1] is not fine:
            doubtful = count(self._joint(first, fine, anew=True), doubtful)
        above = [i for i in counted if i not in doubtful and _grows_above(cells[i])]
        if doubtful + above and joint:
            # a mode that is all but neutral has to be met to a fraction of its growth rate
            close = ReducedFamily(family, fine.V, OPTIONS.close, base=first)
            doubtful, _ = (count(close, chosen, within_band=True) for chosen in (doubtful, above))
        for i in above:
            cells[i] = replace(cells[i], open_above=True)
        for i in doubtful:
            try:
                spectrum = self.direct(family, points[i])
            except (SingularShiftError, np.linalg.LinAlgError):
                continue  # stays without a certificate
            if len(spectrum):
                cells[i] = _direct(spectrum, counts[i])
            if _lacks(spectrum.eigenvalues, values[i], model.error):
                cells[i] = replace(cells[i], certificate=replace(cells[i].certificate, certain=False))
        return self._recounted(cells, family, points, doubtful)

    def _joint(self, first: ReducedFamily, fine: ReducedFamily, anew: bool = False) -> ReducedFamily:
        """Space of a count of a viscoelastic wall: static responses alone say little of that; with the vectors that a
        list rests on, of this column or of the one before at the same state, they are enough.
        """
        if anew or self._counter is None or self._counter[0] is not first:
            self._counter = first, fine, ReducedFamily(first.family, fine.V, OPTIONS.joint, base=first)
        return self._counter[2]

    def direct(self, family: PencilFamily, mu: Hashable, count: int = OPTIONS.searched) -> Spectrum:
        """Leading modes of the full operator.

        Raises
        ------
        SingularShiftError
            If no usable shift was found.
        """
        found = leading_modes(family.at(mu), count, family.search(mu), workspace=self.workspace)
        return _modes_of(family, mu, found)

    def _directly(self, reduction: FamilyReduction, points, spectra=None) -> list[Cell]:
        family, first, cells = reduction.family, reduction.first(points), []
        for i, mu in enumerate(points):
            spectrum = _modes_of(family, mu, spectra[i]) if spectra else self.direct(family, mu)
            cell = _direct(spectrum, _counted(first, mu, spectrum.eigenvalues))
            if not cell.certificate.agrees and len(spectrum):  # see `_joint`
                vectors = np.hstack([spectrum.q.real, spectrum.q.imag])
                joint = ReducedFamily(family, vectors, OPTIONS.joint, base=first)
                cell = _direct(spectrum, _counted(joint, mu, spectrum.eigenvalues))
            cells.append(cell)
        return self._recounted(cells, family, points, range(len(points)))

    def _uncoupled(self, family: PencilFamily, points) -> list[Cell]:
        """Cells of a structure that nothing couples: its full spectra and counts, each once for every damping."""
        cells, known = [], {}
        for mu in points:
            key = family.structure(mu)
            if key not in known:
                known[key] = self._certified(family, mu)
            listed, own = _modes_of(family, mu, known[key].spectrum).eigenvalues, known[key].certificate
            cells.append(Cell(listed[: OPTIONS.kept], replace(own, certain=own.certain and len(listed) > 0), DIRECT))
        return cells

    def _recounted(self, cells: list[Cell], family, points, chosen) -> list[Cell]:
        """Cells, of which those chosen that still lack agreement have a count of their own."""
        for i in chosen:
            if cells[i].certificate.agrees:
                continue
            try:
                found = self._anew(family, points[i])
            except (SingularShiftError, np.linalg.LinAlgError):
                continue
            if len(found.leading):
                cells[i] = found
        return cells

    def _certified(self, family: PencilFamily, mu: Hashable) -> CertifiedSpectrum:
        return certified_spectrum(family.at(mu), OPTIONS.searched, family.search(mu), workspace=self.workspace)

    def _anew(self, family: PencilFamily, mu: Hashable) -> Cell:
        """Cell of the full operator, counted on a basis of structural modes, made finer as far as it takes."""
        found = self._certified(family, mu)
        listed = _modes_of(family, mu, found.spectrum).eigenvalues
        return Cell(listed[: OPTIONS.kept], found.certificate, DIRECT)

    def counted_whole(self, family: PencilFamily, mu: Hashable, cell: Cell) -> Cell:
        """The cell of a parameter point; where it is stable up to the end of a band above which more is counted that is
        resolved, that of the full operator, or the same left open above the band.

        Raises
        ------
        SingularShiftError
            If the full operator has no usable shift.
        """
        own, end = cell.certificate, family.search(mu).whole
        if cell.open_above or not own.stable or own.band >= end or (cell.leading.real > own.line).any():
            return cell
        whole = self.reduction(family).first([mu]).count(mu, cell.leading, end)
        if whole.certain and not whole.number:
            return cell
        found = self._anew(family, mu)
        if not found.certificate.stable:
            return found
        if found.certificate.band >= end:
            return cell
        return replace(cell, open_above=True)


def cell_beside(reduction: FamilyReduction, mu: Hashable, error: float, safety: float) -> Cell:
    """Cell of an operator next to another one, see `FamilyReduction.beside`.

    Leading eigenvalues are corrected with the full matrices; what that changes counts as their error. Listed as
    unstable are those corrected, counted all of the reduced model; it is left open where the model has more of them
    above the band.

    Parameters
    ----------
    error : float
        Relative error of eigenvalues that is known to come from elsewhere.
    safety : float
        The cell has a certificate where all leading growth rates are farther from zero than so many errors.
    """
    family, model = reduction.family, reduction.coarse
    values = model.eigenvalues(mu)
    places = family.reach(mu).leading(values)[: OPTIONS.beside]
    change = reduction.correction(model.near(mu, places), mu)
    order = np.argsort(-(places + change).real)
    leading, change = (places + change)[order], change[order]
    doubt = np.maximum(np.abs(change), error * np.abs(leading)) / np.abs(leading.real)
    clear = bool(np.isfinite(leading).all() and doubt.max(initial=0.0) <= 1.0 / safety)
    band = _counted_band(family, mu)
    number, whole = (number_right_of(values, 0.0, end) for end in (band, family.search(mu).whole))
    cell = Cell.of(leading, leading, Certificate(number, number, True, 0.0, band), clear, REDUCED)
    return replace(cell, open_above=bool(cell.certificate.stable and whole > number))


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
    least = max(snapshots, OPTIONS.losses) if mixed else snapshots
    for number in (least, 2 * least + 1, 4 * least + 3):
        places = spread(points, number)
        taken = [points[i] for i in places]
        first = reduction.first(taken)
        most = max(OPTIONS.vectors if first is reduction.coarse else OPTIONS.band_vectors, count)
        checked = between(places)
        if mixed:  # few corrections leave most where most relaxes, and of the quick modes that lead where least does
            checked += [int(np.argmax(losses)), int(np.argmin(losses))]
        checked = [points[i] for i in checked]
        fine = reduction.fine(first, taken, most)
        error = reduction.error(fine, checked)
        if error > OPTIONS.tolerance:
            fine = reduction.deeper(fine, taken, most)
            error = reduction.error(fine, checked)
        if error <= OPTIONS.tolerance:
            break
    return first, fine, error


def _corrected(model: ReducedColumn, points, leading: list[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
    """Leading eigenvalues of a reduced operator, and the points (bool) at which they are accurate.

    The faster the leading modes are, the less the space has of them, since the corrections of its vectors lack the
    inertia. Those of the fastest are corrected until that changes little; corrections leave their square.
    """
    known = {i: np.zeros(0) for i, row in enumerate(leading) if not len(row)}

    def change(i) -> np.ndarray:
        if i not in known:
            known[i] = model.corrected(points[i], leading[i][: OPTIONS.held])
        return known[i]

    def error(i) -> float:
        size = np.maximum(np.abs(leading[i][: OPTIONS.held]), model.reduction.slow)
        return (np.abs(change(i)) / size).max(initial=0.0)

    found, trusted = list(leading), np.zeros(len(points), bool)
    if model.error > OPTIONS.tolerance:
        return found, trusted
    order = np.argsort([np.abs(row[: OPTIONS.held]).max(initial=0.0) for row in leading])
    low, high, at = 0, len(points), len(points) - 1
    while low < high:
        low, high = (at + 1, high) if error(order[at]) <= OPTIONS.tolerance else (low, at)
        at = (low + high) // 2
    trusted[order[:low]] = True
    for i in order[low:]:
        listed = leading[i][: OPTIONS.held]
        exact = listed + change(i)
        if error(i) <= np.sqrt(OPTIONS.tolerance) and ((exact.real > 0) == (listed.real > 0)).all():
            row = np.concatenate([exact, leading[i][OPTIONS.held :]])
            found[i], trusted[i] = row[np.argsort(-row.real)], True
    return found, trusted


def _counted(reduced: ReducedFamily, mu: Hashable, leading: np.ndarray, within_band: bool = False) -> Count:
    """Count of unstable eigenvalues: in the band, or of a viscoelastic wall, which damps all, over all frequencies."""
    band = _counted_band(reduced.family, mu, within_band)
    number = max(2, int((leading.real > 0).sum()) + 1)
    return reduced.count(mu, leading[:number], band)


def _counted_band(family: PencilFamily, mu: Hashable, within_band: bool = False) -> float:
    """Frequency up to which eigenvalues are counted, Hz."""
    options = family.search(mu)
    if options.max_frequency is None or (family.relaxation(mu) is not None and not within_band):
        return options.whole
    return options.inside * options.max_frequency


def _grows_above(cell: Cell) -> bool:
    """True where none of the list grows, which ends at the band, and both counts, which do not, find what does."""
    own = cell.certificate
    return own.unstable > 0 and own.agrees and not (cell.leading.real > own.line).any()


def _beside_changes(leading) -> np.ndarray:
    """Cells whose neighbour has another number of unstable eigenvalues."""
    number = np.array([int((row.real > 0).sum()) for row in leading])
    change = np.flatnonzero(np.diff(number))
    return np.unique(np.concatenate([change, change + 1]))


def _direct(spectrum: Spectrum, found: Count) -> Cell:
    """Cell of a spectrum of the full operator; where all listed are unstable there may be more, whatever was counted on
    a reduced model.
    """
    values = spectrum.eigenvalues
    return Cell.of(values, values, found, bool((values.real <= found.line).any()), DIRECT)


def _lacks(searched: np.ndarray, listed: np.ndarray, error: float) -> bool:
    """True where a reduced operator lists an eigenvalue that is unstable within twice its relative error, and a search
    with the full operator, which ends at a band, has none there.
    """
    near = listed[listed.real > -2.0 * error * np.abs(listed)]
    apart = np.abs(near[:, None] - searched).min(axis=1, initial=np.inf)
    return bool((apart > CERTIFICATES.apart * np.abs(near)).any())


def spread(points, number: int) -> list[int]:
    """Indices of points spread over the list."""
    return sorted({int(round(x)) for x in np.linspace(0, len(points) - 1, min(number, len(points)))})


def between(places: list[int]) -> list[int]:
    """The middle of the widest gap between places, the first of several."""
    if len(places) < 2:
        return places
    gaps = [(b - a, -a, (a + b) // 2) for a, b in zip(places[:-1], places[1:])]
    return [max(gaps)[2]]
