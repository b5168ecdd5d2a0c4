r"""Eigenpairs from a solver to a result: all of a small pencil; verified, refined by Newton, merged; left vectors."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import dataclass, field

import numpy as np
import scipy.linalg as la

from .factor import SingularShiftError, Workspace, first_regular
from .operator import CoupledPencil, real_apply
from .spectrum import LEFT, PAIRS, Mode, Oval, SearchedRegion


def all_pairs(pencil: CoupledPencil, *, left: bool):
    """Finite eigenpairs of the first-order form, conjugates given once.

    Returns
    -------
    eigenvalues : ndarray, shape (k,)
        Imaginary part >= 0.
    q, u : ndarray
        Right vectors.
    w, W : ndarray or None
        Left vectors of the polynomial, w^H T = 0.
    """
    n, (matrix, lu) = pencil.n, _standard(pencil)
    rates, inner = slice(n, 2 * n), slice(2 * n, 2 * n + pencil.b)
    if matrix is None:
        values, right, z = _general(pencil, left)
    elif left:
        values, below, right = la.eig(matrix, left=True, right=True, check_finite=False)
        # y^H E^-1 F = l y^H, hence z = E^-T y
        z = below.copy()
        z[n : 2 * n + pencil.b] = la.lu_solve(lu, below[n : 2 * n + pencil.b], trans=1, check_finite=False)
    else:
        values, right = la.eig(matrix, check_finite=False)
    keep = values.imag >= 0
    x = right[:, keep]
    if not left:
        return values[keep], x[:n], x[inner], None, None
    return values[keep], x[:n], x[inner], z[rates][:, keep], z[inner][:, keep]


def all_eigenvalues(pencil: CoupledPencil) -> np.ndarray:
    """Finite eigenvalues without vectors, conjugates given once; several times as fast."""
    matrix, _ = _standard(pencil)
    values = _general(pencil, False)[0] if matrix is None else la.eigvals(matrix, check_finite=False)
    return values[values.imag >= 0]


def _standard(pencil):
    """E^-1 F and the LU of the one block of E that is not diagonal; None where that is nearly singular."""
    F, E = pencil.first_order()
    block = slice(pencil.n, 2 * pencil.n + pencil.b)
    inertia = E[block, block]
    size = np.abs(inertia).max(axis=1, initial=0.0)
    scaled = inertia / np.where(size > 0, size, 1.0)[:, None]
    scaled /= np.where(scaled.any(axis=0), np.abs(scaled).max(axis=0, initial=0.0), 1.0)
    if not np.linalg.cond(scaled, 1) < 1e9:
        return None, None
    lu = la.lu_factor(inertia, check_finite=False)
    matrix = F / np.where(E.diagonal() != 0, E.diagonal(), 1.0)[:, None]
    matrix[block] = la.lu_solve(lu, F[block], check_finite=False)
    return matrix, lu


def _general(pencil, left):
    """Eigenpairs by QZ, in units of a typical frequency and with rows equilibrated, else infinite ones are hard to
    tell.
    """
    F, E = pencil.first_order()
    unit = np.sqrt(_largest(pencil.K) / (_largest(pencil.M) or 1.0)) or 1.0
    col = np.ones(pencil.order)
    col[pencil.n : 2 * pencil.n] = unit
    F, E = F * col, E * (col * unit)
    size = np.maximum(np.abs(F).max(axis=1), np.abs(E).max(axis=1))
    row = 1.0 / np.where(size > 0, size, 1.0)
    (alpha, beta), below, right = la.eig(
        F * row[:, None], E * row[:, None], left=True, right=True, homogeneous_eigvals=True
    )
    finite = np.abs(beta) > 1e-13 * np.hypot(np.abs(alpha), np.abs(beta))
    z = below[:, finite] * row[:, None] if left else None
    return unit * alpha[finite] / beta[finite], right[:, finite] * col[:, None], z


def _largest(matrix) -> float:
    return float(np.abs(matrix.data).max(initial=0.0))


ROUNDING = 64 * np.finfo(float).eps


def measure(pencil: CoupledPencil, eigenvalues, q, u) -> tuple[np.ndarray, np.ndarray]:
    """Residual and backward error of pairs, as `Spectrum` defines them.

    Parameters
    ----------
    eigenvalues : array, shape (k,)
    q, u : arrays, shapes (n, k) and (b, k)

    Returns
    -------
    residual, backward_error : ndarray, shape (k,)
    """
    s = np.asarray(eigenvalues)
    if not s.size:
        return np.zeros(0), np.zeros(0)
    structure, fluid = pencil.terms(s, q, u)
    left = np.linalg.norm(sum(structure), axis=0)
    terms = sum(np.linalg.norm(t, axis=0) for t in structure)
    powers = np.abs(s) ** np.arange(3)[:, None]
    size_q, size_u = np.linalg.norm(q, axis=0), np.linalg.norm(u, axis=0)
    on_q, on_u, rows_on_q, rows_on_u, relaxing = pencil.norms
    stiffness = on_q @ powers
    if pencil.relaxation is not None:
        stiffness = stiffness + relaxing @ np.abs(pencil.relaxation.factors(s))
    full = stiffness * size_q + on_u @ powers[:2] * size_u
    residual, backward = _ratio(left, terms), _ratio(left, full)
    if pencil.b:
        scale = rows_on_q.T @ powers * size_q + rows_on_u.T @ powers[:2] * size_u
        fluid_error = _ratio(np.abs(sum(fluid)), scale).max(axis=0)
        residual, backward = np.maximum(residual, fluid_error), np.maximum(backward, fluid_error)
    return residual, backward


def balanced(pencil: CoupledPencil, eigenvalues, q, u) -> np.ndarray:
    """Inner unknowns that satisfy the rows of the fluid exactly, U = -S^-1 R J q.

    Where a stiff structure leaves more rounding error in q than in the few rows of the fluid.
    Pairs for which S is nearly singular (motions of the fluid alone) keep theirs.
    """
    u = np.array(u, complex)
    y = real_apply(pencil.J, q)
    for j, s in enumerate(eigenvalues):
        _, _, R, S = pencil.fluid_at(s)
        if np.linalg.cond(S) < 1e8:
            u[:, j] = -np.linalg.solve(S, R @ y[:, j])
    return u


def preferable(residual, backward, old_residual, old_backward):
    """True where a pair is better than the one before: closer, or at rounding level at last."""
    return (residual < old_residual) & ((backward <= ROUNDING) | (old_backward > ROUNDING)) | (
        (backward <= ROUNDING) & (old_backward > ROUNDING)
    )


def acceptable(residual, backward_error, tolerance) -> np.ndarray:
    """Pairs below the tolerance, or as good as rounding allows."""
    return (residual <= tolerance) | (backward_error <= ROUNDING)


def newton(pencil: CoupledPencil, eigenvalue: complex, q, u, *, workspace: Workspace, tolerance: float, steps: int = 4):
    """Improve one pair by inverse iteration on the full pencil, with a new LU each step.

    Solves T(l) y = T'(l) x and takes l - (c^H x)/(c^H y), x = y / (c^H y).

    Returns
    -------
    eigenvalue, q, u, residual, backward_error
        The best pair seen; it may still miss the tolerance.
    """
    real = complex(eigenvalue).imag == 0.0

    def scaled(l, q, u):
        size = np.linalg.norm(q) or np.linalg.norm(u) or 1.0
        q, u = q / size, u / size
        r, e = measure(pencil, np.array([l]), q[:, None], u[:, None])
        plain = l, q, u, float(r[0]), float(e[0])
        if r[0] <= 0.1 * tolerance or not u.size:
            return plain
        other = balanced(pencil, [l], q[:, None], u[:, None])
        r, e = measure(pencil, np.array([l]), q[:, None], other)
        return (l, q, other[:, 0], float(r[0]), float(e[0])) if preferable(r, e, plain[3], plain[4])[0] else plain

    best = scaled(eigenvalue, np.asarray(q, complex), np.asarray(u, complex))
    current = best
    for _ in range(steps):
        if acceptable(best[3], best[4], 0.01 * tolerance):
            break
        l, q, u = current[:3]
        shifted = factored_beside(pencil, l.real if real else l, workspace)
        if shifted is None:
            break
        l = shifted.shift  # the place of the factor, not the eigenvalue itself
        y, w = shifted.solve(*pencil.apply_derivative(l, q, u))
        along = np.vdot(q, y) + np.vdot(u, w)
        if not np.isfinite(along) or along == 0:
            break
        l = l - (np.vdot(q, q) + np.vdot(u, u)) / along
        current = scaled(complex(l.real) if real else l, y, w)
        if not np.isfinite(current[3]):
            break
        if preferable(current[3], current[4], best[3], best[4]):
            best = current
    return best


def factored_beside(pencil: CoupledPencil, eigenvalue, workspace: Workspace):
    """T factored a little beside an eigenvalue, so that inverse iteration contracts fast.

    Returns None if no such place was found.
    """
    places = (eigenvalue * (1 + nudge) if eigenvalue else nudge for nudge in (1e-8, 1e-6, 1e-4))
    with suppress(SingularShiftError):
        return first_regular(workspace.shifted, pencil, places)[1]
    return None


def _ratio(a, b):
    return a / np.where(b > 0, b, 1.0)


SAME = 1e-6  # relative distance below which two shifts are taken to have found one eigenvalue
TIGHT = 1e-9  # residual above which the inner unknowns of the fluid are computed afresh


@dataclass
class Found:
    """Pairs collected so far, upper half-plane."""

    eigenvalues: np.ndarray
    q: np.ndarray
    u: np.ndarray
    residual: np.ndarray
    backward_error: np.ndarray
    left_q: np.ndarray | None = None
    left_u: np.ndarray | None = None
    ovals: dict[complex, Oval] = field(default_factory=dict)
    everything: bool = False
    shifts: list[complex] = field(default_factory=list)
    applications: int = 0
    refined: int = 0
    rejected: int = 0
    lowest: float = 0.0
    slope: float = np.inf
    notes: list[str] = field(default_factory=list)

    @property
    def region(self) -> SearchedRegion:
        """Oval in which all were found."""
        return SearchedRegion(tuple(self.ovals.values()), self.everything, self.lowest, self.slope)

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the arrays with an entry or a column for each pair."""
        return PAIRS if self.left_q is None else PAIRS + LEFT

    def note(self, sentence: str) -> None:
        """Add a sentence once."""
        if sentence not in self.notes:
            self.notes.append(sentence)


