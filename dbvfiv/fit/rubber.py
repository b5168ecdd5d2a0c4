"""Constants of rubbers from tests in tension, planar and equibiaxial tension, one or several of them.

In each test with the stretch l the thinnest direction is free, and the nominal stress of a pulled direction is
P = (tau_1 - tau_3)/l with the principal Kirchhoff stresses tau_i = dW/d(ln l_i) (Treloar 1975, The physics of rubber
elasticity). W, and with it P, is linear in the C_ij of polynomials in both invariants (Yeoh 1993, Rubber Chem. Technol.
66, 754), in Ogden's mu_p (1972, Proc. R. Soc. A 326, 565) and in mu_inf, mu_0, c and c_3 of the softening rubber; it is
not in Ogden's alpha_p and in x_0, here called exponents. So constants are linear least squares at given exponents, and
the exponents are searched for by the residual that is left (variable projection: Golub & Pereyra 2003, Inverse
Problems 19, R1). It has several minima (Ogden, Saccomandi & Sgura 2004, Comput. Mech. 34, 484), so the search starts
from the best of many sets of exponents.

One kind of test alone tells constants apart badly: over a small range of strains in tension the columns of C10 and C01
are nearly parallel, and the fit returns large constants of opposite sign that describe the test well and other states
of strain badly. The condition number says how far this goes; the "stable" constraint keeps the constants usable. The
constants of the softening rubber are at least 0, and mu_inf at least mu_0/200, in any case, which makes it stable in
every state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from dbvfiv.fit.curves import TensionTest, loading_tests, read_tests
from dbvfiv.materials.energy import KNEE, OGDEN_FROM, PARAMETER_COUNT
from dbvfiv.materials.laws import (
    LEAST_SHARE,
    Law,
    MaterialError,
    MooneyRivlin,
    Ogden,
    SofteningRubber,
    Yeoh,
    rubber_shear_modulus,
)
from dbvfiv.materials.prony import nonnegative
from dbvfiv.materials.stability import StableRange, principal_stress, rubber_moduli, stable_range, strain_rays

#: Principal logarithmic strains of each kind of test over that of the stretch.
RAYS = {"uniaxial": (1.0, -0.5, -0.5), "planar": (1.0, 0.0, -1.0), "biaxial": (1.0, 1.0, -2.0)}
CONSTRAINTS = ("none", "non-negative", "stable")
ERRORS = ("absolute", "relative")
LEAST_MARGIN = 0.01
#: Numbers of terms of each form, the usual one first.
TERMS = {"neo-hookean": (1,), "softening": (4,), "mooney-rivlin": (2, 3), "yeoh": (3, 2), "ogden": (2, 1, 3)}
_NAMES = {
    "neo-hookean": ("c10",),
    "softening": ("mu_inf", "mu_0", "c", "c_3"),
    "mooney-rivlin": ("c10", "c01", "c11"),
    "yeoh": ("c10", "c20", "c30"),
}
#: Place of each constant among the parameters of a rubber, and its factor there.
_PLACES = {
    **{name: (place, 1.0) for place, name in enumerate(("c10", "c01", "c11", "c20", "c30", "mu_0"))},
    "mu_inf": (0, 0.5),
    "c": (3, 0.25),
    "c_3": (4, 1.0 / 6.0),
}
#: Exponents that searches start from, the largest, and the numbers of searches.
_STARTS, _LARGEST = (-8.0, -4.0, -2.0, -1.0, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0), 30.0
_TRIED = {"none": 8, "non-negative": 8, "stable": 2}
#: x_0 that are tried before the best is refined.
_KNEES = 80
#: Of the matrix of a fit: what is smaller is noise of its arithmetic.
_DIGITS = 1e-13
#: Rounds of cutting planes, and distance of the states looked at, in equivalent strain.
_MAX_CUTS, _SPACING = 200, 0.05


@dataclass(frozen=True)
class Form:
    """One form of the energy: "neo-hookean", "softening", "mooney-rivlin", "yeoh" or "ogden", with some terms."""

    name: str
    terms: int

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the constants that W is linear in, as the case file writes them."""
        return _NAMES.get(self.name, tuple(f"mu{p + 1}" for p in range(self.terms)))[: self.terms]

    @property
    def exponent_names(self) -> tuple[str, ...]:
        """Names of the constants that W is not linear in: Ogden's exponents, x_0 of the softening rubber."""
        if self.softens:
            return ("x_0",)
        return tuple(f"alpha{p + 1}" for p in range(self.terms)) if self.name == "ogden" else ()

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

    def units(self, exponents=()) -> np.ndarray:
        """Parameters (terms, 8), or (terms, 8 + 2 terms) of Ogden's, of a rubber per unit of each constant."""
        exponents = np.asarray(exponents)
        more = 2 * self.terms if self.name == "ogden" else 0
        units = np.zeros((self.terms, PARAMETER_COUNT + more), np.result_type(exponents, float))
        if more:
            units[:, OGDEN_FROM::2], units[:, OGDEN_FROM + 1 :: 2] = np.eye(self.terms), exponents
        for unit, name in zip(units, () if more else self.names):
            place, unit[place] = _PLACES[name]
        if self.softens:
            units[:, KNEE] = exponents
        return units

    def columns(self, mode: str, strain, exponents=()) -> np.ndarray:
        """Nominal stress per unit of each constant, (n, terms), at engineering strains (n,)."""
        strain = np.asarray(strain, float)
        ln = np.log1p(strain)[:, None] * RAYS[mode]
        stress = np.stack([principal_stress(unit, ln) for unit in self.units(exponents)], axis=-1)
        return (stress[:, 0] - stress[:, 2]) / (1.0 + strain[:, None])

    def slopes(self, mode: str, strain, exponents, constants) -> np.ndarray:
        """Derivatives of the nominal stress by the exponents, (n, len(exponents)), at constants (terms,)."""
        steps = np.asarray(exponents) + 1e-30j * np.eye(len(exponents))
        return np.stack([(self.columns(mode, strain, step) @ constants).imag / 1e-30 for step in steps], axis=-1)

    def moduli(self, log_stretches, exponents=()) -> np.ndarray:
        """Hill moduli per unit of each constant, (..., terms, 5, 5)."""
        return np.stack([rubber_moduli(unit, log_stretches) for unit in self.units(exponents)], axis=-3)


