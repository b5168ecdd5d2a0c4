"""Exponents of Ogden's law: a search over them with the mu_p of each choice by linear least squares.

The residual has several minima (Ogden, Saccomandi & Sgura 2004, Comput. Mech. 34, 484), so the search starts from the
best of many sets of exponents; without an active constraint its answer is improved over all unknowns at once.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from scipy.optimize import least_squares

_STARTS = (-8.0, -4.0, -2.0, -1.0, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0)
_TRIED = {"none": 8, "non-negative": 8, "stable": 2}
_LARGEST = 30.0
_TIGHT = 1e-15
_FAR = 1e6


def search(problem) -> tuple[np.ndarray, bool | None]:
    """Exponents of least residual, descending, and whether the constraint changed them.

    Parameters
    ----------
    problem
        Of `fit.fit_rubber`: tests, weights, constraint, `matrix` and `solve` at given exponents.
    """
    free = _polished(problem, _best(problem, constrained=False))
    constants, unconstrained = problem.solve(free)
    if np.array_equal(constants, unconstrained):
        return _ordered(free), False
    return _ordered(_best(problem, constrained=True)), True


def _ordered(exponents: np.ndarray) -> np.ndarray:
    return np.sort(exponents)[::-1]


def _best(problem, constrained: bool) -> np.ndarray:
    """The best of searches from several sets of exponents."""

    def residual(exponents):
        constants = problem.solve(exponents, constrained)[0]
        return (problem.matrix(exponents) @ constants - problem.target) / np.linalg.norm(problem.target)

    quick = [(float(np.sum(residual_of_free(problem, s) ** 2)), s) for s in combinations(_STARTS, problem.form.terms)]
    starts = [np.array(start) for _, start in sorted(quick)[: _TRIED[problem.constraint if constrained else "none"]]]
    # an exponent of zero is no term: each keeps its sign
    found = []
    for start in starts:
        bounds = np.where(start > 0, 0.05, -_LARGEST), np.where(start > 0, _LARGEST, -0.05)
        tight = {} if constrained else {"xtol": 1e-12, "ftol": 1e-12, "gtol": 1e-12}
        found.append(least_squares(residual, start, bounds=bounds, max_nfev=200 if not constrained else 40, **tight))
    return min(found, key=lambda answer: answer.cost).x


def residual_of_free(problem, exponents) -> np.ndarray:
    """Weighted residuals (n,) of the unconstrained constants at given exponents."""
    return problem.matrix(exponents) @ problem.solve(exponents, constrained=False)[0] - problem.target


def _polished(problem, exponents: np.ndarray) -> np.ndarray:
    """Exponents after a search over all unknowns with the exact derivatives."""
    size = np.linalg.norm(problem.target)
    constants = problem.solve(exponents, constrained=False)[0]
    scale = np.maximum(np.abs(constants), 1e-300)
    count = len(exponents)

    def residual(x):
        if np.abs(x[count:]).max() > 2 * _LARGEST:  # terms that cancel each other: the search before has the answer
            return np.full(len(problem.target), _FAR)
        return (problem.matrix(x[count:]) @ (x[:count] * scale) - problem.target) / size

    def derivative(x):
        return np.hstack([problem.matrix(x[count:]) * scale, problem.slopes(x[count:], x[:count] * scale)]) / size

    start = np.concatenate([constants / scale, exponents])
    answer = least_squares(residual, start, derivative, method="lm", xtol=_TIGHT, ftol=_TIGHT, gtol=_TIGHT)
    return answer.x[count:] if answer.cost <= np.sum(residual(start) ** 2) / 2 else exponents
