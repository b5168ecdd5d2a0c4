"""Answers of linearised flow laws."""

from __future__ import annotations

import numpy as np
import scipy.linalg as la


def answer(parts, s: complex) -> np.ndarray:
    """Pressures (m, m) of changes of the areas that grow as exp(s t), the law's own unknowns with them."""
    inner = la.solve(parts["S0"] + s * parts["S1"], parts["R0"] + s * parts["R1"] + s * s * parts["R2"])
    return parts["A0"] + s * parts["A1"] + s * s * parts["A2"] - (parts["B0"] + s * parts["B1"]) @ inner


def frequencies(parts, lost: float = 1e-4) -> np.ndarray:
    """Angular frequencies of a fluid between walls at rest that loses nothing, rad/s, rising."""
    values = la.eigvals(-parts["S0"], parts["S1"])
    values = values[np.isfinite(values) & (np.abs(values) < 1e7)]
    assert np.abs(values.real).max() < lost * np.abs(values).max()
    return np.sort(values.imag[values.imag > 1.0])
