"""Forms of the energy of an incompressible rubber that can be fitted, and their stress in the usual tests.

In tension, planar tension and equibiaxial tension with the stretch l the thinnest direction is free, and the nominal
stress of each pulled direction is P = (dW/d(ln l1) - dW/d(ln l3))/l with l3 = l^-1/2, l^-1 and l^-2. With
W = sum C_ij (I1 - 3)^i (I2 - 3)^j that is linear in the C_ij; with Ogden's W = sum mu_p/alpha_p (l1^alpha_p +
l2^alpha_p + l3^alpha_p - 3) it is linear in the mu_p, not in the alpha_p (Treloar 1975, The physics of rubber
elasticity; Yeoh 1993, Rubber Chem. Technol. 66, 754; Ogden 1972, Proc. R. Soc. A 326, 565). The softening rubber (see
`softening`) is linear in mu_inf, mu_0, c and c_3, not in x_0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dbvfiv.materials.checks import MaterialError
from dbvfiv.materials.hill import hill_moduli, invariants, knee_slopes, moduli_of, ogden_moduli
from dbvfiv.materials.softening import LEAST_SHARE

#: Logarithm of l3 over that of the stretch, with the sign turned.
THINNING = {"uniaxial": 0.5, "planar": 1.0, "biaxial": 2.0}
MODES = tuple(THINNING)


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
