"""Oscillations in a record under noise: constant, growing or ringing down, with 95 % intervals; and that noise.

A model of a few oscillations a exp(rate t) cos(2 pi f t + phase) on a polynomial level is fitted by least squares
(variable projection with Levenberg's damping); starting values are peaks of spectra of the whole and of its parts. The
intervals are those of Cramer and Rao for noise of the density found about each oscillation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.ndimage import uniform_filter1d
from scipy.special import erfcx

from .series import Series

#: Half a 95 % interval over the standard error.
WIDE = 1.96
#: Margin of a peak over the largest of so many values of a noise's spectrum, which is the logarithm of their number in
#: the mean; beyond it lies noise once in a thousand records.
PEAK = 7.0
#: Lines looked for at most, amplitude of the smallest over the largest, and degree of the level below them.
_MOST, _SMALLEST, LEVEL = 12, 0.01, 5
#: Resolutions within which lines are fitted together.
_NEAR = 10.0
#: Rounds of a fit to clipped samples at most, and relative change of its amplitudes at which it ends.
_HIDDEN, _SETTLED = 60, 1e-6
#: Multiples of the mains looked for, how far off, Hz, the mains may be, and their cycles without which a record does
#: not tell them from what oscillates.
_MULTIPLES, _OFF, _CYCLES = 8, 0.2, 5


@dataclass(frozen=True)
class Line:
    """An oscillation amplitude exp(rate (t - start)) cos(2 pi frequency (t - start) + phase).

    Attributes
    ----------
    frequency, rate : float, Hz, 1/s
    amplitude : float
        At `start`.
    phase : float, rad
    start : float, s
    errors : (float, float, float)
        Half the 95 % intervals of frequency, rate and amplitude.
    ratio_error : float
        Half the 95 % interval of the damping ratio.
    called : str
        "mains" or "" or what it is beside the strongest.
    """

    frequency: float
    rate: float = 0.0
    amplitude: float = 0.0
    phase: float = 0.0
    start: float = 0.0
    errors: tuple[float, float, float] = (np.nan, np.nan, np.nan)
    called: str = ""

    @property
    def damping_ratio(self) -> float:
        return -self.rate / float(np.hypot(self.rate, 2 * np.pi * self.frequency))

    @property
    def ratio_error(self) -> float:
        size = float(np.hypot(self.rate, 2 * np.pi * self.frequency))
        return float(np.hypot(self.errors[1], self.damping_ratio * 2 * np.pi * self.errors[0])) / size

    @property
    def change(self) -> float:
        """Relative change of the amplitude from one cycle to the next."""
        return float(np.expm1(min(self.rate / self.frequency, 300.0)))

    def within(self, other: float, more: float = 0.0) -> bool:
        """True where a frequency is this one within the intervals and some more, Hz."""
        return abs(self.frequency - other) <= 2.0 * self.errors[0] + more


@dataclass(frozen=True)
class Fit:
    """Oscillations and level fitted to samples."""

    lines: tuple[Line, ...]
    left: np.ndarray  #: (k,); what is left of the samples.
    level: np.ndarray  #: (k,); the polynomial below the oscillations.


def density(values: np.ndarray, step: float) -> tuple[np.ndarray, np.ndarray]:
    """One-sided power density (Hann window), unit squared per Hz, and the density of the noise in it: medians over
    bands that widen with the frequency, which lines do not move.

    Returns
    -------
    power, floor : (k,) arrays
        At the frequencies of `numpy.fft.rfftfreq`.
    """
    window = np.hanning(len(values) + 2)[1:-1]
    power = 2.0 * step * np.abs(np.fft.rfft((values - values.mean()) * window)) ** 2 / (window @ window)
    edges = [1]
    while edges[-1] < len(power):
        edges.append(edges[-1] + max(24, edges[-1] // 4))
    edges[-1] = len(power)
    if len(edges) > 2 and edges[-1] - edges[-2] < 16:
        del edges[-2]
    middles = [0.5 * (a + b) for a, b in zip(edges, edges[1:])]
    medians = [np.median(power[a:b]) for a, b in zip(edges, edges[1:])]
    floor = np.exp(np.interp(np.arange(len(power)), middles, np.log(np.maximum(medians, 1e-300)))) / np.log(2.0)
    return power, floor


def strongest(values: np.ndarray, step: float, low: float = 0.0, high: float = np.inf, parts: bool = True):
    """The cell of spectra of the whole and of its parts that stands highest over the noise.

    Parameters
    ----------
    values : (k,) array
    step : float, s
    low, high : float, Hz
        Band looked at.
    parts : bool
        Look at quarters, sixteenths and 64ths too, half overlapping, which show what does not last.

    Returns
    -------
    frequency : float, Hz
        Not a number if nothing stands out.
    margin : float
        Of its height over the highest that noise makes, over the density of the noise.
    energy : float
        Of an oscillation that makes it: amplitude squared times its duration over 4, s.
    at : (int, int)
        First sample and number of samples of the cell.
    """
    count = len(values)
    best = (np.nan, -np.inf, 0.0, (0, count))
    _, floor = density(values, step)
    grid = np.fft.rfftfreq(count, step)
    for share in (1, 4, 16, 64) if parts else (1,):
        length = count // share
        if length < 64:
            break
        window = np.hanning(length + 2)[1:-1]
        frames = sliding_window_view(values, length)[:: max(length // 2, 1)]
        frames = frames - frames.mean(axis=1, keepdims=True)
        power = 2.0 * step * np.abs(np.fft.rfft(frames * window, axis=1)) ** 2 / (window @ window)
        frequency = np.fft.rfftfreq(length, step)
        chosen = np.flatnonzero(
            (frequency > max(low, (2.5 if share > 1 else 1.5) / (length * step))) & (frequency < high)
        )
        if not len(chosen):
            continue
        ratio = power[:, chosen] / np.interp(frequency[chosen], grid, floor)
        beside = np.maximum(power[:, chosen - 1], power[:, np.minimum(chosen + 1, power.shape[1] - 1)])
        margin = np.where(power[:, chosen] >= beside, ratio - np.log(ratio.size) - PEAK, -np.inf)
        row, column = np.unravel_index(int(np.argmax(margin)), margin.shape)
        if margin[row, column] > best[1]:
            k = int(chosen[column])
            found = float(frequency[k])
            if 0 < k < power.shape[1] - 1:
                a, b, c = np.log(np.maximum(power[row, k - 1 : k + 2], 1e-300))
                found += 0.5 * (a - c) / ((a - 2 * b + c) or 1.0) * frequency[1]
            # a sine of amplitude a over the cell has the peak a^2 step (sum w)^2 / (2 sum w^2)
            energy = float(power[row, k]) * 0.5 * (window @ window) * length / window.sum() ** 2
            best = (found, float(margin[row, column]), energy, (row * max(length // 2, 1), length))
    return best if best[1] > 0 else (np.nan, -np.inf, 0.0, (0, count))


def fit(
    series: Series,
    lines: Sequence[Line],
    level: int = 0,
    *,
    rates: bool = False,
    rails: tuple[float, float] | None = None,
    rounds: int = 12,
) -> Fit:
    """Fit oscillations on a polynomial level to even samples by least squares, from a guess of their frequencies.

    Parameters
    ----------
    lines : sequence of Line
        Frequencies, and rates where they are not zero, to start from.
    level : int
        Degree of the polynomial.
    rates : bool
        Fit the rate of the first one too, which is constant otherwise.
    rails : (float, float), optional
        Smallest and largest value of a record that is clipped there: such samples count as beyond, by what is expected
        there.
    """
    values, duration = series.values, series.duration
    x = (series.times() - series.start) / duration
    level_columns = np.polynomial.legendre.legvander(2.0 * x - 1.0, level)
    count = len(lines)
    place = np.array([[line.frequency, line.rate] for line in lines]).reshape(-1, 2) * duration
    free = np.zeros((count, 2), bool)
    free[:, 0] = True
    free[:1, 1] = rates
    wanted, weight = values, np.ones(1)

    def columns(place: np.ndarray) -> np.ndarray:
        sides = [level_columns]
        for turns, growth in place:
            wave = _powers(growth + 2j * np.pi * turns, x) * np.exp(-max(growth, 0.0))
            sides.append(np.stack([wave.real, wave.imag], axis=1))
        return np.concatenate(sides, axis=1)

    def project(place: np.ndarray):
        matrix = columns(place)
        weighted = weight[:, None] * matrix if rails else matrix
        gram = weighted.T @ matrix
        gram[np.diag_indices(len(gram))] *= 1.0 + 1e-12
        try:
            found = np.linalg.solve(gram, weighted.T @ wanted)
        except np.linalg.LinAlgError:
            found = np.linalg.lstsq(gram, weighted.T @ wanted, rcond=None)[0]
        left = wanted - matrix @ found
        return matrix, found, left, float((weight * left) @ left)

    def slopes(place: np.ndarray, matrix: np.ndarray, found: np.ndarray) -> np.ndarray:
        sides = []
        for k, (_turns, growth) in enumerate(place):
            at = level + 1 + 2 * k
            cosine, sine = matrix[:, at], matrix[:, at + 1]
            a, b = found[at : at + 2]
            if free[k, 0]:
                sides.append(2 * np.pi * x * (b * cosine - a * sine))
            if free[k, 1]:
                sides.append((x - (growth > 0)) * (a * cosine + b * sine))
        return np.stack(sides, axis=1)

    matrix, found, left, square = project(place)
    damping = 1e-6
    for _ in range(rounds if count else 0):
        whole = np.concatenate([matrix, slopes(place, matrix, found)], axis=1)
        gram, size = _gram(whole, weight)
        right = whole.T @ (weight * left) / size
        better = False
        for _ in range(6):
            try:
                step = np.linalg.solve(gram + damping * np.eye(len(gram)), right) / size
            except np.linalg.LinAlgError:  # two columns alike, as of a line that has died at once
                damping = max(10.0 * damping, 1e-4)
                continue
            change = np.zeros_like(place)
            change[free] = np.clip(step[matrix.shape[1] :], -1.0, 1.0) * np.where(
                np.abs(place[free]) > 20, 1.0 + 0.02 * np.abs(place[free]) * (np.nonzero(free)[1] == 1), 1.0
            )
            trial = project(place + change)
            if trial[3] <= square * (1 + 1e-12):
                better = True
                break
            damping = max(10.0 * damping, 1e-4)
        if not better:
            break
        place, damping = place + change, 0.1 * damping
        gain = square - trial[3]
        matrix, found, left, square = trial
        if rails is not None:
            wanted, weight = _beyond(values, wanted - left, left, rails)
            before = found
            matrix, found, left, square = project(place)
            if np.abs(found - before).max() <= _SETTLED * np.abs(found).max():
                break
        elif gain <= 1e-3 * square / len(x):  # of the likelihood, hardly anything
            break
    left = weight * left
    whole = np.concatenate([matrix, slopes(place, matrix, found)], axis=1) if count else matrix
    return Fit(
        _with_errors(series, lines, place, whole, weight, found, left, free, level),
        left,
        level_columns @ found[: level + 1],
    )


def _powers(exponent: complex, x: np.ndarray) -> np.ndarray:
    """exp(exponent x) at even steps (k,), as products of few exponentials."""
    block = int(np.sqrt(len(x))) + 1
    return np.outer(np.exp(exponent * x[::block]), np.exp(exponent * x[:block])).ravel()[: len(x)]


def _beyond(
    values: np.ndarray, model: np.ndarray, left: np.ndarray, rails: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Samples and their weights with those at the rails replaced by what Newton's step on the likelihood of being
    beyond makes of them, for normal noise about the model.
    """
    low, high = values <= rails[0], values >= rails[1]
    beyond = np.concatenate([model[low] - rails[0], rails[1] - model[high]])
    seen = float(np.sum(left[~(low | high)] ** 2))
    spread = max(np.sqrt(seen / max(np.count_nonzero(~(low | high)), 1)), 1e-9 * float(np.ptp(values)))
    for _ in range(8):  # expectation and maximisation for the noise, of which the rails hide the largest
        away = beyond / spread
        hidden = len(away) + away @ _hazard(away)
        spread = max(np.sqrt((seen + spread**2 * hidden) / len(values)), 1e-9 * float(np.ptp(values)))
    wanted, weight = values.copy(), np.ones(len(values))
    for chosen, rail, sign in ((low, rails[0], -1.0), (high, rails[1], 1.0)):
        away = sign * (rail - model[chosen]) / spread
        mean = _hazard(away)
        weight[chosen] = np.maximum(mean * (mean - away), 1e-6)
        wanted[chosen] = model[chosen] + sign * spread * mean / weight[chosen]
    return wanted, weight


