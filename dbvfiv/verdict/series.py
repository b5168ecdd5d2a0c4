"""A time series: checks, gaps, even samples, spectrum; its period, the trend from one cycle to the next, and
the shuttings of a valve.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
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


def longest_part(time: np.ndarray, gaps: bool = True) -> tuple[slice, tuple[str, ...]]:
    """Longest part of a record between gaps, the later of equal ones.

    Parameters
    ----------
    time : (k,) array
        Increasing.
    gaps : bool
        Whether there may be gaps.

    Returns
    -------
    part : slice
        Everything if there is no gap.
    notes : tuple of str
        Sentences on gaps and uneven steps.
    """
    after = gaps_in(time) if gaps else np.zeros(0, int)
    edges = np.concatenate([[0], after + 1, [len(time)]])
    sizes = np.diff(edges)
    at = len(sizes) - 1 - int(np.argmax(sizes[::-1]))
    part = slice(int(edges[at]), int(edges[at + 1]))
    notes = []
    if len(after):
        longest = int(after[np.argmax(time[after + 1] - time[after])])
        word = "a gap" if len(after) == 1 else f"{len(after)} gaps, the longest"
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
    """Even samples of a signal."""

    start: float  #: s.
    step: float  #: s.
    values: np.ndarray  #: (k,).

    @classmethod
    def of(cls, time, values) -> Series:
        """From samples at increasing times; uneven ones are interpolated by a cubic spline at their typical distance.
        Raises ValueError if lengths differ, times do not increase, or numbers are not finite.
        """
        time, values = check_samples(time, values)
        gaps = np.diff(time)
        step = float(np.median(gaps))
        if np.ptp(gaps) <= 1e-6 * step or time.size < 4:
            return cls(float(time[0]), float((time[-1] - time[0]) / (time.size - 1)), values)
        # where most lie close together, no more than were given
        step = max(step, (time[-1] - time[0]) / max(200_000, time.size))
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
    """Times and values as arrays (k,), k at least 2. Raises ValueError if lengths differ, times do not increase, or
    numbers are not finite.
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


# -- cycles


@dataclass(frozen=True)
class Trend:
    """Straight line through the logarithms of a sequence."""

    slope: float  #: From one to the next, of the logarithm.
    error: float  #: Standard error of the slope, widened for residuals that hang together.
    change: float  #: Over the whole sequence.
    scatter: float  #: Root mean square about the line.
    smooth: bool  #: Whether what is left about the line is smooth rather than scattered (von Neumann's ratio).

    @property
    def significant(self) -> bool:
        return abs(self.slope) > 4.0 * self.error

    @property
    def step(self) -> float:
        """Relative change from one to the next."""
        return float(np.expm1(min(self.slope, 300.0)))


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


def find_period(series: Series) -> tuple[float, float]:
    """Period to a sample, of four samples at least and half the duration at most, and its mismatch; (nan, nan) if the
    signal never comes back to itself.

    The first lag that matches nearly as well as the best one is taken, which tells a period from its multiples and a
    doubled period from half of it.
    """
    largest = int(0.5 * (len(series.values) - 1))
    if largest <= 4 or np.ptp(series.values) == 0.0:
        return np.nan, np.nan
    error = mismatch(series.values, largest)
    valley = np.flatnonzero((error[1:-1] <= error[:-2]) & (error[1:-1] < error[2:])) + 1
    # what lies before the signal has moved away from itself is no return
    away = np.argmax(error > 0.5 * np.nanmax(error))
    valley = valley[(valley > away) & (valley >= 4)]
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
            if abs(change) < 1e-10 * period:  # far below what any record resolves
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
    """Cycles from the first to the last one."""

    period: float  #: s.
    shape: np.ndarray  #: (k, 128); the signal over each cycle.
    #: (k,); sqrt(2) times the root mean square about the cycle's own mean: the amplitude of a sine, and far less
    #: touched by noise than extremes.
    spread: np.ndarray
    mean: np.ndarray  #: (k,).
    #: (k - 1,); root mean square of the difference of two neighbours about their means, over sqrt(2) times their root
    #: mean square.
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


