"""Forms of the energy of an incompressible rubber that can be fitted, and their stress in the usual tests.

In tension, planar tension and equibiaxial tension with the stretch l the thinnest direction is free, and the nominal
stress of each pulled direction is P = (dW/d(ln l1) - dW/d(ln l3))/l with l3 = l^-1/2, l^-1 and l^-2. With
W = sum C_ij (I1 - 3)^i (I2 - 3)^j that is linear in the C_ij; with Ogden's W = sum mu_p/alpha_p (l1^alpha_p +
l2^alpha_p + l3^alpha_p - 3) it is linear in the mu_p, not in the alpha_p (Treloar 1975, The physics of rubber
elasticity; Yeoh 1993, Rubber Chem. Technol. 66, 754; Ogden 1972, Proc. R. Soc. A 326, 565).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dbvfiv.materials.checks import MaterialError
from dbvfiv.materials.hill import hill_moduli, ogden_moduli

#: Logarithm of l3 over that of the stretch, with the sign turned.
THINNING = {"uniaxial": 0.5, "planar": 1.0, "biaxial": 2.0}
MODES = tuple(THINNING)


@dataclass(frozen=True)
class Form:
    """One form of the energy.

    Attributes
    ----------
    name : str
        "neo-hookean", "mooney-rivlin", "yeoh" or "ogden".
    terms : int
    powers : tuple of (int, int)
        Powers of I1 - 3 and I2 - 3 of each constant; empty for Ogden's.
    """

    name: str
    terms: int
    powers: tuple[tuple[int, int], ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Of the constants that W is linear in, as the case file writes them."""
        if not self.powers:
            return tuple(f"mu{p + 1}" for p in range(self.terms))
        return tuple(f"c{i}{j}" for i, j in self.powers)

    @property
    def title(self) -> str:
        """As it stands in tables and figures."""
        return self.name if self.name == "neo-hookean" else f"{self.name} {self.terms}"

    def columns(self, mode: str, strain, exponents=()) -> np.ndarray:
        """Nominal stress per unit of each constant, (n, terms), at engineering strains (n,)."""
        return (
            ogden_columns(mode, strain, exponents) if not self.powers else invariant_columns(mode, strain, self.powers)
        )

    def moduli(self, log_stretches, exponents=()) -> np.ndarray:
        """Hill moduli per unit of each constant, (..., terms, 5, 5)."""
        if not self.powers:
            return ogden_moduli(log_stretches, exponents)
        return hill_moduli(log_stretches, self.powers)


_POWERS = {
    "neo-hookean": ((1, 0),),
    "mooney-rivlin": ((1, 0), (0, 1), (1, 1)),
    "yeoh": ((1, 0), (2, 0), (3, 0)),
    "ogden": (),
}
#: Numbers of terms of each form, the usual one first.
TERMS = {"neo-hookean": (1,), "mooney-rivlin": (2, 3), "yeoh": (3, 2), "ogden": (2, 1, 3)}


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
    chosen = (("neo-hookean", 1), ("mooney-rivlin", 2), ("mooney-rivlin", 3), ("yeoh", 3), ("ogden", 2), ("ogden", 3))
    return tuple(form_of(*pair) for pair in chosen)


def invariant_columns(mode: str, strain, powers) -> np.ndarray:
    """Nominal stress per unit of each C_ij, dimensionless, (n, len(powers)).

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
    columns = []
    for i, j in powers:
        column = np.zeros_like(l)
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
