"""Prony series of a viscoelastic material over its long-term (equilibrium) law, and its fit to measured data.

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

from dbvfiv.materials.law import MaterialError
from dbvfiv.materials.least_squares import nonnegative

#: How far beyond its branches a series keeps its loss factor when it is scaled, in decades; and rounds to do so.
_MARGIN, _ROUNDS = 0.1, 60


@dataclass(frozen=True)
class Prony:
    r"""Generalised Maxwell branches beside the slow law.

    Stress :math:`S = S_e(E) + \sum_j h_j` with :math:`\dot h_j + h_j/\tau_j = g_j \dot S_e` (quasi-linear
    viscoelasticity). Small motions see the tangent of the slow law times
    :math:`r(s) = 1 + \sum_j g_j s \tau_j / (1 + s \tau_j)`.

    Parameters
    ----------
    strengths : tuple of float
        g_j, over the slow modulus; not negative.
    times : tuple of float
        tau_j, s; positive.

    Raises
    ------
    MaterialError
        If the numbers of both differ, or one of them is out of range; a negative strength would give energy away.

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
        for name, values, fits in (
            ("strength", strengths, lambda x: x >= 0),
            ("time", times, lambda x: x > 0),
        ):
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
        """The series whose loss factor is `factor` times this one's, at the same times.

        Least squares on tan delta over the frequencies of the branches, with strengths that stay positive; the storage
        modulus follows from it, as causality demands.

        Parameters
        ----------
        factor : float
            Not negative; zero gives an elastic material, one this series.

        Raises
        ------
        MaterialError
            If the factor is negative or not finite.
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
    omega = np.logspace(low, high, max(int(20 * (high - low)), 4 * times.size) + 1)
    target = factor * prony.loss_factor(omega / (2 * np.pi))
    x = 1j * np.multiply.outer(omega, times)
    branch = x / (1.0 + x)
    matrix = branch.imag - target[:, None] * branch.real  # times g: target where tan delta is met
    storage = prony.modulus(1j * omega).real
    for _ in range(_ROUNDS):
        strengths = nonnegative(matrix / storage[:, None], target / storage)
        before, storage = storage, 1.0 + branch.real @ strengths
        if np.abs(storage - before).max() <= 1e-14 * storage.max():
            break
    return Prony(tuple(strengths), prony.times)


LARGEST_LOSS_FACTOR = 2.0
#: How far the ends of the times reach beyond the band, in decades of frequency at its lower and upper end: offset and
#: slope over the decades a branch covers. Measured for loss factors of 0.05 to 0.5, see docs/damping.md.
_LOWER, _UPPER = (0.60, -1.05), (0.86, -1.10)
_FIT_ROUNDS = 40
#: Points a decade at which a constant loss factor is asked for.
_PER_DECADE = 25


@dataclass(frozen=True)
class PronyFit:
    """A series and how well it meets what it was fitted to.

    Attributes
    ----------
    prony : Prony
    quantity : str
        What was fitted: "tan delta", "moduli" or "relaxing modulus".
    at : numpy.ndarray, shape (n,)
        Frequencies, Hz, or times, s, of a relaxing modulus.
    error : numpy.ndarray, shape (n,)
        Fitted over wanted, less one: of tan delta, or of the relaxing modulus.
    """

    prony: Prony
    quantity: str
    at: np.ndarray
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
    """Times of a series that is to hold over a band of frequencies, ascending.

    Spread evenly over the logarithm; few branches lie within the band, many reach beyond it.

    Parameters
    ----------
    band : tuple of float
        Lowest and highest frequency, Hz.
    branches : int

    Returns
    -------
    numpy.ndarray, shape (branches,)
        s.
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
    """A series whose loss factor is the same over a band, with the largest relative error as small as it gets.

    Parameters
    ----------
    loss_factor : float
        tan delta, 0 (elastic) to 2.
    band : tuple of float
        Lowest and highest frequency, Hz.
    branches : int

    Raises
    ------
    MaterialError
        For a loss factor or a band out of range.

    Examples
    --------
    >>> fit = fit_constant(0.2, (1.0, 200.0), 4)
    >>> fit.largest_error < 0.03
    True
    """
    _check_loss(np.array([loss_factor], float))
    low, high = _checked_band(band)
    times = relaxation_times(band, branches)
    at = np.geomspace(low, high, max(int(_PER_DECADE * np.log10(high / low)), 4 * branches) + 1)
    if loss_factor == 0.0:
        return PronyFit(Prony((0.0,) * branches, times), "tan delta", at, np.zeros(len(at)))
    wanted = np.full(len(at), float(loss_factor))
    strengths = _fit_loss(at, wanted, times, level=True)
    return _of_tan_delta(Prony(strengths, times), at, wanted)