def harmonics(series: Series, period: float, cycles: int) -> np.ndarray:
    """(k, 2) amplitude and phase of the first eight multiples of the frequency, over the last whole cycles."""
    samples = cycles * 256
    t = series.end - period * cycles * (1.0 - np.arange(samples) / samples)
    values = series.spline()(t)
    count = min(8, max(1, int(0.5 * period / series.step)))
    angle = 2j * np.pi / period * np.arange(1, count + 1)[:, None] * (t - series.start)
    coefficients = 2.0 * np.mean(values * np.exp(-angle), axis=1)
    return np.stack([np.abs(coefficients), np.angle(coefficients)], axis=1)


#: Level over that of a shut valve from which on it is open; between the two it is what it was.
_OPEN = 2.0
#: Shuttings that make chatter, and longest standstill at the end, in intervals, that is not the end of it.
_CHATTER, _STILL = 3, 3.0
#: Standard errors by which the mean interval may change between the two halves.
_REGULAR = 4.0


@dataclass(frozen=True)
class Shuttings:
    """Shuttings in even or uneven samples."""

    #: shut and opened: (k,); samples at which the valve was found shut, and those at which it had last been found open
    #: again before.
    shut: np.ndarray
    opened: np.ndarray
    intervals: np.ndarray  #: (k - 1,), s.
    goes_on: bool  #: True where the series ends before a further one is overdue.

    @classmethod
    def of(cls, time: np.ndarray, values: np.ndarray, level: float) -> Shuttings:
        """Shuttings of a signal (k,) at times (k,): from twice a level or more to the level or less."""
        known = np.flatnonzero((values <= level) | (values > _OPEN * level))
        shut = values[known] <= level
        falls, rises = (np.flatnonzero(shut[1:] & ~shut[:-1]) + 1, np.flatnonzero(~shut[1:] & shut[:-1]) + 1)
        if len(falls) and (not len(rises) or rises[0] > falls[0]):
            rises = np.insert(rises, 0, 0)
        at = known[falls]
        intervals = np.diff(time[at])
        overdue = time[-1] - time[at[-1]] if len(at) else np.inf
        return cls(at, known[rises[: len(falls)]], intervals, bool(overdue <= _STILL * intervals.max(initial=0.0)))

    @property
    def chatters(self) -> bool:
        """True of several that go on."""
        return len(self.shut) >= _CHATTER and self.goes_on

    def kept(self, least: int) -> np.ndarray:
        """The later half of the intervals (k,), s, but not fewer than some number if there are as many."""
        return self.intervals[-max(least, len(self.intervals) // 2) :]

    def is_settled(self, least: int) -> bool:
        """True where enough intervals are known and the mean of the kept ones does not change beyond chance."""
        first, last = np.array_split(self.kept(least), 2)
        if len(first) + len(last) < least:
            return False
        error = np.sqrt(first.var() / len(first) + last.var() / len(last))
        return bool(abs(first.mean() - last.mean()) <= max(_REGULAR * error, 0.02 * last.mean()))

    def evidence(self, time: np.ndarray, opening, velocity, flow) -> dict[str, Any]:
        """Numbers of the chatter, SI, for JSON, from opening, m, velocity of a lip, m/s, and mass flow, kg/s, (k,).

        The speed of a lip is the largest inwards between its widest opening and the shutting.
        """
        whole = slice(self.shut[0], self.shut[-1] + 1)
        widest, speed, shut = [], [], 0.0
        for begin, end, before in zip(self.opened[1:], self.shut[1:], self.shut[:-1]):
            top = begin + int(np.argmax(opening[begin : end + 1]))
            widest.append(float(opening[top]))
            speed.append(float(max(0.0, -np.min(velocity[top : end + 1]))))
            shut += float(time[begin] - time[before])
        length = float(time[self.shut[-1]] - time[self.shut[0]])
        trapezoids = 0.5 * (flow[whole][1:] + flow[whole][:-1]) @ np.diff(time[whole])
        return {
            "shuttings": len(self.shut),
            "rate": 1.0 / float(self.intervals.mean()),
            "interval_scatter": float(self.intervals.std() / self.intervals.mean()),
            "shut_share": shut / length,
            "opening": float(np.mean(widest)),
            "largest_opening": max(widest),
            "impact_speed": float(np.mean(speed)),
            "largest_impact_speed": max(speed),
            "mean_flow": float(trapezoids / length),
        }
