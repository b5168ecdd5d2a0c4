"""Floquet exponents of periodic motions by Hill's method: perturbations exp(sigma t) times a Fourier series.

The linearisation projected on the basis of the corrections is a small dense problem, quadratic in sigma or nearly so,
whose leading eigenvalues come from shifted Arnoldi iterations. What their vectors miss in the full equations is
measured, and added to the basis until it is small; how far the exponent of the shift in time is from zero measures the
rest.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import scipy.linalg as la

from continuation.harmonics import Harmonics
from continuation.linear import SYMMETRIC, factorise, product
from continuation.periodic import by_parts

#: Shifts: distance right of the axis, no round number as exponents may be, and how far up the band, both over omega.
_RIGHT, _UP = 0.1037, (0.0, 0.25, 0.5)
#: Steps of an Arnoldi iteration after which its eigenvalues are looked at.
_STEPS = 60
#: Least radius about the real shift, over omega, in which all eigenvalues are found: with turns of those whose series
#: is cut off within the band.
_REACH = 0.75
#: Exponents that are enough where those wanted lie far to the left of these.
_ENOUGH = 5
#: Most that the outer two harmonics may hold of a perturbation.
_RIM = 0.05
#: Most corrections of an eigenpair whose projection is not exact.
_REFINED = 10
#: Largest share that either of the leading two perturbations may miss; four times as much for the others.
_TOLERANCE = 1e-3
#: Times that the basis is made larger for them.
_ROUNDS = 3
#: Largest share of the equations of a perturbation out of the band beyond the series.
_CLOSED = 1e-4
#: Distance over omega within which turned exponents with like perturbations are one.
_ALIKE = 0.02
#: Distance over omega of the exponent of the shift in time from zero up to which exponents are trusted.
_TRUSTED = 0.05
#: Distance from half the frequency, and from zero, at which the imaginary part of a real multiplier may come out, over
#: omega; share of a perturbation that others of one exponent lack where it is another one.
_EDGE, _REAL, _APART = 1e-4, 1e-6, 1e-3


@dataclass(frozen=True, eq=False)
class Exponents:
    """Leading Floquet exponents."""

    #: (k,); 1/s, sorted by growth rate, imaginary parts from 0 to omega / 2; that of the shift in time left out.
    values: np.ndarray
    vectors: list[np.ndarray]  #: (2 H + 1, n); coefficients of the perturbations.
    errors: np.ndarray  #: (k,); share of each perturbation that it misses in the full equations.
    trivial: float  #: Size of the exponent of the shift in time, 1/s; zero for a forced system.
    omega: float
    #: (k,); exponents that go with the vectors: the values but for whole turns.
    as_found: np.ndarray = field(default_factory=lambda: np.zeros(0, complex))

    @classmethod
    def unknown(cls, omega: float) -> Exponents:
        """No exponents of a motion, where none were asked for."""
        return cls(np.zeros(0, complex), [], np.zeros(0), np.inf, omega)

    @property
    def multipliers(self) -> np.ndarray:
        """(k,) complex."""
        return np.exp(self.values * 2 * np.pi / self.omega)

    @property
    def unstable(self) -> int:
        """Dimension in which perturbations grow; those that grow slower than the shift in time moves do not count.

        It is -1, not known, where the exponent of the shift in time is far from zero: near a homoclinic orbit, say,
        perturbations grow and decay within a period by more than rounding leaves.
        """
        if self.trivial > _TRUSTED * self.omega:
            return -1
        return int(self.dimensions[self.grows].sum())

    @property
    def grows(self) -> np.ndarray:
        """(k,) bool: those that grow faster than the shift in time moves."""
        return self.values.real > max(2.0 * self.trivial, 1e-6 * self.omega)

    @property
    def dimensions(self) -> np.ndarray:
        """(k,) dimensions of the perturbations: 1 where the multiplier is real, 2 of a pair."""
        high = np.abs(self.values.imag) / self.omega
        return np.where((high <= _REAL) | (np.abs(high - 0.5) <= _EDGE), 1, 2)

    @property
    def stable(self) -> bool:
        return self.unstable == 0


def floquet_exponents(solver, linear, count: int = 4) -> Exponents:
    """Leading exponents of the motion of a linearisation.

    Parameters
    ----------
    solver : continuation.cycles.CycleSolver
        Its basis grows by what perturbations miss.
    linear : continuation.cycle_linearisation.CycleLinearisation
        At the motion itself.
    count : int
        Exponents wanted.
    """
    for left in range(_ROUNDS, -1, -1):
        found = _of_projection(linear, count, solver.system.autonomous)
        missed = _missed(linear, found.as_found, found.vectors)
        errors = np.array([share for share, _ in missed])
        found = replace(found, errors=errors)
        limits = _TOLERANCE * np.where(np.arange(len(errors)) < 2, 1.0, 4.0)
        if not left or not np.any(errors > limits):
            return found
        rows = [p for (share, rest), most in zip(missed, limits) if share > most for p in (rest.real, rest.imag)]
        if not linear.extend(solver.learn_perturbations(np.concatenate(rows))):
            return found
    return found


def _missed(linear, shifts: np.ndarray, vectors: list[np.ndarray]) -> list[tuple[float, np.ndarray]]:
    """Share that each perturbation misses, and the correction (2 H + 1, n) that one pass of the smoother gives."""
    if linear.smoother is None:
        return [(0.0, np.zeros_like(vector)) for vector in vectors]
    missed, basis = [], linear.basis
    vectors = [v.real if s.imag == 0.0 and not v.imag.any() else v for s, v in zip(shifts, vectors)]
    shifts = [s.real if np.isrealobj(v) else s for s, v in zip(shifts, vectors)]
    for vector, force in zip(vectors, linear.operator.apply_each(vectors, shifts)):
        scaled, whole = linear.smoother(force) / linear.scale, np.linalg.norm(vector / linear.scale)
        outside = scaled - by_parts(lambda part: (part @ basis) @ basis.T, scaled)
        missed.append((float(np.linalg.norm(outside) / whole), outside * linear.scale))
    return missed


def _of_projection(linear, count: int, autonomous: bool) -> Exponents:
    motion = linear.motion
    found = _leading(linear.reduced, count + 1)
    found = found[: count + 1] if linear.exact else _all_refined(linear, found, count + 1)
    trivial = 0.0
    if autonomous and found:
        trivial = float(abs(found.pop(int(np.argmin([abs(folded) for folded, _, _ in found])))[0]))
    found = sorted(found, key=lambda one: -one[0].real)[:count]
    values, as_found = (np.array(part, complex) for part in ([one[0] for one in found], [one[1] for one in found]))
    vectors = [linear.lift(x) for _, _, x in found]
    return Exponents(values, vectors, np.zeros(len(found)), trivial, motion.omega, as_found)


def _all_refined(linear, found, count: int) -> list[tuple[complex, complex, np.ndarray]]:
    """The leading ones corrected; what does not settle belongs to the stand-in alone."""
    kept: list[tuple[complex, complex, np.ndarray]] = []
    for folded, sigma, x in found[: count + 3]:
        new, x = _refined(linear, sigma, x)
        turned = folded + new - sigma
        if np.isfinite(new) and all(abs(turned - other) > 1e-4 * linear.motion.omega for other, _, _ in kept):
            kept.append((turned, new, x))
        if len(kept) == count:
            break
    return kept


def _refined(linear, sigma: complex, x: np.ndarray) -> tuple[complex, np.ndarray]:
    """An eigenpair of the projection of the operator itself, from that of what stands for it, by Newton's method with
    the matrix of the latter; not a number where that does not settle.
    """
    reduced, omega = linear.reduced, linear.motion.omega
    v, shape, step = linear.scale[:, None] * linear.basis, x.shape, 1e-4 * linear.motion.omega
    x, last = x / np.linalg.norm(x), np.inf
    size = x.size
    for count in range(_REFINED):
        if count < 3:  # the quadratic about a shift is off where it relaxes; later matrices are not
            middle, ahead = reduced.matrix(complex(sigma)), reduced.matrix(complex(sigma + step))
            matrix = np.zeros((size + 1, size + 1), complex)
            matrix[:size, :size], matrix[:size, size] = middle, (ahead - middle) @ x.ravel() / step
            matrix[size, :size] = x.ravel().conj()
            balance = 1.0 / np.maximum(np.abs(matrix).max(axis=1), 1e-300)
            factor = la.lu_factor(matrix * balance[:, None], check_finite=False)
        rest = (linear.operator.apply(x @ v.T, sigma) @ v).ravel()
        change = la.lu_solve(factor, balance * np.append(-rest, 0.0), check_finite=False)
        moved = abs(change[size])
        if not moved <= min(0.5 * omega, 4.0 * last):
            break
        x, sigma, last = x + change[:size].reshape(shape), complex(sigma + change[size]), moved
        if moved <= 1e-7 * omega:
            return sigma, x
    return complex(np.nan, np.nan), x


def _each_once(pairs, inside, h: Harmonics, omega: float) -> list[tuple[complex, complex, np.ndarray]]:
    """Perturbations with imaginary parts from 0 to omega / 2, each once.

    All turns of an exponent by whole frequencies are eigenvalues, but for what the series cuts off. Those in the band
    come first and are taken, of a multiple one as many as are independent. Others are turned into it where nothing like
    them is known there: a perturbation that is faster than the motion needs fewer harmonics as it is, and its vector
    stays so.
    """
    found: list[tuple[complex, complex, np.ndarray]] = []
    turned: list[np.ndarray] = []  # what they are as functions of time with their exponents within the band
    for sigma, x in pairs:
        turn = np.round(sigma.imag / omega)
        folded = sigma - 1j * omega * turn
        motion = (h.evaluate(x) * np.exp(2j * np.pi * turn * np.arange(h.samples) / h.samples)[:, None]).ravel()
        if folded.imag < -_REAL * omega:
            folded, sigma, x, motion = np.conj(folded), np.conj(sigma), x.conj(), motion.conj()
        near = 1e-6 if inside(sigma) else _ALIKE
        alike = [other for (place, _, _), other in zip(found, turned) if abs(folded - place) <= near * omega]
        if alike and inside(sigma):
            space = la.orth(np.stack(alike, axis=1))
            new = np.linalg.norm(motion - space @ (space.conj().T @ motion)) > _APART * np.linalg.norm(motion)
        if not alike or (inside(sigma) and new):
            found.append((complex(folded), complex(sigma), x))
            turned.append(motion)
    return found


def _cut_off(reduced, sigma: complex, x: np.ndarray) -> float:
    """Share of a perturbation's equations beyond the series, over those within at the frequency of the motion."""
    h = reduced.motion.harmonics
    samples = h.evaluate(x)
    rest = reduced.on_samples(samples, complex(sigma))
    moved = reduced.on_samples(samples, complex(sigma + reduced.motion.omega)) - rest
    return float(np.linalg.norm(rest - h.evaluate(h.project(rest))) / np.linalg.norm(moved))


