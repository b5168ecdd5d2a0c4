"""Leading eigenpairs of a pencil: shifts, merging, verification, completeness."""
from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg as la

from .condensation import ShiftedPencil, Workspace
from .factorization import SingularShiftError, petsc_is_complex
from .krylov import KrylovPairs, near_shift
from .left import biorthogonalise
from .options import SearchOptions
from .pencil import CoupledPencil
from .region import Oval, SearchedRegion
from .residual import Residuals, acceptable, derivative_times, factored_beside, newton
from .spectrum import Spectrum

SAME = 1e-6  # relative distance below which two shifts are taken to have found one eigenvalue


DEPTH = 0.4  # growth rate over angular frequency, down to which a band is searched at most


@dataclass
class _Found:
    """Pairs collected so far, upper half-plane."""

    values: np.ndarray
    q: np.ndarray
    u: np.ndarray
    residual: np.ndarray
    backward: np.ndarray
    left_q: np.ndarray | None = None
    left_u: np.ndarray | None = None
    ovals: dict[complex, Oval] = field(default_factory=dict)
    everything: bool = False
    shifts: list[complex] = field(default_factory=list)
    applications: int = 0
    refined: int = 0
    rejected: int = 0
    stalled: bool = False
    notes: list[str] = field(default_factory=list)