def upper_half(values, q, u):
    """One of each conjugate pair, the imaginary part positive; real ones made real."""
    scale = np.abs(values)
    flat = np.abs(values.imag) <= 1e-11 * scale
    values = np.where(flat, values.real + 0j, values)
    upper = list(np.flatnonzero(values.imag >= 0))
    for i in np.flatnonzero(values.imag < 0):  # a partner that did not converge with it
        mirror = [j for j in upper if abs(values[j] - values[i].conj()) <= SAME * scale[i] and values[j].imag > 0]
        partner_count = np.sum(np.abs(values - values[i]) <= SAME * scale[i])
        if len(mirror) < partner_count:
            values[i] = values[i].conj()
            q[:, i], u[:, i] = q[:, i].conj(), u[:, i].conj()
            upper.append(i)
    return values[upper], q[:, upper], u[:, upper]


def verified(pencil, values, q, u) -> Found:
    """Pairs normalised and measured on the full pencil."""
    q, u = normalised(q, u)
    residual, backward = measure(pencil, values, q, u)
    coarse = np.flatnonzero(residual > TIGHT)
    if pencil.b and coarse.size:
        other = balanced(pencil, values[coarse], q[:, coarse], u[:, coarse])
        again = measure(pencil, values[coarse], q[:, coarse], other)
        better = preferable(*again, residual[coarse], backward[coarse])
        chosen = coarse[better]
        u[:, chosen] = other[:, better]
        residual[chosen], backward[chosen] = again[0][better], again[1][better]
    return Found(values, q, u, residual, backward)


