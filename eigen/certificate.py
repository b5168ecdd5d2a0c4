"""Leading modes with the independent count of the unstable ones, and their agreement."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from .basis import TransferBasis
from .count import Count, unstable_count
from .factor import StructureMatrices, Workspace
from .krylov import KrylovPairs, krylov_pairs
from .operator import CoupledPencil, real_apply
from .pairs import SAME, Found, acceptable, all_pairs, left_by_inverse_iteration, newton, normalised
from .search import by_growth, leading_modes, with_left
from .spectrum import SearchOptions, Spectrum, number_right_of


@dataclass(frozen=True)
class CertificateOptions:
    """Sizes of a count on a basis, and how far it is trusted."""

    #: Unknowns beyond which a count is made on a basis: a dense factorisation of so many takes some 10 ms, a count some
    #: hundred of them.
    dense: int = 400
    trusted: float = 0.1  #: Largest error of log det on the basis; a count is wrong where it comes to pi.
    checked: int = 2  #: Frequencies at which a basis is compared with the full pencil.
    finer: int = 3  #: Finer bases tried at most where the first one leaves a count open.
    #: Size, over the largest, below which directions of exact responses are left out of a finer basis.
    distinct: float = 1e-4
    #: Points of a count over all frequencies where one up to the end of a band can stand in for it.
    points_beyond: int = 1000
    distant: int = 4  #: Oscillating pairs that a list lacks which are looked for at most, and real ones.
    apart: float = 0.02  #: Relative distance from which on an eigenvalue on a basis is none of the list.
    steps: int = 8  #: Newton steps for one of them, which is known roughly.


OPTIONS = CertificateOptions()


@dataclass(frozen=True)
class Certificate:
    """Agreement of a spectrum with an independent count, for a mode list and for a cell of a map alike.

    Attributes
    ----------
    unstable : int
        Eigenvalues right of `line` by the spectrum, conjugates counted apart.
    counted : int
        The same by the argument principle.
    certain : bool
        The count followed its phase everywhere, and what both rest on is accurate enough.
    line : float
        Growth rate counted from, 1/s.
    band : float
        Hz; frequencies up to it were looked at, infinite for all.

    Examples
    --------
    >>> Certificate(2, 2, True).stable, Certificate(0, 2, True).stable, Certificate(0, 0, True).stable
    (False, None, True)
    """

    unstable: int
    counted: int
    certain: bool
    line: float = 0.0
    band: float = np.inf

    @property
    def agrees(self) -> bool:
        """Both routes give the same number, and the count is certain."""
        return self.certain and self.unstable == self.counted

    @property
    def stable(self) -> bool | None:
        """True where all eigenvalues up to the band decay; None without agreement."""
        return self.unstable == 0 if self.agrees else None

    @property
    def statement(self) -> str:
        """Both counts in a sentence."""
        listed = f"{self.unstable} unstable eigenvalues{self.where}"
        if self.agrees:
            return f"{listed}: the spectrum and the independent count agree."
        if self.counted < 0:
            return f"{listed} are listed; nobody counted them."
        if not self.certain:
            return f"{listed} are listed; the independent count ({self.counted}) is uncertain."
        return f"{listed} are listed, the independent count finds {self.counted}: they disagree."

    def beside(self, beyond: int) -> str:
        """Statement with the number of unstable eigenvalues that are listed beyond the band."""
        return f"{self.statement[:-1]}; {beyond} more are listed beyond that band." if beyond else self.statement

    @property
    def where(self) -> str:
        """The region in words, empty for the whole right half-plane."""
        text = "" if self.line == 0 else f" with a growth rate above {self.line:.4g} 1/s"
        return text + (f" up to {self.band:.4g} Hz" if np.isfinite(self.band) else "")


def missing_pairs(
    pencil: CoupledPencil,
    spectrum: Spectrum,
    basis: TransferBasis | None,
    line: float,
    options: SearchOptions,
    workspace: Workspace,
) -> Found | None:
    """Unstable pairs of the full pencil near those that the pencil on a basis has and a spectrum lacks: beyond its band
    too, if that was not asked for, as far as they are resolved; without a basis those of a small pencil.

    Each is brought to the full pencil by Newton steps and has to pass the residual test like any other, however far it
    moves on the way: a basis may know it roughly. The fastest growing ones are tried.

    Parameters
    ----------
    line : float
        Growth rate above which a pair counts as unstable, 1/s.

    Returns
    -------
    Found or None
        None if none was found.
    """
    values, q, u, _, _ = all_pairs(pencil if basis is None else pencil.projected(basis.V), left=False)
    end = 2 * np.pi * (options.whole if options.max_frequency is None else options.max_frequency)
    apart = np.abs(values[:, None] - spectrum.eigenvalues).min(axis=1, initial=np.inf) > OPTIONS.apart * np.abs(values)
    unstable = np.flatnonzero((values.real > line) & (values.imag <= end) & apart)
    unstable = unstable[np.argsort(-values.real[unstable])]
    still = values.imag[unstable] == 0
    chosen = [*unstable[still][: OPTIONS.distant], *unstable[~still][: OPTIONS.distant]]
    starts = [(values[i], q[:, i] if basis is None else basis.V @ q[:, i], u[:, i]) for i in chosen]
    pairs = []
    for start in starts:
        pair = newton(pencil, *start, workspace=workspace, tolerance=options.tolerance, steps=OPTIONS.steps)
        value, _, _, residual, backward = pair
        known = [abs(value - x) <= SAME * abs(x) for x in (*spectrum.eigenvalues, *(other[0] for other in pairs))]
        inside = value.real > line and value.imag <= end
        if inside and acceptable(residual, backward, options.tolerance) and not any(known):
            pairs.append(pair)
    if not pairs:
        return None
    values, q, u, residual, backward = (np.stack(part, axis=-1) for part in zip(*pairs))
    found = Found(values, *normalised(q, u), residual, backward)
    if spectrum.left_q is not None:
        left = zip(*(left_by_inverse_iteration(pencil, value, workspace) for value in values))
        found.left_q, found.left_u = (np.stack(part, axis=-1).conj() for part in left)
    return found


def joined(pencil: CoupledPencil, spectrum: Spectrum, found: Found, line: float) -> Spectrum:
    """The spectrum with further unstable pairs, sorted; as long as was asked for, if not more are unstable."""
    parts = {name: np.concatenate([getattr(one, name) for one in (spectrum, found)], axis=-1) for name in found.parts}
    order = by_growth(parts["eigenvalues"])
    order = order[: max(spectrum.asked, int(np.sum(parts["eigenvalues"].real > line)))]
    real = found.eigenvalues.imag == 0
    notes = []
    if real.any():
        rates = ", ".join(f"{value.real:.4g}" for value in found.eigenvalues[real])
        notes.append(
            f"Motions that grow by {rates} 1/s without oscillating lie far from where modes are searched for; the "
            f"independent count pointed to them."
        )
    beyond = found.eigenvalues.imag > 2 * np.pi * spectrum.band
    for chosen, where in (
        (beyond, f"beyond the band up to {spectrum.band:.4g} Hz in which the list is complete"),
        (~real & ~beyond, "where the search did not reach"),
    ):
        if chosen.any():
            frequencies = ", ".join(f"{value.imag / (2 * np.pi):.4g}" for value in found.eigenvalues[chosen])
            notes.append(f"Unstable modes at {frequencies} Hz lie {where}; the independent count pointed to them.")
    spectrum = replace(
        spectrum,
        **{name: part[..., order] for name, part in parts.items()},
        refined=spectrum.refined + found.eigenvalues.size,
        notes=(*spectrum.notes, *notes),
    )
    return spectrum if found.left_q is None else with_left(pencil, spectrum)


#: Multiples of it, modulo one, fill an interval evenly and never repeat.
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


@dataclass(frozen=True)
class CertifiedSpectrum:
    """Two routes to the number of unstable modes.

    Attributes
    ----------
    spectrum : Spectrum
    count : Count
    certificate : Certificate
        Both numbers right of `count.line`, up to `count.band`; certain if the count and the basis behind it are.
    response_error : float or None
        Largest |log det| error of the reduced basis behind the count at the frequencies
        checked exactly; None if the count was exact.
    """

    spectrum: Spectrum
    count: Count
    certificate: Certificate
    response_error: float | None

    def __repr__(self) -> str:
        return f"<CertifiedSpectrum: {self.statement} {self.spectrum!r}>"

    @property
    def agrees(self) -> bool:
        """Both routes find the same number, and the count is certain."""
        return self.certificate.agrees

    @property
    def unstable_count(self) -> int:
        """Number by the spectrum; conjugates counted apart."""
        return self.certificate.unstable

    @property
    def unstable_count_independent(self) -> int:
        """Number by the count."""
        return self.certificate.counted

    @property
    def stable(self) -> bool | None:
        """False if any pair listed is unstable by more than rounding, which is proof; True, for the band counted, if
        both routes agree that there is none; else None.
        """
        rounding = 1e-9 * np.abs(self.spectrum.eigenvalues).max(initial=0.0)
        return False if self.spectrum.count_right_of(self.count.line + rounding) else self.certificate.stable

    @property
    def lacks_growth(self) -> bool:
        """True where the basis of the count lacks motions in which the structure gains energy, as finer ones do."""
        unsure = self.count.certain and not self.certificate.certain
        return unsure and self.response_error is not None and self.response_error < OPTIONS.trusted

    @property
    def statement(self) -> str:
        """The verdict in a sentence."""
        said = self.certificate.statement
        if self.agrees:
            return self.certificate.beside(self.spectrum.count_right_of(self.count.line) - self.unstable_count)
        if not self.count.certain:
            return f"{said} {' '.join(self.count.notes)}"
        if self.lacks_growth:
            return f"{said} The structure gains energy in motions that the reduced basis behind that count lacks."
        if not self.certificate.certain:
            return f"{said} The reduced basis behind that count is too coarse (error {self.response_error:.2g})."
        return said


def certified_spectrum(
    pencil: CoupledPencil,
    count: int,
    options: SearchOptions | None = None,
    *,
    workspace: Workspace | None = None,
    basis: TransferBasis | None = None,
    whole: bool = True,
    dense: int = OPTIONS.dense,
    solver: Callable[..., KrylovPairs] = krylov_pairs,
) -> CertifiedSpectrum:
    """Leading modes and an independent count of the unstable ones, with their agreement.

    Parameters
    ----------
    pencil, count, options, workspace, solver
        As for `leading_modes`.
    basis : TransferBasis, optional
        For the count of a large pencil; made if missing.
    whole : bool
        Count over all frequencies, also where a band was asked for; without, in that band alone where both routes agree
        there. A lightly damped wall has very many modes to pass beyond it.
    dense : int
        Unknowns beyond which a count is made on a basis.

    Notes
    -----
    Where the basis leaves the count open, it is made finer by the vectors of the spectrum, then by exact responses at
    the frequencies of the check before, and compared at other frequencies each time.

    Returns
    -------
    CertifiedSpectrum
    """
    options = options or SearchOptions()
    workspace = workspace or Workspace()
    search = partial(leading_modes, pencil, workspace=workspace, solver=solver)
    spectrum = search(count, options)
    basis = (basis or TransferBasis(pencil, workspace=workspace)) if pencil.n > dense else None
    asked = pencil, options, search, workspace
    if not whole and options.max_frequency is not None and np.isfinite(spectrum.band):
        found, _ = _judged(*asked, spectrum, basis, within=options.inside * spectrum.band)
        if found.agrees:
            return found
    found, basis = _judged(*asked, spectrum, basis)
    for finer in range(1, OPTIONS.finer + 1):
        if found.agrees or basis is None or found.lacks_growth:
            break
        basis = _finer(pencil, basis, found, finer, workspace)
        if basis.size > dense:
            break
        found, basis = _judged(*asked, found.spectrum, basis, finer)
    return found


def _finer(pencil, basis, found, finer, workspace) -> TransferBasis:
    """A basis that answers better than the one that left a count open."""
    spectrum = found.spectrum
    if finer == 1 and len(spectrum):  # a mode that is all but neutral has to be met to a fraction of its growth rate
        return basis.enlarged(pencil, *(q for q in (spectrum.q, spectrum.left_q) if q is not None))
    checked = _checks(spectrum, found.count, finer - 1, basis)
    exact = []
    for f in checked:
        factor = workspace.factored(pencil, 2j * np.pi * f)
        exact += [factor.solve(pencil.G.toarray().astype(complex))]
        exact += [factor.solve_transposed(pencil.J.toarray().T.astype(complex))]
    return basis.enlarged(pencil, *exact, compression=OPTIONS.distinct)


def _judged(pencil, options, search, workspace, spectrum, basis, finer=0, within=None):
    """A spectrum beside a count, and the basis of the count; both may grow by what the count points to. The count is
    that of all that is resolved, or `within` a band, Hz.
    """
    model, scale = pencil, None
    if basis is not None:
        model, scale = pencil.projected(basis.V), 2 * np.pi * (float(basis.structural_frequencies[0]) or 1.0)

    def counted(band=None):
        # a structure that loses stability by itself has very many modes beyond a band that hardly decay
        beyond = band is None and np.isfinite(spectrum.band) and model is not pencil
        most = {"max_points": OPTIONS.points_beyond} if beyond else {}
        end = options.whole if band is None else band
        return unstable_count(model, scale=scale, hints=spectrum.eigenvalues, band=end, **most)

    winding = counted(within)
    if (
        winding.number > listed_unstable(spectrum, winding)
        and len(spectrum)
        and spectrum.growth_rate[-1] > winding.line
        and np.isinf(spectrum.band)
    ):
        # all that were asked for are unstable: look at the rest of the unstable ones too
        spectrum = search(winding.number + 2, options)
    if winding.number > listed_unstable(spectrum, winding):
        distant = missing_pairs(pencil, spectrum, basis, winding.line, options, workspace)
        if distant is not None:
            spectrum = joined(pencil, spectrum, distant, winding.line)
            if basis is not None:
                basis = basis.enlarged(pencil, distant.q)
                model = pencil.projected(basis.V)
            winding = counted()
    settled = winding.certain and winding.number == listed_unstable(spectrum, winding)
    if not settled and np.isfinite(spectrum.band):
        # the spectrum, and the basis, speak for a band only; count in the same
        winding = counted(band=options.inside * spectrum.band)
        none_stable = not len(spectrum) or spectrum.growth_rate[-1] > winding.line
        if winding.number > listed_unstable(spectrum, winding) and none_stable:
            spectrum = search(winding.number + 2, replace(options, max_frequency=spectrum.band))
    listed = listed_unstable(spectrum, winding)
    error = None
    if model is not pencil:
        error = response_error(pencil, model, _checks(spectrum, winding, finer, basis), workspace)
    trusted = winding.certain and (error is None or (error < OPTIONS.trusted and basis.holds_what_grows(pencil)))
    certificate = Certificate(listed, winding.number, trusted, winding.line, winding.band)
    return CertifiedSpectrum(spectrum, winding, certificate, error), basis


def listed_unstable(spectrum: Spectrum, count: Count) -> int:
    """Number of eigenvalues of a spectrum in the region of a count, conjugates counted apart."""
    return number_right_of(spectrum.eigenvalues, count.line, count.band)


def response_error(
    pencil: CoupledPencil, reduced: CoupledPencil, frequencies: Sequence[float], workspace: Workspace | None = None
) -> float:
    """Largest error of log det of the condensed pencil made by a reduced one, at i 2 pi f."""
    workspace = workspace or Workspace()
    worst, small, forces = 0.0, StructureMatrices(reduced), reduced.G.toarray()
    for f in frequencies if pencil.m else ():
        s = 2j * np.pi * f
        exact = workspace.factored(pencil, s).solve(pencil.G.toarray().astype(complex))
        coupling, _ = pencil.fluid.condensed([s])
        other = np.linalg.solve(small.matrix(s).toarray(), forces)
        both = [np.eye(pencil.m) - coupling[0] @ H for H in (real_apply(pencil.J, exact), reduced.J @ other)]
        ratio = np.linalg.det(np.linalg.solve(*both))
        worst = max(worst, float(abs(np.log(ratio))) if ratio != 0 else np.inf)
    return worst


def _checks(spectrum, winding, finer, basis):
    """Frequencies to compare at: those of the leading modes, where the count is decided; for a finer basis, which is
    made for those, others each time from somewhat below the list to somewhat above it.
    """
    listed = [f for f in spectrum.frequency if 0 < f <= winding.band]
    if not finer:
        return listed[: OPTIONS.checked] or list(winding.frequencies[1:2])
    listed = listed or list(basis.structural_frequencies[basis.structural_frequencies > 0]) or winding.frequencies[1:2]
    low, high = 0.7 * min(listed), min(1.4 * max(listed), winding.band)
    places = (np.arange((finer - 1) * OPTIONS.checked, finer * OPTIONS.checked) + 1) * GOLDEN % 1.0
    return list(low * (high / low) ** places)
