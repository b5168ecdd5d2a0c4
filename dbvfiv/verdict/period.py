"""The period of a signal: where the signal repeats itself best, refined on a spline."""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from .series import Series


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
