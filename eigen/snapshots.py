"""Which conditions of a list vectors are taken at, and which they are checked at."""

from __future__ import annotations

import numpy as np


def spread(conditions, number: int) -> list[int]:
    """Indices of conditions spread over the list."""
    return sorted({int(round(x)) for x in np.linspace(0, len(conditions) - 1, min(number, len(conditions)))})


def between(places: list[int]) -> list[int]:
    """The middle of the widest gap between places, the first of several."""
    if len(places) < 2:
        return places
    gaps = [(b - a, -a, (a + b) // 2) for a, b in zip(places[:-1], places[1:])]
    return [max(gaps)[2]]
