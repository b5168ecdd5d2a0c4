"""Accelerations that the next step is likely to find, from those of the last ones."""

from __future__ import annotations

import numpy as np


class Predictor:
    """Accelerations (n,) at the last instants, four at most, and what follows from them."""

    def __init__(self) -> None:
        self._points: list[tuple[float, np.ndarray]] = []

    @property
    def last(self) -> tuple[float, np.ndarray] | None:
        """Time, s, and accelerations of the last step; None without any."""
        return self._points[-1] if self._points else None

    def add(self, time: float, accelerations: np.ndarray) -> None:
        """Remember a step."""
        self._points = [*self._points[-3:], (time, accelerations)]

    def shorten(self) -> None:
        """Forget all but the last step."""
        self._points = self._points[-1:]

    def accelerations(self, time: float) -> np.ndarray:
        """Accelerations (n,) at a later instant, s; at least one step must be known.

        On even steps by formulas that are exact for a parabola (or a straight line) plus a part of alternating sign:
        without numerical damping, stiff modes with much stiffness damping alternate, and a parabola alone would throw
        that part up sevenfold.
        """
        points = self._points
        gaps = np.diff([t for t, _ in points] + [time])
        if len(points) >= 3 and np.ptp(gaps) <= 1e-6 * gaps[-1]:
            values = [value for _, value in points]
            if len(values) >= 4:
                return 2.0 * (values[-1] - values[-3]) + values[-4]
            return values[-1] + values[-2] - values[-3]
        (before, old), (here, new) = points[-2:] if len(points) > 1 else (points[0], (points[0][0] + 1.0, points[0][1]))
        return new + (time - here) / (here - before) * (new - old)