def normalised(q, u):
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


def polish(pencil, shifted, batch, tolerance) -> None:
    """Residual inverse iteration with the factor at hand for pairs that miss the tolerance.

    x - T(sigma)^-1 T(l) x with l corrected along the way (Neumaier 1985): wipes out what the
    far modes have left in the vector, for the price of two block solves.
    """
    for _ in range(3):
        bad = np.flatnonzero(batch.residual > 0.3 * tolerance)
        if not bad.size:
            return
        values, q, u = batch.eigenvalues[bad], batch.q[:, bad], batch.u[:, bad]
        dq, du = shifted.solve(*pencil.apply(values, q, u))
        eq, eu = shifted.solve(*pencil.apply_derivative(values, q, u))
        along = np.sum(q.conj() * eq, axis=0) + np.sum(u.conj() * eu, axis=0)
        step = (np.sum(q.conj() * dq, axis=0) + np.sum(u.conj() * du, axis=0)) / along
        step = np.where(values.imag == 0, step.real, step)
        new = values - step
        q, u = normalised(q - dq + step * eq, u - du + step * eu)
        residual, backward = measure(pencil, new, q, u)
        better = (residual < batch.residual[bad]) & (np.abs(step) < 1e-4 * np.abs(values))
        if not better.any():
            return
        chosen = bad[better]
        batch.eigenvalues[chosen], batch.residual[chosen] = new[better], residual[better]
        batch.backward_error[chosen] = backward[better]
        batch.q[:, chosen], batch.u[:, chosen] = q[:, better], u[:, better]


