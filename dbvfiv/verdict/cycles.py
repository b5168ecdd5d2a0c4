"""Cycles of a known period, counted back from the end: amplitudes, means, mismatch from one to the next, harmonics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .series import Series

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
