"""Bases that are orthonormal in a mass."""

from __future__ import annotations

import numpy as np

#: Squares of lengths that rounding leaves, relative to one.
ROUNDING = 1e-15


def unit(mass, X: np.ndarray) -> np.ndarray:
    """Columns of length one in the mass; those of no length left out."""
    size = np.sqrt(np.einsum("ij,ij->j", X, mass @ X))
    return X[:, size > 0] / size[size > 0]


def orthonormal(mass, X: np.ndarray, compression: float, passes: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Basis of the span of columns, and mass times it; directions weaker than `compression` left out, each column
    counts alike.
    """
    X = unit(mass, X)
    MX = mass @ X
    # a second pass removes what rounding left in the first; the mass goes along, which spares a product
    for threshold in (max(compression**2, 1e-14), 1e-14)[:passes]:
        gram = X.T @ MX
        weight, turn = np.linalg.eigh(0.5 * (gram + gram.T))
        keep = weight > threshold * weight.max(initial=0.0)
        turn = turn[:, keep][:, ::-1] / np.sqrt(weight[keep][::-1])
        X, MX = X @ turn, MX @ turn
    return X, MX


def outside(V: np.ndarray, mass, X: np.ndarray, least: float) -> np.ndarray:
    """Basis of what columns of length one have outside an orthonormal space; what is shorter than `least` left out."""
    X = unit(mass, X)
    for threshold in (max(least**2, ROUNDING), 0.5):  # the second pass removes what rounding left in the first
        X = X - V @ (V.T @ (mass @ X))
        gram = X.T @ (mass @ X)
        weight, turn = np.linalg.eigh(0.5 * (gram + gram.T))
        keep = weight > threshold
        X = X @ (turn[:, keep][:, ::-1] / np.sqrt(weight[keep][::-1]))
    return X
