"""Mooney-Rivlin constants from a uniaxial tension test.

The nominal stress of an incompressible bar at the stretch l,

    P = 2 (l - l^-2)(W1 + W2/l),   W1 = C10 + C11 (I2 - 3),   W2 = C01 + C11 (I1 - 3),

is linear in the constants, so the fit is a linear least-squares problem. Tension alone tells C10 and C01 apart badly:
over a small range of strains their columns are nearly parallel, and the fit returns large constants of opposite sign
that describe the test well and other states of strain badly. The condition number says how far this goes; the "stable"
constraint keeps the constants usable.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from dbvfiv.materials.checks import MaterialError
from dbvfiv.materials.mooney_rivlin import MooneyRivlin
from dbvfiv.materials.stability import hill_moduli
from dbvfiv.materials.tension_test import TensionTest

CONSTRAINTS = ("none", "non-negative", "stable")
LEAST_MARGIN = 0.01
_MAX_CUTS = 200


def uniaxial_columns(stretch, terms: int = 3) -> np.ndarray:
    """Nominal stress per unit of each constant.

    Parameters
    ----------
    stretch : array_like, shape (n,)
    terms : int
        2 (C10, C01) or 3 (and C11).

    Returns
    -------
    numpy.ndarray, shape (n, terms)
        Dimensionless. Written in the strain l - 1, so that small strains lose no digits.
    """
    stretch = np.asarray(stretch, dtype=float)
    s = stretch - 1.0
    first = 2.0 * s * (stretch**2 + stretch + 1.0) / stretch**2
    columns = [first, first / stretch]
    if terms == 3:
        i1 = s**2 * (stretch + 2.0) / stretch
        i2 = s**2 * (2.0 * stretch + 1.0) / stretch**2
        columns.append(first * (i2 + i1 / stretch))
    return np.stack(columns, axis=-1)


def uniaxial_stress(law: MooneyRivlin, stretch) -> np.ndarray:
    """Nominal stress of a rubber bar in tension or compression, Pa, at the given stretches."""
    return uniaxial_columns(stretch) @ np.array([law.c10, law.c01, law.c11])


@dataclass(frozen=True)
class UniaxialFit:
    """Constants fitted to a tension test, and how far to trust them.

    Attributes
    ----------
    constants : numpy.ndarray, shape (terms,)
        C10, C01 and, for three terms, C11, Pa.
    residuals : numpy.ndarray, shape (n,)
        Measured minus fitted nominal stress, Pa.
    r_squared : float
        1 - |residuals|^2/|stress - mean|^2; NaN if all stresses are equal.
    condition_number : float
        Of the least-squares matrix with columns scaled to unit length.
    covariance : numpy.ndarray, shape (terms, terms)
        Pa^2, from the residual variance; that of the unconstrained problem even if a constraint
        is active, in which case it overstates the scatter.
    constraint : str
        "none", "non-negative" or "stable".
    active : bool
        Whether the constraint changed the answer.
    """

    constants: np.ndarray
    residuals: np.ndarray
    r_squared: float
    condition_number: float
    covariance: np.ndarray
    constraint: str
    active: bool

    @property
    def standard_errors(self) -> np.ndarray:
        """Standard error of each constant, Pa."""
        return np.sqrt(np.diag(self.covariance))

    def law(self, density: float) -> MooneyRivlin:
        """The fitted rubber.

        Raises
        ------
        MaterialError
            If the constants give no positive shear modulus.
        """
        c10, c01, *c11 = (float(c) for c in self.constants)
        return MooneyRivlin(c10, c01, c11[0] if c11 else 0.0, density)


def fit_mooney_rivlin(
    test: TensionTest, terms: int = 3, constraint: str = "none", stable_to: float | None = None
) -> UniaxialFit:
    """Fit two or three constants to a tension test by linear least squares.

    Parameters
    ----------
    test : TensionTest
    terms : int
        2 or 3.
    constraint : {"none", "non-negative", "stable"}
        "non-negative": every constant at least 0. For two terms that suffices for stability at all strains.
        "stable": a Hill margin (see `stability`) of at least 0.01 in every state, not only
        tension, of equivalent logarithmic strain up to `stable_to`.
    stable_to : float, optional
        Engineering strain of the tension that has this equivalent strain; the largest strain of
        the test if not given. Only for "stable".

    Raises
    ------
    MaterialError
        For fewer than ``terms + 1`` different strains, an unknown option, or a fit that finds no
        positive stiffness.
    """
    if terms not in (2, 3):
        raise MaterialError(f"A Mooney-Rivlin fit has 2 or 3 terms, but {terms!r} was given.")
    if constraint not in CONSTRAINTS:
        raise MaterialError(f"The constraint must be one of {', '.join(CONSTRAINTS)}, but {constraint!r} was given.")
    different = np.unique(test.strain[test.strain != 0.0]).size
    if different < terms + 1:
        raise MaterialError(
            f"A fit of {terms} constants needs at least {terms + 1} different strains other than zero, but the "
            f"tension test has {different}."
        )
    raw = uniaxial_columns(1.0 + test.strain, terms)
    scale = np.linalg.norm(raw, axis=0)
    matrix = raw / scale
    u, singular, vt = np.linalg.svd(matrix, full_matrices=False)
    free = vt.T @ (u.T @ test.stress / singular)
    scaled = free
    if constraint == "non-negative":
        scaled = nnls(matrix, test.stress)[0] if np.any(free < 0.0) else free
    elif constraint == "stable":
        reach = float(np.max(np.abs(test.strain))) if stable_to is None else stable_to
        scaled = _stable(matrix, test.stress, free, scale, reach)
    residuals = test.stress - matrix @ scaled
    variance = np.sum((test.stress - matrix @ free) ** 2) / (test.stress.size - terms)
    inverse = (vt.T / singular**2) @ vt
    spread = np.sum((test.stress - test.stress.mean()) ** 2)
    return UniaxialFit(
        constants=scaled / scale,
        residuals=residuals,
        r_squared=float(1.0 - np.sum(residuals**2) / spread) if spread > 0.0 else float("nan"),
        condition_number=float(singular[0] / singular[-1]),
        covariance=variance * inverse / np.outer(scale, scale),
        constraint=constraint,
        active=not np.array_equal(scaled, free),
    )


def _stable(matrix, stress, free, scale, reach: float) -> np.ndarray:
    """Least squares under Hill's inequality with a margin, by cutting planes.

    Each Hill modulus less the margin is the least eigenvalue of a matrix that is linear in the constants, so an
    eigenvector of a negative one gives a linear inequality that the answer must fulfil.
    """
    if not 0.0 < reach < np.inf:
        raise MaterialError(f"stable_to must be a strain greater than 0, but {reach!r} was given.")
    terms = scale.size
    radius = np.log1p(reach) * np.linspace(0.0, 1.0, 21)
    angle = np.linspace(0.0, np.pi / 3.0, 25)
    rays = np.stack([np.cos(angle - k * 2.0 * np.pi / 3.0) for k in range(3)], axis=-1)
    states = (radius[:, None, None] * rays).reshape(-1, 3)
    moduli = hill_moduli(states)[:, :terms]
    moduli[:, :2] -= LEAST_MARGIN * 4.0 * np.eye(5)  # 2 mu = 4 (C10 + C01)
    moduli /= scale[:, None, None]
    answer, cuts = free, np.zeros((0, terms))
    size = np.linalg.norm(free)
    for _ in range(_MAX_CUTS):
        values, vectors = np.linalg.eigh(np.tensordot(moduli, answer, axes=([1], [0])))
        worst = np.argsort(values[:, 0])[:3]
        normals = np.einsum("sa,skab,sb->sk", vectors[worst, :, 0], moduli[worst], vectors[worst, :, 0])
        violated = values[worst, 0] < -1e-9 * size * np.linalg.norm(normals, axis=1)
        if not violated.any():
            return answer
        cuts = np.vstack([cuts, normals[violated] / np.linalg.norm(normals[violated], axis=1)[:, None]])
        answer = _least_squares_above(matrix, stress, cuts)
    raise MaterialError(
        f"No stable constants were found within {_MAX_CUTS} rounds for strains up to {reach:.3g}; try a smaller "
        "stable_to or two terms."
    )


def _least_squares_above(matrix, target, normals) -> np.ndarray:
    """Least squares with ``normals @ x >= 0``, as a dual non-negative problem (Lawson & Hanson, ch. 23)."""
    q, r = np.linalg.qr(matrix)
    centre = q.T @ target
    reduced = np.linalg.solve(r.T, normals.T).T  # normals R^-1
    weights, _ = nnls(reduced.T, -centre)  # nearest point of a cone, by its polar
    return np.linalg.solve(r, centre + reduced.T @ weights)
