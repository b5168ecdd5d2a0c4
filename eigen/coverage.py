"""What a search has covered, and whether that is what was asked for."""

from __future__ import annotations

import numpy as np

from .pairs import Found
from .region import Oval

CLEAR = 0.8  # what counts as clearly right of a limit point of eigenvalues, as a fraction of it
DEPTH = 0.4  # growth rate over angular frequency, down to which a band is searched at most


def band_sought(options) -> float:
    """Upper end of the band sought, rad/s."""
    return np.inf if options.max_frequency is None else 2 * np.pi * options.max_frequency


def number_in_band(found, options) -> int:
    """Eigenvalues found up to the end of the band."""
    return int(np.sum(found.values.imag <= band_sought(options)))


def would_do(values, oval: Oval, found, aim, options) -> bool:
    """Whether eigenvalues that have converged in an oval are all that is asked for."""
    apart = values[apart_from_limit(values, options) & (values.imag >= -1e-11 * np.abs(values))]
    trial = Found(apart, *(np.zeros(0),) * 4, lowest=found.lowest, slope=found.slope)
    trial.ovals[oval.shift] = oval
    return is_covered(trial, aim, options)


def apart_from_limit(values, options) -> np.ndarray:
    """Which eigenvalues do not belong to those that crowd around the limit point."""
    if options.limit_point is None:
        return np.ones(values.size, bool)
    return np.abs(values - options.limit_point) > 0.05 * abs(options.limit_point)


def leading_band(found, aim, options) -> tuple[float, float]:
    """Growth rate of the last of the leading modes, and the band that holds them, rad/s."""
    values = found.values
    if options.limit_point is not None:
        floor = CLEAR * options.limit_point
        values = values[values.real > floor]
        growth = np.sort(values.real)[::-1]
        band = min(band_sought(options), float(values.imag.max(initial=0.0)))
        return float(growth[aim - 1]) if growth.size >= aim else floor, band
    if options.max_frequency is not None:
        band = 2 * np.pi * options.max_frequency
        values = values[values.imag <= band * (1 + 1e-12)]
        growth = np.sort(values.real)[::-1]
        return (growth[min(aim, growth.size) - 1] if growth.size else -np.inf), band
    if not values.size:
        return -np.inf, np.inf
    if not found.everything:
        covered = _widest_covered(found, aim)
        if covered is not None:
            return covered
    order = np.argsort(-values.real)[:aim]
    return float(values.real[order].min()), float(values.imag[order].max())


def _widest_covered(found, aim) -> tuple[float, float] | None:
    """The widest band whose leading modes the region covers, with the growth rate of the last."""
    region = found.region
    tops = np.unique(found.values.imag)[::-1]
    for band in tops[:: max(1, tops.size // 60)]:
        growth = np.sort(found.values.real[found.values.imag <= band])[::-1]
        if growth.size < aim:
            return None
        low, high = region.complete_between(float(band), samples=100)
        if low <= growth[aim - 1] and high > 0:
            return float(growth[aim - 1]), float(band)
    return None


def is_covered(found, aim, options) -> bool:
    """Whether the leading modes asked for are known to be the leading ones."""
    if found.everything:
        return True
    growth, band = leading_band(found, aim, options)
    if options.limit_point is not None:
        low, high = found.region.complete_between(band)
        return low <= growth and high > 0
    inside = found.values.imag <= band * (1 + 1e-12)
    low, high = found.region.complete_between(band)
    if inside.sum() < aim:
        # a band may hold fewer: enough if it is searched down to strongly damped modes
        return options.max_frequency is not None and low <= -DEPTH * band and high > 0
    return low <= growth and high > 0