def form_of(name: str, terms: int | None = None) -> Form:
    """A form by its name; with the usual number of terms if none is given. Raises MaterialError for a form or a number
    of terms that there is not.
    """
    if name not in TERMS:
        raise MaterialError(f"The law to be fitted must be one of {', '.join(TERMS)}, but {name!r} was given.")
    if terms is None:
        terms = TERMS[name][0]
    if isinstance(terms, bool) or terms not in TERMS[name]:
        possible = " or ".join(str(t) for t in sorted(TERMS[name]))
        title = "-".join(word.capitalize() for word in name.split("-"))
        raise MaterialError(f"A {title} fit has {possible} terms, but {terms!r} was given.")
    return Form(name, terms)


def all_forms() -> tuple[Form, ...]:
    """Every form with every number of terms that is worth comparing."""
    several = (("mooney-rivlin", 2), ("mooney-rivlin", 3), ("yeoh", 3), ("ogden", 2), ("ogden", 3))
    return tuple(form_of(*pair) for pair in (("neo-hookean", 1), ("softening", 4), *several))


def equivalent_strain(mode: str, strain) -> np.ndarray:
    """Logarithmic strain of the tension that is as far from rest, sqrt(2/3) |ln U|."""
    return np.sqrt(2.0 / 3.0) * np.linalg.norm(RAYS[mode]) * np.abs(np.log1p(np.asarray(strain, dtype=float)))


def uniaxial_stress(law: Law, stretch) -> np.ndarray:
    """Nominal stress of a rubber bar in tension or compression, Pa, at the given stretches."""
    ln = np.log(np.asarray(stretch, float))[..., None] * RAYS["uniaxial"]
    stress = principal_stress(law.parameters, ln)
    return (stress[..., 0] - stress[..., 2]) / stretch


