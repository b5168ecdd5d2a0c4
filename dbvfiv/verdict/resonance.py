"""Damped oscillations that noise drives: frequency and damping of the peaks of a spectrum, with 95 % intervals.

In a band the power density of a response to noise is rational: a pole f - i w for each mode, whose growth rate is
-2 pi w, and a zero beside it for what the modes do together, S = g prod((x - r)^2 + s^2) / ((x - f)^2 + w^2). Peaks
that overlap are poles of one band and fitted together. The ordinates of a periodogram are independent and
exponentially distributed about S (Whittle 1953): the fit has the greatest likelihood and the intervals are those of its
information matrix.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.ndimage import uniform_filter1d
from scipy.optimize import minimize

from .lines import WIDE, Line
from .series import Series

#: Gain in the logarithm of the likelihood from which a peak is one: four more numbers gain so much by chance once in
#: some thousand records of ten candidates.
_GAIN = 14.0
#: Half widths of a peak that a fit looks at on either side, ordinates without which there is none, peaks at most, and
#: poles at most in a band.
_REACH, _FEWEST, _MOST, _TOGETHER = (12.0, 6.0, 3.0, 2.0), 24, 6, 3
#: Damping ratio beyond which a peak is none, and ordinates of a smoothed spectrum over its width.
_BROAD, _SMOOTHED = 0.3, 3.0
#: Half a band at most, over its frequency, and the highest resonance over the highest frequency.
_SHARE, _HIGHEST = 0.25, 0.9
#: Standard errors by which an eighth of a band may differ from a fit.
_EVEN = 3.5
#: Ordinates to which those of a band are thinned, some sixteen over a half width in the widest, and how many a half
#: width needs.
_LEFT, _FINE = 400, 6
#: Bounds of a pole and its zero, each a place and the logarithm of a distance from the axis; in half bands.
_BOX = ((-1.5, 1.5), (-9.0, 1.0), (-30.0, 30.0), (-9.0, 4.0))


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
        if any(abs(old.frequency - start) < 0.5 * _half(old) and width < _half(old) for _, old in found):
            continue
        gain, lines = _fitted(frequency, power, start, width)
        near = [
            old
            for old in found
            if any(abs(old[1].frequency - one.frequency) < _half(old[1]) + _half(one) for one in lines)
        ]
        if all(old[0] < gain for old in near):
            found = [old for old in found if old not in near] + [(gain, one) for one in lines]
    found.sort(key=lambda one: -one[0])
    return tuple(line for _, line in found[:_MOST])


def _half(line: Line) -> float:
    return -line.rate / (2 * np.pi)


def _candidates(frequency: np.ndarray, power: np.ndarray, low: float) -> Iterator[tuple[float, float]]:
    """Frequencies and half widths, Hz, of maxima of the spectrum at several widths of smoothing."""
    step, length = frequency[1] - frequency[0], 4
    while length * 8 < len(power):
        window = np.hanning(length + 2)[1:-1]
        smooth = np.convolve(power, window / window.sum(), "same")
        inner = np.flatnonzero((smooth[1:-1] > smooth[:-2]) & (smooth[1:-1] >= smooth[2:])) + 1
        inner = inner[(frequency[inner] > low) & (frequency[inner] < _HIGHEST * frequency[-1])]
        around = np.convolve(power, np.full(8 * length, 1.0 / (8 * length)), "same")
        best = inner[np.argsort(-(smooth / around)[inner])[:_MOST]]
        for at in best:
            yield float(frequency[at]), length * step / _SMOOTHED
        length *= 3


def _fitted(frequency: np.ndarray, power: np.ndarray, start: float, width: float) -> tuple[float, list[Line]]:
    """Gain of the likelihood over a smooth spectrum, and the resonances of the widest band about a start in which a few
    are all there is.
    """
    for wide in _REACH:
        at, half = start, width
        for _ in range(2):  # the band follows the width that is found
            half = max(half, 0.5 * _FEWEST * frequency[0] / wide)
            middle, reach = at, min(wide * half, _SHARE * at)
            near = np.abs(frequency - middle) < reach
            if np.count_nonzero(near) < _FEWEST:
                return 0.0, []
            x, y, many = _thinned((frequency[near] - middle) / reach, power[near] / power[near].mean())
            inside = np.abs(x) < max(half / reach, 2.0 / len(x))
            height = max(float(y[inside].mean()), 1e-12) / max(float(np.quantile(y, 0.3)), 1e-3)
            fit = _least(x, y, [0.0, *_bump(0.0, half / reach, height)])
            at, half = middle + fit[1] * reach, float(np.exp(fit[2])) * reach
            if not abs(fit[1]) < 0.6 or half > reach:
                break
        flat, poles = _cost(x, y, _least(x, y, [0.0])), 1
        while poles < _TOGETHER:
            more = min((_least(x, y, [*fit, *bump]) for bump in _bumps(x, y, fit)), key=lambda one: _cost(x, y, one))
            if many * (_cost(x, y, fit) - _cost(x, y, more)) < _GAIN:
                break
            fit, poles = more, poles + 1
        if many > 1 and np.exp(min(fit[2::4])) < _FINE * (x[1] - x[0]):
            continue
        ratio = y * np.exp(-_log_density(x, fit))
        if max(abs(part.mean() - 1) * np.sqrt(many * len(part)) for part in np.array_split(ratio, 8)) < _EVEN:
            found = _lines_of((x, y, many), fit, (middle, reach), power[near].mean())
            lines = [one for one in found if one.frequency < _HIGHEST * frequency[-1]]
            return many * (flat - _cost(x, y, fit)), lines
    return 0.0, []


def _thinned(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray, int]:
    """Means of so many neighbours that some hundred ordinates are left, over which the density is smooth."""
    many = max(1, len(x) // _LEFT)
    x, y = (part[: len(x) // many * many].reshape(-1, many).mean(axis=1) for part in (x, y))
    return x, y, many


def _bump(place: float, width: float, height: float) -> list[float]:
    """A pole and a zero that together raise a density by a factor at a place."""
    return [place, np.log(width), place, np.log(width) + 0.5 * np.log(height)]


def _bumps(x: np.ndarray, y: np.ndarray, numbers: np.ndarray) -> list[list[float]]:
    """Starts of a further pole: the two likeliest places where the spectrum stands over a fit, by running means of
    several lengths.
    """
    ratio, length, found = y * np.exp(-_log_density(x, numbers)), _FEWEST // 4, []
    while 3 * length < len(x):
        smooth = uniform_filter1d(ratio, length, mode="nearest")
        at = int(np.argmax(smooth))
        height = max(float(smooth[at]), 1.2)
        found.append((length * (height - 1.0 - np.log(height)), _bump(x[at], length / len(x), height)))
        length *= 2
    return [bump for _, bump in sorted(found)[-2:]]


def _log_density(x: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Logarithm of S: that of g, then place and logarithm of the distance from the axis of a pole and of its zero."""
    log = np.full(len(x), numbers[0])
    for f, w, r, s in np.reshape(numbers[1:], (-1, 4)):
        log += np.log((x - r) ** 2 + np.exp(2 * s)) - np.log((x - f) ** 2 + np.exp(2 * w))
    return log


