"""Constants of rubbers from tests in tension, planar and equibiaxial tension, one or several of them.

The residual has several minima (Ogden, Saccomandi & Sgura 2004, Comput. Mech. 34, 484), so the search starts from the
best of many sets of exponents; without an active constraint its answer is improved over all unknowns at once.

In tension, planar tension and equibiaxial tension with the stretch l the thinnest direction is free, and the nominal
stress of each pulled direction is P = (dW/d(ln l1) - dW/d(ln l3))/l with l3 = l^-1/2, l^-1 and l^-2. With
W = sum C_ij (I1 - 3)^i (I2 - 3)^j that is linear in the C_ij; with Ogden's W = sum mu_p/alpha_p (l1^alpha_p +
l2^alpha_p + l3^alpha_p - 3) it is linear in the mu_p, not in the alpha_p (Treloar 1975, The physics of rubber
elasticity; Yeoh 1993, Rubber Chem. Technol. 66, 754; Ogden 1972, Proc. R. Soc. A 326, 565). The softening rubber (see
`softening`) is linear in mu_inf, mu_0, c and c_3, not in x_0.

The nominal stress is linear in the constants of neo-Hookean, Mooney-Rivlin and Yeoh forms, so the fit is a linear
least-squares problem; Ogden's exponents are searched for about it (see `search`), and x_0 of the softening rubber,
whose other constants are kept at least 0, which makes it stable in every state. One kind of test alone tells
constants apart badly: over a small range of strains in tension the columns of C10 and C01 are nearly parallel, and the
fit returns large constants of opposite sign that describe the test well and other states of strain badly. The
condition number says how far this goes; the "stable" constraint keeps the constants usable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np
from scipy.optimize import least_squares, minimize_scalar

from dbvfiv.materials.hill import hill_moduli, invariants, knee_slopes, least_modulus, moduli_of, ogden_moduli
from dbvfiv.materials.law import Law, MaterialError
from dbvfiv.materials.least_squares import LEAST_MARGIN, nonnegative, stable_constants, states_within
from dbvfiv.materials.mooney_rivlin import MooneyRivlin
from dbvfiv.materials.ogden import Ogden
from dbvfiv.materials.rubber_tests import TensionTest
from dbvfiv.materials.softening import LEAST_SHARE, SofteningRubber
from dbvfiv.materials.stability import StableRange, stable_range_of
from dbvfiv.materials.yeoh import Yeoh

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


#: Logarithm of l3 over that of the stretch, with the sign turned.
THINNING = {"uniaxial": 0.5, "planar": 1.0, "biaxial": 2.0}


@dataclass(frozen=True)
class Form:
    """One form of the energy.

    Attributes
    ----------
    name : str
        "neo-hookean", "softening", "mooney-rivlin", "yeoh" or "ogden".
    terms : int
    powers : tuple of (int, int)
        Powers of I1 - 3 and I2 - 3 of each constant; empty where W is not linear in all constants.
    """

    name: str
    terms: int
    powers: tuple[tuple[int, int], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the constants that W is linear in, as the case file writes them."""
        if self.softens:
            return "mu_inf", "mu_0", "c", "c_3"
        if not self.powers:
            return tuple(f"mu{p + 1}" for p in range(self.terms))
        return tuple(f"c{i}{j}" for i, j in self.powers)

    @property
    def exponent_names(self) -> tuple[str, ...]:
        """Names of the constants that W is not linear in: Ogden's exponents, x_0 of the softening rubber."""
        if self.softens:
            return ("x_0",)
        return () if self.powers else tuple(f"alpha{p + 1}" for p in range(self.terms))

    @property
    def softens(self) -> bool:
        """True for the form of the softening rubber, whose constants make it stable in every state."""
        return self.name == "softening"

    @property
    def mixing(self) -> np.ndarray:
        """Constants (terms, terms) per unit of each unknown of a fit; unknowns at least 0 keep the softening rubber
        stable.
        """
        mixing = np.eye(self.terms)
        if self.softens:
            mixing[0, 1] = LEAST_SHARE
        return mixing

    @property
    def title(self) -> str:
        """Title of the form for tables and figures."""
        return self.name if len(TERMS[self.name]) == 1 else f"{self.name} {self.terms}"

    def columns(self, mode: str, strain, exponents=()) -> np.ndarray:
        """Nominal stress per unit of each constant, (n, terms), at engineering strains (n,)."""
        if self.softens:
            return softening_columns(mode, strain, exponents[0])
        return invariant_columns(mode, strain, self.powers) if self.powers else ogden_columns(mode, strain, exponents)

    def slopes(self, mode: str, strain, exponents, constants) -> np.ndarray:
        """Derivatives of the nominal stress by the exponents, (n, len(exponents)), at constants (terms,)."""
        if self.softens:
            return softening_slopes(mode, strain, exponents[0]) * constants[1]
        return ogden_slopes(mode, strain, exponents) * constants

    def moduli(self, log_stretches, exponents=()) -> np.ndarray:
        """Hill moduli per unit of each constant, (..., terms, 5, 5)."""
        if self.softens:
            knee = moduli_of(log_stretches, knee_slopes(invariants(log_stretches)[0], exponents[0]))
            linear, square, cube = np.moveaxis(hill_moduli(log_stretches, ((1, 0), (2, 0), (3, 0))), -3, 0)
            return np.stack([0.5 * linear, knee, 0.25 * square, cube / 6.0], axis=-3)
        return hill_moduli(log_stretches, self.powers) if self.powers else ogden_moduli(log_stretches, exponents)


