r"""Prony series of a material from its loss factor, from measured moduli or from a relaxation test.

The times are spread over a band of frequencies once and for all; what is left, the strengths, is a non-negative
linear least-squares problem. With x = omega tau, storage and loss over the slow modulus are

    E' = 1 + sum_j g_j x_j^2 / (1 + x_j^2),    E'' = sum_j g_j x_j / (1 + x_j^2),

and tan delta = E''/E' is linear in g once multiplied by E', which is taken from the fit before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dbvfiv.materials.checks import MaterialError
from dbvfiv.materials.nonnegative import nonnegative
from dbvfiv.materials.prony import Prony

LARGEST_LOSS_FACTOR = 2.0
#: How far the ends of the times reach beyond the band, in decades of frequency at its lower and upper end: offset and
#: slope over the decades a branch covers. Measured for loss factors of 0.05 to 0.5, see docs/damping.md.
_LOWER, _UPPER = (0.60, -1.05), (0.86, -1.10)
_ROUNDS = 40
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
    for _ in range(_ROUNDS):
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
