"""Noise about a constant level, told from motion by its spectrum: broad, without a line, and the same all the time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .series import Series

_SHARE, _FEWEST = 0.2, 64
_BANDS = 16
#: Smallest share of the band up to half the sampling rate that noise fills.
_FILLED = 0.3
#: Margin of a line over the largest of so many values of a noise's spectrum, which is the logarithm of their number in
#: the mean; beyond it lies noise once in a thousand records.
_LINE = 7.0
#: Standard errors by which the level may move.
_LEVEL = 4.0


@dataclass(frozen=True)
class Noise:
    """Noise about a level.

    Attributes
    ----------
    level : float
    rms : float
        Root mean square about the level.
    """

    level: float
    rms: float


def noise_at_end(series: Series) -> Noise | None:
    """Level and noise of the last fifth of a series; None if that is anything but noise about a constant level.

    Noise has no memory: its spectrum (Hann window) fills at least a third of what the sampling shows, holds no line,
    and its level and its strength stay within what chance explains.
    """
    part = series.last(max(_SHARE * series.duration, (_FEWEST - 1) * series.step))
    values, count = part.values, len(part.values)
    level = float(values.mean())
    rms = float(values.std())
    if count < _FEWEST // 2 or rms == 0.0:
        return None
    power = np.abs(np.fft.rfft((values - level) * np.hanning(count + 2)[1:-1])[2:]) ** 2
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
    if filled < _FILLED or line > np.log(len(power)) + _LINE or moved > _LEVEL * chance or not even:
        return None
    return Noise(level, rms)
