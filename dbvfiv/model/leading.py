"""Rule for the leading modes of the valve, shared by every study that searches a spectrum."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np

from eigen.spectrum import CLEAR, LOWEST, SearchOptions

from ..case.model import Case
from ..case.parameters import Mu
from ..texts import digits

#: Room above the highest structural frequency that a band is made for, and the least of these that it holds.
ROOM, LEAST_MODES = 1.05, 10
#: What is left out of lists of modes where materials relax.
CREEP = (
    "Materials with loss factors creep: after a push a part of the deflection dies out slowly, without swinging. Such "
    "motions are not listed as modes unless they grow, or are about to."
)


class BandOrigin(Enum):
    """Origin of the frequency band that a search covers."""

    NONE = "none"  #: no band: stiffness damping orders the modes
    ASKED = "asked"  #: named by who asks
    STRUCTURE = "structure"  #: holds as many structural frequencies as modes are wanted
    LINE = "line"  #: what the elements of an elastic line resolve, or the rows of the mesh in a compressed fluid


@dataclass(frozen=True)
class LeadingSearch:
    """Search for the leading modes under given conditions."""

    options: SearchOptions  #: For `eigen.leading_modes` and `eigen.certified_spectrum`.
    origin: BandOrigin
    frequencies: int = 0  #: Structural frequencies in vacuo that a band of the origin STRUCTURE holds.
    creeps: bool = False  #: True for viscoelastic materials, whose relaxation spectrum has to be told from modes.
    #: Hz; frequency up to which the search is a verdict on the state: the band, or without one a band that holds as
    #: many structural frequencies as modes are wanted. Reduced-order models resolve no modes above it, whatever they
    #: count.
    claimed: float = np.inf
    wanted: float = np.inf  #: Hz; frequency up to which modes are wanted; infinite where nothing says so.

    @property
    def band(self) -> float:
        """Upper end of the band, Hz; infinite without one."""
        return np.inf if self.options.max_frequency is None else self.options.max_frequency

    @property
    def floor(self) -> float:
        """Growth rate down to which modes can be listed, 1/s; minus infinity without a limit point."""
        return -np.inf if self.options.limit_point is None else CLEAR * self.options.limit_point

    @property
    def end_key(self) -> str:
        """Key of the case that moves the end of the band."""
        return "upstream.elements or mesh.along" if self.origin is BandOrigin.LINE else "modes.max_frequency"

    @property
    def note(self) -> str | None:
        """Sentence on the origin and limits of the band, for the reader of a result; None where it needs none."""
        if self.origin is BandOrigin.LINE:
            said = (
                f"The elements of the line, or the rows of the mesh in a fluid that is compressed, resolve waves up to "
                f"{digits(self.band, 4)} Hz, so the search covers the band up to there; {self.end_key} moves its end"
            )
            if self.band < self.wanted < np.inf:
                many = f"{self.wanted / self.band:.3g} times as many"
                said += f", {many} to the {digits(self.wanted, 4)} Hz that were wanted"
            return f"{said}."
        if self.origin is not BandOrigin.STRUCTURE:
            return None
        why = "Loss factors damp all frequencies alike and" if self.creeps else "Without stiffness damping"
        return (
            f"{why} growth rates do not order the modes, so the search covers the band up "
            f"to {digits(self.band, 4)} Hz, which holds {self.frequencies} structural frequencies in vacuo; "
            f"modes.max_frequency chooses another."
        )

    def left_open(self, band: float, growing: Iterable[complex] = ()) -> str:
        """Sentence on a state that is stable up to a frequency, Hz, where a count finds more above it, with the
        growing pairs that were found there, 1/s.
        """
        found = sorted((value for value in growing if value.imag > 0), key=lambda value: -value.real)
        end, said = f"{self.end_key} moves the end", f"Above {digits(band, 4)} Hz the count finds more"
        if not found:
            return f"{said}: modes may be unstable there; {end}."
        which = ", ".join(f"{v.imag / (2 * np.pi):.4g} Hz by {v.real:.3g} 1/s" for v in found[:3])
        if self.origin is BandOrigin.LINE:
            end += f"; {found[0].imag / (2 * np.pi * self.band):.3g} times as far reaches the first of them"
        return f"{said}: modes grow there as the model has it, {which}; {end}."

    @property
    def notes(self) -> tuple[str, ...]:
        """The note, if there is one, and what a reader has to know about creep."""
        return (() if self.note is None else (self.note,)) + ((CREEP,) if self.creeps else ())


def other_end(case: Case) -> str:
    """Clause on the keys of a case that move the end of its bands."""
    waves = (
        ", upstream.elements or mesh.along that of the waves resolved" if case.has_waves or case.is_compressed else ""
    )
    return f"modes.max_frequency chooses another end{waves}"


def limit_point(beta: float) -> float | None:
    """Growth rate at which infinitely many eigenvalues accumulate under stiffness damping, 1/s; None without it."""
    return -1.0 / beta if beta > 0 else None


def growth_floor(beta: float) -> float:
    """Growth rate down to which modes can be listed, clear of the limit point, 1/s; minus infinity without damping."""
    limit = limit_point(beta)
    return -np.inf if limit is None else CLEAR * limit


def select_search(
    options: SearchOptions,
    mu: Mu,
    structural_frequencies: Callable[[int], np.ndarray],
    count: int,
    resolved: float = np.inf,
) -> LeadingSearch:
    """Search for the leading modes of a state, with its limit point or frequency band.

    Stiffness damping orders modes by frequency until they reach the limit point -1/beta: leading modes are those of
    largest growth rate, right of it. Without it growth rates of high modes do not fall, so that "leading" has a meaning
    within a band of frequencies only: the one asked for, or one that holds as many structural frequencies in vacuo as
    modes are wanted. Loss factors do not order modes either: slow motions shade off into relaxation, and the lower end
    of the search goes by the first structural frequencies, however wide the band. A band that was asked for is
    respected under any damping.

    Parameters
    ----------
    options : SearchOptions
        Search options as asked for.
    mu : Mu
        Only the stiffness damping and the factor on the loss factors matter.
    structural_frequencies : callable
        From a number to that many lowest frequencies of the undamped structure in vacuo at the state, Hz, ascending;
        fewer where there are no more; not called where a band was asked for without loss factors.
        `eigen.lowest_frequencies` computes them.
    count : int
        Modes wanted, a conjugate pair being one.
    resolved : float
        Frequency, Hz, up to which the fluid's own waves are resolved; nothing is searched beyond it.

    Returns
    -------
    LeadingSearch

    Examples
    --------
    >>> found = select_search(SearchOptions(), Mu(density=10.0), lambda n: np.array([14.0, 20.0]), 2)
    >>> round(found.band, 6), found.origin.value
    (21.0, 'structure')
    >>> select_search(SearchOptions(), Mu(density=10.0, beta=0.003), lambda n: np.zeros(0), 2).options.limit_point
    -333.3333333333333
    """
    found = _select(options, mu, structural_frequencies, count)
    wanted = min(found.claimed, found.band)
    if resolved >= wanted:  # what is wanted is resolved, and nothing above the waves that are
        found = replace(found, options=replace(found.options, resolved=resolved))
    if found.band > resolved:
        found = replace(found, options=replace(found.options, max_frequency=resolved), origin=BandOrigin.LINE)
    if found.creeps and np.isfinite(found.band):
        first = ROOM * np.asarray(structural_frequencies(LEAST_MODES), float)[:LEAST_MODES].max(initial=0.0)
        if 0 < first < found.band:
            found = replace(found, options=replace(found.options, lowest=LOWEST * first))
    return replace(found, claimed=min(wanted, resolved), wanted=wanted)


def _select(options: SearchOptions, mu: Mu, structural_frequencies, count: int) -> LeadingSearch:
    """As `select_search`, whatever is resolved."""
    asked = BandOrigin.NONE if options.max_frequency is None else BandOrigin.ASKED
    creeps = mu.loss_factor > 0
    limit = None if creeps else limit_point(mu.beta)
    if asked is BandOrigin.ASKED:
        options = options if limit is None else replace(options, limit_point=limit)
        return LeadingSearch(options, asked, creeps=creeps)
    known = np.asarray(structural_frequencies(count), float)[:count]
    highest = float(known.max(initial=0.0))
    if limit is not None:
        claimed = ROOM * highest if highest > 0 else np.inf
        options = replace(options, limit_point=limit, covered=claimed if highest > 0 else 0.0)
        return LeadingSearch(options, asked, claimed=claimed)
    if not highest > 0:
        return LeadingSearch(options, asked, creeps=creeps)  # nothing oscillates: any band would be arbitrary
    return LeadingSearch(replace(options, max_frequency=ROOM * highest), BandOrigin.STRUCTURE, len(known), creeps)
