"""Material laws: constants with their bounds, and the parameters of the energy (`energy`) that they stand for."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from numbers import Real
from typing import ClassVar

import numpy as np

from dbvfiv.errors import CaseError
from dbvfiv.materials.energy import ENERGIES, LINEAR_ELASTIC, MOONEY_RIVLIN, OGDEN_FROM, PARAMETER_COUNT

#: Least mu_inf over mu_0 with which a softening rubber is stable at all strains for any x_0 (0.0048 serves). Without it
#: the power law loses Hill's condition in equibiaxial tension, by 0.3 % of its stiffness at rest, where x_0 < 0.02.
LEAST_SHARE = 0.005
FIBRE_CONSTANTS = ("program", "table")


class MaterialError(CaseError):
    """A material constant, table or test file that cannot be used; the message says why."""


def require_finite(law: str, **constants: float) -> None:
    """Raise `MaterialError` unless every constant is a finite real number."""
    for name, value in constants.items():
        if isinstance(value, bool) or not isinstance(value, Real) or not math.isfinite(value):
            raise MaterialError(f"{law}: {name} must be a finite number, but {value!r} was given.")


def require_positive(law: str, **constants: float) -> None:
    """Raise `MaterialError` unless every constant is finite and greater than zero."""
    require_finite(law, **constants)
    for name, value in constants.items():
        if value <= 0.0:
            raise MaterialError(f"{law}: {name} must be greater than zero, but {value:g} was given.")


class Law:
    """A plane-stress material law."""

    #: ``LINEAR_ELASTIC`` (0) or ``MOONEY_RIVLIN`` (1, with Yeoh's terms, a knee and Ogden's terms); a class constant.
    kind: ClassVar[int]
    title: ClassVar[str]  #: What messages call it; a class constant.
    #: Names of the constants that are moduli.
    moduli: ClassVar[tuple[str, ...]]
    density: float  #: Reference density, kg/m3.
    #: (8,), or (8 + 2 n,) of a rubber with n terms of Ogden's; float64; see
    #: `dbvfiv.materials.energy.linear_elastic_energy` and `rubber_energy`.
    parameters: np.ndarray
    small_strain_shear_modulus: float  #: In-plane shear modulus (12) in the reference state, Pa.

    def energy(self, e):
        """Strain energy per reference volume, J/m3, of ``e = [E11, E22, 2 E12, 2 E13, 2 E23]``."""
        return ENERGIES[self.kind](self.parameters, e)

    def scaled(self, factor: float) -> Law:
        """The law with all moduli, and so its energy, times a factor."""
        values = {name: getattr(self, name) for name in self.moduli}
        times = {n: tuple(factor * v for v in x) if isinstance(x, tuple) else factor * x for n, x in values.items()}
        return replace(self, **times)

    def _require(self, positive: tuple[str, ...], finite: tuple[str, ...] = ()) -> None:
        require_finite(self.title, **{name: getattr(self, name) for name in finite})
        require_positive(self.title, **{name: getattr(self, name) for name in positive})


def _padded(*constants: float) -> np.ndarray:
    """Constants followed by zeros, as the float64 array of eight that every law exposes."""
    return np.pad(np.array(constants, dtype=float), (0, PARAMETER_COUNT - len(constants)))


def rubber_shear_modulus(parameters: np.ndarray) -> float:
    """mu = 2 (C10 + C01) + m0 + 1/2 sum mu_p alpha_p, Pa; Young's modulus at small strain is three times this."""
    ogden = 0.5 * np.dot(parameters[OGDEN_FROM::2], parameters[OGDEN_FROM + 1 :: 2])
    return float(2.0 * (parameters[0] + parameters[1]) + parameters[5] + ogden)


class Rubber(Law):
    """An incompressible rubber."""

    kind = MOONEY_RIVLIN

    @property
    def small_strain_shear_modulus(self) -> float:
        """See `rubber_shear_modulus`."""
        return rubber_shear_modulus(self.parameters)


