"""Search for the leading eigenpairs of a pencil: shifts, merging, verification, completeness."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from .factor import SingularShiftError, Workspace, real_if_real
from .krylov import KrylovPairs, krylov_pairs
from .operator import CoupledPencil, apart_from_creep
from .pairs import Found, all_pairs, attach_left, biorthogonalise, empty, merge, polish, refine, upper_half, verified
from .spectrum import CLEAR, END, LOWEST, SLOPE, Oval, SearchOptions, Spectrum

DEPTH = 0.4  # growth rate over angular frequency, down to which a band is searched at most


def band_sought(options) -> float:
    """Upper end of the band sought, rad/s."""
    return np.inf if options.max_frequency is None else 2 * np.pi * options.max_frequency


def number_in_band(found, options) -> int:
    """Eigenvalues found up to the end of the band."""
    return int(np.sum(found.eigenvalues.imag <= band_sought(options)))


def would_do(values, ovals: list[Oval], found, aim, options) -> bool:
    """True where eigenvalues that have converged in some discs are all that is asked for."""
    apart = values[apart_from_limit(values, options) & (values.imag >= -1e-11 * np.abs(values))]
    trial = Found(apart, *(np.zeros(0),) * 4, lowest=found.lowest, slope=found.slope)
    trial.ovals |= {oval.shift: oval for oval in ovals}
    return is_covered(trial, aim, options)


def apart_from_limit(values, options) -> np.ndarray:
    """Mask of eigenvalues that do not belong to those that crowd around the limit point."""
    if options.limit_point is None:
        return np.ones(values.size, bool)
    return np.abs(values - options.limit_point) > 0.05 * abs(options.limit_point)


def leading_band(found, aim, options) -> tuple[float, float]:
    """Growth rate of the last of the leading modes, and the band that holds them, rad/s."""
    values = found.eigenvalues
    if options.limit_point is not None:
        floor = CLEAR * options.limit_point
        values = values[values.real > floor]
        growth = np.sort(values.real)[::-1]
        band = min(band_sought(options), float(values.imag.max(initial=0.0)))
        return float(growth[aim - 1]) if growth.size >= aim else floor, band
    if options.max_frequency is not None:
        band = 2 * np.pi * options.max_frequency
        values = values[values.imag <= band * (1 + 1e-12)]
        growth = np.sort(values.real)[::-1]
        return (growth[min(aim, growth.size) - 1] if growth.size else -np.inf), band
    if not values.size:
        return -np.inf, np.inf
    least = 2 * np.pi * options.covered
    if not found.everything:
        covered = _widest_covered(found, aim, least)
        if covered is not None:
            return covered
    order = np.argsort(-values.real)[:aim]
    return float(values.real[order].min()), max(float(values.imag[order].max()), least)


def _widest_covered(found, aim, least) -> tuple[float, float] | None:
    """The widest band, no narrower than the least, rad/s, whose leading modes the region covers, with the growth rate
    of the last.
    """
    region = found.region
    tops = np.unique(np.maximum(found.eigenvalues.imag, least))[::-1]
    for band in tops[:: max(1, tops.size // 60)]:
        growth = np.sort(found.eigenvalues.real[found.eigenvalues.imag <= band])[::-1]
        if growth.size < aim:
            return None
        low, high = region.complete_between(float(band), samples=100)
        if low <= growth[aim - 1] and high > 0:
            return float(growth[aim - 1]), float(band)
    return None


def is_covered(found, aim, options) -> bool:
    """True where the leading modes asked for are known to be the leading ones."""
    if found.everything:
        return True
    growth, band = leading_band(found, aim, options)
    low, high = found.region.complete_between(band)
    inside = found.eigenvalues.imag <= band * (1 + 1e-12)
    if options.limit_point is None and inside.sum() < aim:
        # a band may hold fewer: enough if it is searched down to strongly damped modes
        return options.max_frequency is not None and low <= -DEPTH * band and high > 0
    return low <= growth and high > 0


def plan_shifts(pencil, count, options, workspace):
    """First shift, and whether a limit point of eigenvalues is near enough to matter."""
    if options.shifts is not None:
        return options, None
    if pencil.relaxation is not None:
        # all from the lowest frequency to the highest lie as high above the real axis of 1 / (lambda - shift)
        lowest = lowest_sought(pencil, count, options, workspace)
        highest = lowest / LOWEST if options.max_frequency is None else 2 * np.pi * options.max_frequency
        return options, 0.9 * np.sqrt(lowest * highest)
    first = first_shift(pencil, max(count, options.least), options, workspace)
    if options.limit_point is None:
        return options, first
    beside = 1.5 * abs(options.limit_point)
    if beside < first:
        return options, beside
    return replace(options, limit_point=None), first


def holding_shift(options, growth) -> float:
    """Real shift whose disc up to the limit point holds the band asked for down to a growth rate; 0 without a band."""
    if options.max_frequency is None:
        return 0.0
    end, band = END * abs(options.limit_point), band_sought(options)
    return 0.5 * (band**2 + growth**2 - end**2) / max(end + growth, 1e-3 * end)


def lowest_sought(pencil, count, options, workspace) -> float:
    """Angular frequency above which a search where the stiffness relaxes has to be complete, rad/s."""
    return options.slowest or LOWEST * first_shift(pencil, max(count, options.least), options, workspace)


def first_shift(pencil, aim, options, workspace) -> float:
    """A positive real shift of the size of the frequencies sought."""
    if options.max_frequency is not None:
        # close to the band its eigenvalues lie well apart; next to a limit point the disc has to stay flat
        return (0.75 if options.limit_point is None else 1.5) * 2 * np.pi * options.max_frequency
    typical = pencil.typical_frequency
    lowest = probe = 1e-3 * typical
    for _ in range(3):  # inverse power iteration on the structure with M at the shift
        try:
            factor = workspace.factored(pencil, probe)
        except SingularShiftError:
            probe *= 1.37
            continue
        x = np.random.default_rng(3).standard_normal(pencil.n)
        for _ in range(6):
            x = factor.solve(pencil.M @ x).real
            size = np.linalg.norm(x)
            if not (np.isfinite(size) and size > 0):
                return probe
            x /= size
        lowest = size**-0.5
        # with the shift small against the frequency the estimate holds
        if lowest > 2 * probe or probe < 1e-6 * typical:
            break
        probe *= 0.05
    return max(lowest, probe) * max(3.0, 1.0 * aim)


def next_shift(pencil, found, aim, options, workspace) -> complex:
    """The natural real shift where the band was far off, then complex ones up the band.

    Where nothing converged the spectrum is dense as seen from afar, as heavy fluids make it: go closer.
    """
    if pencil.relaxation is not None:
        return found.shifts[0] * (2.5, 0.4)[len(found.shifts) % 2] ** ((len(found.shifts) + 1) // 2)
    if not found.eigenvalues.size and all(isinstance(s, float) for s in found.shifts):
        closer = min(found.shifts) / 3.0
        if options.max_frequency is None:
            return closer
        return min(closer, first_shift(pencil, aim, replace(options, max_frequency=None), workspace))
    if options.max_frequency is not None and len(found.shifts) == 1:
        natural = first_shift(pencil, aim, replace(options, max_frequency=None), workspace)
        if natural < 0.75 * 2 * np.pi * options.max_frequency:
            return natural
    if options.limit_point is not None:  # a larger disc hugs the line through the limit point
        last, needed = max(abs(s) for s in found.shifts), holding_shift(options, leading_band(found, aim, options)[0])
        if not needed:
            return 3.0 * last
        return float(np.clip(1.25 * needed, 1.25 * last, 2.0 * last))
    if options.max_frequency is not None:
        band = 2 * np.pi * options.max_frequency
    else:
        band = max(leading_band(found, aim, options)[1], abs(found.shifts[0]))
    step = len([s for s in found.shifts if isinstance(s, complex)])
    height = band * (1.0, 0.5, 0.75, 0.25)[step % 4]
    return complex(0.3 * band, height)


def leading_modes(
    pencil: CoupledPencil,
    count: int,
    options: SearchOptions | None = None,
    *,
    workspace: Workspace | None = None,
    solver: Callable[..., KrylovPairs] = krylov_pairs,
) -> Spectrum:
    """The eigenpairs of largest growth rate, each verified on the full pencil.

    Parameters
    ----------
    pencil : CoupledPencil
    count : int
        Number of modes; a conjugate pair is one mode.
    options : SearchOptions, optional
    workspace : Workspace, optional
        Keeps the symbolic factorisation between pencils of one pattern.
    solver : callable
        Eigenpairs near a shift, with the arguments and values of `eigen.krylov_pairs`.

    Returns
    -------
    Spectrum
        Pairs that fail the residual test, also after Newton steps, are left out and counted.
        `status` is "incomplete", with a note, if fewer than asked are certified as leading.

    Raises
    ------
    ValueError
        If count is not positive.
    SingularShiftError
        If no usable shift was found.

    Examples
    --------
    >>> import numpy as np
    >>> pencil = CoupledPencil(M=np.eye(2), C=0.1 * np.eye(2), K=np.diag([1.0, 4.0]))
    >>> modes = leading_modes(pencil, 2)
    >>> np.round(modes.growth_rate, 6)
    array([-0.05, -0.05])
    >>> modes.status
    'complete'
    """
    if count < 1:
        raise ValueError("The number of modes asked for must be at least 1.")
    options = options or SearchOptions()
    workspace = workspace or Workspace()
    dense = options.method == "dense" or (options.method == "auto" and pencil.order <= options.dense_below)
    if dense:
        return _result(pencil, _dense(pencil, count, options, workspace), count, options)
    options, first = plan_shifts(pencil, count, options, workspace)
    return _result(pencil, _search(pencil, count, options, workspace, first, solver), count, options)


def _search(pencil, count, options, workspace, first, solver) -> Found:
    found = empty(pencil, options.left)
    if pencil.relaxation is not None:
        found.lowest, found.slope = lowest_sought(pencil, count, options, workspace), SLOPE
    aim = max(count, options.least)
    pairs = int(2.4 * aim) + 4
    given = options.shifts is not None
    queue = list(options.shifts) if given else [first]
    while queue:
        shift = queue.pop(0)
        before = number_in_band(found, options)
        _at_shift(pencil, shift, pairs, aim, options, workspace, found, solver)
        fresh = number_in_band(found, options) - before
        if found.everything or (is_covered(found, aim, options) and not given):
            break
        if not queue and not given and len(found.shifts) < options.max_shifts:
            if options.max_frequency is not None and found.eigenvalues.size and fresh == 0 and len(found.shifts) > 1:
                break  # the band holds no more within reach
            queue = [next_shift(pencil, found, aim, options, workspace)]
    return found


def _at_shift(pencil, shift, wanted, aim, options, workspace, found, solver) -> None:
    """Search near one shift and merge."""
    relaxing = pencil.relaxation is not None
    asked = {"limit_point": options.limit_point}

    def enough(values, reach, beside):
        return would_do(values, _ovals(shift, reach, beside, relaxing), found, aim, options)

    def search(shifted):
        asked_for = enough if relaxing or not options.shifts else None
        return solver(shifted, wanted, band=band_sought(options), enough=asked_for, **asked)

    shift, shifted, pairs = _clear_of_eigenvalues(pencil, shift, workspace, found, search)
    found.shifts.append(shift)
    found.applications += pairs.applications
    apart = apart_from_limit(pairs.eigenvalues, options) & apart_from_creep(pencil, pairs.eigenvalues)
    batch = verified(
        pencil, *upper_half(pairs.eigenvalues[apart], pairs.vectors_q[:, apart], pairs.vectors_u[:, apart])
    )
    polish(pencil, shifted, batch, options.tolerance)
    dropped = refine(pencil, batch, aim, band_sought(options), options.tolerance, found)
    if options.left:

        def transposed(enough):
            return solver(shifted, wanted, transposed=True, enough=enough, **asked)

        attach_left(pencil, batch, transposed, found)
    merge(found, batch)
    reach = min([pairs.reach * (1 + 1e-9)] + [(1 - 1e-6) * _reach_to(d, shift, relaxing) for d in dropped])
    beside = min([pairs.beside * (1 + 1e-9)] + [(1 - 1e-6) * _reach_to(d, shift, True) for d in dropped])
    found.ovals |= {oval.shift: oval for oval in _ovals(shift, reach, beside, relaxing)}
    found.everything = found.everything or (pairs.exhausted and not dropped.size)


def _ovals(shift, reach, beside, relaxing) -> list[Oval]:
    """Discs in which all eigenvalues are known after a search at a shift."""
    if relaxing and not isinstance(shift, complex):
        reach, beside = 0.0, reach
    discs = Oval(shift, reach), Oval(complex(shift.real, beside), beside)
    return [disc for disc in discs if disc.reach > 0]


def _reach_to(place, shift, relaxing) -> float:
    """Reach of the disc that ends at a place."""
    distance = abs(place - shift)
    if not relaxing or isinstance(shift, complex):
        return distance
    high = abs(np.imag(place))  # the disc touches the real axis at the shift
    return distance**2 / (2 * high) if high else np.inf


def _clear_of_eigenvalues(pencil, shift, workspace, found, search):
    """Factor at the shift, moved aside if it sits on an eigenvalue."""
    shift = real_if_real(shift)
    unit = abs(shift) or 1.0
    for attempt in range(4):
        moved = shift + 1e-3 * unit * attempt * (1 + 0.7 * attempt)
        try:
            shifted = workspace.shifted(pencil, moved)
        except SingularShiftError:
            continue
        pairs = search(shifted)
        nearest = np.abs(pairs.eigenvalues - moved).min(initial=np.inf)
        if nearest > 1e-9 * unit:
            if attempt:
                found.notes.append(f"The shift {shift:.6g} sits on an eigenvalue; {moved:.6g} was used instead.")
            return moved, shifted, pairs
    raise SingularShiftError(
        f"No usable shift was found near {shift:.6g}: the pencil is singular there, and perhaps everywhere."
    )


def _dense(pencil, count, options, workspace) -> Found:
    """Every eigenvalue at once, verified and refined like any other."""
    values, q, u, w, W = all_pairs(pencil, left=options.left)
    found = empty(pencil, options.left)
    if pencil.relaxation is not None:
        apart = apart_from_creep(pencil, values)
        values, q, u, w, W = (None if a is None else a[..., apart] for a in (values, q, u, w, W))
    batch = verified(pencil, values, q, u)
    if options.left:
        batch.left_q, batch.left_u = w, W
    # only pairs that may be asked for are worth a Newton step
    dropped = refine(pencil, batch, max(count, options.least), band_sought(options), options.tolerance, found)
    merge(found, batch)
    found.everything = not dropped.size
    if dropped.size:
        found.ovals[0.0] = Oval(0.0, float(np.abs(dropped).min()))
    return found


def _result(pencil, found: Found, count, options) -> Spectrum:
    """Sort, cut to the number asked for, and say what is certified."""
    region = found.region
    _, band = leading_band(found, max(count, options.least), options)
    inside = np.flatnonzero(found.eigenvalues.imag <= band * (1 + 1e-12))
    order = inside[by_growth(found.eigenvalues[inside])]
    if options.limit_point is not None:
        order = order[found.eigenvalues.real[order] > CLEAR * options.limit_point]
    order = order[:count]
    if options.limit_point is not None and options.max_frequency is None and order.size:
        band = float(found.eigenvalues.imag[order].max())
    low, high = region.complete_between(band)
    notes = list(found.notes)
    growth = found.eigenvalues.real[order]
    certified = int(np.sum(growth >= low))
    all_there_are = found.everything and order.size == int(np.sum(found.eigenvalues.imag <= band * (1 + 1e-12)))
    complete = certified == order.size and (order.size >= count or all_there_are)
    if options.limit_point is not None and order.size < count:
        complete = certified == order.size and low <= CLEAR * options.limit_point
        notes.append(
            f"{order.size} modes have growth rates above {CLEAR * options.limit_point:.6g} 1/s. "
            f"Infinitely many eigenvalues accumulate at {options.limit_point:.6g} 1/s, so no "
            f"list of leading modes goes on from there to the {count} asked for."
        )
    elif order.size < count:
        searched = options.max_frequency is not None and low < np.inf
        where = _within(found, options, low) if searched and not all_there_are else ""
        notes.append(
            f"{count} modes were asked for, {order.size} were found{where}"
            + ("; there are no more." if all_there_are or where else ".")
        )
    if certified < order.size:
        notes.append(
            f"Only the first {certified} modes are certified as leading; below a growth "
            f"rate of {low:.6g} 1/s the search is not complete up to "
            f"{band / (2 * np.pi):.6g} Hz."
        )
    spectrum = Spectrum(
        **{name: getattr(found, name)[..., order] for name in found.parts},
        asked=count,
        status="complete" if complete else "incomplete",
        complete_above=low,
        complete_below=high,
        band=np.inf if found.everything and options.max_frequency is None else band / (2 * np.pi),
        region=region,
        shifts=tuple(found.shifts),
        applications=found.applications,
        refined=found.refined,
        rejected=found.rejected,
        notes=tuple(notes),
    )
    return with_left(pencil, spectrum) if options.left else spectrum


def _within(found, options, low) -> str:
    """The part of a band that was searched, in words."""
    if not found.lowest:
        return f" up to {options.max_frequency:.6g} Hz with a growth rate above {low:.6g} 1/s"
    growth = f"a growth rate above {low:.6g} 1/s and " if np.isfinite(low) else ""
    return (
        f" between {found.lowest / (2 * np.pi):.3g} and {options.max_frequency:.6g} Hz with {growth}"
        f"a damping ratio below {found.slope / np.hypot(1.0, found.slope):.2g}"
    )


def by_growth(values):
    """Largest growth rate first; of those that differ by rounding only, as without damping, the lowest frequency."""
    unit = 1e-9 * np.abs(values).max(initial=0.0) or 1.0
    return np.lexsort((-values.real, values.imag, -np.round(values.real / unit)))


def with_left(pencil, spectrum) -> Spectrum:
    """The spectrum with its left vectors scaled."""
    vectors = spectrum.q, spectrum.u, spectrum.left_q, spectrum.left_u
    w, W, error, defective = biorthogonalise(pencil, spectrum.eigenvalues, *vectors)
    notes = spectrum.notes
    if defective:
        which = ", ".join(f"{spectrum.eigenvalues[i]:.6g}" for i in defective)
        notes += (f"The eigenvalues {which} are defective or nearly so; their left vectors are not scaled.",)
    return replace(spectrum, left_q=w, left_u=W, biorthogonality=error, notes=notes)
