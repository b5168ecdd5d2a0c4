"""Onsets under the other continuity law, beside those of the case's own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from .intervals import Interval, common_stretches
from .run import FoundOnsets

#: Kind of the note that holds them.
NOTE = "other law"
#: Stretches narrower than this part of their place are what is left of the search for an onset.
_SLIVER = 1e-6


def note_of(found: FoundOnsets) -> dict[str, Any]:
    """Note that a record keeps of the onsets under the other continuity law."""
    return {
        "continuity": found.case.fluid.continuity,
        "points": [point.summary() for point in found.points],
        "scan": {
            "values": found.values.tolist(),
            "growth_rate": found.growth_rates[:, 0].tolist(),
            "frequency": found.frequencies[:, 0].tolist(),
            "certified": found.certified.tolist(),
            "verdict": [verdict.summary() for verdict in found.verdicts],
        },
        "stable": [list(stretch) for stretch in found.stable_intervals],
        "unstable": [list(stretch) for stretch in found.unstable_intervals],
        "failures": list(found.failures),
        "warnings": list(found.warnings),
    }


def disagreements(
    own: str, stable: Sequence[Interval], unstable: Sequence[Interval], other: dict[str, Any]
) -> list[tuple[float, float, str]]:
    """Stretches (start, stop, law that is stable) in which one law is stable and the other is not.

    Parameters
    ----------
    own : str
        The case's law, with its `stable` and `unstable` stretches.
    other : dict
        As `note_of` gives it.
    """
    found = [(*part, own) for part in common_stretches([stable, other["unstable"]])]
    found += [(*part, other["continuity"]) for part in common_stretches([unstable, other["stable"]])]
    found = [part for part in found if part[1] - part[0] > _SLIVER * abs(part[1])]
    joined: list[tuple[float, float, str]] = []
    for low, high, law in sorted(found):
        if joined and joined[-1][2] == law and low - joined[-1][1] <= _SLIVER * abs(low):
            joined[-1] = (joined[-1][0], high, law)
        else:
            joined.append((low, high, law))
    return joined