@dataclass(frozen=True)
class MooneyRivlin(Rubber):
    """Mooney-Rivlin rubber: W = c10 (I1 - 3) + c01 (I2 - 3) + c11 (I1 - 3)(I2 - 3) (Th. 3.1, 3.2). Raises MaterialError
    for a constant that is not finite, a density that is not positive, or c10 + c01 <= 0.

    The third constant multiplies the product of both invariants; it is not the C20 (I1 - 3)^2 of other
    three-parameter forms. Single constants, Pa, may be negative, as in the fits of Th. Table 3-3, but the small-strain
    shear modulus 2 (c10 + c01) must be positive.
    """

    title = "Mooney-Rivlin rubber"
    moduli = ("c10", "c01", "c11")

    c10: float
    c01: float
    c11: float
    density: float

    def __post_init__(self) -> None:
        self._require(("density",), ("c10", "c01", "c11"))
        if self.c10 + self.c01 <= 0.0:
            raise MaterialError(
                "Mooney-Rivlin rubber: the small-strain shear modulus 2 (c10 + c01) must be "
                f"greater than zero, but c10 = {self.c10:g} Pa and c01 = {self.c01:g} Pa give "
                f"{2.0 * (self.c10 + self.c01):g} Pa."
            )

    @classmethod
    def neo_hookean(cls, shear_modulus: float, density: float) -> MooneyRivlin:
        """Neo-Hookean rubber W = mu/2 (I1 - 3), that is C10 = mu/2 and nothing else."""
        require_positive("Neo-Hookean rubber", shear_modulus=shear_modulus)
        return cls(c10=0.5 * shear_modulus, c01=0.0, c11=0.0, density=density)

    @property
    def parameters(self) -> np.ndarray:
        return _padded(self.c10, self.c01, self.c11)


@dataclass(frozen=True)
class Yeoh(Rubber):
    """Yeoh rubber: W = c10 x + c20 x^2 + c30 x^3, x = I1 - 3 (Yeoh 1993, Rubber Chem. Technol. 66, 754). Raises
    MaterialError for a constant that is not finite, a density or c10 that is not positive.

    Constants in Pa.
    """

    title = "Yeoh rubber"
    moduli = ("c10", "c20", "c30")

    c10: float
    c20: float
    c30: float
    density: float

    def __post_init__(self) -> None:
        self._require(("c10", "density"), ("c20", "c30"))

    @property
    def parameters(self) -> np.ndarray:
        return _padded(self.c10, 0.0, 0.0, self.c20, self.c30)


@dataclass(frozen=True)
class SofteningRubber(Rubber):
    """Rubber that softens at small strain and stiffens at large ones, by the first invariant x = I1 - 3 alone. Raises
    MaterialError for a constant out of range.

        W = 1/2 [mu_inf x + 2 mu_0 x_0 (sqrt(1 + x/x_0) - 1) + c x^2/2 + c_3 x^3/3]

    A neo-Hookean term, a power law with the exponent 1/2 (Knowles 1977, Int. J. Fracture 13, 611), the largest
    softening with which the shear stress still rises everywhere, and Yeoh's second and third terms. The knee at small
    strain is that of filled rubber (Payne, Mullins). Hill's condition (see `stability`) holds at all strains for
    mu_inf >= mu_0/200, whatever x_0 is.

    Parameters
    ----------
    mu_inf, mu_0 : float
        Shear modulus that is left beyond the knee, and what that at rest exceeds it by, Pa; not negative, not both 0.
    x_0 : float
        I1 - 3 at the knee; positive.
    c : float
        Stiffening, Pa; not negative.
    density : float
        Reference density, kg/m3.
    c_3 : float
        Stiffening that grows with the square of x, Pa; not negative.

    Examples
    --------
    >>> SofteningRubber(mu_inf=0.3e6, mu_0=1e6, x_0=0.01, c=2e6, density=1300.0).small_strain_shear_modulus
    1300000.0
    """

    title = "Softening rubber"
    moduli = ("mu_inf", "mu_0", "c", "c_3")

    mu_inf: float
    mu_0: float
    x_0: float
    c: float
    density: float
    c_3: float = 0.0

    def __post_init__(self) -> None:
        self._require(("x_0", "density"), self.moduli)
        for key in self.moduli:
            if getattr(self, key) < 0.0:
                raise MaterialError(
                    f"{self.title}: {key} must not be negative, but {getattr(self, key):g} Pa was given."
                )
        if self.mu_inf + self.mu_0 <= 0.0:
            raise MaterialError(f"{self.title}: mu_inf + mu_0 must be greater than zero, but both are 0 Pa.")

    @property
    def parameters(self) -> np.ndarray:
        return _padded(0.5 * self.mu_inf, 0.0, 0.0, 0.25 * self.c, self.c_3 / 6.0, self.mu_0, self.x_0)


