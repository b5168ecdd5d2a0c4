"""Verdict on the final behaviour of a time series.

Sampling at the period, beats, slow growth and noise do not mislead it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..texts import digits, json_value
from .lines import PEAK
from .series import (
    Cycles,
    Series,
    Shuttings,
    check_samples,
    comes_and_goes,
    extremes,
    find_period,
    harmonics,
    longest_part,
    refine,
    remaining,
    settled,
    swings,
    trend_of,
    undersampled,
)


@dataclass(frozen=True)
class JudgeOptions:
    """Options of a verdict."""

    #: Largest change, over the last fifth and still to come, of a steady signal relative to its size.
    steady: float = 1e-4
    residual: float = 1e-3  #: Largest residual of a steady state, where a residual is known.
    cycles: int = 10  #: Cycles that a limit cycle must have kept.
    periodic: float = 0.02  #: Largest periodicity error of a limit cycle without noise.
    noisy: float = 0.4  #: Largest periodicity error of a limit cycle with noise on it.
    drift: float = 2e-3  #: Largest relative change of the amplitude over the cycles looked at, and still to come.
    band: float = 0.02  #: Relative band within which amplitudes count as equal.
    #: Largest root mean square of noise, relative to the level it lies on, within which a signal counts as steady.
    noise: float = 0.02


NAMES = ("steady", "decaying", "limit cycle", "growing", "closed", "chatters", "irregular", "undecided")
#: Further ones of measured records.
RECORDED = ("decayed", "modulated", "several lines", "mains")


@dataclass(frozen=True)
class Verdict:
    """Final behaviour of a time series."""

    name: str  #: One of `NAMES`, of a measured record also of `RECORDED`.
    decided: bool  #: True where a longer series would not change the verdict.
    reason: str  #: One sentence.
    mean: float = np.nan  #: Over whole cycles where there are cycles, over the end of the series otherwise.
    #: Half the distance between the extremes of the last cycles, or of the end of the series; of a record with lines
    #: that of the first, at the end where it grows and at the start where it rings down.
    amplitude: float = np.nan
    period: float = np.nan  #: s; not a number without cycles.
    cycles: int = 0  #: Cycles that the verdict rests on.
    #: Root mean square of x(t + T) - x(t) over that of two unrelated signals of the same variance: 0 periodic, 1
    #: unrelated.
    periodicity_error: float = np.nan
    #: Factor of the periodicity error from one cycle to the next; below 1 while a cycle is being approached.
    periodicity_trend: float = np.nan
    amplitude_trend: float = np.nan  #: Relative change of the amplitude from one cycle to the next.
    #: (k, 2); amplitude and phase, rad, of the first multiples of the frequency: sum a_k cos(2 pi k t / T + phase), t
    #: from the start of the series.
    harmonics: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))
    rms: float = np.nan  #: Root mean square about the mean, of the same part of the series.
    #: smallest and largest: extremes of the whole series.
    smallest: float = np.nan
    largest: float = np.nan
    #: Root mean square of white noise about a constant level, where the end of the series is such noise; not a number
    #: otherwise.
    noise: float = np.nan
    #: s; beginning and end of the part that the verdict is about: the whole series, or its longest part between gaps.
    judged: tuple[float, float] = (np.nan, np.nan)
    notes: tuple[str, ...] = ()  #: Sentences on the samples: gaps, uneven steps.
    #: Oscillations of a measured record, with half their 95 % intervals, for JSON; the one of the verdict first.
    lines: tuple[dict[str, Any], ...] = ()
    #: Frequency, Hz, of the modulation of a measured record, with half its interval; empty without.
    modulation: dict[str, float] = field(default_factory=dict)

    @property
    def frequency(self) -> float:
        """Hz; not a number without cycles."""
        return 1.0 / self.period if self.period > 0 else np.nan

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON; what is not a number is None."""
        return (
            {
                "verdict": self.name,
                "decided": bool(self.decided),
                "reason": self.reason,
                **{name: json_value(getattr(self, name)) for name in _NUMBERS},
                "cycles_observed": self.cycles,
                "judged": json_value(self.judged),
                "notes": list(self.notes),
                "harmonics": [{"amplitude": float(a), "phase": float(p)} for a, p in self.harmonics],
            }
            | ({"lines": list(self.lines)} if self.lines else {})
            | ({"modulation": self.modulation} if self.modulation else {})
        )


