"""Prony series of a viscoelastic material over its long-term (equilibrium) law, and series that meet a loss factor.

Equations (T.7) and (T.8) of docs/theory.md.

The times are spread over a band of frequencies once and for all; what is left, the strengths, is a non-negative
linear least-squares problem. With x = omega tau, storage and loss over the slow modulus are

    E' = 1 + sum_j g_j x_j^2 / (1 + x_j^2),    E'' = sum_j g_j x_j / (1 + x_j^2),

and tan delta = E''/E' is linear in g once multiplied by E', which is taken from the fit before.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.optimize import lsq_linear, nnls

from dbvfiv.case.damping import LARGEST_LOSS
from dbvfiv.materials.laws import MaterialError
from dbvfiv.texts import shortly

#: Error of a fit, rms, beyond which it says nothing of the material.
WORST = 0.5
#: How far beyond its branches a series keeps its loss factor when it is scaled, in decades.
_MARGIN = 0.1
_ROUNDS = 40
#: Steps for each unknown: data that unknowns meet to rounding take more than the three of the library.
_STEPS = 50
#: How far the ends of the times reach beyond the band, in decades of frequency at its lower and upper end: offset and
#: slope over the decades a branch covers. Measured for loss factors of 0.05 to 0.5, see docs/damping.md.
_LOWER, _UPPER = (0.60, -1.05), (0.86, -1.10)
#: Points a decade at which a constant loss factor is asked for.
PER_DECADE = 25


def nonnegative(matrix: np.ndarray, target: np.ndarray) -> np.ndarray:
    """Unknowns x >= 0, (n,), of the least ||A x - b||, for A (m, n) and b (m,).

    The active-set method of Lawson and Hanson; where rounding makes it go round in circles, that of Stark and Parker.
    """
    try:
        return nnls(matrix, target, maxiter=_STEPS * matrix.shape[1])[0]
    except RuntimeError:
        return lsq_linear(matrix, target, (0.0, np.inf), method="bvls", tol=1e-15).x


def branch_moduli(frequency: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Complex modulus (n, j) of a branch of each relaxation time, s, per unit of its strength, at frequencies, Hz."""
    x = 2j * np.pi * np.multiply.outer(frequency, times)
    return x / (1.0 + x)


def fit_loss(frequency, wanted, times, weights, level: bool = False) -> np.ndarray:
    """Strengths (j,) for tan delta `wanted` (n,) at frequencies (n,), Hz, with times (j,), s.

    The errors are relative ones times `weights` (n,); with `level` the largest error is made small by Lawson's weights,
    not the mean one.
    """
    branch = branch_moduli(frequency, times)
    storage = np.ones(len(frequency))
    best, found = np.inf, np.zeros(len(times))
    for _ in range(_ROUNDS):
        scale = weights / (wanted * storage)
        strengths = nonnegative((branch.imag - wanted[:, None] * branch.real) * scale[:, None], weights / storage)
        before, storage = storage, 1.0 + branch.real @ strengths
        if not level:
            found = strengths
            if np.abs(storage - before).max() <= 1e-14 * storage.max():
                break
            continue
        error = np.abs(branch.imag @ strengths / storage / wanted - 1.0)
        if error.max() < best:
            best, found = error.max(), strengths
        weights = weights * np.sqrt(error / max(error.max(), 1e-300))
        weights = np.maximum(weights, 1e-6 * weights.max())
    return found


@dataclass(frozen=True)
class Prony:
    r"""Generalised Maxwell branches beside the slow law. Raises MaterialError if the numbers of both differ, or one of
    them is out of range; a negative strength would give energy away.

    Stress :math:`S = S_e(E) + \sum_j h_j` with :math:`\dot h_j + h_j/\tau_j = g_j \dot S_e` (quasi-linear
    viscoelasticity). Small motions see the tangent of the slow law times
    :math:`r(s) = 1 + \sum_j g_j s \tau_j / (1 + s \tau_j)`.

    Parameters
    ----------
    strengths : tuple of float
        g_j, over the slow modulus; not negative.
    times : tuple of float
        tau_j, s; positive.

    Examples
    --------
    >>> material = Prony((0.2,), (1.0 / (2 * np.pi * 10.0),))
    >>> round(float(material.loss_factor(10.0)), 6)
    0.090909
    """

    strengths: tuple[float, ...]
    times: tuple[float, ...]

    def __post_init__(self):
        strengths = tuple(float(g) for g in self.strengths)
        times = tuple(float(t) for t in self.times)
        if len(strengths) != len(times):
            raise MaterialError(
                f"A Prony series has as many times as strengths; {len(strengths)} strengths and "
                f"{len(times)} times were given."
            )
        for name, values, fits in (("strength", strengths, lambda x: x >= 0), ("time", times, lambda x: x > 0)):
            for value in values:
                if not (np.isfinite(value) and fits(value)):
                    raise MaterialError(
                        f"The relaxation {name} {value:g} was given; it must be finite and "
                        + ("positive." if name == "time" else "not negative: the branch would give energy away.")
                    )
        object.__setattr__(self, "strengths", strengths)
        object.__setattr__(self, "times", times)

    @property
    def elastic(self) -> bool:
        """True where all strengths are zero, so that the material is elastic."""
        return not any(self.strengths)

    def modulus(self, s):
        """r(s), the tangent over that of the slow law; s in 1/s, of any shape."""
        x = np.multiply.outer(np.asarray(s), np.array(self.times))
        return 1.0 + (x / (1.0 + x)) @ np.array(self.strengths)

    def loss_factor(self, frequency):
        """tan delta at frequencies, Hz."""
        r = self.modulus(2j * np.pi * np.asarray(frequency, float))
        return r.imag / r.real

    def scaled(self, factor: float) -> Prony:
        """The series whose loss factor is `factor` times this one's, at the same times; 0 gives an elastic material.
        Raises MaterialError if the factor is negative or not finite, or no series with these times comes near such a
        loss factor.

        Least squares on tan delta over the frequencies of the branches, with strengths that stay positive; the storage
        modulus follows from it, as causality demands.
        """
        if not (np.isfinite(factor) and factor >= 0):
            raise MaterialError(f"A loss factor was to be multiplied by {factor:g}; the factor must not be negative.")
        if factor == 1.0 or self.elastic:
            return self
        if factor == 0.0:
            return Prony((0.0,) * len(self.times), self.times)
        return _scaled(self, float(factor))