@dataclass(frozen=True)
class Ogden(Rubber):
    """Ogden rubber: W = sum mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3) with the principal stretches l.
    Raises MaterialError for unequal numbers of moduli and exponents, a constant that is not finite, an exponent of 0,
    or a shear modulus at small strain that is not positive.

    As many moduli mu_p, Pa, single ones of which may be negative, as exponents alpha_p, none of them 0.

    Examples
    --------
    >>> Ogden((0.6e6, -0.01e6), (1.3, -2.0), 1300.0).small_strain_shear_modulus
    400000.0
    """

    title = "Ogden rubber"
    moduli = ("mu",)

    mu: tuple[float, ...]
    alpha: tuple[float, ...]
    density: float

    def __post_init__(self) -> None:
        if not self.mu or len(self.mu) != len(self.alpha):
            raise MaterialError(
                f"{self.title}: mu and alpha must have as many entries, one or more, but {len(self.mu)} and "
                f"{len(self.alpha)} were given."
            )
        for name, values in (("mu", self.mu), ("alpha", self.alpha)):
            require_finite(self.title, **{f"{name}_{p}": value for p, value in enumerate(values, 1)})
        self._require(("density",))
        if 0.0 in self.alpha:
            raise MaterialError(f"{self.title}: an exponent must not be 0; leave its term out.")
        if self.small_strain_shear_modulus <= 0.0:
            raise MaterialError(
                f"{self.title}: the small-strain shear modulus, half the sum of mu alpha, must be greater than zero, "
                f"but it is {self.small_strain_shear_modulus:g} Pa."
            )

    @property
    def parameters(self) -> np.ndarray:
        return np.concatenate([_padded(), np.stack([self.mu, self.alpha], axis=1).ravel()])


