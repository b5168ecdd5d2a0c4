"""Where to put the shifts of a search."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .coverage import leading_band
from .factorization import SingularShiftError

#: Where the stiffness relaxes: the lowest frequency searched for, over the highest, and decay over angular frequency
#: down to which the search goes at most; slower and more strongly damped motions shade off into creep.
LOWEST = 0.05
SLOPE = 0.75


def plan_shifts(pencil, count, options, workspace):
    """First shift, and whether a limit point of eigenvalues is near enough to matter."""
    if options.shifts is not None:
        return options, None
    if pencil.relaxation is not None:
        # all from the lowest frequency to the highest lie as high above the real axis of 1 / (lambda - shift)
        return options, 0.9 * LOWEST**-0.5 * lowest_sought(pencil, count, options, workspace)
    first = first_shift(pencil, max(count, options.least), options, workspace)
    if options.limit_point is None:
        return options, first
    beside = 1.5 * abs(options.limit_point)
    if beside < first:
        return options, beside
    return replace(options, limit_point=None), first


def lowest_sought(pencil, count, options, workspace) -> float:
    """Angular frequency above which a search where the stiffness relaxes has to be complete, rad/s."""
    if options.max_frequency is not None:
        return LOWEST * 2 * np.pi * options.max_frequency
    return LOWEST * first_shift(pencil, max(count, options.least), options, workspace)


def first_shift(pencil, aim, options, workspace) -> float:
    """A positive real shift of the size of the frequencies sought."""
    if options.max_frequency is not None:
        # close to the band its eigenvalues lie well apart; next to a limit point the disc has to stay flat
        return (0.75 if options.limit_point is None else 1.5) * 2 * np.pi * options.max_frequency
    stiffness, inertia = np.abs(pencil.K.diagonal()), np.abs(pencil.M.diagonal())
    typical = np.sqrt(np.median(stiffness + 1e-300) / np.median(inertia + 1e-300))
    probe = 1e-3 * typical if np.isfinite(typical) and typical > 0 else 1.0
    lowest = probe
    for _ in range(3):  # inverse power iteration on the structure with M at the shift
        try:
            factor = workspace.factored(pencil, probe)
        except SingularShiftError:
            probe *= 1.37
            continue
        x = np.random.default_rng(3).standard_normal(pencil.n)
        for _ in range(6):
            x = factor.solve(pencil.M @ x).real
            size = np.linalg.norm(x)
            if not (np.isfinite(size) and size > 0):
                return probe
            x /= size
        lowest = size**-0.5
        # with the shift small against the frequency the estimate holds
        if lowest > 2 * probe or probe < 1e-6 * typical:
            break
        probe *= 0.05
    return max(lowest, probe) * max(3.0, 1.0 * aim)


def next_shift(pencil, found, aim, options, workspace) -> complex:
    """The natural real shift where the band was far off, then complex ones up the band.

    Where nothing converged the spectrum is dense as seen from afar, as heavy fluids make it: go closer.
    """
    if pencil.relaxation is not None:
        return found.shifts[0] * (2.5, 0.4)[len(found.shifts) % 2] ** ((len(found.shifts) + 1) // 2)
    if not found.values.size and all(isinstance(s, float) for s in found.shifts):
        closer = min(found.shifts) / 3.0
        if options.max_frequency is None:
            return closer
        return min(closer, first_shift(pencil, aim, replace(options, max_frequency=None), workspace))
    if options.limit_point is not None:  # a larger disc hugs the line through the limit point
        return 3.0 * max(abs(s) for s in found.shifts)
    if options.max_frequency is not None and len(found.shifts) == 1:
        natural = first_shift(pencil, aim, replace(options, max_frequency=None), workspace)
        if natural < 0.75 * 2 * np.pi * options.max_frequency:
            return natural
    if options.max_frequency is not None:
        band = 2 * np.pi * options.max_frequency
    else:
        band = max(leading_band(found, aim, options)[1], abs(found.shifts[0]))
    step = len([s for s in found.shifts if isinstance(s, complex)])
    height = band * (1.0, 0.5, 0.75, 0.25)[step % 4]
    return complex(0.3 * band, height)
