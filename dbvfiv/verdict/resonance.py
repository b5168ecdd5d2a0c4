"""Damped oscillations that noise drives: frequency and damping of the peaks of a spectrum, with 95 % intervals.

About a peak the power density of a response is that of one pole beside whatever is smooth, other modes and noise of the
instrument: S = (a0 + a1 x + a2 x^2) / (x^2 + w^2), x = f - f0, with the growth rate -2 pi w. The ordinates of a
periodogram are independent and exponentially distributed about S (Whittle 1953): the fit has the greatest likelihood
and the intervals are those of its information matrix.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from scipy.optimize import minimize

from .lines import WIDE, Line
from .series import Series

#: Gain in the logarithm of the likelihood over a smooth spectrum from which a peak is one: three more numbers gain so
#: much by chance once in some thousand records of ten candidates.
_GAIN = 14.0
#: Half widths of a peak that a fit looks at on either side, ordinates without which there is none, peaks at most.
_REACH, _FEWEST, _MOST = (6.0, 3.0, 2.0), 24, 6
#: Damping ratio beyond which a peak is none, and ordinates of a smoothed spectrum over its width.
_BROAD, _SMOOTHED = 0.3, 3.0
#: Standard errors by which an eighth of a band may differ from a fit.
_EVEN = 3.5
#: Bounds of the numbers of a peak, see `_log_density`.
_BOX = ((-1.0, 1.0), (-9.0, 1.0), (-30.0, 30.0), (-4.0, 4.0), (-30.0, 30.0))


def resonances(series: Series, low: float = 0.0) -> tuple[Line, ...]:
    """Resonances in even samples, the most certain first; `low`, Hz, is a frequency below which a level moves."""
    values = series.values - series.values.mean()
    count = len(values)
    if count < 8 * _FEWEST:
        return ()
    frequency = np.fft.rfftfreq(count, series.step)[1:-1]
    power = 2.0 * series.step / count * np.abs(np.fft.rfft(values))[1:-1] ** 2
    found: list[tuple[float, Line]] = []
    for start, width in _candidates(frequency, power, max(low, 8.0 / series.duration)):
        if any(abs(old[1].frequency - start) < 0.5 * _half(old[1]) and width < _half(old[1]) for old in found):
            continue
        one = _fitted(frequency, power, start, width)
        if one is None:
            continue
        gain, line, level = one
        near = [old for old in found if abs(old[1].frequency - line.frequency) < _half(old[1]) + _half(line)]
        if any(old[0] >= gain for old in near):
            continue
        found = [old for old in found if old not in near]
        amplitude = float(np.sqrt(max(level, 0.0)))
        found.append((gain, Line(line.frequency, line.rate, amplitude, 0.0, series.start, line.errors, "resonance")))
    found.sort(key=lambda one: -one[0])
    return tuple(line for _, line in found[:_MOST])


def _half(line: Line) -> float:
    return -line.rate / (2 * np.pi)


def _candidates(frequency: np.ndarray, power: np.ndarray, low: float):
    """Frequencies and half widths, Hz, of maxima of the spectrum at several widths of smoothing."""
    step, length = frequency[1] - frequency[0], 4
    while length * 8 < len(power):
        window = np.hanning(length + 2)[1:-1]
        smooth = np.convolve(power, window / window.sum(), "same")
        inner = np.flatnonzero((smooth[1:-1] > smooth[:-2]) & (smooth[1:-1] >= smooth[2:])) + 1
        inner = inner[(frequency[inner] > low) & (frequency[inner] < 0.9 * frequency[-1])]
        around = np.convolve(power, np.full(8 * length, 1.0 / (8 * length)), "same")
        best = inner[np.argsort(-(smooth / around)[inner])[:_MOST]]
        for at in best:
            yield float(frequency[at]), length * step / _SMOOTHED
        length *= 3


def _fitted(frequency: np.ndarray, power: np.ndarray, start: float, width: float):
    """Gain of the likelihood, resonance and mean square about a start, in the widest band in which one peak is all
    there is; None where there is none.
    """
    for wide in _REACH:
        at, half = start, width
        for _ in range(2):  # the band follows the width that is found
            half = max(half, 0.5 * _FEWEST * frequency[0] / wide)
            reach = min(wide * half, 0.5 * at)
            near = np.abs(frequency - at) < reach
            if np.count_nonzero(near) < _FEWEST:
                return None
            x, y = (frequency[near] - at) / reach, power[near] / power[near].mean()
            inside = np.abs(x) < max(half / reach, 2.0 / len(x))
            peak = np.log(max(float(y[inside].mean()), 1e-12))
            rest = np.log(max(float(np.quantile(y, 0.3)), 1e-3))
            found = _least(partial(_log_density, x), [0.0, np.log(half / reach), peak, 0.0, rest], y)
            at, half = at + found.x[0] * reach, float(np.exp(found.x[1])) * reach
            if not abs(found.x[0]) < 0.6 or at <= 0 or half > min(_BROAD * at, reach):
                return None
        blocks = np.array_split(y * np.exp(-_log_density(x, found.x)), 8)
        if max(abs(block.mean() - 1) * np.sqrt(len(block)) for block in blocks) < _EVEN:
            break
    else:
        return None
    flat = _least(lambda p: p[0] + p[1] * x, [0.0, 0.0], y)
    slopes = _slopes(partial(_log_density, x), found.x)
    spreads = np.sqrt(np.maximum(np.diag(np.linalg.pinv(slopes @ slopes.T)), 0.0))
    errors = WIDE * reach * spreads[0], WIDE * 2 * np.pi * half * spreads[1], np.nan
    if flat.fun - found.fun < _GAIN or errors[1] > 2 * np.pi * half or found.x[2] - found.x[4] < np.log(2):
        return None
    density = np.exp(_log_density(x, found.x)) - np.exp(found.x[4])
    mean_square = 2.0 * max(density.mean(), 0.0) * power[near].mean() * 2 * reach
    return flat.fun - found.fun, Line(at, -2 * np.pi * half, errors=errors), mean_square


def _log_density(x: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Logarithm of S: place, logarithm of the half width, of the density at the peak, skewness, of the density far off.

    The skewness lies between -1 and 1, where S touches zero.
    """
    place, width, peak, skew, rest = numbers
    u = (x - place) * np.exp(-width)
    top = np.exp(peak) + np.exp(rest) * u**2 + 2.0 * np.tanh(skew) * np.exp(0.5 * (peak + rest)) * u
    return np.log(np.maximum(top, 1e-300)) - np.log1p(u**2)


def _least(density, start, y: np.ndarray):
    """Numbers of the greatest likelihood of exponentially distributed ordinates."""

    def cost(numbers):
        log = density(numbers)
        ratio = y * np.exp(-log)
        return float(np.sum(log + ratio)), _slopes(density, numbers) @ (1.0 - ratio)

    box = _BOX[: len(start)] if len(start) > 2 else None
    return minimize(cost, np.asarray(start, float), jac=True, method="L-BFGS-B", bounds=box, options={"maxiter": 300})


def _slopes(density, numbers: np.ndarray) -> np.ndarray:
    """Derivatives (p, k) of the logarithm of a density by its numbers, by central differences."""
    step, rows = 1e-5, []
    for i in range(len(numbers)):
        move = np.zeros(len(numbers))
        move[i] = step
        rows.append((density(numbers + move) - density(numbers - move)) / (2 * step))
    return np.array(rows)
