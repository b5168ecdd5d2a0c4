"""Derivatives by differences."""

from __future__ import annotations

import numpy as np


def difference(function, x, direction, step):
    """Fourth-order central difference of a function along a direction."""
    f = [np.asarray(function(x + k * step * direction)) for k in (-2, -1, 1, 2)]
    return (f[0] - 8 * f[1] + 8 * f[2] - f[3]) / (12 * step)
