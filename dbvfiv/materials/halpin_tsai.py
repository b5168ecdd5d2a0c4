"""Ply constants from those of fibre and matrix (Halpin-Tsai, Th. 3.3).

    M = Mm (Mf + xi (f Mf + (1 - f) Mm)) / (f Mm + (1 - f) Mf + xi Mm)

xi = 0 is the series (Reuss) mean, xi -> infinity the parallel (Voigt) mean. The sources do
not agree on one point: App. A's program gives the plane of the ply the shear modulus with xi = 2
(5.57 MPa) and both transverse planes the one with xi = 0 (2.94 MPa), while Th. Table 3-5 prints
2.94 MPa for xy and xz and 5.57 MPa for yz; the Poisson ratios (0.282 with xi = 2, 0.269 with xi = 0)
are exchanged in the same way. The table's 1558 MPa along the fibre is 0.3 % above the program's
1553.8. The program's assignment is the default here, because the listing runs; which of the two the
published results were computed with is not said.
"""

from __future__ import annotations

from dbvfiv.materials.checks import MaterialError, require_finite, require_positive
from dbvfiv.materials.orthotropic import OrthotropicPly

FIBRE_CONSTANTS = ("program", "table")


def halpin_tsai(fibre: float, matrix: float, fibre_fraction: float, xi: float) -> float:
    """Halpin-Tsai mean of one property (a modulus or a Poisson ratio).

    Parameters
    ----------
    fibre, matrix : float
        The property of the constituents; any unit, the same for both.
    fibre_fraction : float
        Volume fraction of the fibre, 0 to 1.
    xi : float
        Reinforcement coefficient, at least 0.
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
    """Unidirectional ply from its constituents; the defaults are App. A's.

    ``e1`` uses `xi`, ``e2`` 0, ``g12`` and ``nu12`` 2, ``g13`` = ``g23`` 0.

    Parameters
    ----------
    fibre_fraction : float
        Volume fraction of the fibre, greater than 0 and less than 1.
    fibre_modulus, matrix_modulus : float
        Young's moduli of the isotropic constituents, Pa.
    fibre_poisson, matrix_poisson : float
        Their Poisson ratios, greater than 0 and at most 0.5.
    xi : float
        Coefficient for the modulus along the fibre, 2 (length/thickness) of the fibre.
    density : float
        Of the ply, kg/m3.

    Raises
    ------
    MaterialError
        For a constant outside these bounds.
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
    """The reference valve's fibre ply.

    Parameters
    ----------
    constants : {"program", "table"}
        "program": App. A's constituents through Halpin-Tsai. "table": the printed constants of
        Th. Table 3-5 (1558 and 7.94 MPa, shear 2.94, 2.94, 5.57 MPa for 12, 13, 23, Poisson 0.27).

    Raises
    ------
    MaterialError
        For any other word.
    """
    if constants == "program":
        return ply_from_constituents()
    if constants == "table":
        return OrthotropicPly(1558e6, 7.94e6, 0.27, 2.94e6, 2.94e6, 5.57e6, 1270.0)
    raise MaterialError(f"Fibre constants must be one of {', '.join(FIBRE_CONSTANTS)}, but {constants!r} was given.")
