"""A time series: checks, gaps, even samples, smooth interpolation, spectrum."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline, make_interp_spline

#: In a record with even steps, but for gaps, a gap is longer than this many of them.
_EVEN = 3.5
#: In a record with uneven steps, a gap is longer than this many of its longer steps (95th percentile), as samples at
#: random times lie far apart now and then.
_UNEVEN = 4.0
#: Relative difference of steps that rounded times explain.
_ROUNDED = 0.05
_FEWEST = 8


def gaps_in(time: np.ndarray) -> np.ndarray:
    """Samples (g,) after which a record with times (k,) has a gap."""
    steps = np.diff(time)
    if len(steps) < _FEWEST:
        return np.zeros(0, int)
    typical = np.median(steps)
    even = np.mean(np.abs(steps - typical) <= _ROUNDED * typical) > 0.8
    return np.flatnonzero(steps > (_EVEN * typical if even else _UNEVEN * np.percentile(steps, 95)))


def longest_part(time: np.ndarray) -> tuple[slice, tuple[str, ...]]:
    """Longest part of a record between gaps, the later of equal ones.

    Parameters
    ----------
    time : (k,) array
        Increasing.

    Returns
    -------
    part : slice
        Everything if there is no gap.
    notes : tuple of str
        Sentences on gaps and uneven steps.
    """
    gaps = gaps_in(time)
    edges = np.concatenate([[0], gaps + 1, [len(time)]])
    sizes = np.diff(edges)
    at = len(sizes) - 1 - int(np.argmax(sizes[::-1]))
    part = slice(int(edges[at]), int(edges[at + 1]))
    notes = []
    if len(gaps):
        longest = int(gaps[np.argmax(time[gaps + 1] - time[gaps])])
        word = "a gap" if len(gaps) == 1 else f"{len(gaps)} gaps, the longest"
        notes.append(
            f"The record has {word} from {time[longest]:.6g} to {time[longest + 1]:.6g} s; "
            f"what is judged is its longest part without one, {time[part][0]:.6g} to {time[part][-1]:.6g} s."
        )
    steps = np.diff(time[part])
    if len(steps) and np.ptp(steps) > _ROUNDED * np.median(steps):
        notes.append(f"The samples are uneven, {steps.min():.3g} to {steps.max():.3g} s apart, and were interpolated.")
    return part, tuple(notes)


@dataclass(frozen=True)
class Series:
    """Even samples of a signal.

    Attributes
    ----------
    start : float, s
    step : float, s
    values : (k,) array
    """

    start: float
    step: float
    values: np.ndarray

    @classmethod
    def of(cls, time, values) -> Series:
        """From samples at increasing times; uneven ones are interpolated by a cubic spline at their typical distance.

        Raises
        ------
        ValueError
            If lengths differ, times do not increase, or numbers are not finite.
        """
        time, values = check_samples(time, values)
        gaps = np.diff(time)
        step = float(np.median(gaps))
        if np.ptp(gaps) <= 1e-6 * step or time.size < 4:
            return cls(float(time[0]), float((time[-1] - time[0]) / (time.size - 1)), values)
        step = max(step, (time[-1] - time[0]) / 200_000)
        count = int(np.floor((time[-1] - time[0]) / step * (1 + 1e-12)))
        even = time[-1] - step * np.arange(count, -1, -1)
        return cls(float(even[0]), step, CubicSpline(time, values)(even))

    @property
    def duration(self) -> float:
        """Length, s."""
        return self.step * (len(self.values) - 1)

    @property
    def end(self) -> float:
        """Time of the last value, s."""
        return self.start + self.duration

    def last(self, duration: float) -> Series:
        """The end of the series."""
        count = min(len(self.values), max(2, int(round(duration / self.step)) + 1))
        return Series(self.end - (count - 1) * self.step, self.step, self.values[-count:])

    def times(self) -> np.ndarray:
        return self.start + self.step * np.arange(len(self.values))

    def spline(self):
        """Interpolating spline of degree five, or of what the number of samples allows."""
        degree = min(5, len(self.values) - 1)
        degree -= 1 - degree % 2
        return make_interp_spline(self.times(), self.values, k=max(degree, 1))


def check_samples(time, values) -> tuple[np.ndarray, np.ndarray]:
    """Times and values as arrays (k,), k at least 2.

    Raises
    ------
    ValueError
        If lengths differ, times do not increase, or numbers are not finite.
    """
    time, values = np.asarray(time, float), np.asarray(values, float)
    if time.ndim != 1 or time.shape != values.shape:
        raise ValueError(
            f"The series has {time.size} times and {values.size} values; both must be lists of the same length."
        )
    if time.size < 2:
        raise ValueError("A series needs at least two samples.")
    if not (np.isfinite(time).all() and np.isfinite(values).all()):
        where = int(np.flatnonzero(~(np.isfinite(time) & np.isfinite(values)))[0])
        raise ValueError(f"Sample {where + 1} of the series is not a finite number.")
    gaps = np.diff(time)
    if gaps.min() <= 0:
        where = int(np.argmin(gaps > 0))
        raise ValueError(f"The times of the series do not increase at sample {where + 2}.")
    return time, values


def spectrum(series: Series) -> tuple[np.ndarray, np.ndarray]:
    """One-sided amplitude spectrum about the mean with a Hann window: a sine of amplitude a shows a peak of about a.

    Returns
    -------
    frequency : (k,) array, Hz
    amplitude : (k,) array
    """
    values = series.values - series.values.mean()
    window = np.hanning(len(values) + 2)[1:-1]
    amplitude = 2.0 * np.abs(np.fft.rfft(values * window)) / window.sum()
    return np.fft.rfftfreq(len(values), series.step), amplitude


def in_steps(value: float, step: float) -> str:
    """A value with no more digits than its resolution carries.

    Examples
    --------
    >>> in_steps(35.714, 20.0), in_steps(35.714, 0.25)
    ('36', '35.7')
    """
    decimals = max(0, -math.floor(math.log10(step))) if step > 0 else 6
    return f"{value:.{min(decimals, 12)}f}"


def undersampled(series: Series) -> float:
    """Frequency, Hz, of a line that holds most of the signal's power and is sampled fewer than four times a cycle; zero
    without one.
    """
    frequency, amplitude = spectrum(series)
    power = amplitude**2
    at = int(np.argmax(power))
    if 4.0 * frequency[at] * series.step <= 1.0:
        return 0.0
    return float(frequency[at]) if power[max(at - 3, 0) : at + 4].sum() > 0.5 * power.sum() else 0.0


def swings(series: Series) -> int:
    """Number of upward crossings of the signal's mean."""
    above = series.values > series.values.mean()
    return int(np.count_nonzero(above[1:] & ~above[:-1]))