@dataclass(frozen=True)
class IsotropicElastic(Law):
    """Isotropic linear elastic (St Venant-Kirchhoff) sheet. Raises MaterialError for a constant outside these bounds.

        W = E/(2 (1 - nu^2)) (e1^2 + e2^2 + 2 nu e1 e2) + G/2 (e3^2 + e4^2 + e5^2),  G = E/(2 (1 + nu))

    Young's modulus in Pa, greater than zero; Poisson's ratio greater than -1, at most 0.5 (plane stress allows the
    incompressible limit).
    """

    kind = LINEAR_ELASTIC
    title = "Isotropic material"
    moduli = ("youngs_modulus",)

    youngs_modulus: float
    poisson_ratio: float
    density: float

    def __post_init__(self) -> None:
        self._require(("youngs_modulus", "density"))
        self._require((), ("poisson_ratio",))
        if not -1.0 < self.poisson_ratio <= 0.5:
            raise MaterialError(
                "Isotropic material: poisson_ratio must be greater than -1 and at most 0.5, but "
                f"{self.poisson_ratio:g} was given."
            )

    @property
    def parameters(self) -> np.ndarray:
        q11 = self.youngs_modulus / (1.0 - self.poisson_ratio**2)
        g = self.small_strain_shear_modulus
        return _padded(q11, q11, self.poisson_ratio * q11, g, g, g)

    @property
    def small_strain_shear_modulus(self) -> float:
        """G = E/(2 (1 + nu)), Pa."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))


@dataclass(frozen=True)
class OrthotropicPly(Law):
    """Unidirectional ply (orthotropic St Venant-Kirchhoff sheet), axis 1 along the fibre. Raises MaterialError for a
    modulus or density that is not positive, or a Poisson ratio that makes the plane-stress stiffness indefinite.

        W = (Q11 e1^2 + 2 Q12 e1 e2 + Q22 e2^2 + G12 e3^2 + G13 e4^2 + G23 e5^2) / 2
        Q11 = E1/k,  Q22 = E2/k,  Q12 = nu12 E2/k,  k = 1 - nu12^2 E2/E1

    Young's moduli along and across the fibre and shear moduli in Pa; nu12 is the contraction across the fibre for
    tension along it, and its square must be less than e1/e2.
    """

    kind = LINEAR_ELASTIC
    title = "Orthotropic ply"
    moduli = ("e1", "e2", "g12", "g13", "g23")

    e1: float
    e2: float
    nu12: float
    g12: float
    g13: float
    g23: float
    density: float

    def __post_init__(self) -> None:
        self._require(("e1", "e2", "g12", "g13", "g23", "density"))
        self._require((), ("nu12",))
        if self.nu12**2 >= self.e1 / self.e2:
            raise MaterialError(
                "Orthotropic ply: the square of nu12 must be less than e1/e2 = "
                f"{self.e1 / self.e2:g} for a positive energy, but nu12 = {self.nu12:g} was given."
            )

    @property
    def parameters(self) -> np.ndarray:
        k = 1.0 - self.nu12**2 * self.e2 / self.e1
        return _padded(self.e1 / k, self.e2 / k, self.nu12 * self.e2 / k, self.g12, self.g13, self.g23)

    @property
    def small_strain_shear_modulus(self) -> float:
        """In-plane shear modulus G12, Pa."""
        return self.g12


def halpin_tsai(fibre: float, matrix: float, fibre_fraction: float, xi: float) -> float:
    """Halpin-Tsai mean of one property (a modulus or a Poisson ratio) of fibre and matrix (Th. 3.3).

        M = Mm (Mf + xi (f Mf + (1 - f) Mm)) / (f Mm + (1 - f) Mf + xi Mm)

    xi = 0 is the series (Reuss) mean, xi -> infinity the parallel (Voigt) mean.
    """
    f = fibre_fraction
    parallel = f * fibre + (1.0 - f) * matrix
    return matrix * (fibre + xi * parallel) / (f * matrix + (1.0 - f) * fibre + xi * matrix)


def ply_from_constituents(
    fibre_fraction: float = 0.45,
    fibre_modulus: float = 3460e6,
    matrix_modulus: float = 4.37e6,
    fibre_poisson: float = 0.21,
    matrix_poisson: float = 0.35,
    xi: float = 120000.0,
    density: float = 1270.0,
) -> OrthotropicPly:
    """Unidirectional ply from its isotropic constituents by Halpin-Tsai; the defaults are App. A's. Raises
    MaterialError for a fraction that is not between 0 and 1, a modulus or density that is not positive, or a Poisson
    ratio that is not greater than 0 and at most 0.5.

    ``e1`` uses `xi`, 2 (length/thickness) of the fibre, ``e2`` 0, ``g12`` and ``nu12`` 2, ``g13`` = ``g23`` 0. That is
    how App. A's program has it (5.57 MPa in the plane of the ply, 2.94 MPa across it), while Th. Table 3-5 prints 2.94
    MPa for xy and xz and 5.57 MPa for yz, exchanges the Poisson ratios (0.282 with xi = 2, 0.269 with xi = 0) in the
    same way, and has 1558 MPa along the fibre, 0.3 % above the program's 1553.8. Which of the two the published results
    were computed with is not said.
    """
    name = "Halpin-Tsai ply"
    require_positive(name, fibre_modulus=fibre_modulus, matrix_modulus=matrix_modulus)
    require_positive(name, density=density, fibre_fraction=fibre_fraction)
    require_finite(name, fibre_poisson=fibre_poisson, matrix_poisson=matrix_poisson, xi=xi)
    if fibre_fraction >= 1.0:
        raise MaterialError(f"{name}: fibre_fraction must be less than 1, but {fibre_fraction:g} was given.")
    if xi < 0.0:
        raise MaterialError(f"{name}: xi must be at least 0, but {xi:g} was given.")
    for key, value in (("fibre_poisson", fibre_poisson), ("matrix_poisson", matrix_poisson)):
        # The series mean of two ratios is meaningless when one of them is not positive.
        if not 0.0 < value <= 0.5:
            raise MaterialError(f"{name}: {key} must be greater than 0 and at most 0.5, but {value:g} was given.")
    fibre_shear = fibre_modulus / (2.0 * (1.0 + fibre_poisson))
    matrix_shear = matrix_modulus / (2.0 * (1.0 + matrix_poisson))
    transverse_shear = halpin_tsai(fibre_shear, matrix_shear, fibre_fraction, 0.0)
    return OrthotropicPly(
        e1=halpin_tsai(fibre_modulus, matrix_modulus, fibre_fraction, xi),
        e2=halpin_tsai(fibre_modulus, matrix_modulus, fibre_fraction, 0.0),
        nu12=halpin_tsai(fibre_poisson, matrix_poisson, fibre_fraction, 2.0),
        g12=halpin_tsai(fibre_shear, matrix_shear, fibre_fraction, 2.0),
        g13=transverse_shear,
        g23=transverse_shear,
        density=density,
    )


def fibre_ply(constants: str = "program") -> OrthotropicPly:
    """The reference valve's fibre ply: "program", App. A's constituents, or "table", the constants of Th. Table 3-5.
    Raises MaterialError for any other word.
    """
    if constants == "program":
        return ply_from_constituents()
    if constants == "table":
        return OrthotropicPly(1558e6, 7.94e6, 0.27, 2.94e6, 2.94e6, 5.57e6, 1270.0)
    raise MaterialError(f"Fibre constants must be one of {', '.join(FIBRE_CONSTANTS)}, but {constants!r} was given.")