@lru_cache(4096)  # scans over the factor ask for the same series again and again
def _scaled(prony: Prony, factor: float) -> Prony:
    """See `Prony.scaled`."""
    times = np.array(prony.times)
    low, high = np.log10(1.0 / times.max()) - _MARGIN, np.log10(1.0 / times.min()) + _MARGIN
    frequency = np.logspace(low, high, max(int(20 * (high - low)), 4 * times.size) + 1) / (2 * np.pi)
    target = factor * prony.loss_factor(frequency)
    found = Prony(tuple(fit_loss(frequency, target, times, target)), prony.times)
    missed = float(np.linalg.norm(found.loss_factor(frequency) - target) / np.linalg.norm(target))
    if missed > WORST:
        raise MaterialError(
            f"The loss factor of a material is to be {factor:.4g} times its own, up to {target.max():.3g}, which a "
            f"series of {times.size} {'branch' if times.size == 1 else 'branches'} misses by {missed:.0%} rms; "
            "damping.loss_factor must be lower."
        )
    return found


@shortly
@dataclass(frozen=True)
class PronyFit:
    """A series and how well it meets what it was fitted to."""

    prony: Prony
    quantity: str  #: What was fitted: "tan delta", "moduli" or "relaxing modulus".
    #: (n,); fitted over wanted, less one: of tan delta, of storage and then loss modulus, or of the relaxing modulus.
    error: np.ndarray

    @property
    def largest_error(self) -> float:
        """Largest relative error, a fraction."""
        return float(np.abs(self.error).max())

    @property
    def rms_error(self) -> float:
        """Root mean square of the relative errors, a fraction."""
        return float(np.sqrt(np.mean(self.error**2)))


def relaxation_times(band: tuple[float, float], branches: int) -> np.ndarray:
    """Times (branches,), s, of a series that is to hold over a band of frequencies, Hz, ascending.

    Spread evenly over the logarithm; few branches lie within the band, many reach beyond it.
    """
    low, high = _checked_band(band)
    if isinstance(branches, bool) or not isinstance(branches, (int, np.integer)) or branches < 1:
        raise MaterialError(f"A Prony series has at least one branch, but {branches!r} was given.")
    if branches == 1:
        return np.array([1.0 / (2 * np.pi * np.sqrt(low * high))])
    decades = np.log10(high / low)
    covered = decades / branches
    beyond = [max(offset + slope * covered, -0.25 * decades) for offset, slope in (_LOWER, _UPPER)]
    ends = np.log10(low) - beyond[0], np.log10(high) + beyond[1]
    return 1.0 / (2 * np.pi * np.logspace(ends[1], ends[0], branches))


def fit_constant(loss_factor: float, band: tuple[float, float], branches: int) -> PronyFit:
    """A series whose loss factor is the same over a band, with the largest relative error as small as it gets. Raises
    MaterialError for a loss factor or a band out of range.

    Parameters
    ----------
    loss_factor : float
        tan delta, 0 (elastic) to 2.
    band : tuple of float
        Lowest and highest frequency, Hz.

    Examples
    --------
    >>> fit = fit_constant(0.2, (1.0, 200.0), 4)
    >>> fit.largest_error < 0.03
    True
    """
    check_loss(np.array([loss_factor], float))
    low, high = _checked_band(band)
    times = relaxation_times(band, branches)
    at = np.geomspace(low, high, max(int(PER_DECADE * np.log10(high / low)), 4 * branches) + 1)
    if loss_factor == 0.0:
        return PronyFit(Prony((0.0,) * branches, times), "tan delta", np.zeros(len(at)))
    return fit_loss_curve(at, np.full(len(at), float(loss_factor)), times, level=True)


def fit_loss_curve(at: np.ndarray, wanted: np.ndarray, times: np.ndarray, level: bool = False) -> PronyFit:
    """Series of given times, s, for tan delta `wanted` (n,) at frequencies (n,), Hz; see `fit_loss`."""
    prony = Prony(fit_loss(at, wanted, times, even_weights(at), level), times)
    return PronyFit(prony, "tan delta", prony.loss_factor(at) / wanted - 1.0)


def _checked_band(band: tuple[float, float]) -> tuple[float, float]:
    low, high = (float(f) for f in band)
    if not 0 < low < high < np.inf:
        raise MaterialError(
            f"A band goes from a positive frequency to a higher one, but {low:g} to {high:g} Hz is given."
        )
    return low, high


def check_loss(tan_delta: np.ndarray) -> None:
    """Refuse loss factors out of range by a `MaterialError`."""
    for value in tan_delta:
        if not 0 <= value <= LARGEST_LOSS:
            raise MaterialError(
                f"A loss factor (tan delta) must lie between 0 and {LARGEST_LOSS:g}, but {value:g} was found."
            )


def even_weights(at: np.ndarray) -> np.ndarray:
    """Roots of the share of each point in the logarithmic axis, so that crowds of points do not rule."""
    if at.size < 3:
        return np.ones(at.size)
    return np.sqrt(np.gradient(np.log(at)) * at.size / np.log(at[-1] / at[0]))
