"""Constants of rubbers from tests in tension, planar and equibiaxial tension, one or several at once.

The nominal stress is linear in the constants of neo-Hookean, Mooney-Rivlin and Yeoh forms, so the fit is a linear
least-squares problem; Ogden's exponents are searched for about it (see `ogden_fit`), and x_0 of the softening rubber,
whose other constants are kept at least 0, which makes it stable in every state. One kind of test alone tells
constants apart badly: over a small range of strains in tension the columns of C10 and C01 are nearly parallel, and the
fit returns large constants of opposite sign that describe the test well and other states of strain badly. The
condition number says how far this goes; the "stable" constraint keeps the constants usable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import minimize_scalar

from dbvfiv.materials import ogden_fit
from dbvfiv.materials.checks import MaterialError
from dbvfiv.materials.constrained import LEAST_MARGIN, stable_constants, states_within
from dbvfiv.materials.hill import least_modulus
from dbvfiv.materials.law import Law
from dbvfiv.materials.mooney_rivlin import MooneyRivlin
from dbvfiv.materials.nonnegative import nonnegative
from dbvfiv.materials.rubber_forms import Form, equivalent_strain, first_invariant, form_of, invariant_columns
from dbvfiv.materials.softening import SofteningRubber
from dbvfiv.materials.stability import StableRange, stable_range_of
from dbvfiv.materials.tension_test import TensionTest
from dbvfiv.materials.yeoh import Yeoh

CONSTRAINTS = ("none", "non-negative", "stable")
ERRORS = ("absolute", "relative")
#: Forms that the wall takes.
TAKEN = ("softening", "neo-hookean", "mooney-rivlin", "yeoh")
#: x_0 that are tried before the best is refined.
_KNEES = 80
#: Of the matrix of a fit: what is smaller is noise of its arithmetic.
_DIGITS = 1e-13
__all__ = ["CONSTRAINTS", "ERRORS", "LEAST_MARGIN", "RubberFit", "fit_mooney_rivlin", "fit_rubber", "uniaxial_stress"]


def uniaxial_stress(law: MooneyRivlin, stretch) -> np.ndarray:
    """Nominal stress of a rubber bar in tension or compression, Pa, at the given stretches."""
    powers = form_of("mooney-rivlin", 3).powers
    return invariant_columns("uniaxial", np.asarray(stretch, float) - 1.0, powers) @ law.parameters[:3]


@dataclass(frozen=True)
class RubberFit:
    """Constants fitted to tests, and how far to trust them.

    Attributes
    ----------
    form : Form
    tests : tuple of TensionTest
    constants : numpy.ndarray, shape (terms,)
        Those that W is linear in, Pa: mu_inf, mu_0, c and c_3 of the softening rubber, the C_ij, or Ogden's mu_p.
    exponents : numpy.ndarray, shape (terms,), (1,) or (0,)
        Those that it is not linear in: Ogden's alpha_p, x_0 of the softening rubber.
    residuals : numpy.ndarray, shape (n,)
        Measured minus fitted nominal stress, Pa, test after test.
    r_squared : float
        1 - |residuals|^2/|stress - mean|^2 over all tests; NaN if all stresses are equal.
    condition_number : float
        Of the least-squares matrix (of the Jacobian, for Ogden) with columns scaled to unit length.
    covariance : numpy.ndarray, shape (m, m)
        Of constants and exponents, from the residual variance; that of the unconstrained problem even if a
        constraint is active, in which case it overstates the scatter.
    constraint : str
        "none", "non-negative" or "stable".
    active : bool
        Whether the constraint changed the answer.
    """

    form: Form
    tests: tuple[TensionTest, ...]
    constants: np.ndarray
    exponents: np.ndarray
    residuals: np.ndarray
    r_squared: float
    condition_number: float
    covariance: np.ndarray
    constraint: str
    active: bool

    @property
    def standard_errors(self) -> np.ndarray:
        """Standard error of each constant, Pa, and then of each exponent."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def rms(self) -> float:
        """Root mean square of the residuals, Pa."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def by_test(self) -> list[np.ndarray]:
        """Residuals of each test, Pa."""
        return np.split(self.residuals, np.cumsum([test.stress.size for test in self.tests])[:-1])

    @property
    def shear_modulus(self) -> float:
        """At small strain, Pa; not positive for constants that no rubber has."""
        return float(0.5 * self.form.moduli(np.zeros(3), self.exponents)[:, 0, 0] @ self.constants)

    @property
    def reach(self) -> float:
        """Largest equivalent logarithmic strain of the tests."""
        return max(float(equivalent_strain(test.mode, test.strain).max()) for test in self.tests)

    @cached_property
    def stable_range(self) -> StableRange:
        """Within which stretches the constants describe a stable rubber; nowhere if they do not at rest."""
        if self.shear_modulus <= 0.0:
            return StableRange((1.0, 1.0), (1.0, 1.0), (1.0, 1.0), 0.0, (1.0, 1.0, 1.0))
        return stable_range_of(self.margin)

    def margin(self, log_stretches) -> np.ndarray:
        """Least Hill modulus over 2 mu at principal logarithmic strains (..., 3) -> (...)."""
        moduli = self.form.moduli(log_stretches, self.exponents)
        return least_modulus(np.tensordot(moduli, self.constants, axes=([-3], [0]))) / (2.0 * self.shear_modulus)

    def stress(self, mode: str, strain) -> np.ndarray:
        """Nominal stress, Pa, at engineering strains of a kind of test."""
        return self.form.columns(mode, strain, self.exponents) @ self.constants

    def law(self, density: float) -> Law:
        """The fitted rubber, for a wall.

        Raises
        ------
        MaterialError
            If the wall has no such law, or the constants give no positive shear modulus.
        """
        if self.form.name not in TAKEN:
            raise MaterialError(
                f"The wall has no law of the form {self.form.name}; it takes {' and '.join(TAKEN)}. "
                "The fit is for comparison."
            )
        first, second, third, fourth = (*(float(c) for c in self.constants), 0.0, 0.0, 0.0)[:4]
        if self.form.softens:
            return SofteningRubber(first, second, float(self.exponents[0]), third, density, fourth)
        return (Yeoh if self.form.name == "yeoh" else MooneyRivlin)(first, second, third, density)


def fit_mooney_rivlin(
    test: TensionTest, terms: int = 3, constraint: str = "none", stable_to: float | None = None
) -> RubberFit:
    """Fit two or three constants to a tension test; see `fit_rubber`."""
    return fit_rubber([test], form_of("mooney-rivlin", terms), constraint, stable_to)


def fit_rubber(
    tests: Sequence[TensionTest],
    form: Form,
    constraint: str = "none",
    stable_to: float | None = None,
    error: str = "absolute",
) -> RubberFit:
    """Fit a form of the energy to one or several tests at once by least squares.

    Parameters
    ----------
    tests : sequence of TensionTest
    form : Form
        See `rubber_forms.form_of`.
    constraint : {"none", "non-negative", "stable"}
        "non-negative": every constant at least 0 (Ogden: every mu_p alpha_p). For neo-Hookean, two-constant
        Mooney-Rivlin, Yeoh and Ogden that suffices for stability at all strains.
        "stable": a Hill margin (see `stability`) of at least 0.01 in every state of equivalent logarithmic strain
        up to `stable_to`, not only in those tested. The softening rubber takes none of them: its constants are at
        least 0, and mu_inf at least mu_0/200, in any case, which suffices for stability at all strains.
    stable_to : float, optional
        Engineering strain of the tension that has this equivalent strain; the largest
        of the tests if not given. Only for "stable".
    error : {"absolute", "relative"}
        What is squared and summed: stress, or stress over the measured one (points without stress do not count).

    Raises
    ------
    MaterialError
        For fewer different strains than unknowns plus one, or an unknown option.
    """
    tests = tuple(tests)
    if constraint not in CONSTRAINTS:
        raise MaterialError(f"The constraint must be one of {', '.join(CONSTRAINTS)}, but {constraint!r} was given.")
    if error not in ERRORS:
        raise MaterialError(f"The error must be one of {', '.join(ERRORS)}, but {error!r} was given.")
    unknowns = len(form.names) + len(form.exponent_names)
    different = len({(test.mode, float(s)) for test in tests for s in test.strain if s != 0.0})
    if different < unknowns + 1:
        which = "tension test has" if len(tests) == 1 and tests[0].mode == "uniaxial" else "tests have"
        raise MaterialError(
            f"A fit of {unknowns} constants needs at least {unknowns + 1} different strains other than zero, but the "
            f"{which} {different}."
        )
    stress = np.concatenate([test.stress for test in tests])
    weight = _weights(stress, error)
    states, reach = np.zeros((1, 3)), 0.0
    if constraint == "stable":
        far = max(float(equivalent_strain(test.mode, test.strain).max()) for test in tests)
        reach = far if stable_to is None else float(np.log1p(stable_to)) if stable_to > -1.0 else float("nan")
        states = states_within(reach)
    problem = _Problem(tests, form, stress, weight, constraint, states, reach)
    if form.powers:
        problem.require_independent()
        exponents, active = np.zeros(0), None
    elif form.softens:
        exponents, active = _search_knee(problem), None
    else:
        exponents, active = ogden_fit.search(problem)
    constants, free = problem.solve(exponents)
    jacobian = problem.matrix(exponents)
    if not form.powers:
        jacobian = np.hstack([jacobian, problem.slopes(exponents, constants)])
    return _described(problem, exponents, constants, jacobian, active or not np.array_equal(constants, free))


def _search_knee(problem: _Problem) -> np.ndarray:
    """x_0 (1,) of least residual, between I1 - 3 of the least strain other than zero and ten times the largest."""
    seen = np.concatenate([first_invariant(test.mode, test.strain) for test in problem.tests])

    def left(log_knee: float) -> float:
        knee = np.exp([log_knee])
        return float(np.sum((problem.matrix(knee) @ problem.solve(knee)[0] - problem.target) ** 2))

    tried = np.linspace(np.log(seen[seen > 0.0].min()), np.log(10.0 * seen.max()), _KNEES)
    best = int(np.argmin([left(knee) for knee in tried]))
    between = tried[max(best - 1, 0)], tried[min(best + 1, _KNEES - 1)]
    return np.exp([minimize_scalar(left, bounds=between, method="bounded", options={"xatol": 1e-9}).x])


def _weights(stress: np.ndarray, error: str) -> np.ndarray:
    """Weights of the residuals (k,): one, or one over the measured stress, 1/Pa."""
    if error == "absolute":
        return np.ones_like(stress)
    size = np.abs(stress)
    return np.where(size > 0.0, 1.0 / np.where(size > 0.0, size, 1.0), 0.0)


@dataclass(frozen=True)
class _Problem:
    """The constants at given exponents: a linear problem with its constraint."""

    tests: tuple[TensionTest, ...]
    form: Form
    stress: np.ndarray
    weight: np.ndarray
    constraint: str
    states: np.ndarray
    reach: float

    def matrix(self, exponents) -> np.ndarray:
        """Weighted stress per unit of each constant (n, terms)."""
        rows = [self.form.columns(test.mode, test.strain, exponents) for test in self.tests]
        return self.weight[:, None] * np.concatenate(rows)

    def slopes(self, exponents, constants) -> np.ndarray:
        """Weighted derivatives of the stress by the exponents (n, len(exponents)) at constants (terms,)."""
        rows = [self.form.slopes(test.mode, test.strain, exponents, constants) for test in self.tests]
        return self.weight[:, None] * np.concatenate(rows)

    @property
    def target(self) -> np.ndarray:
        return self.weight * self.stress

    def require_independent(self) -> None:
        """Refuse tests that leave a combination of the constants open."""
        raw = self.matrix(())
        size = np.linalg.norm(raw, axis=0)
        singular = np.linalg.svd(raw / size, compute_uv=False)
        if singular[-1] <= _DIGITS * singular[0]:
            kinds = " and ".join(dict.fromkeys(test.mode for test in self.tests))
            raise MaterialError(
                f"The constants {', '.join(self.form.names)} cannot be told apart by {kinds} tests alone; add another "
                "kind of test, or fit fewer terms."
            )

    def solve(self, exponents, constrained: bool = True) -> tuple[np.ndarray, np.ndarray]:
        """Constants under the constraint and without it, each (terms,), Pa."""
        mixing = self.form.mixing
        raw = self.matrix(exponents) @ mixing
        scale = np.linalg.norm(raw, axis=0)
        matrix = raw / scale
        u, singular, vt = np.linalg.svd(matrix, full_matrices=False)
        free = vt.T @ (u.T @ self.target / singular)
        scaled = free
        constraint = "non-negative" if self.form.softens else self.constraint
        if constrained and constraint == "non-negative":
            sign = np.sign(exponents) if self.form.name == "ogden" else np.ones(len(scale))
            scaled = sign * nonnegative(matrix * sign, self.target) if np.any(sign * free < 0.0) else free
        elif constrained and constraint == "stable":
            moduli = self.form.moduli(self.states, exponents) / scale[:, None, None]
            scaled = stable_constants(matrix, self.target, free, moduli, self.reach)
        return mixing @ (scaled / scale), mixing @ (free / scale)


def _described(problem: _Problem, exponents, constants, jacobian, active: bool) -> RubberFit:
    """The answer with its statistics."""
    stress = problem.stress
    model = np.concatenate([problem.form.columns(t.mode, t.strain, exponents) for t in problem.tests]) @ constants
    residuals = stress - model
    size = np.linalg.norm(jacobian, axis=0)
    size[size == 0.0] = 1.0  # the exponent of a term that is not there
    _, singular, vt = np.linalg.svd(jacobian / size, full_matrices=False)
    free = problem.solve(exponents, constrained=False)[0]
    left = problem.target - problem.matrix(exponents) @ free
    variance = np.sum(left**2) / (np.count_nonzero(problem.weight) - len(size))
    known = singular > _DIGITS * singular[0]
    inverse = (vt[known].T / singular[known] ** 2) @ vt[known] if known.all() else np.full((len(size),) * 2, np.nan)
    spread = np.sum((stress - stress.mean()) ** 2)
    return RubberFit(
        form=problem.form,
        tests=problem.tests,
        constants=constants,
        exponents=np.asarray(exponents, float),
        residuals=residuals,
        r_squared=float(1.0 - np.sum(residuals**2) / spread) if spread > 0.0 else float("nan"),
        condition_number=float(singular[0] / singular[-1]) if known.all() else float("inf"),
        covariance=variance * inverse / np.outer(size, size),
        constraint=problem.constraint,
        active=bool(active),
    )
