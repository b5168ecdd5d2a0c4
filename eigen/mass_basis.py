"""Bases that are orthonormal in a mass."""

from __future__ import annotations

import numpy as np

#: Squares of lengths that rounding leaves, relative to one.
ROUNDING = 1e-15
#: Least eigenvalue of the products of vectors of unit length that are made orthonormal together.
ALIKE = 1e-8


class NotPositiveError(ArithmeticError):
    """A mass is not positive definite."""

    def __init__(self):
        super().__init__("The matrix is not positive definite.")


def _unit(mass, X: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Columns of length one in the mass, and mass times them; those of no length left out."""
    MX = mass @ X
    size = np.sqrt(np.einsum("ij,ij->j", X, MX))
    return X[:, size > 0] / size[size > 0], MX[:, size > 0] / size[size > 0]


def orthonormal(mass, X: np.ndarray, compression: float, passes: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Basis of the span of columns, and mass times it; directions weaker than `compression` left out, each column
    counts alike.
    """
    X, MX = _unit(mass, X)
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
    X, MX = _unit(mass, X)
    for threshold in (max(least**2, ROUNDING), 0.5):  # the second pass removes what rounding left in the first
        X = X - V @ (V.T @ MX)
        MX = mass @ X
        gram = X.T @ MX
        weight, turn = np.linalg.eigh(0.5 * (gram + gram.T))
        keep = weight > threshold
        turn = turn[:, keep][:, ::-1] / np.sqrt(weight[keep][::-1])
        X, MX = X @ turn, MX @ turn
    return X


def beside(V: np.ndarray, MV: np.ndarray, mass, X: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """What columns have outside an orthonormal space of which the mass's products are known, down to rounding.

    Returns
    -------
    share : (j, b) array
        Products of the space with the columns.
    rest, images : (n, k) arrays
        Basis of what is left of them, and mass times it.

    Raises
    ------
    NotPositiveError
        If a vector of negative length is met.
    """
    share, size = MV.T @ X, np.einsum("ij,ij->j", X, mass @ X)
    if np.any(size < 0.0):
        raise NotPositiveError
    rest = (X - V @ share)[:, size > 0.0] / np.sqrt(size[size > 0.0])
    rest, images = _apart(*_long(rest, mass @ rest, ROUNDING))
    # the second pass removes what rounding left in the first; what loses much once more was rounding
    rest = rest - V @ (MV.T @ rest)
    return share, *_apart(*_long(rest, mass @ rest, 0.5))


def _long(X, MX, least: float) -> tuple[np.ndarray, np.ndarray]:
    """Columns whose squared lengths are greater than a given one, brought to length one."""
    size = np.einsum("ij,ij->j", X, MX)
    if np.any(size < -ALIKE):
        raise NotPositiveError
    kept = size > least
    if not kept.all():
        X, MX, size = X[:, kept], MX[:, kept], size[kept]
    return X / np.sqrt(size), MX / np.sqrt(size)


def _apart(X, MX) -> tuple[np.ndarray, np.ndarray]:
    """Columns of length one made orthonormal to each other."""
    if not X.shape[1]:
        return X, MX
    weight, turn = np.linalg.eigh(X.T @ MX)
    if weight[0] < -ALIKE:
        raise NotPositiveError
    if weight[0] < ALIKE:
        return _one_by_one(X, MX)
    turn = turn / np.sqrt(weight)
    return X @ turn, MX @ turn


def _one_by_one(X, MX) -> tuple[np.ndarray, np.ndarray]:
    """The same in their order (Gram and Schmidt, twice), without those that the ones before them hold."""
    kept, images = [], []
    for x, mx in zip(X.T, MX.T, strict=True):
        for _ in range(2):
            for other, image in zip(kept, images, strict=True):
                part = image @ x
                x, mx = x - part * other, mx - part * image
        square = x @ mx
        if square > ROUNDING:
            kept.append(x / np.sqrt(square))
            images.append(mx / np.sqrt(square))
    return np.array(kept).T, np.array(images).T
