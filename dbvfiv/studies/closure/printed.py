"""Sentences below the table of back-pressure states."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from .closing import ClosingResult
    from .result import ClosureResult


def verdict(result: ClosureResult) -> list[str]:
    """Sentences on the balances, on buckling, on the safety against it and on the turn of the drive."""
    safety = result.safety
    return [
        *_balances(result),
        *_buckling(result),
        *(part.sentence for part in result.classes),
        *([] if safety is None else [safety.sentence]),
        *([] if result.closing is None else _closing(result.closing)),
        *result.measured.sentences(),
    ]


def _balances(result: ClosureResult) -> list[str]:
    if not result.states:
        return []
    force, energy = (
        max(getattr(state, name) for state in result.states) for name in ("force_balance", "energy_balance")
    )
    return [f"Forces balance to {force:.1g} of their sizes, work and energies to {energy:.1g} of the work."]


def _buckling(result: ClosureResult) -> list[str]:
    if result.buckling:
        return [f"Buckling ({b.kind}) at {b.pressure / 1e3:.6g} kPa." for b in result.buckling[:3]]
    followed = [point for point in result.walk if np.isfinite(point.lowest_eigenvalue)]
    if not followed:
        return []
    softest = min(followed, key=lambda point: point.lowest_eigenvalue)
    return [
        f"No buckling within the symmetry of the model up to "
        f"{max(p.pressure for p in followed) / 1e3:.4g} kPa; the stiffness is least at "
        f"{softest.pressure / 1e3:.4g} kPa, "
        f"{softest.lowest_eigenvalue / followed[0].lowest_eigenvalue:.0%} of that at the start."
    ]


def _closing(closing: ClosingResult) -> list[str]:
    told = closing.summary()
    turn = (
        f"Drive turned from {told['open_pressure'] / 1e3:g} to {-told['open_pressure'] / 1e3:g} kPa "
        f"in {told['reversal_time']:g} s:"
    )
    if told["closing_time"] is None:
        return [f"{turn} open at the end, {told['duration']:.4g} s."]
    return [
        f"{turn} shut for good {told['closing_time']:.4g} s after it began to turn "
        f"({told['closing_time_after_sign_change']:.4g} s after it changed "
        f"sign), fluid pressure between {told['lowest_pressure'] / 1e3:.4g} and "
        f"{told['highest_pressure'] / 1e3:.4g} kPa."
    ]