def _is_whole(h: Harmonics, x: np.ndarray) -> bool:
    weight = np.sum(np.abs(h.two_sided(x)) ** 2, axis=1)
    rim = weight[[0, 1, -2, -1] if h.count > 3 else [0, -1]].sum()
    return bool(rim <= _RIM * weight.sum())


def _leading(reduced, count: int) -> list[tuple[complex, complex, np.ndarray]]:
    """Perturbations of the projection by decreasing growth, each once, the leading ones among them: see `_each_once`.

    Where the matrix is quadratic in the exponent one real shift serves: the iteration goes on until it has all
    eigenvalues in a circle that holds the band as far to the left as those wanted lie. Where something relaxes, or that
    is not reached, what is near shifts up the band is taken, by the quadratic about each.
    """
    omega, pairs = reduced.motion.omega, []
    if reduced.polynomial:
        shift = _RIGHT * omega
        for pairs, radius, steps in _nearest(reduced.quadratic(0.0), shift):
            found = _perturbations(reduced, pairs)
            reach = np.sqrt(max(radius**2 - ((0.5 + _EDGE) * omega) ** 2, 0.0)) if radius >= _REACH * omega else 0.0
            complete = [one for one in found if shift - one[0].real <= reach]
            if len(complete) >= min(count, _ENOUGH if steps >= 2 * _STEPS else count):
                return found if len(complete) >= count else complete
    for shift in (omega * (_RIGHT + 1j * up) for up in _UP):
        *_, (near, *_) = _nearest(reduced.quadratic(0.0 if reduced.polynomial else shift), shift, _STEPS)
        pairs = pairs + near
    return _perturbations(reduced, pairs)


