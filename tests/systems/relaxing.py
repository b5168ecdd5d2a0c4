"""Stiffness that relaxes, put into pencils, and closed forms for it."""

from __future__ import annotations

import numpy as np

from eigen import CoupledPencil, Relaxation

from .random_pencils import random_pencil

#: Four branches, one a decade; strengths of a loss factor near 0.15.
TIMES = (0.3, 0.03, 3e-3, 3e-4)
STRENGTHS = (0.2, 0.2, 0.2, 0.2)


def mode_roots(square: float, strengths, times, damping: float = 0.0, share: float = 1.0) -> np.ndarray:
    """Zeros of s^2 + damping s + square (1 + share phi(s)), a polynomial once multiplied out."""
    poles = [np.array([tau, 1.0]) for tau in times]

    def product(factors):
        out = np.ones(1)
        for factor in factors:
            out = np.polymul(out, factor)
        return out

    total = np.polymul([1.0, damping, square], product(poles))
    for j, (g, tau) in enumerate(zip(strengths, times)):
        rest = product(poles[:j] + poles[j + 1 :])
        total = np.polyadd(total, share * square * np.polymul([g * tau, 0.0], rest))
    roots = np.roots(total).astype(complex)
    for _ in range(4):  # the coefficients span many decades
        roots = roots - np.polyval(total, roots) / np.polyval(np.polyder(total), roots)
    return roots


def relaxing_random(rng, n, m, b, *, groups=2, branches=3, **keywords) -> CoupledPencil:
    """A random pencil with relaxing parts that are symmetric and not negative, not of full rank all of them."""
    pencil = random_pencil(rng, n, m, b, **keywords)
    matrices = []
    for _ in range(groups):
        root = rng.standard_normal((n, int(rng.integers(1, n + 1))))
        matrices.append(root @ root.T * 10 ** rng.uniform(-1, 1) / n)
    strengths = rng.uniform(0, 1, (groups, branches)) * (rng.random((groups, branches)) < 0.7)
    return pencil.replace(relaxation=Relaxation(matrices, strengths, 10 ** rng.uniform(-2, 2, branches)))
