"""Constants of a fibre ply from tests of strips, and of its fibre and matrix by Halpin-Tsai backwards.

A strip pulled along the warp (the fibre), the weft (across it) or at 45 degrees answers as the wall's ply does, with a
line between second Piola-Kirchhoff stress and Green-Lagrange strain, so that the nominal stress at the strain s is
E (1 + s)(s + s^2/2). The shear modulus follows from the three,

    1/G12 = 4/E45 - 1/E1 - 1/E2 + 2 nu12/E1,

nu12 from the strain across a warp strip. Backwards through Halpin-Tsai: the weft modulus is the series mean of
fibre and matrix, the warp modulus the one with `xi`; two equations for two moduli.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

from dbvfiv.fit.curves import STRAIN_UNITS, TensionTest, read_columns
from dbvfiv.materials.laws import MaterialError, OrthotropicPly, halpin_tsai, ply_from_constituents, require_positive

_SOFTEST, _STIFFEST = 1e-3, 0.5
#: Poisson ratios of fibre and matrix where none is measured, and those of the matrix next to one that no matrix gives,
#: as cases take them.
_USUAL, _ENDS = (0.21, 0.35), (1e-3, 0.499)


@dataclass(frozen=True)
class StripTest:
    """A strip of the ply pulled along "warp", "weft" or "bias" (45 degrees), with the engineering strain (n,) across it
    where that was measured.
    """

    direction: str
    test: TensionTest
    across: np.ndarray | None = None

    @property
    def modulus(self) -> float:
        """Between second Piola-Kirchhoff stress and Green-Lagrange strain, Pa, by least squares. Raises MaterialError
        if stress does not grow with strain.
        """
        column = self.unit_stress(self.test.strain)
        if not np.any(column):
            raise MaterialError(f"The {self.direction} test has no strain other than zero.")
        value = float(column @ self.test.stress / (column @ column))
        if value <= 0.0:
            raise MaterialError(f"The {self.direction} test has no stiffness: its stress does not grow with strain.")
        return value

    @property
    def residuals(self) -> np.ndarray:
        """Measured less fitted nominal stress, Pa."""
        return self.test.stress - self.modulus * self.unit_stress(self.test.strain)

    @property
    def poisson(self) -> float | None:
        """Contraction across the strip by Green-Lagrange strains; None where it was not measured."""
        if self.across is None:
            return None
        along, across = (e + e**2 / 2 for e in (self.test.strain, self.across))
        return float(-(along @ across) / (along @ along))

    @staticmethod
    def unit_stress(strain) -> np.ndarray:
        """Nominal stress per unit of the modulus at engineering strains."""
        strain = np.asarray(strain, dtype=float)
        return (1.0 + strain) * (strain + strain**2 / 2.0)


def read_strip_test(path: str | Path, direction: str) -> StripTest:
    """Read a strip test: engineering_strain (or stretch), nominal_stress, and transverse_strain if measured. Raises
    MaterialError: see `curves.read_curves`.
    """
    test, columns = read_columns(path, {"transverse_strain": STRAIN_UNITS})
    return StripTest(direction, test, columns.get("transverse_strain"))


@dataclass(frozen=True)
class Constituents:
    """Fibre and matrix of a ply: the keys of a material of kind halpin-tsai, in SI units."""

    fibre_fraction: float
    fibre_modulus: float
    matrix_modulus: float
    fibre_poisson: float
    matrix_poisson: float
    xi: float

    def ply(self, density: float, fibre_fraction: float | None = None) -> OrthotropicPly:
        """The ply of these constituents, of another volume fraction of the fibre if one is given."""
        fraction = self.fibre_fraction if fibre_fraction is None else fibre_fraction
        return ply_from_constituents(**vars(self) | {"fibre_fraction": fraction}, density=density)


def constituents_of(
    e1: float,
    e2: float,
    fibre_fraction: float = 0.45,
    xi: float = 120000.0,
    nu12: float | None = None,
    poisson: tuple[float, float] = _USUAL,
) -> Constituents:
    """Halpin-Tsai backwards: fibre and matrix from the moduli of the ply. Raises MaterialError for moduli or a Poisson
    ratio that no fibre and matrix give.

    Parameters
    ----------
    e1, e2 : float
        Along and across the fibre, Pa.
    fibre_fraction, xi : float
        Volume fraction of the fibre, and coefficient along it.
    nu12 : float, optional
        Poisson ratio of the ply; gives that of the matrix in place of the second of `poisson`, of fibre and matrix.
    """
    require_positive("Halpin-Tsai ply", e1=e1, e2=e2, fibre_fraction=fibre_fraction, xi=xi)
    if fibre_fraction >= 1.0:
        raise MaterialError(f"Halpin-Tsai ply: fibre_fraction must be less than 1, but {fibre_fraction:g} was given.")
    largest = e2 * (1.0 + xi * fibre_fraction)
    if not e2 <= e1 < largest:
        raise MaterialError(
            f"No fibre and matrix give a ply of e1 = {e1 / 1e6:g} MPa and e2 = {e2 / 1e6:g} MPa: with xi = {xi:g} and "
            f"a fraction of {fibre_fraction:g} e1 must be at least e2 and less than {largest / 1e6:g} MPa; are warp "
            "and weft exchanged?"
        )
    f = fibre_fraction

    def matrix(fibre: float) -> float:
        return (1.0 - f) / (1.0 / e2 - f / fibre)

    def excess(log: float) -> float:
        fibre = np.exp(log)
        return np.log(halpin_tsai(fibre, matrix(fibre), f, xi) / e1)

    low = np.log(e2)
    high = low + 1.0
    while excess(high) < 0.0 and high < low + 200.0:
        high += 2.0
    fibre = e2 if e1 == e2 else float(np.exp(brentq(excess, low, high, xtol=1e-15, rtol=1e-15)))
    fibre_poisson, matrix_poisson = poisson
    if nu12 is not None:
        matrix_poisson = _matrix_poisson(nu12, fibre_poisson, f)
    return Constituents(f, fibre, float(matrix(fibre)), fibre_poisson, matrix_poisson, xi)


def _matrix_poisson(nu12: float, fibre_poisson: float, fraction: float) -> float:
    """Poisson ratio of the matrix from that of the ply (Halpin-Tsai with 2, as `ply_from_constituents`)."""

    def excess(value: float) -> float:
        return halpin_tsai(fibre_poisson, value, fraction, 2.0) - nu12

    if not excess(_SOFTEST) <= 0.0 <= excess(_STIFFEST):
        ends = (halpin_tsai(fibre_poisson, v, fraction, 2.0) for v in (_SOFTEST, _STIFFEST))
        raise MaterialError(
            f"No matrix gives a ply the Poisson ratio {nu12:.4g} with {fibre_poisson:g} of the fibre and a fraction of "
            f"{fraction:g}: it must lie between " + " and ".join(f"{end:.4g}" for end in ends) + "."
        )
    return float(brentq(excess, _SOFTEST, _STIFFEST, xtol=1e-15))


@dataclass(frozen=True)
class PlyFit:
    """A ply from its tests: constants measured, or else from the constituents by Halpin-Tsai backwards; `missed` is a
    sentence on a measured Poisson ratio that no constituents give.
    """

    tests: tuple[StripTest, ...]
    constituents: Constituents
    ply: OrthotropicPly
    measured: tuple[str, ...]
    missed: str = ""


def fit_ply(
    tests: tuple[StripTest, ...], fibre_fraction: float = 0.45, xi: float = 120000.0, density: float = 1270.0
) -> PlyFit:
    """Ply constants from strips pulled along warp and weft, and at 45 degrees if that was tested. Raises MaterialError
    if warp or weft is missing, or the moduli fit no ply.
    """
    by = {test.direction: test for test in tests}
    for direction in ("warp", "weft"):
        if direction not in by:
            raise MaterialError(f"A ply needs tests along warp and weft, but {direction} is missing.")
    e1, e2, nu12 = by["warp"].modulus, by["weft"].modulus, by["warp"].poisson
    near, missed = _nearest_poisson(nu12, fibre_fraction)
    constituents = constituents_of(e1, e2, fibre_fraction, xi, near)
    made = constituents.ply(density)
    values = {name: getattr(made, name) for name in ("nu12", "g12", "g13", "g23")} | {"e1": e1, "e2": e2}
    measured = ["e1", "e2"]
    if nu12 is not None:
        values["nu12"] = nu12
        measured.append("nu12")
    if "bias" in by:
        values["g12"] = _shear_modulus(by["bias"].modulus, e1, e2, values["nu12"])
        measured.append("g12")
    return PlyFit(tests, constituents, OrthotropicPly(**values, density=density), tuple(measured), missed)


def _nearest_poisson(nu12: float | None, fraction: float) -> tuple[float | None, str]:
    """Poisson ratio of a ply, or the nearest one that a matrix gives beside the usual fibre, and a sentence on that."""
    if nu12 is None or not 0.0 < fraction < 1.0:
        return nu12, ""
    low, high = (halpin_tsai(_USUAL[0], end, fraction, 2.0) for end in _ENDS)
    near = float(np.clip(nu12, low, high))
    if near == nu12:
        return nu12, ""
    return near, (
        f"No matrix gives a ply the Poisson ratio {nu12:.4g} with {_USUAL[0]:g} of the fibre and a fraction of "
        f"{fraction:g}; what is not measured is that of the nearest, {near:.4g}."
    )


def _shear_modulus(bias: float, e1: float, e2: float, nu12: float) -> float:
    compliance = 4.0 / bias - 1.0 / e1 - 1.0 / e2 + 2.0 * nu12 / e1
    if compliance <= 0.0:
        raise MaterialError(
            f"The strip at 45 degrees is too stiff ({bias / 1e6:.4g} MPa) for a ply of {e1 / 1e6:.4g} MPa along and "
            f"{e2 / 1e6:.4g} MPa across the fibre; no shear modulus gives that."
        )
    return 1.0 / compliance