def leading_modes(pencil: CoupledPencil, count: int, options: SearchOptions | None = None,
                  *, workspace: Workspace | None = None) -> Spectrum:
    """The eigenpairs of largest growth rate, each verified on the full pencil.

    Parameters
    ----------
    pencil : CoupledPencil
    count : int
        Number of modes; a conjugate pair is one mode.
    options : SearchOptions, optional
    workspace : Workspace, optional
        Keeps the symbolic factorisation between pencils of one pattern.

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
    dense = options.method == "dense" or (options.method == "auto"
                                          and pencil.order <= options.dense_below)
    found = (_dense if dense else _search)(pencil, count, options, workspace)
    return _result(pencil, found, count, options)


def _search(pencil, count, options, workspace) -> _Found:
    found = _empty(pencil, options)
    aim = max(count, options.least)
    pairs = min(2 * aim + 4, options.max_pairs)
    given = options.shifts is not None
    queue = list(options.shifts) if given else [_first_shift(pencil, aim, options, workspace)]
    while queue:
        shift = queue.pop(0)
        wanted = pairs
        before = _in_band(found, options)
        while True:
            got = _at_shift(pencil, shift, wanted, aim, options, workspace, found)
            if found.everything or queue or _is_covered(found, aim, options):
                break
            if got < wanted or wanted >= min(options.max_pairs, pencil.order):
                break
            wanted = min(int(1.6 * wanted) + 2, options.max_pairs)
        fresh = _in_band(found, options) - before
        if found.everything or (_is_covered(found, aim, options) and not given):
            break
        if not queue and not given and len(found.shifts) < options.max_shifts:
            if options.max_frequency is not None and fresh == 0 and len(found.shifts) > 1:
                break  # the band holds no more within reach
            queue = [_next_shift(found, aim, options)]
    return found


def _in_band(found, options) -> int:
    band = np.inf if options.max_frequency is None else 2 * np.pi * options.max_frequency
    return int(np.sum(found.values.imag <= band))


def _at_shift(pencil, shift, wanted, aim, options, workspace, found) -> int:
    """Search near one shift and merge; returns the number of eigenvalues that converged."""
    shift, shifted, pairs = _clear_of_eigenvalues(pencil, shift, wanted, options, workspace, found)
    found.shifts.append(shift)
    found.applications += pairs.applications
    batch = _batch(pencil, *_upper(pairs.eigenvalues, pairs.vectors_q, pairs.vectors_u))
    _polish(pencil, shifted, batch, options)
    dropped = _refine(pencil, batch, aim, options, found)
    if options.left:
        _attach_left(pencil, shifted, batch, wanted, options, found)
    _merge(found, batch)
    paired = isinstance(shift, complex) and not petsc_is_complex()
    mirror = np.conj(shift) if paired else shift
    reach = min([pairs.reach * (1 + 1e-9)]
                + [(1 - 1e-6) * np.sqrt(abs(d - shift) * abs(d - mirror)) for d in dropped])
    if reach > 0:
        found.ovals[shift] = Oval(shift, reach, paired)
    found.everything = found.everything or (pairs.exhausted and not dropped.size)
    return pairs.eigenvalues.size


def _clear_of_eigenvalues(pencil, shift, wanted, options, workspace, found):
    """Factor at the shift, moved aside if it sits on an eigenvalue."""
    shift = complex(shift)
    shift = shift.real if shift.imag == 0.0 else shift
    unit = abs(shift) or 1.0
    for attempt in range(4):
        moved = shift + 1e-3 * unit * attempt * (1 + 0.7 * attempt)
        try:
            shifted = workspace.shifted(pencil, moved)
        except SingularShiftError:
            continue
        pairs = near_shift(shifted, wanted, tolerance=options.krylov_tolerance)
        nearest = np.abs(pairs.eigenvalues - moved).min(initial=np.inf)
        if nearest > 1e-9 * unit:
            if attempt:
                found.notes.append(f"The shift {shift:.6g} sits on an eigenvalue; "
                                   f"{moved:.6g} was used instead.")
            return moved, shifted, pairs
    raise SingularShiftError(f"No usable shift was found near {shift:.6g}: the pencil is singular "
                             "there, and perhaps everywhere.")


def _first_shift(pencil, aim, options, workspace) -> float:
    """A positive real shift of the size of the frequencies sought."""
    if options.max_frequency is not None:
        return 1.5 * 2 * np.pi * options.max_frequency
    stiffness, inertia = np.abs(pencil.K.diagonal()), np.abs(pencil.M.diagonal())
    typical = np.sqrt(np.median(stiffness + 1e-300) / np.median(inertia + 1e-300))
    probe = 1e-3 * typical if np.isfinite(typical) and typical > 0 else 1.0
    lowest = probe
    for _ in range(3):  # inverse power iteration on the structure with M at the shift
        try:
            shifted = workspace.shifted(pencil, probe)
        except SingularShiftError:
            probe *= 1.37
            continue
        x = np.random.default_rng(3).standard_normal(pencil.n)
        for _ in range(6):
            x = shifted.factor.solve(pencil.M @ x).real
            size = np.linalg.norm(x)
            if not (np.isfinite(size) and size > 0):
                return probe
            x /= size
        lowest = size ** -0.5
        # with the shift small against the frequency the estimate holds
        if lowest > 2 * probe or probe < 1e-6 * typical:
            break
        probe *= 0.05
    return max(lowest, probe) * max(3.0, 1.0 * aim)


def _next_shift(found, aim, options) -> complex:
    """A complex shift at the upper end of what has been covered."""
    if options.max_frequency is not None:
        band = 2 * np.pi * options.max_frequency
    else:
        band = max(_leading(found, aim, options)[1], abs(found.shifts[0]))
    step = len([s for s in found.shifts if isinstance(s, complex)])
    height = band * (1.0, 0.5, 0.75, 0.25)[step % 4]
    return complex(0.3 * band, height)


def _leading(found, aim, options) -> tuple[float, float]:
    """Growth rate of the last of the leading modes, and the band that holds them, rad/s."""
    values = found.values
    if options.max_frequency is not None:
        band = 2 * np.pi * options.max_frequency
        values = values[values.imag <= band * (1 + 1e-12)]
        growth = np.sort(values.real)[::-1]
        return (growth[min(aim, growth.size) - 1] if growth.size else -np.inf), band
    order = np.argsort(-values.real)[:aim]
    if not order.size:
        return -np.inf, np.inf
    return float(values.real[order].min()), float(values.imag[order].max())


def _is_covered(found, aim, options) -> bool:
    if found.everything:
        return True
    growth, band = _leading(found, aim, options)
    inside = found.values.imag <= band * (1 + 1e-12)
    low, high = SearchedRegion(tuple(found.ovals.values())).complete_between(band)
    if inside.sum() < aim:
        # a band may hold fewer: enough if it is searched down to strongly damped modes
        return options.max_frequency is not None and low <= -DEPTH * band and high > 0
    return low <= growth and high > 0


def _upper(values, q, u):
    """One of each conjugate pair, the imaginary part positive; real ones made real."""
    scale = np.abs(values)
    flat = np.abs(values.imag) <= 1e-11 * scale
    values = np.where(flat, values.real + 0j, values)
    upper = list(np.flatnonzero(values.imag >= 0))
    for i in np.flatnonzero(values.imag < 0):  # a partner that did not converge with it
        mirror = [j for j in upper if abs(values[j] - values[i].conj()) <= SAME * scale[i]
                  and values[j].imag > 0]
        partner_count = np.sum(np.abs(values - values[i]) <= SAME * scale[i])
        if len(mirror) < partner_count:
            values[i] = values[i].conj()
            q[:, i], u[:, i] = q[:, i].conj(), u[:, i].conj()
            upper.append(i)
    return values[upper], q[:, upper], u[:, upper]


def _batch(pencil, values, q, u) -> _Found:
    q, u = _normalised(q, u)
    residual, backward = Residuals(pencil).measure(values, q, u)
    return _Found(values, q, u, residual, backward)


def _normalised(q, u):
    """Unit 2-norm of the structural part, its largest component real and positive."""
    q, u = np.array(q, complex), np.array(u, complex)
    for j in range(q.shape[1]):
        part = q[:, j] if np.linalg.norm(q[:, j]) > 0 else u[:, j]
        largest = part[np.argmax(np.abs(part))] if part.size else 0.0
        if largest == 0:
            continue
        factor = np.abs(largest) / largest / np.linalg.norm(part)
        q[:, j] *= factor
        u[:, j] *= factor
    return q, u


def _polish(pencil, shifted, batch, options) -> None:
    """Residual inverse iteration with the factor at hand for pairs that miss the tolerance.

    x - T(sigma)^-1 T(l) x with l corrected along the way (Neumaier 1985): wipes out what the
    far modes have left in the vector, for the price of two block solves.
    """
    for _ in range(3):
        bad = np.flatnonzero(batch.residual > 0.3 * options.tolerance)
        if not bad.size:
            return
        values, q, u = batch.values[bad], batch.q[:, bad], batch.u[:, bad]
        structure, fluid = pencil.terms(values, q, u)
        dq, du = shifted.solve(sum(structure), sum(fluid))
        eq, eu = shifted.solve(*derivative_times(pencil, values, q, u))
        along = np.sum(q.conj() * eq, axis=0) + np.sum(u.conj() * eu, axis=0)
        step = (np.sum(q.conj() * dq, axis=0) + np.sum(u.conj() * du, axis=0)) / along
        step = np.where(values.imag == 0, step.real, step)
        new = values - step
        q, u = _normalised(q - dq + step * eq, u - du + step * eu)
        residual, backward = Residuals(pencil).measure(new, q, u)
        better = (residual < batch.residual[bad]) & (np.abs(step) < 1e-4 * np.abs(values))
        if not better.any():
            return
        chosen = bad[better]
        batch.values[chosen], batch.residual[chosen] = new[better], residual[better]
        batch.backward[chosen] = backward[better]
        batch.q[:, chosen], batch.u[:, chosen] = q[:, better], u[:, better]


def _refine(pencil, batch, aim, options, found) -> np.ndarray:
    """Newton steps on leading pairs that miss the tolerance; those that still do are dropped.

    Returns
    -------
    ndarray
        Eigenvalues dropped: the search does not vouch for their surroundings.
    """
    good = acceptable(batch.residual, batch.backward, options.tolerance)
    if good.all():
        return np.zeros(0, complex)
    ranked = np.sort(batch.values.real[good])[::-1]
    matters = ranked[aim - 1] if ranked.size >= aim else -np.inf
    workspace = Workspace()
    for i in np.flatnonzero(~good):
        if batch.values[i].real < matters:
            continue
        value, q, u, residual, backward = newton(
            pencil, batch.values[i], batch.q[:, i], batch.u[:, i],
            workspace=workspace, tolerance=options.tolerance)
        moved = abs(value - batch.values[i]) > 1e-3 * abs(batch.values[i])
        if moved or not acceptable(residual, backward, options.tolerance):
            found.rejected += 1
            found.notes.append(f"A pair near {batch.values[i]:.6g} was rejected: its residual "
                               f"{residual:.2g} exceeds the tolerance.")
            continue
        good[i] = True
        batch.values[i], batch.residual[i], batch.backward[i] = value, residual, backward
        batch.q[:, [i]], batch.u[:, [i]] = _normalised(q[:, None], u[:, None])
        found.refined += 1
    dropped = batch.values[~good]
    for name in ("values", "q", "u", "residual", "backward"):
        setattr(batch, name, getattr(batch, name)[..., good])
    return dropped


def _attach_left(pencil, shifted: ShiftedPencil, batch, wanted, options, found) -> None:
    """Left vectors from the same factor, matched by eigenvalue; strays by inverse iteration."""
    k = batch.values.size
    batch.left_q = np.zeros((pencil.n, k), complex)
    batch.left_u = np.zeros((pencil.b, k), complex)
    pairs = near_shift(shifted, wanted, tolerance=options.krylov_tolerance, transposed=True)
    found.applications += pairs.applications
    free = np.ones(pairs.eigenvalues.size, bool)
    workspace = Workspace()
    for i, value in enumerate(batch.values):
        distance = np.where(free, np.abs(pairs.eigenvalues - value), np.inf)
        j = int(np.argmin(distance)) if distance.size else -1
        if j >= 0 and distance[j] <= SAME * abs(value):
            free[j] = False
            w, W = pairs.vectors_q[:, j], pairs.vectors_u[:, j]
        else:
            w, W = left_by_inverse_iteration(pencil, value, workspace)
        # the transposed problem gives w^T T = 0
        batch.left_q[:, i], batch.left_u[:, i] = w.conj(), W.conj()


def left_by_inverse_iteration(pencil, value, workspace):
    """Solution w of w^T T(value) = 0 by two solves with the transpose at the eigenvalue."""
    shifted = factored_beside(pencil, value if value.imag else value.real, workspace)
    if shifted is None:
        raise SingularShiftError(f"The pencil cannot be factored next to {value:.6g}.")
    rng = np.random.default_rng(11)
    w, W = rng.standard_normal(pencil.n) + 0j, rng.standard_normal(pencil.b) + 0j
    for _ in range(3):
        w, W = shifted.solve_transposed(w, W)
        size = np.linalg.norm(w) or np.linalg.norm(W)
        w, W = w / size, W / size
    return w, W


def _merge(found: _Found, batch: _Found) -> None:
    """Add what is new; of an eigenvalue found twice keep the pair of smaller residual."""
    partner = np.full(batch.values.size, -1)
    taken = np.zeros(found.values.size, bool)
    for i in np.argsort(batch.residual):
        distance = np.where(taken, np.inf, np.abs(found.values - batch.values[i]))
        if distance.size and distance.min() <= SAME * abs(batch.values[i]):
            partner[i] = int(np.argmin(distance))
            taken[partner[i]] = True
    names = ["values", "q", "u", "residual", "backward"]
    names += ["left_q", "left_u"] if found.left_q is not None else []
    for i in np.flatnonzero(partner >= 0):
        if batch.residual[i] < found.residual[partner[i]]:
            for name in names:
                getattr(found, name)[..., partner[i]] = getattr(batch, name)[..., i]
    new = partner < 0
    for name in names:
        old = getattr(found, name)
        setattr(found, name, np.concatenate([old, getattr(batch, name)[..., new]], axis=-1))


def _empty(pencil, options) -> _Found:
    def none(rows):
        return np.zeros((rows, 0), complex)

    found = _Found(np.zeros(0, complex), none(pencil.n), none(pencil.b), np.zeros(0), np.zeros(0))
    if options.left:
        found.left_q, found.left_u = none(pencil.n), none(pencil.b)
    return found


def _dense(pencil, count, options, workspace) -> _Found:
    """All finite eigenvalues by the QZ method."""
    found = _empty(pencil, options)
    F, E = pencil.first_order()
    # frequencies in units of their typical size, else infinite eigenvalues are hard to tell
    unit = np.sqrt(_size(pencil.K) / _size(pencil.M)) or 1.0
    n = pencil.n
    row, col = np.ones(pencil.order), np.ones(pencil.order)
    col[n:2 * n] = unit
    F, E = F * col, E * col * unit
    for matrix_row in range(pencil.order):
        size = max(np.abs(F[matrix_row]).max(), np.abs(E[matrix_row]).max())
        row[matrix_row] = 1.0 / size if size > 0 else 1.0
    (alpha, beta), left, right = la.eig(F * row[:, None], E * row[:, None], left=True, right=True,
                                        homogeneous_eigvals=True)
    finite = np.abs(beta) > 1e-13 * np.hypot(np.abs(alpha), np.abs(beta))
    values = alpha[finite] / beta[finite] * unit
    x, z = right[:, finite] * col[:, None], left[:, finite] * row[:, None]
    keep = values.imag >= 0
    values, x, z = values[keep], x[:, keep], z[:, keep]
    batch = _batch(pencil, values, x[:n], x[2 * n:])
    if options.left:
        batch.left_q, batch.left_u = z[n:2 * n], z[2 * n:]
    bad = ~acceptable(batch.residual, batch.backward, options.tolerance)
    if bad.any():  # QZ is backward stable in the norm of F, E, not term by term
        workspace = Workspace()
        for i in np.flatnonzero(bad):
            value, q, u, residual, backward = newton(
                pencil, batch.values[i], batch.q[:, i], batch.u[:, i],
                workspace=workspace, tolerance=options.tolerance)
            if abs(value - batch.values[i]) <= 1e-3 * abs(batch.values[i]):
                batch.values[i], batch.residual[i], batch.backward[i] = value, residual, backward
                batch.q[:, [i]], batch.u[:, [i]] = _normalised(q[:, None], u[:, None])
                found.refined += 1
        good = acceptable(batch.residual, batch.backward, options.tolerance)
        found.rejected = int((~good).sum())
        for name in ("values", "q", "u", "residual", "backward") + (
                ("left_q", "left_u") if options.left else ()):
            setattr(batch, name, getattr(batch, name)[..., good])
    _merge(found, batch)
    found.everything = found.rejected == 0
    if found.rejected:
        found.notes.append(f"{found.rejected} pairs of the dense solution missed the tolerance.")
        growth = np.abs(values[bad].real)
        found.ovals[0.0] = Oval(0.0, float(growth.min(initial=np.inf)), False)
    return found


def _size(matrix):
    data = np.abs(matrix.data)
    return float(data.max(initial=0.0))


def _result(pencil, found: _Found, count, options) -> Spectrum:
    """Sort, cut to the number asked for, and say what is certified."""
    region = SearchedRegion(tuple(found.ovals.values()), found.everything)
    _, band = _leading(found, max(count, options.least), options)
    order = np.lexsort((found.values.imag, -found.values.real))
    order = order[found.values.imag[order] <= band * (1 + 1e-12)][:count]
    if options.max_frequency is None and order.size:
        band = float(found.values.imag[order].max())
    low, high = region.complete_between(band)
    notes = list(found.notes)
    growth = found.values.real[order]
    certified = int(np.sum(growth >= low))
    all_there_are = found.everything and order.size == int(np.sum(found.values.imag <= band * (1 + 1e-12)))
    complete = certified == order.size and (order.size >= count or all_there_are)
    if order.size < count:
        where = "" if all_there_are or options.max_frequency is None else (
            f" up to {options.max_frequency:.6g} Hz with a growth rate above {low:.6g} 1/s")
        notes.append(f"{count} modes were asked for, {order.size} were found{where}"
                     + ("; there are no more." if all_there_are or where else "."))
    if certified < order.size:
        notes.append(f"Only the first {certified} modes are certified as leading; below a growth "
                     f"rate of {low:.6g} 1/s the search is not complete up to "
                     f"{band / (2 * np.pi):.6g} Hz.")
    spectrum = Spectrum(
        eigenvalues=found.values[order], q=found.q[:, order], u=found.u[:, order],
        residual=found.residual[order], backward_error=found.backward[order], asked=count,
        status="complete" if complete else "incomplete", complete_above=low, complete_below=high,
        band=np.inf if found.everything and options.max_frequency is None else band / (2 * np.pi),
        region=region, shifts=tuple(found.shifts), applications=found.applications,
        refined=found.refined, rejected=found.rejected, notes=tuple(notes))
    if not options.left:
        return spectrum
    return _with_left(pencil, spectrum, found.left_q[:, order], found.left_u[:, order])


def _with_left(pencil, spectrum, left_q, left_u) -> Spectrum:
    w, W, error, defective = biorthogonalise(pencil, spectrum.eigenvalues, spectrum.q,
                                             spectrum.u, left_q, left_u)
    notes = spectrum.notes
    if defective:
        which = ", ".join(f"{spectrum.eigenvalues[i]:.6g}" for i in defective)
        notes += (f"The eigenvalues {which} are defective or nearly so; their left vectors are "
                  "not scaled.",)
    return replace(spectrum, left_q=w, left_u=W, biorthogonality=error, notes=notes)
