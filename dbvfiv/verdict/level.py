"""Verdicts on signals without cycles: a level, a drift, noise about a level."""

from __future__ import annotations

import numpy as np

from .noise import noise_at_end
from .options import JudgeOptions
from .series import Series, swings
from .verdict import Verdict


def without_cycles(series: Series, options: JudgeOptions, size: float, residual: float | None, at_end: dict) -> Verdict:
    """Verdict on a signal without cycles, from its size and from mean, amplitude and rms of its end."""
    tail = series.last(0.2 * series.duration).values
    thirds = [part.mean() for part in np.array_split(tail, 3)]
    first, second = thirds[1] - thirds[0], thirds[2] - thirds[1]
    to_come = abs(second) / (1.0 - min(abs(second / first), 0.99)) if first and abs(second) > 1e-13 * size else 0.0
    if 2.0 * at_end["amplitude"] <= options.steady * size and to_come <= options.steady * size:
        if residual is not None and not residual <= options.residual:
            return Verdict(
                "undecided",
                False,
                (
                    f"The signal stands still but its system does not (residual "
                    f"{residual:.2g}): it may be sampled at its own period."
                ),
                **at_end,
            )
        return Verdict(
            "steady", True, f"It changes by less than {options.steady:g} of its size, and little is to come.", **at_end
        )
    ranges = np.array([np.ptp(part) for part in np.array_split(series.values, 8)])
    levels = np.array([part.mean() for part in np.array_split(series.values, 8)])
    late = ranges[-4:]
    falling, rising = np.all(np.diff(late) < 0), np.all(np.diff(late) > 0)
    if falling and late[-1] < 0.6 * late[0]:
        return Verdict(
            "decaying", bool(late[-1] < 0.1 * ranges.max()), "Its changes become smaller and smaller.", **at_end
        )
    if rising and late[-1] > 1.5 * late[0] and ranges[-1] == ranges.max():
        return Verdict(
            "growing", bool(late[-1] > 10 * max(late[0], 1e-300)), "Its changes become larger and larger.", **at_end
        )
    steps = np.diff(levels[-5:])
    if np.all(steps > 0) or np.all(steps < 0):
        if np.ptp(levels[-5:]) > 2.0 * np.median([_scatter(part) for part in np.array_split(series.values, 8)[-4:]]):
            shrinking = abs(steps[-1]) < 0.5 * abs(steps[0])
            return Verdict(
                "decaying" if shrinking else "growing",
                False,
                "It drifts one way" + (", slower and slower." if shrinking else "."),
                **at_end,
            )
    if swings(series) < options.cycles:
        return Verdict("undecided", False, "It moves, and too few swings have been seen to tell how.", **at_end)
    return Verdict("irregular", True, "It moves without a period.", **at_end)


def _scatter(part: np.ndarray) -> float:
    t = np.arange(len(part))
    return float(np.ptp(part - np.polyval(np.polyfit(t, part, 1), t)))


def within_noise(series: Series, options: JudgeOptions, residual: float | None, at_end: dict) -> Verdict | None:
    """Verdict on a signal that ends in a constant level with noise on it; None if it does not."""
    noise = noise_at_end(series)
    if noise is None or (residual is not None and not residual <= options.residual):
        return None
    facts = at_end | {"mean": noise.level, "rms": noise.rms, "noise": noise.rms}
    share = noise.rms / abs(noise.level) if noise.level else np.inf
    if noise.rms <= options.noise * abs(noise.level):
        words = f"It is constant within noise of {noise.rms:.3g} (root mean square, {100 * share:.2g} % of its level)."
        return Verdict("steady", True, words, **facts)
    level = f"{100 * share:.3g} % of its level" if share < 10 else f"its level is {noise.level:.2g}"
    words = f"It is noise of {noise.rms:.3g} (root mean square, {level}) without a period: too much to call it steady."
    return Verdict("irregular", True, words, **facts)