#: Numbers of a verdict by their keys in JSON.
_NUMBERS = ("mean", "amplitude", "frequency", "period", "periodicity_error", "periodicity_trend", "amplitude_trend")
_NUMBERS += ("rms", "smallest", "largest", "noise")
_SHARE, _FEWEST_OF_NOISE = 0.2, 64
_BANDS = 16
#: Smallest share of the band up to half the sampling rate that noise fills.
FILLED = 0.3
#: Standard errors by which the level may move.
_LEVEL = 4.0


def noise_at_end(series: Series) -> tuple[float, float] | None:
    """Level of the last fifth of a series and root mean square of the noise about it; None if it is anything else.

    Noise has no memory: its spectrum (Hann window) fills at least a third of what the sampling shows, holds no line,
    and its level and its strength stay within what chance explains.
    """
    part = series.last(max(_SHARE * series.duration, (_FEWEST_OF_NOISE - 1) * series.step))
    values, count = part.values, len(part.values)
    level = float(values.mean())
    rms = float(values.std())
    if count < _FEWEST_OF_NOISE // 2 or rms == 0.0:
        return None
    power = np.abs(np.fft.rfft((values - level) / rms * np.hanning(count + 2)[1:-1])[2:]) ** 2
    bands = np.array_split(power, min(_BANDS, max(2, len(power) // _BANDS)))
    means = np.array([band.mean() for band in bands])
    if not means.min() > 0:
        return None
    filled = means.sum() ** 2 / (len(means) * (means**2).sum())
    line = max(band.max() / band.mean() for band in bands)
    thirds = np.array_split(values, 3)
    moved = np.ptp([third.mean() for third in thirds])
    chance = rms * np.sqrt(2.0 / (filled * count / 3.0))
    halves = [half.std() for half in np.array_split(values, 2)]
    even = max(halves) <= 1.5 * min(halves)
    if filled < FILLED or line > np.log(len(power)) + PEAK or moved > _LEVEL * chance or not even:
        return None
    return level, rms


def without_cycles(series: Series, options: JudgeOptions, size: float, residual: float | None, at_end: dict) -> Verdict:
    """Verdict on a signal without cycles, from its size and from mean, amplitude and rms of its end."""

    def found(name: str, decided: bool, words: str) -> Verdict:
        return Verdict(name, bool(decided), words, **at_end)

    thirds = [part.mean() for part in np.array_split(series.last(0.2 * series.duration).values, 3)]
    first, second = thirds[1] - thirds[0], thirds[2] - thirds[1]
    to_come = abs(second) / (1.0 - min(abs(second / first), 0.99)) if first and abs(second) > 1e-13 * size else 0.0
    if 2.0 * at_end["amplitude"] <= options.steady * size and to_come <= options.steady * size:
        if residual is not None and not residual <= options.residual:
            still = f"The signal stands still but its system does not (residual {residual:.2g})"
            return found("undecided", False, f"{still}: it may be sampled at its own period.")
        words = f"It changes by less than {options.steady:g} of its size, and little is to come."
        return found("steady", True, words)
    parts = np.array_split(series.values, 8)
    ranges = np.array([np.ptp(part) for part in parts])
    late = ranges[-4:]
    if np.all(np.diff(late) < 0) and late[-1] < 0.6 * late[0]:
        return found("decaying", late[-1] < 0.1 * ranges.max(), "Its changes become smaller and smaller.")
    if np.all(np.diff(late) > 0) and late[-1] > 1.5 * late[0] and ranges[-1] == ranges.max():
        return found("growing", late[-1] > 10 * max(late[0], 1e-300), "Its changes become larger and larger.")
    levels = np.array([part.mean() for part in parts[-5:]])
    steps = np.diff(levels)
    drifts = np.all(steps > 0) or np.all(steps < 0)
    if drifts and np.ptp(levels) > 2.0 * np.median([_scatter(part) for part in parts[-4:]]):
        if abs(steps[-1]) < 0.5 * abs(steps[0]):
            return found("decaying", False, "It drifts one way, slower and slower.")
        return found("growing", False, "It drifts one way.")
    if swings(series) < options.cycles:
        return found("undecided", False, "It moves, and too few swings have been seen to tell how.")
    return found("irregular", True, "It moves without a period.")


def _scatter(part: np.ndarray) -> float:
    t = np.arange(len(part))
    return float(np.ptp(part - np.polyval(np.polyfit(t, part, 1), t)))


def within_noise(series: Series, options: JudgeOptions, residual: float | None, at_end: dict) -> Verdict | None:
    """Verdict on a signal that ends in a constant level with noise on it; None if it does not."""
    noise = noise_at_end(series)
    if noise is None or (residual is not None and not residual <= options.residual):
        return None
    level, rms = noise
    facts = at_end | {"mean": level, "rms": rms, "noise": rms}
    share = rms / abs(level) if level else np.inf
    if rms <= options.noise * abs(level):
        words = f"It is constant within noise of {rms:.3g} (root mean square, {digits(100 * share, 2)} % of its level)."
        return Verdict("steady", True, words, **facts)
    size = f"{digits(100 * share)} % of its level" if share < 10 else f"its level is {level:.2g}"
    words = f"It is noise of {rms:.3g} (root mean square, {size}) without a period: too much to call it steady."
    return Verdict("irregular", True, words, **facts)


#: Samples without which nothing is said.
_FEWEST = 16
#: Share of the power of a motion that grows or decays that its own harmonic holds where a weaker motion lengthens the
#: period.
_NEARLY_ALL = 0.8


def judge(
    time,
    values,
    options: JudgeOptions = JudgeOptions(),
    *,
    residual: float | None = None,
    closed_below: float | None = None,
    gaps: bool = True,
) -> Verdict:
    """Verdict on a signal. Raises ValueError if the samples are no series.

    Parameters
    ----------
    time, values : (k,) arrays
        Samples at increasing times; uneven ones are interpolated. Of a record with gaps the longest part between
        them is judged, and a note says so.
    residual : float, optional
        How far from equilibrium the system is at the end, relative; a signal that stands still while its system does
        not is not steady.
    closed_below : float, optional
        Level below which the signal counts as closed; one that goes from above twice that level to below it again and
        again, without a period, chatters.
    gaps : bool
        Take steps far longer than most for gaps; those of a run in time are none.

    Returns
    -------
    Verdict

    Examples
    --------
    >>> t = np.linspace(0.0, 20.0, 2001)
    >>> verdict = judge(t, 3.0 + np.sin(2 * np.pi * t))
    >>> verdict.name, round(verdict.frequency, 6), round(verdict.amplitude, 6)
    ('limit cycle', 1.0, 1.0)
    """
    time, values, facts = longest_samples(time, values, gaps)
    series = Series.of(time, values) if len(values) >= _FEWEST else None
    if series is None or len(series.values) < _FEWEST:  # interpolation takes the larger steps of uneven ones
        words = f"There are fewer than {_FEWEST} samples{' between two gaps' if gaps and facts['notes'] else ''}."
        sizes = {"mean": float(values.mean()), "amplitude": 0.5 * float(np.ptp(values)), "rms": float(values.std())}
        return Verdict("undecided", False, words, **sizes, **facts)
    return replace(_judge(series, options, residual, closed_below), **facts)


def longest_samples(time, values, gaps: bool) -> tuple[np.ndarray, np.ndarray, dict[str, Any]]:
    """Times and values (k,) of the longest part of a record without a gap, and what a verdict on it says of the whole.
    Raises ValueError if the samples are no series.
    """
    time, values = check_samples(time, values)
    part, notes = longest_part(time, gaps)
    facts = {"smallest": float(values.min()), "largest": float(values.max()), "notes": notes}
    return time[part], values[part], facts | {"judged": (float(time[part][0]), float(time[part][-1]))}


def _judge(series: Series, options: JudgeOptions, residual: float | None, closed_below: float | None) -> Verdict:
    tail = series.last(0.2 * series.duration)
    at_end = {
        "mean": float(tail.values.mean()),
        "amplitude": 0.5 * float(np.ptp(tail.values)),
        "rms": float(tail.values.std()),
    }
    if closed_below is not None and series.last(0.3 * series.duration).values.max() <= closed_below:
        return Verdict("closed", True, "The signal stays below the level of a closed valve.", **at_end)
    size = max(abs(at_end["mean"]), float(np.ptp(series.values)))
    if closed_below is not None:
        shuttings = Shuttings.of(series.times(), series.values, closed_below)
        if shuttings.chatters:
            cycle = _oscillation(series, options, size)
            periodic = cycle is not None and cycle.decided and cycle.name == "limit cycle"
            return cycle if periodic else _chatter(series, shuttings, options)
    if at_end["amplitude"] > 1e-9 * size:
        fast = undersampled(series)
        if fast:
            samples = f"{1.0 / (fast * series.step):.2g} samples a cycle"
            words = f"It swings at {fast:.4g} Hz, and {samples} are too few to judge by."
            return Verdict("undecided", False, words, **at_end)
        found = _oscillation(series, options, size)
        if found is not None and (found.decided and found.name != "irregular"):
            return found
        found = found or without_cycles(series, options, size, residual, at_end)
        return within_noise(series, options, residual, at_end) or found
    return without_cycles(series, options, size, residual, at_end)


def _chatter(series: Series, shuttings: Shuttings, options: JudgeOptions) -> Verdict:
    """Verdict on a signal that opens and shuts, without a period."""
    kept, even = shuttings.kept(options.cycles), shuttings.is_settled(options.cycles)
    part = series.last(series.end - series.times()[shuttings.shut[-len(kept) - 1]])
    words = f"It parts and meets {len(shuttings.shut)} times, the last {len(kept) + 1} of them"
    words += f" {kept.mean():.3g} s apart (standard deviation {kept.std():.2g} s)"
    return Verdict(
        "chatters",
        even,
        words + ("." if even else "; too few, or their rate still changes."),
        mean=float(part.values.mean()),
        amplitude=0.5 * float(np.ptp(part.values)),
        period=float(kept.mean()),
        cycles=len(kept),
        rms=float(part.values.std()),
    )


def _oscillation(series: Series, options: JudgeOptions, size: float) -> Verdict | None:
    """Verdict on a signal with cycles; None if it has none, or is steady but for cycles too small to matter."""
    period, error = _period(series)
    if not period > 0 or error > 1.0:
        return None
    cycles = Cycles.of(series, period)
    if len(cycles) < 3:
        return None
    low, high = extremes(series, period)
    recent = cycles.last(max(options.cycles, len(cycles) // 2))
    kept = cycles.last(options.cycles)
    facts = {
        "mean": float(kept.mean.mean()),
        "amplitude": 0.5 * (high - low),
        "period": period,
        "cycles": len(recent),
        "periodicity_error": float(np.sqrt(np.mean(kept.error**2))),
        "periodicity_trend": _factor(kept.error),
        "amplitude_trend": trend_of(kept.spread).step,
        "harmonics": harmonics(series, period, min(len(cycles), options.cycles)),
        "rms": float(kept.spread.mean() / np.sqrt(2.0)),
    }
    small = 0.5 * (high - low) <= options.steady * size
    direction = _direction(cycles, options)
    if direction in ("growing", "decaying"):
        facts["mean"] = float(cycles.mean[-1])
        if (times := _strongest_multiple(cycles.last(3))) > 1:  # a weaker motion repeats with so many of its cycles
            facts |= {"period": period / times, "cycles": times * len(recent)}
            facts["amplitude_trend"] = (1.0 + facts["amplitude_trend"]) ** (1.0 / times) - 1.0
            facts["harmonics"] = harmonics(series, period / times, min(times * len(cycles), options.cycles))
    if small and direction != "growing":
        return None
    return _name(series, cycles, recent, facts, direction, options)


def _name(
    series: Series, cycles: Cycles, recent: Cycles, facts: dict, direction: str, options: JudgeOptions
) -> Verdict:
    """Verdict on cycles by the first rule that holds."""

    def irregular(words: str) -> Verdict:
        return Verdict("irregular", True, words, **facts)

    def undecided(words: str) -> Verdict:
        return Verdict("undecided", False, words, **facts)

    error, count = facts["periodicity_error"], len(cycles)
    rate = abs(trend_of(cycles.last(options.cycles).spread).slope)
    noisy = error > options.periodic
    moves = direction in ("growing", "decaying")
    # amplitudes may wander because nothing repeats, and slow growth does not make cycles so different
    if moves and error > options.noisy and rate < 0.5 * error:
        moves = False
    if moves and noisy and rate < 0.2 * error and not _noise_on_cycle(cycles, options):
        moves = False
    if moves:
        return _growth(cycles, recent, facts, direction, options)
    enough = (1.5 if error > options.noisy else 4.0) * options.cycles  # swings without a return
    if count < options.cycles and noisy and swings(series) >= enough:
        return irregular(f"After {swings(series)} swings it still repeats within {digits(100 * error, 2)} % only.")
    if count < options.cycles:
        return undecided(f"Only {count} cycles have been seen and {options.cycles} are needed.")
    if error > options.noisy:
        return irregular(f"Nothing repeats: the periodicity error is {error:.2g}.")
    if noisy and not _noise_on_cycle(cycles, options):
        return irregular(f"Cycles differ from one to the next by {digits(100 * error, 2)} %, and not by noise.")
    band = max(options.band, 6.0 * trend_of(recent.spread).scatter) if noisy else options.band
    if comes_and_goes(cycles.spread[-max(options.cycles, 3 * count // 4) :], band if noisy else 0.5 * options.band):
        return irregular("The amplitude comes and goes: beats.")
    still = settled(cycles.spread, band)
    if still < max(options.cycles, count // 5):
        return undecided(f"The amplitude has been settled for {still} cycles only.")
    if direction == "settling":
        return undecided("The amplitude still settles.")
    pace = trend_of(cycles.pace()) if count > 6 else None
    if pace is not None and pace.significant and abs(pace.change) > options.drift:
        return undecided(f"The period still changes by {digits(100 * np.expm1(-pace.slope), 2, '+')} % a cycle.")
    means = cycles.last(options.cycles).mean
    if np.ptp(means) > max(10 * options.drift, (1.5 if noisy else 0.5) * error) * recent.spread.mean():
        if trend_of(np.exp((means - means.mean()) / np.ptp(means))).significant:
            return undecided("The mean of the cycles still moves.")
        return irregular("The mean of the cycles comes and goes.")
    words = f"{still} cycles of equal amplitude, repeating within {digits(100 * error, 2)} %"
    return Verdict("limit cycle", True, words + (", the difference being noise." if noisy else "."), **facts)


def _growth(cycles: Cycles, recent: Cycles, facts: dict, direction: str, options: JudgeOptions) -> Verdict:
    """Verdict on cycles whose amplitude grows or decays."""
    count = len(cycles)
    words = f"The amplitude changes by {digits(100 * facts['amplitude_trend'], 2, '+')} % a cycle"
    if comes_and_goes(cycles.spread, 2.5 * options.band):
        return Verdict("irregular", count >= 2 * options.cycles, words + " after having come and gone before.", **facts)
    if _slackens(recent.spread):
        return Verdict(direction, False, words + ", less and less: it may be on its way to another amplitude.", **facts)
    doubled = abs(np.log(cycles.spread[-1] / cycles.spread[max(0, count - options.cycles)])) > 0.3
    return Verdict(direction, count >= options.cycles or (count >= 5 and doubled), words + ".", **facts)


def _period(series: Series) -> tuple[float, float]:
    """Best period over several ends of the series, each freed of its slow drift while it is looked for."""
    best = (np.nan, np.inf)
    for share in (0.5, 0.25, 0.12, 1.0):
        part = series.last(share * series.duration)
        if len(part.values) < 32:
            continue
        t = np.linspace(-1.0, 1.0, len(part.values))
        level = part.values - np.polyval(np.polyfit(t, part.values, 2), t)
        if np.ptp(level) <= 1e-8 * np.ptp(part.values):
            continue
        period, error = find_period(replace(part, values=level))
        if not period > 0 or period * 3 > part.duration:
            continue
        period, error = refine(part, period, error)
        if error < 0.7 * best[1]:
            best = (period, error)
    return best


def _direction(cycles: Cycles, options: JudgeOptions) -> str:
    """Tell "growing", "decaying", "settling" or "" from nested ends of the sequence of amplitudes."""
    spread, count = cycles.spread, len(cycles)
    if count < options.cycles:
        found = trend_of(spread)
        if found.significant and abs(found.change) > 0.05:
            return "growing" if found.slope > 0 else "decaying"
        return ""
    length, name = options.cycles, ""
    while True:
        part = spread[-length:]
        found = trend_of(part)
        if found.significant and abs(found.change) > options.drift:
            left = remaining(part)
            if not np.isfinite(left):
                return "growing" if found.slope > 0 else "decaying"
            if abs(left) > 2.5 * options.drift and length == options.cycles:
                name = "settling"
        if length >= count // 2:
            break
        length = min(2 * length, max(options.cycles, count // 2))
    # slow growth under noise shows over all cycles first; the later half must not speak against it
    whole, late = trend_of(spread), trend_of(spread[-(count // 2) :])
    goes_on = late.slope / whole.slope > 0.5 and abs(late.slope) > 2.0 * late.error if whole.slope else False
    hidden = not whole.smooth and abs(late.slope - whole.slope) <= 3.0 * late.error
    if whole.significant and abs(whole.change) > options.drift and (goes_on or hidden):
        return "growing" if whole.slope > 0 else "decaying"
    return name


def _strongest_multiple(cycles: Cycles) -> int:
    """Harmonic of cycles that holds nearly all of their power; 1 without such a one."""
    power = (np.abs(np.fft.rfft(cycles.shape - cycles.mean[:, None], axis=1)) ** 2).sum(axis=0)[1:]
    most = int(np.argmax(power))
    return most + 1 if power[most] > _NEARLY_ALL * power.sum() else 1


def _slackens(spread: np.ndarray) -> bool:
    """True where amplitudes change less and less, in proportion.

    They do so on the way to a limit cycle, but not in exponential growth or decay.
    """
    half = len(spread) // 2
    first, last = trend_of(spread[: half + 1]), trend_of(spread[-half - 1 :])
    return bool(abs(last.slope) + 2.0 * last.error < 0.9 * abs(first.slope))


def _noise_on_cycle(cycles: Cycles, options: JudgeOptions) -> bool:
    """True where cycles differ by white noise, uncorrelated within a cycle and from one to the next."""
    kept = cycles.last(4 * options.cycles)
    left = kept.shape - kept.shape.mean(axis=0)
    left = left - left.mean()
    power = np.mean(left**2)
    if power == 0:
        return True
    within = np.mean(left[:, :-8] * left[:, 8:]) / power  # a sixteenth of a cycle
    across = np.mean(left[:-1] * left[1:]) / power
    # noise averages out over a cycle; amplitudes that scatter as much as the signal does belong to cycles that are not
    # equal
    unequal = trend_of(kept.spread).scatter > 0.4 * np.sqrt(np.mean(kept.error**2))
    return bool(within < 0.5 and across < 0.35 and not unequal)


def _factor(error: np.ndarray) -> float:
    """Factor from one error to the next; not a number where the errors are rounding."""
    return float(np.exp(trend_of(error).slope)) if len(error) >= 3 and error.min() > 1e-12 else np.nan