@dataclass(frozen=True)
class RubberFit:
    """Constants fitted to tests, and how far to trust them."""

    form: Form
    tests: tuple[TensionTest, ...]
    #: (terms,); those that W is linear in, Pa: mu_inf, mu_0, c and c_3 of the softening rubber, the C_ij, or Ogden's
    #: mu_p.
    constants: np.ndarray
    #: (terms,), (1,) or (0,); those that it is not linear in: Ogden's alpha_p, x_0 of the softening rubber.
    exponents: np.ndarray
    residuals: np.ndarray  #: (n,); measured minus fitted nominal stress, Pa, test after test.
    r_squared: float  #: 1 - |residuals|^2/|stress - mean|^2 over all tests; NaN if all stresses are equal.
    condition_number: float  #: Of the Jacobian by constants and exponents, with columns scaled to unit length.
    #: (m, m); of constants and exponents, from the residual variance; that of the unconstrained problem even if a
    #: constraint is active, in which case it overstates the scatter.
    covariance: np.ndarray
    constraint: str  #: "none", "non-negative" or "stable".
    active: bool  #: Whether the constraint changed the answer.

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
        return float(sum(c * rubber_shear_modulus(unit) for c, unit in zip(self.constants, self._units)))

    @property
    def _units(self) -> np.ndarray:
        return self.form.units(self.exponents)

    @property
    def reach(self) -> float:
        """Largest equivalent logarithmic strain of the tests."""
        return max(float(equivalent_strain(test.mode, test.strain).max()) for test in self.tests)

    @cached_property
    def stable_range(self) -> StableRange:
        """Within which stretches the constants describe a stable rubber; nowhere if they do not at rest."""
        if self.shear_modulus <= 0.0:
            return StableRange((1.0, 1.0), (1.0, 1.0), (1.0, 1.0), 0.0)
        return stable_range(self.law(1.0))

    def stress(self, mode: str, strain) -> np.ndarray:
        """Nominal stress, Pa, at engineering strains of a kind of test."""
        return self.form.columns(mode, strain, self.exponents) @ self.constants

    def law(self, density: float) -> Law:
        """The fitted rubber, for a wall. Raises MaterialError if the constants give no positive shear modulus."""
        constants, exponents = self.constants.tolist(), self.exponents.tolist()
        if self.form.name == "ogden":
            return Ogden(tuple(constants), tuple(exponents), density)
        if self.form.softens:
            mu_inf, mu_0, c, c_3 = constants
            return SofteningRubber(mu_inf, mu_0, *exponents, c, density, c_3)
        three = (*constants, 0.0, 0.0)[:3]
        return (Yeoh if self.form.name == "yeoh" else MooneyRivlin)(*three, density)


def fit_rubber(
    tests: Sequence[TensionTest],
    form: Form,
    constraint: str = "none",
    stable_to: float | None = None,
    error: str = "absolute",
) -> RubberFit:
    """Fit a form of the energy to one or several tests at once by least squares. Raises MaterialError for fewer
    different strains than unknowns plus one, or an unknown option.

    Parameters
    ----------
    tests : sequence of TensionTest
    form : Form
        See `form_of`.
    constraint : {"none", "non-negative", "stable"}
        "non-negative": every constant at least 0 (Ogden: every mu_p alpha_p). For neo-Hookean, two-constant
        Mooney-Rivlin, Yeoh and Ogden that suffices for stability at all strains.
        "stable": a Hill margin (see `stability`) of at least 0.01 in every state of equivalent logarithmic strain
        up to `stable_to`, not only in those tested. The softening rubber takes none of them.
    stable_to : float, optional
        Engineering strain of the tension that has this equivalent strain; the largest
        of the tests if not given. Only for "stable".
    error : {"absolute", "relative"}
        What is squared and summed: stress, or stress over the measured one (points without stress do not count).
    """
    tests = tuple(tests)
    for what, given, known in (("constraint", constraint, CONSTRAINTS), ("error", error, ERRORS)):
        if given not in known:
            raise MaterialError(f"The {what} must be one of {', '.join(known)}, but {given!r} was given.")
    unknowns = len(form.names) + len(form.exponent_names)
    counted = [(test.mode, float(s), p) for test in tests for s, p in zip(test.strain, test.stress) if s != 0.0]
    different = len({(mode, s) for mode, s, p in counted if error == "absolute" or p != 0.0})
    if different < unknowns + 1:
        which = "tension test has" if len(tests) == 1 and tests[0].mode == "uniaxial" else "tests have"
        raise MaterialError(
            f"A fit of {unknowns} constants needs at least {unknowns + 1} different strains other than zero"
            f"{', with stress' if error == 'relative' else ''}, but the {which} {different}."
        )
    problem = _Problem(tests, form, constraint, stable_to, error)
    return problem.describe(*problem.search())


