"""Prony series of a viscoelastic material over its long-term (equilibrium) law.

Equations (T.7) and (T.8) of docs/theory.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from dbvfiv.materials.checks import MaterialError
from dbvfiv.materials.nonnegative import nonnegative

#: How far beyond its branches a series keeps its loss factor when it is scaled, in decades; and rounds to do so.
_MARGIN, _ROUNDS = 0.1, 60


@dataclass(frozen=True)
class Prony:
    r"""Generalised Maxwell branches beside the slow law.

    Stress :math:`S = S_e(E) + \sum_j h_j` with :math:`\dot h_j + h_j/\tau_j = g_j \dot S_e` (quasi-linear
    viscoelasticity). Small motions see the tangent of the slow law times
    :math:`r(s) = 1 + \sum_j g_j s \tau_j / (1 + s \tau_j)`.

    Parameters
    ----------
    strengths : tuple of float
        g_j, over the slow modulus; not negative.
    times : tuple of float
        tau_j, s; positive.

    Raises
    ------
    MaterialError
        If the numbers of both differ, or one of them is out of range; a negative strength would give energy away.

    Examples
    --------
    >>> material = Prony((0.2,), (1.0 / (2 * np.pi * 10.0),))
    >>> round(float(material.loss_factor(10.0)), 6)
    0.090909
    """

    strengths: tuple[float, ...]
    times: tuple[float, ...]

    def __post_init__(self):
        strengths = tuple(float(g) for g in self.strengths)
        times = tuple(float(t) for t in self.times)
        if len(strengths) != len(times):
            raise MaterialError(
                f"A Prony series has as many times as strengths; {len(strengths)} strengths and "
                f"{len(times)} times were given."
            )
        for name, values, fits in (
            ("strength", strengths, lambda x: x >= 0),
            ("time", times, lambda x: x > 0),
        ):
            for value in values:
                if not (np.isfinite(value) and fits(value)):
                    raise MaterialError(
                        f"The relaxation {name} {value:g} was given; it must be finite and "
                        + ("positive." if name == "time" else "not negative: the branch would give energy away.")
                    )
        object.__setattr__(self, "strengths", strengths)
        object.__setattr__(self, "times", times)

    @property
    def elastic(self) -> bool:
        """True where all strengths are zero, so that the material is elastic."""
        return not any(self.strengths)

    def modulus(self, s):
        """r(s), the tangent over that of the slow law; s in 1/s, of any shape."""
        x = np.multiply.outer(np.asarray(s), np.array(self.times))
        return 1.0 + (x / (1.0 + x)) @ np.array(self.strengths)

    def loss_factor(self, frequency):
        """tan delta at frequencies, Hz."""
        r = self.modulus(2j * np.pi * np.asarray(frequency, float))
        return r.imag / r.real

    def scaled(self, factor: float) -> Prony:
        """The series whose loss factor is `factor` times this one's, at the same times.

        Least squares on tan delta over the frequencies of the branches, with strengths that stay positive; the storage
        modulus follows from it, as causality demands.

        Parameters
        ----------
        factor : float
            Not negative; zero gives an elastic material, one this series.

        Raises
        ------
        MaterialError
            If the factor is negative or not finite.
        """
        if not (np.isfinite(factor) and factor >= 0):
            raise MaterialError(f"A loss factor was to be multiplied by {factor:g}; the factor must not be negative.")
        if factor == 1.0 or self.elastic:
            return self
        if factor == 0.0:
            return Prony((0.0,) * len(self.times), self.times)
        return _scaled(self, float(factor))


@lru_cache(4096)  # scans over the factor ask for the same series again and again
def _scaled(prony: Prony, factor: float) -> Prony:
    """See `Prony.scaled`."""
    times = np.array(prony.times)
    low, high = np.log10(1.0 / times.max()) - _MARGIN, np.log10(1.0 / times.min()) + _MARGIN
    omega = np.logspace(low, high, max(int(20 * (high - low)), 4 * times.size) + 1)
    target = factor * prony.loss_factor(omega / (2 * np.pi))
    x = 1j * np.multiply.outer(omega, times)
    branch = x / (1.0 + x)
    matrix = branch.imag - target[:, None] * branch.real  # times g: target where tan delta is met
    storage = prony.modulus(1j * omega).real
    for _ in range(_ROUNDS):
        strengths = nonnegative(matrix / storage[:, None], target / storage)
        before, storage = storage, 1.0 + branch.real @ strengths
        if np.abs(storage - before).max() <= 1e-14 * storage.max():
            break
    return Prony(tuple(strengths), prony.times)