def fit_tan_delta(frequency, tan_delta, times) -> PronyFit:
    """Series of given times from tan delta over frequency; relative errors count, evenly over the logarithm.

    Parameters
    ----------
    frequency : array_like, shape (n,)
        Hz, ascending.
    tan_delta : array_like, shape (n,)
        0 to 2; not zero everywhere.
    times : array_like, shape (j,)
        s.

    Raises
    ------
    MaterialError
        For tables that cannot be used.
    """
    frequency, wanted = checked_tan_delta(frequency, tan_delta)
    times = np.asarray(times, float)
    return _of_tan_delta(Prony(_fit_loss(frequency, wanted, times), times), frequency, wanted)


def fit_moduli(frequency, storage, loss, times) -> PronyFit:
    """Series of given times from storage and loss modulus over frequency.

    The slow modulus is found with the strengths and dropped: what a law is scaled with is its own test.

    Parameters
    ----------
    frequency : array_like, shape (n,)
        Hz, ascending.
    storage, loss : array_like, shape (n,)
        Pa, or any common unit; positive.
    times : array_like, shape (j,)
        s.

    Raises
    ------
    MaterialError
        For tables that cannot be used, or moduli that leave no slow modulus.
    """
    frequency, storage, loss = checked_moduli(frequency, storage, loss)
    times = np.asarray(times, float)
    branch, even = _branch(frequency, times), _even_weights(frequency)
    one = np.ones((len(frequency), 1))
    matrix = np.vstack(
        [
            np.hstack([one, branch.real]) * (even / storage)[:, None],
            np.hstack([0 * one, branch.imag]) * (even / loss)[:, None],
        ]
    )
    found = nonnegative(matrix, np.concatenate([even, even]))
    prony = Prony(_over_slow(found, "storage modulus"), times)
    wanted = loss / storage
    return PronyFit(prony, "moduli", frequency, prony.loss_factor(frequency) / wanted - 1.0)


def fit_relaxation(time, modulus, times) -> PronyFit:
    """Series of given times from a relaxation test: the modulus over the time since the strain was put on.

    Parameters
    ----------
    time : array_like, shape (n,)
        s, ascending, positive.
    modulus : array_like, shape (n,)
        Pa, or any unit; positive.
    times : array_like, shape (j,)
        s.

    Raises
    ------
    MaterialError
        For tables that cannot be used, or a modulus that relaxes to nothing.
    """
    time, modulus = checked_relaxation(time, modulus)
    times = np.asarray(times, float)
    decay = np.exp(-np.multiply.outer(time, 1.0 / times))
    even = _even_weights(time)
    matrix = np.hstack([np.ones((len(time), 1)), decay]) * (even / modulus)[:, None]
    found = nonnegative(matrix, even)
    prony = Prony(_over_slow(found, "relaxing modulus"), times)
    fitted = found[0] + decay @ found[1:]
    return PronyFit(prony, "relaxing modulus", time, fitted / modulus - 1.0)


def checked_tan_delta(frequency, tan_delta) -> tuple[np.ndarray, np.ndarray]:
    """A table that `fit_tan_delta` takes, as arrays.

    Raises
    ------
    MaterialError
    """
    frequency, wanted = _checked("frequency", "Hz", frequency, tan_delta)
    _check_loss(wanted)
    if not (wanted > 0).all():
        raise MaterialError("tan delta must be greater than 0 in a table; an elastic material is loss_factor = 0.")
    return frequency, wanted


