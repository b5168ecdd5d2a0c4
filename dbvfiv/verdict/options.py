"""Options of a verdict."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class JudgeOptions:
    """Options of a verdict.

    Attributes
    ----------
    steady : float
        Largest change, over the last fifth and still to come, of a steady signal relative to its size.
    residual : float
        Largest residual of a steady state, where a residual is known.
    cycles : int
        Cycles that a limit cycle must have kept.
    periodic : float
        Largest periodicity error of a limit cycle without noise.
    noisy : float
        Largest periodicity error of a limit cycle with noise on it.
    drift : float
        Largest relative change of the amplitude over the cycles looked at, and still to come.
    band : float
        Relative band within which amplitudes count as equal.
    noise : float
        Largest root mean square of noise, relative to the level it lies on, within which a signal counts as steady.
    """

    steady: float = 1e-4
    residual: float = 1e-3
    cycles: int = 10
    periodic: float = 0.02
    noisy: float = 0.4
    drift: float = 2e-3
    band: float = 0.02
    noise: float = 0.02
