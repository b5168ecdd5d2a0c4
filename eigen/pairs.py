"""Eigenpairs on their way from a Krylov method to a result: verified, refined, merged."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from .condensation import Workspace
from .region import Oval, SearchedRegion
from .residual import Residuals, acceptable, balanced, derivative_times, newton, preferable

SAME = 1e-6  # relative distance below which two shifts are taken to have found one eigenvalue
TIGHT = 1e-9  # residual above which the inner unknowns of the fluid are computed afresh


@dataclass
class Found:
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
    limited: bool = False
    lowest: float = 0.0
    slope: float = np.inf
    notes: list[str] = field(default_factory=list)

    @property
    def region(self) -> SearchedRegion:
        """Where all were found."""
        return SearchedRegion(tuple(self.ovals.values()), self.everything, self.lowest, self.slope)

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
    residuals = Residuals(pencil)
    residual, backward = residuals.measure(values, q, u)
    coarse = np.flatnonzero(residual > TIGHT)
    if pencil.b and coarse.size:
        other = balanced(pencil, values[coarse], q[:, coarse], u[:, coarse])
        again = residuals.measure(values[coarse], q[:, coarse], other)
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
        values, q, u = batch.values[bad], batch.q[:, bad], batch.u[:, bad]
        structure, fluid = pencil.terms(values, q, u)
        dq, du = shifted.solve(sum(structure), sum(fluid))
        eq, eu = shifted.solve(*derivative_times(pencil, values, q, u))
        along = np.sum(q.conj() * eq, axis=0) + np.sum(u.conj() * eu, axis=0)
        step = (np.sum(q.conj() * dq, axis=0) + np.sum(u.conj() * du, axis=0)) / along
        step = np.where(values.imag == 0, step.real, step)
        new = values - step
        q, u = normalised(q - dq + step * eq, u - du + step * eu)
        residual, backward = Residuals(pencil).measure(new, q, u)
        better = (residual < batch.residual[bad]) & (np.abs(step) < 1e-4 * np.abs(values))
        if not better.any():
            return
        chosen = bad[better]
        batch.values[chosen], batch.residual[chosen] = new[better], residual[better]
        batch.backward[chosen] = backward[better]
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
    inside = batch.values.imag <= band * (1 + 1e-12)
    ranked = np.sort(batch.values.real[good & inside])[::-1]
    matters = ranked[aim - 1] if ranked.size >= aim else -np.inf
    workspace = Workspace()
    for i in np.flatnonzero(~good):
        if batch.values[i].real < matters or not inside[i]:
            good[i] = acceptable(batch.residual[i], batch.backward[i], tolerance)
            continue
        value, q, u, residual, backward = newton(
            pencil, batch.values[i], batch.q[:, i], batch.u[:, i], workspace=workspace, tolerance=tolerance
        )
        moved = abs(value - batch.values[i]) > 1e-3 * abs(batch.values[i])
        if moved or not acceptable(residual, backward, tolerance):
            found.rejected += 1
            found.note(
                f"A pair near {batch.values[i]:.6g} was rejected: its residual {residual:.1g} exceeds the tolerance."
            )
            continue
        good[i] = True
        batch.values[i], batch.residual[i], batch.backward[i] = value, residual, backward
        batch.q[:, [i]], batch.u[:, [i]] = normalised(q[:, None], u[:, None])
        found.refined += 1
    dropped = batch.values[~good]
    names = ["values", "q", "u", "residual", "backward"]
    names += ["left_q", "left_u"] if batch.left_q is not None else []
    for name in names:
        setattr(batch, name, getattr(batch, name)[..., good])
    return dropped


def merge(found: Found, batch: Found) -> None:
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


def empty(pencil, left) -> Found:
    """Nothing found yet."""

    def none(rows):
        return np.zeros((rows, 0), complex)

    found = Found(np.zeros(0, complex), none(pencil.n), none(pencil.b), np.zeros(0), np.zeros(0))
    if left:
        found.left_q, found.left_u = none(pencil.n), none(pencil.b)
    return found
