r"""Rayleigh damping C = alpha M + beta K as a damping ratio over frequency (Th. Eq. 5.5).

xi = alpha / (2 omega) + beta omega / 2
"""

from __future__ import annotations

import numpy as np

from dbvfiv.materials.checks import MaterialError


def rayleigh_ratio(frequency, alpha: float, beta: float):
    """Damping ratio of a mode under Rayleigh damping.

    Parameters
    ----------
    frequency : array_like
        Hz, positive.
    alpha, beta : float
        1/s and s.

    Examples
    --------
    >>> round(float(rayleigh_ratio(41.0, 0.0, 0.003)), 3)
    0.386
    """
    omega = 2 * np.pi * np.asarray(frequency, float)
    return 0.5 * (alpha / omega + beta * omega)


def rayleigh_constants(ratios: tuple[float, float], frequencies: tuple[float, float]) -> tuple[float, float]:
    """alpha and beta that give two damping ratios at two frequencies (Th. Eq. 5.5).

    Between the frequencies the damping is lower, beyond them higher. One constant is negative where the ratios
    differ by more than the frequencies do, and then no Rayleigh damping meets both.

    Parameters
    ----------
    ratios : tuple of float
        Damping ratios, half the loss factors.
    frequencies : tuple of float
        Hz; positive, and different.

    Returns
    -------
    alpha, beta : float
        1/s and s.

    Raises
    ------
    MaterialError
        For frequencies that are not two positive ones.

    Examples
    --------
    Table 5-1 of the thesis, a ratio of 0.05 from 1 to 10 Hz; it prints 0.57 and 0.002:

    >>> alpha, beta = rayleigh_constants((0.05, 0.05), (1.0, 10.0))
    >>> round(alpha, 3), round(beta, 5)
    (0.571, 0.00145)
    """
    low, high = (float(f) for f in frequencies)
    if not (0 < low < np.inf and 0 < high < np.inf and low != high):
        raise MaterialError(
            f"alpha and beta follow from two different frequencies above 0 Hz, but {low:g} and {high:g} Hz were given."
        )
    omega = 2 * np.pi * np.array([low, high])
    alpha, beta = np.linalg.solve(np.stack([0.5 / omega, 0.5 * omega], axis=1), np.asarray(ratios, float))
    return float(alpha), float(beta)
