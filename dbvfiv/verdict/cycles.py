"""Period and cycles of a signal: amplitudes, means, harmonics, and the trend from one cycle to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from .series import Series


@dataclass(frozen=True)
class Trend:
    """Straight line through the logarithms of a sequence.

    Attributes
    ----------
    slope : float
        Relative change from one to the next.
    error : float
        Standard error of the slope, widened for residuals that hang together.
    change : float
        Over the whole sequence.
    scatter : float
        Root mean square about the line.
    smooth : bool
        Whether what is left about the line is smooth rather than scattered (von Neumann's ratio).
    """

    slope: float
    error: float
    change: float
    scatter: float
    smooth: bool

    @property
    def significant(self) -> bool:
        return abs(self.slope) > 4.0 * self.error


def trend_of(values: np.ndarray) -> Trend:
    """Trend of positive values (k,), k at least 3."""
    y = np.log(np.maximum(values, 1e-300))
    x = np.arange(len(y)) - 0.5 * (len(y) - 1)
    slope = float(x @ y / (x @ x))
    left = y - y.mean() - slope * x
    scatter = float(np.sqrt(np.mean(left**2)))
    ratio = np.sum(np.diff(left) ** 2) / max(np.sum(left**2), 1e-300)
    freedom = max(len(y) - 2, 1)
    error = np.sqrt(np.sum(left**2) / freedom / (x @ x)) * np.sqrt(max(1.0, 2.0 / max(ratio, 0.1)))
    return Trend(slope, float(error), slope * (len(y) - 1), scatter, bool(len(y) >= 6 and ratio < 0.8))


def remaining(values: np.ndarray) -> float:
    """Relative change still to come if the sequence goes on as it does: geometric extrapolation of two halves; infinite
    if it does not settle.
    """
    half = len(values) // 2
    first, last = trend_of(values[: half + 1]), trend_of(values[-half - 1 :])
    if abs(last.change) < 1e-12:
        return 0.0
    ratio = last.change / first.change if first.change else np.inf
    if not abs(ratio) < 0.7:
        return np.inf
    return last.change * ratio / (1.0 - ratio)


def settled(values: np.ndarray, band: float) -> int:
    """Number of last values that stay within a relative band about the last three's mean."""
    level = values[-3:].mean()
    outside = np.flatnonzero(np.abs(values - level) > band * level)
    return len(values) - (int(outside[-1]) + 1 if len(outside) else 0)


def comes_and_goes(values: np.ndarray, band: float) -> bool:
    """True where the sequence turned back more than once by more than a relative band: beats, no approach."""
    level = values.max()
    turns, direction, reference = 0, 0, values[0]
    for value in values[1:]:
        if direction >= 0 and value < reference - band * level:
            turns, direction, reference = turns + (direction > 0), -1, value
        elif direction <= 0 and value > reference + band * level:
            turns, direction, reference = turns + (direction < 0), 1, value
        elif (direction > 0 and value > reference) or (direction < 0 and value < reference):
            reference = value
    return turns >= 2


def mismatch(values: np.ndarray, largest: int) -> np.ndarray:
    """Root mean square of x(t + lag) - x(t) over that of unrelated signals, for lags 0..largest (largest + 1,)."""
    x = values - values.mean()
    count = len(x)
    size = next_fast_len(2 * count)
    spectrum = rfft(x, size)
    product = irfft(spectrum * np.conj(spectrum), size)[: largest + 1]
    squares = np.concatenate([[0.0], np.cumsum(x * x)])
    lags = np.arange(largest + 1)
    both = squares[count - lags] + (squares[count] - squares[lags])
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.sqrt(np.maximum(both - 2.0 * product, 0.0) / both)


def find_period(series: Series, longest: float = 0.5, samples: int = 4) -> tuple[float, float]:
    """Period to a sample and its mismatch; (nan, nan) if the signal never comes back to itself.

    The first lag that matches nearly as well as the best one is taken, which tells a period from its multiples and a
    doubled period from half of it.

    Parameters
    ----------
    longest : float
        Longest period over the duration.
    samples : int
        Smallest number of samples of a period.
    """
    largest = int(longest * (len(series.values) - 1))
    if largest <= samples or np.ptp(series.values) == 0.0:
        return np.nan, np.nan
    error = mismatch(series.values, largest)
    valley = np.flatnonzero((error[1:-1] <= error[:-2]) & (error[1:-1] < error[2:])) + 1
    # what lies before the signal has moved away from itself is no return
    away = np.argmax(error > 0.5 * np.nanmax(error))
    valley = valley[(valley > away) & (valley >= samples)]
    if not len(valley):
        return np.nan, np.nan
    # a lag between two samples leaves a mismatch of half the slope of the valley's sides
    between = 0.5 * np.maximum(np.abs(error[valley] - error[valley - 1]), np.abs(error[valley + 1] - error[valley]))
    best = np.min(error[valley])
    close = valley[error[valley] - between <= 1.15 * best + 0.01]
    lag = int(close[0]) if len(close) else int(valley[np.argmin(error[valley])])
    return lag * series.step, float(error[lag])


def refine(series: Series, period: float, error: float = 0.0) -> tuple[float, float]:
    """Period at which the signal repeats best, by Newton's iterations on a spline, and the mismatch there.

    A constant difference between a cycle and the next, slow drift, is left out of account. Where the first guess
    repeats badly the signal is smoothed over a twentieth of the period first, as noise has no slope to go by.
    """
    spline = (smoothed(series, period / 20.0) if error > 0.02 else series).spline()
    slope = spline.derivative()
    for multiple in (1, 2, 4, 8, 16):
        lag = multiple * period
        if lag > 0.6 * series.duration:
            break
        t = np.linspace(series.start, series.end - 1.02 * lag, max(400, min(20_000, len(series.values))))
        here = spline(t)
        for _ in range(15):
            there, rate = spline(t + lag), slope(t + lag)
            rate -= rate.mean()
            change = np.dot(here - there, rate) / max(np.dot(rate, rate), 1e-300)
            change = float(np.clip(change, -0.02 * period, 0.02 * period))
            lag = min(lag + change, series.end - t[-1])
            if abs(change) < 1e-13 * period:
                break
        if abs(lag / multiple - period) > 0.1 * period / multiple:
            break
        period = lag / multiple
    spline = series.spline()
    t = np.linspace(series.start, series.end - period, max(400, min(20_000, len(series.values))))
    here, there = spline(t), spline(t + period)
    here, there = here - here.mean(), there - there.mean()
    both = np.mean(here**2 + there**2)
    return period, float(np.sqrt(np.mean((there - here) ** 2) / both)) if both > 0 else np.nan


def smoothed(series: Series, width: float) -> Series:
    """Running mean twice over a width, s."""
    count = max(1, int(round(width / series.step)))
    if count == 1:
        return series
    window = np.ones(count) / count
    padded = np.pad(series.values, count, mode="edge")
    values = np.convolve(np.convolve(padded, window, "same"), window, "same")[count:-count]
    return Series(series.start, series.step, values)


_PER_CYCLE = 128


@dataclass(frozen=True)
class Cycles:
    """Cycles from the first to the last one.

    Attributes
    ----------
    period : float, s
    shape : (k, 128) array
        The signal over each cycle.
    spread : (k,) array
        sqrt(2) times the root mean square about the cycle's own mean: the amplitude of a sine, and far less touched by
        noise than extremes.
    mean : (k,) array
    error : (k - 1,) array
        Root mean square of the difference of two neighbours about their means, over sqrt(2) times their root mean
        square.
    """

    period: float
    shape: np.ndarray
    spread: np.ndarray
    mean: np.ndarray
    error: np.ndarray

    @classmethod
    def of(cls, series: Series, period: float) -> Cycles:
        count = int(np.floor(series.duration / period * (1 + 1e-9)))
        spline = series.spline()
        phase = np.arange(_PER_CYCLE) / _PER_CYCLE
        starts = series.end - period * np.arange(count, 0, -1)
        shape = spline(starts[:, None] + period * phase)
        mean = shape.mean(axis=1)
        power = np.mean((shape - mean[:, None]) ** 2, axis=1)
        change = np.mean(np.diff(shape - mean[:, None], axis=0) ** 2, axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            error = np.sqrt(change / (power[1:] + power[:-1]))
        return cls(period, shape, np.sqrt(2.0 * power), mean, error)

    def __len__(self) -> int:
        return len(self.spread)

    def last(self, count: int) -> Cycles:
        count = min(count, len(self))
        return Cycles(
            self.period,
            self.shape[-count:],
            self.spread[-count:],
            self.mean[-count:],
            self.error[len(self.error) - count + 1 :],
        )

    def pace(self) -> np.ndarray:
        """(k - 1,) frequency from each cycle to the next over that of the period, by the phase of the strongest
        multiple.
        """
        lines = np.fft.rfft(self.shape, axis=1)[:, 1:]
        number = int(np.argmax(np.sum(np.abs(lines) ** 2, axis=0)))
        turn = np.angle(lines[1:, number] * np.conj(lines[:-1, number]))
        return 1.0 + turn / (2.0 * np.pi * (number + 1))


def extremes(series: Series, period: float) -> tuple[float, float]:
    """Smallest and largest value over the last cycle, between samples too."""
    part = series.last(min(series.duration, period * 1.25 + 6 * series.step))
    spline = part.spline()
    t = np.linspace(part.end - period, part.end, 4001)
    values = spline(t)
    found = []
    for sign in (-1.0, 1.0):
        at = int(np.argmax(sign * values))
        if 0 < at < len(t) - 1:
            a, b, c = values[at - 1 : at + 2]
            bend = a - 2 * b + c
            found.append(b - (c - a) ** 2 / (8 * bend) if bend else b)
        else:
            found.append(values[at])
    return float(found[0]), float(found[1])


def harmonics(series: Series, period: float, cycles: int, count: int = 8) -> np.ndarray:
    """(k, 2) amplitude and phase of the multiples of the frequency, over the last whole cycles."""
    samples = cycles * 256
    t = series.end - period * cycles * (1.0 - np.arange(samples) / samples)
    values = series.spline()(t)
    count = min(count, max(1, int(0.5 * period / series.step)))
    angle = 2j * np.pi / period * np.arange(1, count + 1)[:, None] * (t - series.start)
    coefficients = 2.0 * np.mean(values * np.exp(-angle), axis=1)
    return np.stack([np.abs(coefficients), np.angle(coefficients)], axis=1)