def refine(pencil, batch, aim, band, tolerance, found) -> np.ndarray:
    """Newton steps on leading pairs that miss the tolerance; those that still do are dropped.

    Returns
    -------
    ndarray
        Eigenvalues dropped: the search does not vouch for their surroundings.
    """
    good = batch.residual <= tolerance
    if good.all():
        return np.zeros(0, complex)
    inside = batch.eigenvalues.imag <= band * (1 + 1e-12)
    ranked = np.sort(batch.eigenvalues.real[good & inside])[::-1]
    matters = ranked[aim - 1] if ranked.size >= aim else -np.inf
    workspace = Workspace()
    for i in np.flatnonzero(~good):
        start = batch.eigenvalues[i]
        if start.real < matters or not inside[i]:
            good[i] = acceptable(batch.residual[i], batch.backward_error[i], tolerance)
            continue
        value, q, u, residual, backward = newton(
            pencil, start, batch.q[:, i], batch.u[:, i], workspace=workspace, tolerance=tolerance
        )
        moved = abs(value - start) > 1e-3 * abs(start)
        if moved or not acceptable(residual, backward, tolerance):
            found.rejected += 1
            found.note(f"A pair near {start:.6g} was rejected: its residual {residual:.1g} exceeds the tolerance.")
            continue
        good[i] = True
        batch.eigenvalues[i], batch.residual[i], batch.backward_error[i] = value, residual, backward
        batch.q[:, [i]], batch.u[:, [i]] = normalised(q[:, None], u[:, None])
        found.refined += 1
    dropped = batch.eigenvalues[~good]
    for name in batch.parts:
        setattr(batch, name, getattr(batch, name)[..., good])
    return dropped


def rounding_of(eigenvalues: np.ndarray) -> float:
    """Distance within which two eigenvalues are one, as those that are zero: some 500 rounding units of the largest."""
    return 500 * np.finfo(float).eps * np.abs(eigenvalues).max(initial=0.0)


