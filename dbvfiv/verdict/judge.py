"""Verdict on the final behaviour of a time series.

Sampling at the period, beats, slow growth and noise do not mislead it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .cycles import Cycles, extremes, harmonics
from .level import within_noise, without_cycles
from .options import JudgeOptions
from .period import find_period, refine
from .sampling import longest_part
from .series import Series, check_samples, swings, undersampled
from .trend import comes_and_goes, remaining, settled, trend_of
from .verdict import Verdict

#: Samples without which nothing is said.
_FEWEST = 16


def judge(
    time,
    values,
    options: JudgeOptions = JudgeOptions(),
    *,
    residual: float | None = None,
    closed_below: float | None = None,
) -> Verdict:
    """Verdict on a signal.

    Parameters
    ----------
    time, values : (k,) arrays
        Samples at increasing times; uneven ones are interpolated. Of a record with gaps the longest part between
        them is judged, and a note says so.
    options : JudgeOptions
    residual : float, optional
        How far from equilibrium the system is at the end, relative; a signal that stands still while its system does
        not is not steady.
    closed_below : float, optional
        Level below which the signal counts as closed.

    Returns
    -------
    Verdict

    Raises
    ------
    ValueError
        If the samples are no series.

    Examples
    --------
    >>> t = np.linspace(0.0, 20.0, 2001)
    >>> verdict = judge(t, 3.0 + np.sin(2 * np.pi * t))
    >>> verdict.name, round(verdict.frequency, 6), round(verdict.amplitude, 6)
    ('limit cycle', 1.0, 1.0)
    """
    time, values = check_samples(time, values)
    part, notes = longest_part(time)
    facts = {
        "smallest": float(values.min()),
        "largest": float(values.max()),
        "judged": (float(time[part][0]), float(time[part][-1])),
        "notes": notes,
    }
    time, values = time[part], values[part]
    if len(values) < _FEWEST:
        end = float(values[-1])
        return Verdict("undecided", False, _too_few(notes), mean=end, amplitude=0.0, rms=0.0, **facts)
    found = _judge(Series.of(time, values), options, residual, closed_below)
    return replace(found, **facts)


def _too_few(notes: tuple[str, ...]) -> str:
    between = " between two gaps" if notes else ""
    return f"There are fewer than {_FEWEST} samples{between}."


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
    if at_end["amplitude"] > 1e-9 * size:
        fast = undersampled(series)
        if fast:
            words = (
                f"It swings at {fast:.4g} Hz, and {1.0 / (fast * series.step):.2g} samples a cycle are "
                f"too few to judge by."
            )
            return Verdict("undecided", False, words, **at_end)
        found = _oscillation(series, options, size)
        if found is not None and (found.decided and found.name != "irregular"):
            return found
        found = found or without_cycles(series, options, size, residual, at_end)
        return within_noise(series, options, residual, at_end) or found
    return without_cycles(series, options, size, residual, at_end)


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
        "amplitude_trend": trend_of(kept.spread).slope,
        "harmonics": harmonics(series, period, min(len(cycles), options.cycles)),
        "rms": float(kept.spread.mean() / np.sqrt(2.0)),
    }
    small = 0.5 * (high - low) <= options.steady * size
    direction = _direction(cycles, options)
    if direction in ("growing", "decaying"):
        facts["mean"] = float(cycles.mean[-1])
    if small and direction != "growing":
        return None
    return _name(series, cycles, recent, facts, direction, options)


def _name(
    series: Series, cycles: Cycles, recent: Cycles, facts: dict, direction: str, options: JudgeOptions
) -> Verdict:
    error, count = facts["periodicity_error"], len(cycles)
    rate = abs(facts["amplitude_trend"])
    if error > options.noisy and direction in ("growing", "decaying") and rate < 0.5 * error:
        direction = ""  # the amplitudes wander because nothing repeats
    if (
        direction in ("growing", "decaying")
        and error > options.periodic
        and rate < 0.2 * error
        and not _noise_on_cycle(cycles, options)
    ):
        direction = ""  # growth as slow as that does not make cycles so different
    if direction in ("growing", "decaying"):
        return _growth(cycles, recent, facts, direction, options)
    enough = (1.5 if error > options.noisy else 4.0) * options.cycles  # swings without a return
    if count < options.cycles and error > options.periodic and swings(series) >= enough:
        return Verdict(
            "irregular",
            True,
            f"After {swings(series)} swings it still repeats within {100 * error:.2g} % only.",
            **facts,
        )
    if count < options.cycles:
        return Verdict(
            "undecided", False, f"Only {count} cycles have been seen and {options.cycles} are needed.", **facts
        )
    if error > options.noisy:
        return Verdict("irregular", True, f"Nothing repeats: the periodicity error is {error:.2g}.", **facts)
    if error > options.periodic and not _noise_on_cycle(cycles, options):
        return Verdict(
            "irregular", True, f"Cycles differ from one to the next by {100 * error:.2g} %, and not by noise.", **facts
        )
    noisy = error > options.periodic
    band = max(options.band, 6.0 * trend_of(recent.spread).scatter) if noisy else options.band
    if comes_and_goes(cycles.spread[-max(options.cycles, 3 * count // 4) :], band if noisy else 0.5 * options.band):
        return Verdict("irregular", True, "The amplitude comes and goes: beats.", **facts)
    still = settled(cycles.spread, band)
    if still < max(options.cycles, count // 5):
        return Verdict("undecided", False, f"The amplitude has been settled for {still} cycles only.", **facts)
    if direction == "settling":
        return Verdict("undecided", False, "The amplitude still settles.", **facts)
    pace = cycles.pace()
    if len(pace) >= 6 and trend_of(pace).significant and abs(trend_of(pace).change) > options.drift:
        return Verdict(
            "undecided", False, f"The period still changes by {100 * trend_of(pace).slope:+.2g} % a cycle.", **facts
        )
    means = cycles.last(options.cycles).mean
    if np.ptp(means) > max(10 * options.drift, (1.5 if noisy else 0.5) * error) * recent.spread.mean():
        if trend_of(np.exp((means - means.mean()) / np.ptp(means))).significant:
            return Verdict("undecided", False, "The mean of the cycles still moves.", **facts)
        return Verdict("irregular", True, "The mean of the cycles comes and goes.", **facts)
    words = f"{still} cycles of equal amplitude, repeating within {100 * error:.2g} %" + (
        ", the difference being noise." if noisy else "."
    )
    return Verdict("limit cycle", True, words, **facts)


def _growth(cycles: Cycles, recent: Cycles, facts: dict, direction: str, options: JudgeOptions) -> Verdict:
    """Verdict on cycles whose amplitude grows or decays."""
    count = len(cycles)
    words = f"The amplitude changes by {100 * facts['amplitude_trend']:+.2g} % a cycle"
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