class _Problem:
    """Least squares for the constants at given exponents, under a constraint, and the search for exponents."""

    def __init__(self, tests, form: Form, constraint: str, stable_to: float | None, error: str):
        self.tests, self.form, self.constraint = tests, form, constraint
        self.stress = np.concatenate([test.stress for test in tests])
        size = np.abs(self.stress)
        relative = np.divide(1.0, size, out=np.zeros_like(size), where=size > 0.0)
        self.weight = relative if error == "relative" else np.ones_like(size)
        self.target = self.weight * self.stress
        if constraint == "stable":
            far = max(float(equivalent_strain(test.mode, test.strain).max()) for test in tests)
            self.reach = far if stable_to is None else float(np.log1p(stable_to)) if stable_to > -1.0 else float("nan")
            self.states = states_within(self.reach)

    def matrix(self, exponents) -> np.ndarray:
        """Weighted stress per unit of each constant (n, terms)."""
        rows = [self.form.columns(test.mode, test.strain, exponents) for test in self.tests]
        return self.weight[:, None] * np.concatenate(rows)

    def slopes(self, exponents, constants) -> np.ndarray:
        """Weighted derivatives of the stress by the exponents (n, len(exponents)) at constants (terms,)."""
        rows = [self.form.slopes(test.mode, test.strain, exponents, constants) for test in self.tests]
        return self.weight[:, None] * np.concatenate(rows)

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

    def search(self) -> tuple[np.ndarray, bool]:
        """Exponents of least residual, and whether the constraint changed the answer."""
        if self.form.softens:  # from I1 - 3 of the least strain other than zero to ten times the largest
            seen = np.concatenate([_first_invariant(test) for test in self.tests])
            ends = seen[seen > 0.0].min(), 10.0 * seen.max()
            knees = np.geomspace(*ends, _KNEES)[:, None]
            exponents = self._best(knees, 1, True, lambda start: ends)
        elif self.form.name == "ogden":

            def bounds(start):  # an exponent of zero is no term: each keeps its sign
                return np.where(start > 0, 0.05, -_LARGEST), np.where(start > 0, _LARGEST, -0.05)

            starts = np.array(list(combinations(_STARTS, self.form.terms)))
            exponents = self._best(starts, _TRIED["none"], False, bounds)
            if not np.array_equal(*self.solve(exponents)):
                return np.sort(self._best(starts, _TRIED[self.constraint], True, bounds))[::-1], True
            exponents = np.sort(exponents)[::-1]
        else:
            self._require_independent()
            exponents = np.zeros(0)
        return exponents, not np.array_equal(*self.solve(exponents))

    def _best(self, starts: np.ndarray, tried: int, constrained: bool, bounds) -> np.ndarray:
        """Best of the searches from some of the starting points (k, number of exponents)."""
        size = np.linalg.norm(self.target)

        def residual(exponents):
            return (self.matrix(exponents) @ self.solve(exponents, constrained)[0] - self.target) / size

        def derivative(exponents):  # by Kaufman: what constants that are free to move make up for is taken off
            matrix, constants = self.matrix(exponents), self.solve(exponents, constrained)[0]
            unknowns = np.linalg.solve(self.form.mixing, constants)
            free = (matrix @ self.form.mixing)[:, np.abs(unknowns) > _DIGITS * np.abs(unknowns).max()]
            slopes = self.slopes(exponents, constants)
            return (slopes - free @ np.linalg.lstsq(free, slopes, rcond=None)[0]) / size

        by_hand = constrained and self.constraint == "stable" and not self.form.softens  # the constraint moves too
        options = {"max_nfev": 40} if by_hand else {"jac": derivative, "max_nfev": 400}
        options |= {"xtol": 1e-14, "ftol": 1e-15, "gtol": 1e-15} if not by_hand else {}
        first = constrained and self.form.softens
        costs = [float(np.sum((self.matrix(s) @ self.solve(s, first)[0] - self.target) ** 2)) for s in starts]
        found = [
            least_squares(residual, start, bounds=bounds(start), x_scale=np.abs(start), **options)
            for start in starts[np.argsort(costs, kind="stable")[:tried]]
        ]
        return min(found, key=lambda answer: answer.cost).x

    def _require_independent(self) -> None:
        """Refuse tests that leave a combination of the constants open."""
        raw = self.matrix(())
        singular = np.linalg.svd(raw / np.linalg.norm(raw, axis=0), compute_uv=False)
        if singular[-1] <= _DIGITS * singular[0]:
            kinds = " and ".join(dict.fromkeys(test.mode for test in self.tests))
            raise MaterialError(
                f"The constants {', '.join(self.form.names)} cannot be told apart by {kinds} tests alone; add another "
                "kind of test, or fit fewer terms."
            )

    def describe(self, exponents: np.ndarray, active: bool) -> RubberFit:
        """The answer at some exponents with its statistics."""
        stress, (constants, free) = self.stress, self.solve(exponents)
        model = [self.form.columns(t.mode, t.strain, exponents) @ constants for t in self.tests]
        residuals = stress - np.concatenate(model)
        jacobian = self.matrix(exponents)
        left = self.target - jacobian @ free
        if exponents.size:
            jacobian = np.hstack([jacobian, self.slopes(exponents, constants)])
        size = np.linalg.norm(jacobian, axis=0)
        size[size == 0.0] = 1.0  # the exponent of a term that is not there
        _, singular, vt = np.linalg.svd(jacobian / size, full_matrices=False)
        variance = np.sum(left**2) / (np.count_nonzero(self.weight) - len(size))
        known = singular > _DIGITS * singular[0]
        inverse = (vt.T / singular**2) @ vt if known.all() else np.full((len(size),) * 2, np.nan)
        spread = np.sum((stress - stress.mean()) ** 2)
        return RubberFit(
            form=self.form,
            tests=self.tests,
            constants=constants,
            exponents=exponents,
            residuals=residuals,
            r_squared=float(1.0 - np.sum(residuals**2) / spread) if spread > 0.0 else float("nan"),
            condition_number=float(singular[0] / singular[-1]) if known.all() else float("inf"),
            covariance=variance * inverse / np.outer(size, size),
            constraint=self.constraint,
            active=active,
        )