def checked_moduli(frequency, storage, loss) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A table that `fit_moduli` takes, as arrays; see `checked_tan_delta`."""
    frequency, storage = _checked("frequency", "Hz", frequency, storage)
    _, loss = _checked("frequency", "Hz", frequency, loss)
    _check_positive("storage modulus", frequency, "Hz", storage)
    _check_positive("loss modulus", frequency, "Hz", loss)
    _check_loss(loss / storage)
    return frequency, storage, loss


def checked_relaxation(time, modulus) -> tuple[np.ndarray, np.ndarray]:
    """A table that `fit_relaxation` takes, as arrays; see `checked_tan_delta`."""
    time, modulus = _checked("time", "s", time, modulus)
    _check_positive("modulus", time, "s", modulus)
    return time, modulus


def _checked(name: str, unit: str, at, values) -> tuple[np.ndarray, np.ndarray]:
    """Two columns as arrays: finite, as long as each other, the first one positive and ascending."""
    at, values = np.asarray(at, float), np.asarray(values, float)
    if at.ndim != 1 or at.shape != values.shape:
        raise MaterialError(f"There must be one value for each {name}, but the shapes are {at.shape}, {values.shape}.")
    if not at.size:
        raise MaterialError("There is no row of numbers.")
    if not (np.isfinite(at).all() and np.isfinite(values).all()):
        raise MaterialError("There must be finite numbers only.")
    if at[0] <= 0:
        raise MaterialError(f"The {name} must be greater than 0 {unit}, but {at[0]:g} {unit} was found.")
    for before, after in zip(at, at[1:]):
        if after == before:
            raise MaterialError(f"The {name} {after:g} {unit} appears twice; each must stand once.")
        if after < before:
            raise MaterialError(
                f"The {name} must increase from row to row, but {after:g} {unit} follows {before:g} {unit}."
            )
    return at, values


def _checked_band(band: tuple[float, float]) -> tuple[float, float]:
    low, high = (float(f) for f in band)
    if not 0 < low < high < np.inf:
        raise MaterialError(
            f"A band goes from a positive frequency to a higher one, but {low:g} to {high:g} Hz is given."
        )
    return low, high


def _check_loss(tan_delta: np.ndarray) -> None:
    for value in tan_delta:
        if not 0 <= value <= LARGEST_LOSS_FACTOR:
            raise MaterialError(
                f"A loss factor (tan delta) must lie between 0 and {LARGEST_LOSS_FACTOR:g}, but {value:g} was found."
            )


def _check_positive(what: str, at: np.ndarray, unit: str, values: np.ndarray) -> None:
    bad = np.flatnonzero(values <= 0)
    if bad.size:
        i = bad[0]
        raise MaterialError(f"The {what} must be greater than 0, but at {at[i]:g} {unit} it is {values[i]:g}.")


def _branch(frequency: np.ndarray, times: np.ndarray) -> np.ndarray:
    """(n, j) i omega tau / (1 + i omega tau)."""
    x = 2j * np.pi * np.multiply.outer(frequency, times)
    return x / (1.0 + x)


def _even_weights(at: np.ndarray) -> np.ndarray:
    """Roots of the share of each point in the logarithmic axis, so that crowds of points do not rule."""
    if at.size < 3:
        return np.ones(at.size)
    return np.sqrt(np.gradient(np.log(at)) * at.size / np.log(at[-1] / at[0]))


def _fit_loss(frequency: np.ndarray, wanted: np.ndarray, times: np.ndarray, level: bool = False) -> np.ndarray:
    """Strengths for a tan delta; with `level` the largest error is made small by Lawson's weights, not the mean one."""
    branch, weights = _branch(frequency, times), _even_weights(frequency)
    storage = np.ones(len(frequency))
    best, found = np.inf, np.zeros(len(times))
    for _ in range(_FIT_ROUNDS):
        scale = weights / (wanted * storage)
        strengths = nonnegative((branch.imag - wanted[:, None] * branch.real) * scale[:, None], weights / storage)
        before, storage = storage, 1.0 + branch.real @ strengths
        error = branch.imag @ strengths / storage / wanted - 1.0
        if level:
            largest = np.abs(error).max()
            if largest < best:
                best, found = largest, strengths
            weights = weights * np.sqrt(np.abs(error) / max(largest, 1e-300))
            weights = np.maximum(weights, 1e-6 * weights.max())
        else:
            found = strengths
            if np.abs(storage - before).max() <= 1e-14 * storage.max():
                break
    return found


def _over_slow(found: np.ndarray, what: str) -> np.ndarray:
    if found[0] <= 1e-6 * found.sum():
        raise MaterialError(
            f"The {what} leaves nothing that lasts: the material would flow, and a wall needs a slow modulus above 0."
        )
    return found[1:] / found[0]


def _of_tan_delta(prony: Prony, at: np.ndarray, wanted: np.ndarray) -> PronyFit:
    return PronyFit(prony, "tan delta", at, prony.loss_factor(at) / wanted - 1.0)