def _perturbations(reduced, pairs) -> list[tuple[complex, complex, np.ndarray]]:
    """Eigenpairs that stand for perturbations of the motion, by decreasing growth: see `_each_once`."""
    h, omega = reduced.motion.harmonics, reduced.motion.omega
    inside = lambda sigma: abs(sigma.imag) <= (0.5 + _EDGE) * omega  # noqa: E731
    shaped = ((sigma, reduced.shaped(x)) for sigma, x in pairs)
    kept = [(s, x) for s, x in shaped if _is_whole(h, x) and (inside(s) or _cut_off(reduced, s, x) <= _CLOSED)]
    found = _each_once(sorted(kept, key=lambda pair: not inside(pair[0])), inside, h, omega)
    return sorted(found, key=lambda one: -one[0].real)


def _nearest(parts, shift: complex, most: int = 3 * _STEPS):
    """Eigenpairs near a shift of l0 + sigma l1 + sigma^2 l2, and the radius about it in which they are all, again and
    again as more are found.
    """
    l0, l1, l2 = parts
    shift = shift if np.imag(shift) else np.real(shift)
    matrix = l0 + shift * l1
    solver, size = factorise(matrix if l2 is None else matrix + shift**2 * l2, SYMMETRIC), matrix.shape[0]

    def invert(x):
        if l2 is None:
            return -solver.solve(product(l1, x))
        y, z = x[:size], x[size:]
        top = -solver.solve(product(l2, z + shift * y) + product(l1, y))
        return np.append(top, y + shift * top)

    for pairs, next_one, steps in _arnoldi(invert, size if l2 is None else 2 * size, matrix.dtype, most):
        radius = 1.0 / next_one if next_one else np.inf
        yield [(shift + 1.0 / value, vector[:size]) for value, vector in pairs], radius, steps