def _first_invariant(test: TensionTest) -> np.ndarray:
    """I1 - 3 (n,) at the strains of a test."""
    return np.expm1(2.0 * np.log1p(test.strain)[:, None] * RAYS[test.mode]).sum(axis=-1)


def states_within(reach: float) -> np.ndarray:
    """Principal logarithmic strains (k, 3) that fill the ball of an equivalent strain. Raises MaterialError for a reach
    that is not positive and finite.
    """
    if not 0.0 < reach < np.inf:
        raise MaterialError(f"stable_to must be a strain greater than 0, but {np.expm1(reach):.6g} was given.")
    radius = reach * np.linspace(0.0, 1.0, max(21, int(np.ceil(reach / _SPACING)) + 1))
    return (radius[:, None, None] * strain_rays(25)).reshape(-1, 3)


def stable_constants(matrix, target, free, moduli, reach: float) -> np.ndarray:
    """Least squares under Hill's inequality with a margin, by cutting planes.

    Each Hill modulus less the margin is the least eigenvalue of a matrix that is linear in the constants, so an
    eigenvector of a negative one gives a linear inequality that the answer must fulfil.

    Parameters
    ----------
    matrix, target : numpy.ndarray, shapes (n, terms), (n,)
    free : numpy.ndarray, shape (terms,)
        The answer without the constraint.
    moduli : numpy.ndarray, shape (states, terms, 5, 5)
        Hill moduli per unit of each unknown; the first state is that at rest.
    reach : float
        Equivalent strain, for the message.
    """
    moduli = moduli - LEAST_MARGIN * moduli[0, :, :1, :1] * np.eye(5)
    answer, cuts = free, np.zeros((0, free.size))
    size = np.linalg.norm(free)
    for _ in range(_MAX_CUTS):
        values, vectors = np.linalg.eigh(np.tensordot(moduli, answer, axes=([1], [0])))
        worst = np.argsort(values[:, 0])[:3]
        normals = np.einsum("sa,skab,sb->sk", vectors[worst, :, 0], moduli[worst], vectors[worst, :, 0])
        violated = values[worst, 0] < -1e-9 * size * np.linalg.norm(normals, axis=1)
        if not violated.any():
            return answer
        cuts = np.vstack([cuts, normals[violated] / np.linalg.norm(normals[violated], axis=1)[:, None]])
        answer = _least_squares_above(matrix, target, cuts)
    raise MaterialError(
        f"No stable constants were found within {_MAX_CUTS} rounds for strains up to {np.expm1(reach):.3g}; try a "
        "smaller stable_to or fewer terms."
    )


def _least_squares_above(matrix, target, normals) -> np.ndarray:
    """Least squares with ``normals @ x >= 0``, as a dual non-negative problem (Lawson & Hanson, ch. 23)."""
    q, r = np.linalg.qr(matrix)
    centre = q.T @ target
    reduced = np.linalg.solve(r.T, normals.T).T  # normals R^-1
    weights = nonnegative(reduced.T, -centre)  # nearest point of a cone, by its polar
    return np.linalg.solve(r, centre + reduced.T @ weights)


def law_of_tests(card: Any) -> Law:
    """Law fitted to the tests that a material card (`dbvfiv.case.Card`) names, as it says. Raises MaterialError for
    tests that cannot be used, or constants that its constraint leaves none of.
    """
    tests = loading_tests(read_tests(card.path, card.planar, card.biaxial), card.cycle)
    form = form_of(card.law, card.terms)
    return fit_rubber(tests, form, card.constraint, card.stable_to, card.error).law(card.density)