def merge(found: Found, batch: Found) -> None:
    """Add what is new; of an eigenvalue found twice keep the pair of smaller residual."""
    partner = np.full(batch.eigenvalues.size, -1)
    taken = np.zeros(found.eigenvalues.size, bool)
    rounding = rounding_of(np.append(found.eigenvalues, batch.eigenvalues))
    for i in np.argsort(batch.residual):
        distance = np.where(taken, np.inf, np.abs(found.eigenvalues - batch.eigenvalues[i]))
        if distance.size and distance.min() <= max(SAME * abs(batch.eigenvalues[i]), rounding):
            partner[i] = int(np.argmin(distance))
            taken[partner[i]] = True
    for i in np.flatnonzero(partner >= 0):
        if batch.residual[i] < found.residual[partner[i]]:
            for name in found.parts:
                getattr(found, name)[..., partner[i]] = getattr(batch, name)[..., i]
    new = partner < 0
    for name in found.parts:
        old = getattr(found, name)
        setattr(found, name, np.concatenate([old, getattr(batch, name)[..., new]], axis=-1))


def empty(pencil, left) -> Found:
    """Nothing found yet."""

    def none(rows):
        return np.zeros((rows, 0), complex)

    found = Found(np.zeros(0, complex), none(pencil.n), none(pencil.b), np.zeros(0), np.zeros(0))
    if left:
        found.left_q, found.left_u = none(pencil.n), none(pencil.b)
    return found


def attach_left(pencil, batch, solve, found) -> None:
    """Left vectors from the same factor, matched by eigenvalue; strays by inverse iteration."""
    k = batch.eigenvalues.size
    batch.left_q = np.zeros((pencil.n, k), complex)
    batch.left_u = np.zeros((pencil.b, k), complex)
    pairs = solve(lambda values, *_: _all_there(batch, values))
    found.applications += pairs.applications
    free = np.ones(pairs.eigenvalues.size, bool)
    workspace = Workspace()
    for i, value in enumerate(batch.eigenvalues):
        distance = np.where(free, np.abs(pairs.eigenvalues - value), np.inf)
        j = int(np.argmin(distance)) if distance.size else -1
        if j >= 0 and distance[j] <= SAME * abs(value):
            free[j] = False
            w, W = pairs.vectors_q[:, j], pairs.vectors_u[:, j]
        else:
            w, W = left_by_inverse_iteration(pencil, value, workspace)
        # the transposed problem gives w^T T = 0
        batch.left_q[:, i], batch.left_u[:, i] = w.conj(), W.conj()


def _all_there(batch, values) -> bool:
    """True where every eigenvalue of the right vectors has turned up."""
    if values.size < batch.eigenvalues.size:
        return False
    gaps = np.abs(values[:, None] - batch.eigenvalues).min(axis=0)
    return bool((gaps <= 0.01 * SAME * np.abs(batch.eigenvalues)).all())


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


def biorthogonalise(pencil: CoupledPencil, eigenvalues, q, u, w, W, cluster: float = 1e-7):
    """Scale left vectors to w^H T' x = 1 and sort out those of multiple eigenvalues.

    Returns
    -------
    w, W : ndarray
    biorthogonality : float
        Largest off-diagonal product relative to the norms of the vectors' products.
    defective : list of int
        Modes whose w^H T' x vanishes: a defective or nearly defective eigenvalue. Their left
        vectors keep unit norm.
    """
    k = eigenvalues.size
    w, W = np.array(w, complex), np.array(W, complex)
    if not k:
        return w, W, 0.0, []
    size = np.linalg.norm(w, axis=0)
    size[size == 0] = 1.0
    w, W = w / size, W / size
    table = coupling_of_modes(pencil, eigenvalues, w, W, eigenvalues, q, u)
    magnitude = np.abs(table).max(axis=1)
    defective: list[int] = []
    done = np.zeros(k, bool)
    for i in range(k):
        if done[i]:
            continue
        near = np.abs(eigenvalues - eigenvalues[i]) <= max(cluster * abs(eigenvalues[i]), rounding_of(eigenvalues))
        group = np.flatnonzero(near & ~done)
        done[group] = True
        block = table[np.ix_(group, group)]
        scale = magnitude[group].max() or 1.0
        if np.linalg.cond(block) > 1e8 or np.abs(block).max() < 1e-9 * scale:
            defective.extend(int(g) for g in group)
            continue
        turn = np.linalg.inv(block).conj().T
        w[:, group], W[:, group] = w[:, group] @ turn, W[:, group] @ turn
    table = coupling_of_modes(pencil, eigenvalues, w, W, eigenvalues, q, u)
    off = np.abs(table - np.diag(np.diag(table)))
    off[defective] = 0.0
    off[:, defective] = 0.0
    return w, W, float(off.max(initial=0.0)), defective