def _hazard(value: np.ndarray) -> np.ndarray:
    """Density of the standard normal distribution over its probability of more."""
    return np.sqrt(2 / np.pi) / erfcx(value / np.sqrt(2))


def _gram(whole: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Products of columns scaled to length one, and their lengths."""
    gram = whole.T @ (whole if len(weight) == 1 else weight[:, None] * whole)
    size = np.sqrt(np.diag(gram))
    size[size == 0] = 1.0
    return gram / np.outer(size, size), size


def _with_errors(series, lines, place, whole, weight, found, left, free, level) -> tuple[Line, ...]:
    """The oscillations found, with intervals by the density of what is left about each."""
    if not len(lines):
        return ()
    duration = series.duration
    gram, size = _gram(whole, weight)
    inverse = np.linalg.pinv(gram, hermitian=True) / np.outer(size, size)
    power, floor = density(left, series.step)
    number = {tuple(at): len(found) + k for k, at in enumerate(np.argwhere(free))}
    out = []
    for k, line in enumerate(lines):
        at = level + 1 + 2 * k
        a, b = found[at : at + 2]
        turns, growth = place[k]
        bin, wide = int(round(abs(turns))), 16 + int(abs(growth))
        near = slice(max(1, bin - wide), bin + wide + 1)
        local = max(float(power[near].mean()) if power[near].size else 0.0, float(floor[min(bin, len(floor) - 1)]))
        # samples beyond the rails have weights below 1, and so has what they leave
        variance = local / (2.0 * series.step * weight.mean())
        amplitude = float(np.hypot(a, b))
        toward = np.array([a, b]) / amplitude if amplitude else np.zeros(2)
        along = np.zeros(len(inverse))  # derivatives of the amplitude at the start, over its share of that at the end
        along[at : at + 2] = toward
        if growth > 0 and (k, 1) in number:  # the amplitude at the end is fitted, and the rate tells that at the start
            along[number[k, 1]] = -amplitude
        own = along @ inverse @ along
        deviations = [inverse[number[k, j], number[k, j]] if (k, j) in number else 0.0 for j in (0, 1)]
        errors = WIDE * np.sqrt(variance * np.maximum([*deviations, own], 0.0))
        scale = float(np.exp(-growth)) if growth > 0 else 1.0
        out.append(
            replace(
                line,
                frequency=float(abs(turns) / duration),
                rate=float(growth / duration),
                amplitude=amplitude * scale,
                phase=float(np.arctan2(-b, a) if turns > 0 else np.arctan2(b, a)),
                start=series.start,
                errors=(errors[0] / duration, errors[1] / duration, errors[2] * scale),
            )
        )
    return tuple(out)


def ring(series: Series, frequency: float, level: int = 1) -> Fit:
    """One oscillation whose rate is free, from the best of several rates to start from."""
    best = None
    for growth in (0.0, -1.0, -4.0, -12.0, -40.0, -120.0, 3.0, 10.0):
        guess = Line(frequency, growth / series.duration)
        found = fit(series, [guess], level, rates=True, rounds=0)
        square = float(found.left @ found.left)
        if best is None or square < best[0]:
            best = (square, guess)
    return fit(series, [best[1]], level, rates=True, rounds=40)


def envelope(series: Series, frequency: float, width: float) -> np.ndarray:
    """(k,) amplitude about a frequency, by two running means over a width, s, which are whole periods."""
    periods = max(1, round(width * frequency))
    count = max(2, round(periods / (frequency * series.step)))
    wave = (series.values - series.values.mean()) * np.exp(-2j * np.pi * frequency * series.times())
    for _ in range(2):
        wave = uniform_filter1d(wave.real, count, mode="constant") + 1j * uniform_filter1d(
            wave.imag, count, mode="constant"
        )
    return 2.0 * np.abs(wave)


def outbursts(values: np.ndarray, step: float, frequency: float) -> int:
    """Number of times that an oscillation of a frequency, Hz, rises from below the noise to well above it."""
    series, width = Series(0.0, step, values), 4.0 / frequency
    _, floor = density(values, step)
    at = min(int(round(frequency * len(values) * step)), len(floor) - 1)
    power = envelope(series, frequency, width) ** 2
    # mean square of the amplitude that noise has over a triangle of this width, by its spectrum or where it is quiet
    quiet = float(np.quantile(power, 0.2)) / -np.log(0.8)
    chance = min(4.0 / 3.0 * floor[at] / width, quiet) * (np.log(max(len(values) * step / width, 1.0)) + PEAK)
    low, high = np.flatnonzero(power < chance), np.flatnonzero(power > 4.0 * chance)
    return len(np.unique(np.searchsorted(low, high)))


def wave(line: Line, series: Series) -> np.ndarray:
    """(k,) values of a line of constant amplitude at the samples of a series."""
    t = series.times() - line.start
    return line.amplitude * np.cos(2 * np.pi * line.frequency * t + line.phase)


def constant_lines(
    series: Series, found: Sequence[Line] = (), level: int = LEVEL, rails: tuple[float, float] | None = None
) -> tuple[Fit, bool]:
    """Lines of constant amplitude, the strongest first, each sought in what the others leave.

    Returns
    -------
    fit : Fit
    whole : bool
        False where lines stand closer than the record resolves, or more are there than are sought: what makes them is
        none.
    """
    lines = tuple(found)
    fitted = fit(series, lines, level, rails=rails)
    whole = True
    while True:
        frequency, margin, energy, _ = strongest(fitted.left, series.step, parts=False)
        largest = max((line.amplitude for line in fitted.lines), default=0.0)
        if not margin > 0 or energy < (_SMALLEST * largest) ** 2 * series.duration / 4.0:
            break
        if len(lines) == _MOST:
            whole = False
            break
        near = [line for line in lines if abs(frequency - line.frequency) * series.duration < _NEAR]
        far = [line for line in lines if line not in near]
        own = Series(series.start, series.step, fitted.left + sum(wave(line, series) for line in near))
        own = fit(own, [Line(frequency), *near], 0, rounds=6)
        lines = (*far, *own.lines)
        fitted = fit(series, lines, level, rails=rails, rounds=_HIDDEN if rails else 2)
        lines = fitted.lines
        places = np.sort([line.frequency for line in lines]) * series.duration
        if (np.diff(places) < 1.5).any() or (places[2:] - places[:-2] < 4.0).any():
            whole = False
            break
    fitted = fit(series, fitted.lines, level, rails=rails)
    return replace(fitted, lines=tuple(sorted(fitted.lines, key=lambda line: -line.amplitude))), whole


def mains_lines(series: Series, left: np.ndarray, mains: Sequence[float]) -> tuple[Line, ...]:
    """Lines at a frequency of the mains and its multiples, where the first stands out."""
    best: tuple[Line, ...] = ()
    part = Series(series.start, series.step, left)
    power, floor = density(left, series.step)
    for own in mains:
        if own * series.duration < _CYCLES:
            continue
        found = []
        for multiple in range(1, _MULTIPLES + 1):
            wide = max(_OFF * multiple, 1.0 / series.duration)
            at = multiple * (found[0].frequency if found else own)
            if at + wide > 0.5 / series.step:
                break
            near = slice(max(1, int((at - wide) * series.duration)), int((at + wide) * series.duration) + 2)
            top = near.start + int(np.argmax(power[near] / floor[near]))
            stands = power[top] > (np.log(near.stop - near.start) + PEAK) * floor[top]
            if stands and power[top] >= power[max(top - 3, 0) : top + 4].max():
                frequency = top / (len(left) * series.step)
                line = fit(part, [Line(frequency)], 0).lines[0]
                off = multiple * 2.0 * found[0].errors[0] + 0.2 / series.duration if found else _OFF
                if line.within(at, off):
                    found.append(replace(line, called="mains"))
            if not found:
                break
        if len(found) > len(best):
            best = tuple(found)
    return best
