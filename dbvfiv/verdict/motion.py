"""Motions in a record under noise: nothing, a line, several, a modulated one, growth, a ring-down, or no line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import minimize

from ..texts import digits, json_value
from .judge import FILLED, JudgeOptions, Verdict, judge, longest_samples
from .lines import (
    LEVEL,
    WIDE,
    Fit,
    Line,
    constant_lines,
    density,
    envelope,
    fit,
    mains_lines,
    outbursts,
    ring,
    strongest,
    wave,
)
from .series import Series, harmonics

#: Gain in the logarithm of the likelihood over a smooth spectrum from which a peak is one: three more numbers gain so
#: much by chance once in some thousand records of ten candidates.
_GAIN = 14.0
#: Half widths of a peak that a fit looks at on either side, ordinates without which there is none, peaks at most.
_REACH, _ORDINATES, _MOST = (6.0, 3.0, 2.0), 24, 6
#: Damping ratio beyond which a peak is none, and ordinates of a smoothed spectrum over its width.
_BROAD, _SMOOTHED = 0.3, 3.0
#: Standard errors by which an eighth of a band may differ from a fit.
_EVEN = 3.5
#: Bounds of the numbers of a peak, see `_log_density`.
_BOX = ((-1.0, 1.0), (-9.0, 1.0), (-30.0, 30.0), (-4.0, 4.0), (-30.0, 30.0))


def resonances(series: Series) -> tuple[Line, ...]:
    """Resonances in even samples, the most certain first.

    Frequency and damping of peaks with 95 % intervals: about a peak the power density of a response to noise is that of
    one pole beside whatever is smooth, other modes and noise of the instrument: S = (a0 + a1 x + a2 x^2) /
    (x^2 + w^2), x = f - f0, with the growth rate -2 pi w. The ordinates of a periodogram are independent and
    exponentially distributed about S (Whittle 1953): the fit has the greatest likelihood and the intervals are those of
    its information matrix.
    """
    values = series.values - series.values.mean()
    count = len(values)
    if count < 8 * _ORDINATES:
        return ()
    frequency = np.fft.rfftfreq(count, series.step)[1:-1]
    power = 2.0 * series.step / count * np.abs(np.fft.rfft(values))[1:-1] ** 2
    found: list[tuple[float, Line]] = []
    for start, width in _candidates(frequency, power, 8.0 / series.duration):
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
        best = inner[np.argsort(-smooth[inner] / around[inner])[:_MOST]]
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
            half = max(half, 0.5 * _ORDINATES * frequency[0] / wide)
            reach = min(wide * half, 0.5 * at)
            near = np.abs(frequency - at) < reach
            if np.count_nonzero(near) < _ORDINATES:
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


#: Share of the energy of a ring-down that may be left about its frequency, as its damping depends on the amplitude.
_LEFT = 0.01
#: Most power about a line, beyond that of white noise, over that of the lines.
_HELD = 0.3
#: Cycles below which a level is not told from an oscillation.
_FEW = 12
#: Change of the amplitude over a record, logarithmic, below which multiples of a cycle could be the cause, and those
#: that are fitted beside it.
_SLOW, _OF_CYCLES = 0.5, range(2, 9)
#: Least of a ring-down, of its amplitude at the start, that is left where it has not died.
_DIED = 0.02


@dataclass(frozen=True)
class Motion:
    """Motion in a record."""

    #: name and reason: as in a verdict.
    name: str
    reason: str
    lines: tuple[Line, ...] = ()  #: The one that the verdict is about first.
    modulation: tuple[float, float] = (np.nan, np.nan)  #: (float, float), Hz; frequency and half its 95 % interval.
    start: float = np.nan  #: s; beginning of what was fitted.
    noise: float = np.nan  #: Root mean square of the noise.
    returns: bool = False  #: True where oscillations die and come back.
    base: float = np.nan  #: Hz; frequency of a cycle, of which its lines are multiples.
    level: float | np.ndarray = 0.0  #: float or (k,); what the lines of a limit cycle lie on, at all samples.


#: Cycles a sample beyond which an oscillation is none.
_FASTEST = 0.4
#: Least number of different values of a record that may be clipped; share of samples at a rail over that beside it,
#: which is 2.4 at the crest of a sine that a converter has made steps of.
_LEVELS, _CROWDED = 200, 4
#: Largest of what a fit leaves over the largest value, below which it is rounding.
_ROUNDING = 1e-11
#: Frequencies of the mains, Hz.
MAINS = (50.0, 60.0)
#: Samples without which no line is sought, and motions that are one.
_FEWEST, _LINES = 64, ("decayed", "growing", "limit cycle", "modulated", "several lines", "mains")


def judge_record(
    time,
    values,
    options: JudgeOptions = JudgeOptions(),
    *,
    detrend: bool = True,
    closed_below: float | None = None,
    gaps: bool = True,
    mains: Sequence[float] = MAINS,
) -> Verdict:
    """Verdict on a measured record: what oscillates under its noise, on a level that may drift; of what has no line the
    level, as `judge` has it. Raises ValueError if the samples are no series.

    Parameters
    ----------
    time, values, options, closed_below, gaps
        As for `judge`.
    detrend : bool
        Take a polynomial level off.
    mains : sequence of float, Hz
        Frequencies that may be picked up; none in what is computed.
    """
    judged = partial(judge, time, values, options, closed_below=closed_below, gaps=gaps)
    time, values, facts = longest_samples(time, values, gaps)
    if len(time) < _FEWEST or not np.ptp(values):
        return judged()
    shut = judged() if closed_below is not None else None
    if shut is not None and shut.name == "closed":
        return shut
    series = Series.of(time, values)
    found = find_motion(series, detrend, mains)
    if shut is not None and shut.name == "chatters" and found.name != "limit cycle":
        return shut
    if found.name not in _LINES:
        level = judged()
        if level.name == "limit cycle" and level.decided and abs(level.frequency - found.base) < 1.0 / series.duration:
            return level  # of more multiples than are sought
        goes_one_way = level.name in ("decaying", "growing")
        peaks = () if found.returns or goes_one_way else resonances(series)
        level = replace(level, lines=tuple(map(_summary, peaks)))
        if found.returns:
            return replace(level, name="irregular", decided=True, reason=found.reason)
        if found.name == "steady" and level.name != "steady":
            words = "Nothing stands out of its noise."
            return replace(level, name="steady", decided=True, reason=words, noise=found.noise, cycles=0, period=np.nan)
        if goes_one_way or level.name in ("steady", "undecided"):
            return level
        return replace(level, name="irregular", decided=True, reason=found.reason)
    line = found.lines[0]
    if line.frequency * series.step > _FASTEST or line.amplitude > 2.0 * np.ptp(series.values):
        return judged()  # a level that moves without noise is met by the fastest or the largest of oscillations
    return replace(_verdict(found, series, options), **facts)


def _verdict(found: Motion, series: Series, options: JudgeOptions) -> Verdict:
    """Verdict on a record that holds lines."""
    line = found.lines[0]
    frequency = found.base if found.base > 0 else line.frequency
    cycles = int(series.duration * frequency)
    count = round(cycles / (frequency * series.step))  # samples of whole cycles
    swung = series.values[-count:] if cycles else series.values
    told = tuple(_summary(one) for one in found.lines)
    shape = np.zeros((0, 2))
    if found.name == "limit cycle" and cycles >= 3:
        shape = harmonics(replace(series, values=series.values - found.level), 1.0 / frequency, min(cycles, 200))
    few = found.name == "limit cycle" and cycles < options.cycles
    spacing = {}
    if np.isfinite(found.modulation[0]):
        spacing = dict(zip(("frequency", "frequency_interval"), map(float, found.modulation)))
    return Verdict(
        found.name,
        not few,
        f"Only {cycles} cycles have been seen and {options.cycles} are needed." if few else found.reason,
        mean=float(swung.mean()),
        amplitude=line.amplitude * float(np.exp(min(max(line.rate, 0.0) * (series.end - line.start), 700.0))),
        period=1.0 / frequency,
        cycles=cycles,
        amplitude_trend=line.change,
        harmonics=shape,
        rms=float(swung.std()),
        noise=found.noise,
        lines=told,
        modulation=spacing,
    )


def _summary(line: Line) -> dict[str, Any]:
    """Numbers of an oscillation; intervals are half those of 95 %."""
    frequency, rate, amplitude = json_value(line.errors)
    moves = {"rate": line.rate, "rate_interval": rate, "damping_ratio": line.damping_ratio}
    moves |= {"damping_ratio_interval": line.ratio_error}
    return {
        "frequency": float(line.frequency),
        "frequency_interval": frequency,
        "amplitude": float(line.amplitude),
        "amplitude_interval": amplitude,
        **({name: None if value is None else float(value) for name, value in moves.items()} if line.rate else {}),
        "called": line.called,
    }


def find_motion(series: Series, detrend: bool = True, mains: Sequence[float] = ()) -> Motion:
    """Motion in even samples.

    Parameters
    ----------
    detrend : bool
        Take a polynomial level off.
    mains : sequence of float, Hz
        Frequencies that may be picked up.
    """
    level = LEVEL if detrend else 0
    rails = clipped(series.values)
    flat = fit(series, (), level)
    picked = mains_lines(series, flat.left, mains)
    base = fit(series, picked, level)
    picked = tuple(replace(line, called="mains") for line in base.lines)
    if np.abs(base.left).max() <= _ROUNDING * np.abs(series.values).max():
        return _without_lines(base, series, picked, nothing=True)
    frequency, margin, _, cell = strongest(base.left, series.step, 1.5 / series.duration)
    # slopes show what rings beside a level that moves
    steep, above, _, beside = strongest(np.diff(base.left), series.step, 1.5 / series.duration)
    if not max(margin, above) > 0:
        return _without_lines(base, series, picked)
    sought = [(f, c) for f, m, c in ((frequency, margin, cell), (steep, above, beside)) if m > 0]
    for hum in dict.fromkeys((picked, ())) if rails is None else ():
        freed = Series(series.start, series.step, series.values - sum(wave(line, series) for line in hum))
        for found, cell in sought:
            rung = _ringing(freed, found, cell, level)
            if rung is not None and not _rang_before(freed, rung):
                return replace(rung, lines=rung.lines + hum)
    fitted, whole = constant_lines(series, picked, level, rails)
    named = _named(fitted, whole, series)
    if named.name not in _LINES and any(f > 0 and outbursts(base.left, series.step, f) > 1 for f, _ in sought):
        return replace(named, name="irregular", reason="Oscillations die and come back.", returns=True)
    return named


def clipped(values: np.ndarray) -> tuple[float, float] | None:
    """Rails at which a record is clipped; None where it is not: more than a hundredth of it at an extreme value, and
    many times what is at the value next to that, which tells rails from steps of a converter.
    """
    levels, counts = np.unique(values, return_counts=True)
    if len(levels) < _LEVELS:
        return None
    low, high = float(levels[0]), float(levels[-1])
    hits = [
        rail > 0.01 * len(values) and rail > _CROWDED * beside
        for rail, beside in ((counts[0], counts[1]), (counts[-1], counts[-2]))
    ]
    if not any(hits):
        return None
    return (low if hits[0] else -np.inf, high if hits[1] else np.inf)


def _rang_before(series: Series, rung: Motion) -> bool:
    """True where what rings had died and come back more than once before."""
    early = np.diff(series.values[: int((rung.start - series.start) / series.step)])  # without the level
    return len(early) >= _FEWEST and outbursts(early, series.step, rung.lines[0].frequency) > 1


def _ringing(series: Series, frequency: float, cell: tuple[int, int], level: int) -> Motion | None:
    """Growth or a ring-down, if one oscillation whose rate is free leaves nothing about its frequency."""
    period = 1.0 / frequency
    width = max(period, cell[1] * series.step / 8.0)
    slope = Series(series.start, series.step, np.gradient(series.values))
    swing = envelope(slope, frequency, width)
    at = int(np.argmax(swing))
    start = 0
    before = swing[: max(at - int(2 * width / series.step), 0)]
    if len(before) * series.step > 2 * period and np.median(before) < 0.4 * swing[at]:
        start = at
    starts = dict.fromkeys([0] + [int(at + share * period / series.step) for share in (0, 0.5, 1, 2, 4)])
    tolerable = None
    for begin in starts:
        if begin > 0.9 * len(series.values) or len(series.values) - begin < 32:
            continue
        part = Series(series.start + begin * series.step, series.step, series.values[begin:])
        degree = (min(level, 3) if part.duration * frequency > _FEW else min(level, 1)) if level else 0
        found = ring(part, frequency, degree)
        line = found.lines[0]
        if abs(line.rate) * part.duration < _SLOW:  # multiples of a cycle that is no sine would leak into its rate
            multiples = (Line(k * line.frequency) for k in _OF_CYCLES if k * line.frequency * part.step < _FASTEST)
            found = fit(part, [line, *multiples], degree, rates=True, rounds=40)
            line = found.lines[0]
        if not 0.5 < line.frequency / frequency < 2.0:
            continue
        change = line.rate * part.duration
        if abs(change) < max(2.0 * line.errors[1] * part.duration, 0.02):
            if begin == 0 and start == 0:
                return None
            continue
        if change > 0 and begin:
            continue
        energy = line.amplitude**2 * part.duration / 4.0 * np.expm1(2 * min(change, 300)) / (2 * change)
        _, margin, left, _ = strongest(found.left, part.step, 0.0, 1.5 * line.frequency)
        if begin * part.step > 8.0 / frequency:
            early = series.values[: int(begin - 2.0 * width / part.step)]
            _, before, rest, _ = strongest(early, part.step, 0.5 * frequency) if len(early) > 64 else (0, 0.0, 0.0, 0)
            if before > 0 and rest > _LEFT * energy:
                continue
        if not margin > 0:
            return _rung(line, part, found)
        if left < _LEFT * energy and tolerable is None:
            tolerable = _rung(line, part, found)
    return tolerable


def _rung(line: Line, part: Series, found: Fit) -> Motion:
    _, floor = density(found.left, part.step)
    noise = float(np.sqrt(floor.sum() / part.duration))
    change = line.rate * part.duration
    if change > 0:
        words = f"The amplitude grows by {digits(100 * line.change, 2)} % a cycle."
        return Motion("growing", words, (line,), start=part.start, noise=noise)
    end = float(np.exp(change))
    died = ", to its end" if end < _DIED or (end * line.amplitude < noise and end < 0.3) else ""
    words = f"It rings down by {digits(-100 * line.change, 2)} % a cycle{died}."
    return Motion("decayed", words, (line,), start=part.start, noise=noise)


def _named(fitted: Fit, whole: bool, series: Series) -> Motion:
    own = [line for line in fitted.lines if line.called != "mains" and line.amplitude > 3.0 * line.errors[2]]
    mains = tuple(line for line in fitted.lines if line.called == "mains")
    _, floor = density(fitted.left, series.step)
    noise = float(np.sqrt(floor.sum() / series.duration))
    facts = {"start": series.start, "noise": noise}
    if not own:
        return _without_lines(fitted, series, mains)
    strong = own[0]
    _, margin, rest, _ = strongest(fitted.left, series.step, 0.5 * strong.frequency)
    bursts = margin > 0 and rest > 0.05 * strong.amplitude**2 * series.duration / 4.0
    resolution = 1.0 / series.duration
    base = _fundamental(own, resolution)
    if not whole or bursts or _hump(fitted.left, series, strong, 0.5 * sum(line.amplitude**2 for line in own)):
        if not whole and len(own) > 2:  # more multiples than are sought
            facts["base"] = base
        return Motion("irregular", "Neither its phase nor its spectrum is a line.", fitted.lines, **facts)
    if base:
        lead = min(own, key=lambda line: abs(line.frequency - base))
        base = lead.frequency / max(1, round(lead.frequency / base))
        first = "the first" if base == lead.frequency else f"{base:.4g} Hz"
        lines = tuple(
            replace(line, called="" if line is lead else f"{line.frequency / base:.0f} times {first}")
            for line in sorted(own, key=lambda line: line is not lead)
        )
        facts |= {"base": base, "level": fitted.level}
        return Motion("limit cycle", "A line of constant amplitude and phase.", lines + mains, **facts)
    modulated = _modulation(own, resolution)
    if modulated is not None:
        carrier, spacing = modulated
        rest = tuple(replace(line, called="sideband") for line in own if line is not carrier)
        return Motion(
            "modulated", "Its amplitude or frequency is modulated.", (carrier, *rest, *mains), spacing, **facts
        )
    return Motion("several lines", "Several lines.", (*own, *mains), **facts)


def _hump(left: np.ndarray, series: Series, line: Line, held: float) -> bool:
    power, floor = density(left, series.step)
    at = int(round(line.frequency * series.duration))
    near = np.r_[max(1, at - 12) : max(1, at - 1), at + 2 : at + 13]
    near = near[near < len(power)]
    around = power[at // 2 : at + at // 2 + 1]
    beyond = (around.sum() - len(around) * np.median(floor)) / series.duration
    if beyond > _HELD * held:
        return True
    energy = line.amplitude**2 * series.duration / 4.0
    return bool(
        len(near)
        and power[near].mean() > (1.0 + 4.0 * np.sqrt(2.0 / len(near))) * floor[min(at, len(floor) - 1)]
        and power[near].sum() > 2.0 * _LEFT * energy
    )


def _fundamental(lines: Sequence[Line], resolution: float) -> float:
    """Frequency of which all lines are multiples, that of the strongest or a fraction of it; zero without one."""
    strong = lines[0]
    for fraction in (1, 2, 3, 4):
        base = strong.frequency / fraction
        if fraction > 1 and base < 3.0 * resolution:
            break
        numbers = [max(1, round(line.frequency / base)) for line in lines]
        if all(
            line.within(n * base, 0.1 * resolution + n / fraction * 2 * strong.errors[0])
            for n, line in zip(numbers, lines)
        ):
            return base
    return 0.0


def _modulation(lines: Sequence[Line], resolution: float):
    for carrier in lines[:3]:
        above = [line for line in lines if line.frequency > carrier.frequency]
        for upper in above:
            spacing = upper.frequency - carrier.frequency
            if spacing > 0.5 * carrier.frequency:
                continue
            lower = [
                line for line in lines if line.within(carrier.frequency - spacing, 0.2 * resolution + upper.errors[0])
            ]
            if not lower or not 0.3 < lower[0].amplitude / upper.amplitude < 3.0:
                continue
            orders = [
                (line.frequency - carrier.frequency) / spacing for line in lines if line.frequency > 1.5 * spacing
            ]
            if all(
                abs(n - round(n)) * spacing < 0.3 * resolution + 3 * max(l.errors[0] for l in lines) for n in orders
            ):
                half = 0.5 * (upper.frequency - lower[0].frequency)
                return carrier, (half, 0.5 * float(np.hypot(upper.errors[0], lower[0].errors[0])))
    return None


def _without_lines(fitted: Fit, series: Series, mains: tuple[Line, ...], nothing: bool = False) -> Motion:
    """Motion where no line is left, or nothing but rounding."""
    values = fitted.left
    power, floor = density(values, series.step)
    noise = float(values.std())
    facts = {"lines": mains, "start": series.start, "noise": noise}
    bands = np.array([band.mean() for band in np.array_split(power[2:], min(16, max(2, len(power) // 16)))])
    bands = bands / bands.max() if bands.min() > 0 else bands  # squares of large values overflow
    filled = bands.mean() ** 2 / (bands**2).mean() if bands.min() > 0 else 0.0
    parts = np.array([part.std() for part in np.array_split(values, 4)])
    even = filled >= FILLED and parts.max() <= 1.5 * parts.min()
    if mains and (even or nothing):
        return Motion("mains", "Nothing but the mains.", **facts)
    if even and not nothing:
        return Motion("steady", "It is noise.", **facts)
    return Motion("irregular", "It moves without a line.", **facts)