def coupling_of_modes(pencil: CoupledPencil, left_values, left_q, left_u, right_values, right_q, right_u) -> np.ndarray:
    r"""w_i^H [T(l_i) - T(l_j)] / (l_i - l_j) x_j, the product in which modes are orthogonal.

    For a quadratic pencil this is w^H [(l_i + l_j) M' + C'] x with M', C' the coefficients of
    lambda^2 and lambda of the full pencil; on the diagonal it is w^H T'(l) x. What relaxes adds the
    divided differences of its factors.

    Returns
    -------
    ndarray, shape (k_left, k_right)
    """
    x = right_q, right_u
    wh, Wh = left_q.conj().T, left_u.conj().T
    inertia, damping = (wh @ f + Wh @ g for f, g in (pencil.polynomial(None, None, x), pencil.polynomial(None, x)))
    first, second = np.asarray(left_values)[:, None], np.asarray(right_values)
    table = (first + second) * inertia + damping
    if pencil.relaxation is not None:
        for quotient, matrix in zip(pencil.relaxation.quotients(first, second), pencil.relaxing):
            table = table + quotient * (wh @ real_apply(matrix, right_q))
    return table


def eigenvalue_derivative(pencil: CoupledPencil, mode: Mode, change: tuple[np.ndarray, np.ndarray]) -> complex:
    r"""d lambda = - w^H (dT) x / (w^H T' x) of a simple eigenvalue.

    Parameters
    ----------
    pencil : CoupledPencil
    mode : Mode
        With left vectors, of any scaling.
    change : arrays (n,) and (b,)
        (dT) x, the derivative of T(lambda) x by the parameter at the eigenvalue and vector of the mode, as the
        difference of `CoupledPencil.apply` of two pencils has it.

    Returns
    -------
    complex
        Per unit of the parameter.

    Raises
    ------
    ValueError
        If the mode has no left vector or the eigenvalue is defective.

    Examples
    --------
    >>> from eigen import SearchOptions, leading_modes
    >>> pencil = CoupledPencil(M=np.eye(1), C=[[0.2]], K=[[4.0]])
    >>> mode = leading_modes(pencil, 1, SearchOptions(left=True)).mode(0)
    >>> derivative = eigenvalue_derivative(pencil, mode, (mode.eigenvalue * mode.q, mode.u))  # by the damping
    >>> round(derivative.real, 6)
    -0.5
    """
    if mode.left_q is None:
        raise ValueError("The derivative of an eigenvalue needs its left vector: search with left=True.")

    def along(f, g):
        return np.vdot(mode.left_q, f) + np.vdot(mode.left_u, g)

    x = mode.q, mode.u
    below = along(*pencil.apply_derivative(mode.eigenvalue, *x))
    terms = zip((mode.left_q, mode.left_u), pencil.polynomial(None, x), pencil.polynomial(None, None, x))
    norm = np.linalg.norm
    size = sum(norm(w) * (norm(damped) + 2 * abs(mode.eigenvalue) * norm(inert)) for w, damped, inert in terms)
    if abs(below) <= 1e-7 * size:
        raise ValueError("The eigenvalue is defective; it has no derivative.")
    return complex(-along(*change) / below)