def _arnoldi(apply, size: int, dtype, most: int):
    """Ritz pairs of the largest eigenvalues that have converged, and the size of the largest that has not (zero where
    the space is exhausted), every so many steps; of a small space at its end. Where an invariant space is complete
    another one begins: it may hold more vectors of the same eigenvalues.
    """
    basis, rng = np.zeros((size, 1), dtype), np.random.default_rng(0)
    start = rng.standard_normal(size)
    basis[:, 0] = start / np.linalg.norm(start)
    h = np.zeros((most + 1, most), dtype)
    for k in range(min(most, size)):
        if k % _STEPS == 0:
            basis = np.concatenate([basis, np.zeros((size, _STEPS), dtype)], axis=1)
        w = apply(basis[:, k])
        for _ in range(2):
            part = basis[:, : k + 1].conj().T @ w
            h[: k + 1, k] += part
            w = w - basis[:, : k + 1] @ part
        done, last = k + 1, np.linalg.norm(w)
        if last <= 1e-13 * np.abs(h[: k + 1, : k + 1]).max() or done == size:
            last, w = 0.0, rng.standard_normal(size)
            for _ in range(2):
                w = w - basis[:, :done] @ (basis[:, :done].conj().T @ w)
        h[done, k] = last
        if done == size or (done % _STEPS == 0 and size > most):
            values, vectors = np.linalg.eig(h[:done, :done])
            size_of = np.abs(values)
            good = (last * np.abs(vectors[-1]) <= 1e-9 * size_of) & (size_of > 1e-12 * size_of.max())
            rest = (np.abs(values[~good]).max(initial=0.0) if last else np.inf) if done < size else 0.0
            shapes = basis[:, :done] @ vectors[:, good]
            yield list(zip(values[good].astype(complex), shapes.T)), rest, done
        if done == size:
            return
        basis[:, done] = w / np.linalg.norm(w)