def _slopes(x: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Derivatives (p, k) of the logarithm of S by its numbers."""
    rows = [np.ones(len(x))]
    for f, w, r, s in np.reshape(numbers[1:], (-1, 4)):
        for sign, place, log in ((-1.0, f, w), (1.0, r, s)):
            square = (x - place) ** 2 + np.exp(2 * log)
            rows += [-2.0 * sign * (x - place) / square, 2.0 * sign * np.exp(2 * log) / square]
    return np.array(rows)


def _cost(x: np.ndarray, y: np.ndarray, numbers: np.ndarray) -> float:
    """Less of the logarithm of the likelihood of exponentially distributed ordinates."""
    log = _log_density(x, numbers)
    return float(np.sum(log + y * np.exp(-log)))


def _least(x: np.ndarray, y: np.ndarray, start: list[float]) -> np.ndarray:
    """Numbers of the greatest likelihood."""

    def cost(numbers):
        log = _log_density(x, numbers)
        ratio = y * np.exp(-log)
        return float(np.sum(log + ratio)), _slopes(x, numbers) @ (1.0 - ratio)

    start = np.array(start)
    start[0] += np.log(np.mean(y * np.exp(-_log_density(x, start))))
    box = [(-60.0, 60.0), *_BOX * (len(start) // 4)]
    return minimize(cost, start, jac=True, method="L-BFGS-B", bounds=box, options={"maxiter": 300}).x


def _lines_of(ordinates, numbers: np.ndarray, band: tuple[float, float], scale: float) -> list[Line]:
    """Resonances of the poles of a band, given by its middle and half its width, Hz, and the unit of its density."""
    (x, y, many), (at, reach) = ordinates, band
    slopes, found = np.sqrt(many) * _slopes(x, numbers), []
    spreads = np.sqrt(np.maximum(np.diag(np.linalg.pinv(slopes @ slopes.T, rcond=1e-12, hermitian=True)), 0.0))
    for k in range(1, len(numbers), 4):
        place, half = at + numbers[k] * reach, float(np.exp(numbers[k + 1])) * reach
        rest = np.delete(numbers, range(k, k + 4))
        errors = WIDE * reach * spreads[k], WIDE * 2 * np.pi * half * spreads[k + 1], np.nan
        if abs(numbers[k]) + half / reach > 1 or half > _BROAD * place or errors[1] > 2 * np.pi * half:
            continue
        if many * (_cost(x, y, _least(x, y, rest)) - _cost(x, y, numbers)) < _GAIN:
            continue
        # coefficient of 1 / (1 + u^2), u = (f - place) / half, in partial fractions
        pole = complex(numbers[k], np.exp(numbers[k + 1]))
        zeros = np.prod([(pole - r) ** 2 + np.exp(2 * s) for r, s in zip(numbers[3::4], numbers[4::4])])
        others = np.prod([(pole - f) ** 2 + np.exp(2 * w) for f, w in zip(rest[1::4], rest[2::4])])
        peak = np.exp(numbers[0] - 2 * numbers[k + 1]) * (zeros / others).real
        amplitude = float(np.sqrt(2.0 * np.pi * half * max(peak, 0.0) * scale))
        found.append(Line(place, -2 * np.pi * half, amplitude, errors=errors, called="resonance"))
    return found