_POWERS = {
    "neo-hookean": ((1, 0),),
    "softening": (),
    "mooney-rivlin": ((1, 0), (0, 1), (1, 1)),
    "yeoh": ((1, 0), (2, 0), (3, 0)),
    "ogden": (),
}
#: Numbers of terms of each form, the usual one first.
TERMS = {"neo-hookean": (1,), "softening": (4,), "mooney-rivlin": (2, 3), "yeoh": (3, 2), "ogden": (2, 1, 3)}


def form_of(name: str, terms: int | None = None) -> Form:
    """A form by its name; with the usual number of terms if none is given.

    Raises
    ------
    MaterialError
        For a form or a number of terms that there is not.
    """
    if name not in TERMS:
        raise MaterialError(f"The law to be fitted must be one of {', '.join(TERMS)}, but {name!r} was given.")
    if terms is None:
        terms = TERMS[name][0]
    if isinstance(terms, bool) or terms not in TERMS[name]:
        possible = " or ".join(str(t) for t in sorted(TERMS[name]))
        title = "-".join(word.capitalize() for word in name.split("-"))
        raise MaterialError(f"A {title} fit has {possible} terms, but {terms!r} was given.")
    return Form(name, terms, _POWERS[name][:terms])


def all_forms() -> tuple[Form, ...]:
    """Every form with every number of terms that is worth comparing."""
    several = (("mooney-rivlin", 2), ("mooney-rivlin", 3), ("yeoh", 3), ("ogden", 2), ("ogden", 3))
    return tuple(form_of(*pair) for pair in (("neo-hookean", 1), ("softening", 4), *several))


def _invariants_of(mode: str, strain) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Nominal stress per unit of dW/dI1 and of dW/dI2, I1 - 3 and I2 - 3, each (n,).

    Written in the strain s = l - 1, so that small strains lose no digits.
    """
    s = np.asarray(strain, dtype=float)
    l = 1.0 + s
    if mode == "uniaxial":
        first = 2.0 * s * (l**2 + l + 1.0) / l**2
        second = first / l
        i1, i2 = s**2 * (l + 2.0) / l, s**2 * (2.0 * l + 1.0) / l**2
    elif mode == "planar":
        first = second = 2.0 * s * (l + 1.0) * (l**2 + 1.0) / l**3
        i1 = i2 = (s * (l + 1.0) / l) ** 2
    else:
        first = 2.0 * s * (l + 1.0) * (l**4 + l**2 + 1.0) / l**5
        second = first * l**2
        square = (s * (l + 1.0)) ** 2
        i1, i2 = square * (2.0 * l**2 + 1.0) / l**4, square * (l**2 + 2.0) / l**2
    return first, second, i1, i2


def first_invariant(mode: str, strain) -> np.ndarray:
    """I1 - 3 of a kind of test at engineering strains (n,)."""
    return _invariants_of(mode, strain)[2]


def softening_columns(mode: str, strain, knee: float) -> np.ndarray:
    """Nominal stress per unit of mu_inf, mu_0, c and c_3, (n, 4), at x_0."""
    first, _, i1, _ = _invariants_of(mode, strain)
    return 0.5 * first[:, None] * np.stack([np.ones_like(i1), 1.0 / np.sqrt(1.0 + i1 / knee), i1, i1**2], axis=-1)


def softening_slopes(mode: str, strain, knee: float) -> np.ndarray:
    """Derivative of the second of `softening_columns` by x_0, (n, 1)."""
    first, _, i1, _ = _invariants_of(mode, strain)
    return (0.25 * first * i1 / knee**2 * (1.0 + i1 / knee) ** -1.5)[:, None]


def invariant_columns(mode: str, strain, powers) -> np.ndarray:
    """Nominal stress per unit of each C_ij, dimensionless, (n, len(powers))."""
    first, second, i1, i2 = _invariants_of(mode, strain)
    columns = []
    for i, j in powers:
        column = np.zeros_like(first)
        if i:
            column = column + i * i1 ** (i - 1) * i2**j * first
        if j:
            column = column + j * i1**i * i2 ** (j - 1) * second
        columns.append(column)
    return np.stack(columns, axis=-1)


def ogden_columns(mode: str, strain, exponents) -> np.ndarray:
    """Nominal stress per unit of each mu_p, (l^alpha - l3^alpha)/l, dimensionless, (n, len(exponents))."""
    log, k = np.log1p(np.asarray(strain, dtype=float))[..., None], THINNING[mode]
    alpha = np.asarray(exponents, dtype=float)
    return 2.0 * np.exp((0.5 * alpha * (1.0 - k) - 1.0) * log) * np.sinh(0.5 * alpha * (1.0 + k) * log)


def ogden_slopes(mode: str, strain, exponents) -> np.ndarray:
    """Derivatives of `ogden_columns` by their exponents, (n, len(exponents))."""
    log, k = np.log1p(np.asarray(strain, dtype=float))[..., None], THINNING[mode]
    alpha = np.asarray(exponents, dtype=float)
    return log * (np.exp((alpha - 1.0) * log) + k * np.exp((-k * alpha - 1.0) * log))


def equivalent_strain(mode: str, strain) -> np.ndarray:
    """Logarithmic strain of the tension that is as far from rest, sqrt(2/3) |ln U|."""
    k = THINNING[mode]
    across = k - 1.0  # of ln l2 over ln l, the sum being zero
    return np.sqrt(2.0 / 3.0 * (1.0 + k**2 + across**2)) * np.abs(np.log1p(np.asarray(strain, dtype=float)))


CONSTRAINTS = ("none", "non-negative", "stable")
ERRORS = ("absolute", "relative")
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
            If the constants give no positive shear modulus.
        """
        if self.form.name == "ogden":
            return Ogden(tuple(self.constants.tolist()), tuple(self.exponents.tolist()), density)
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
        See `form_of`.
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
        exponents, active = search(problem)
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
