"""Constants that come with the program: three tested rubbers at any strain level, and loss factors of materials.

Each rubber was tested four times, in tension up to 10, 20, 40 and 60 % (Th. 3.2); the constants of a level describe the
curve of that test. Two sets are shipped: the published ones, and those of a law that is stable in every state
(`laws.SofteningRubber`), fitted by least squares to 60 points of each published curve.

Between the levels constants are interpolated linearly in the strain level, all of them with the same weights, but for
x_0 of the stable set, whose logarithm is: between 10 and 60 % it grows thirty times. The published energy is linear in
its constants, so energy, stress and tangent at any given strain are interpolated linearly too, however strongly the
constants cancel each other. The stable law keeps its conditions between two sets that meet them.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np

from dbvfiv.materials.laws import MaterialError, MooneyRivlin, SofteningRubber, require_finite

_TABLES = {2: "two", 3: "three"}


@cache
def read_toml(name: str) -> dict:
    """Contents of a file NAME.toml beside this one."""
    return tomllib.loads(files("dbvfiv.materials").joinpath(f"{name}.toml").read_text("utf-8"))


def rubber_names() -> tuple[str, ...]:
    """Names of the shipped rubbers."""
    return tuple(sorted(read_toml("rubbers")["three"]))


def strain_levels() -> tuple[float, ...]:
    """Tested strain levels as fractions, ascending."""
    return tuple(read_toml("rubbers")["strain_level"])


def rubber(name: str, strain_level: float = 0.10, *, density: float | None = None) -> SofteningRubber:
    """A shipped rubber at a strain level, by constants that are stable in every state. Raises MaterialError for an
    unknown name or a level outside the tested ones.

    Parameters
    ----------
    name : str
        "CR", "SBR" or "EPDM".
    strain_level : float
        Engineering strain up to which the constants are meant, as a fraction, 0.10 to 0.60.
    density : float, optional
        kg/m3; the shipped 1300 if not given.

    Examples
    --------
    >>> round(rubber("CR", 0.10).small_strain_shear_modulus, -3)
    1339000.0
    """
    mu_inf, mu_0, knee, c, c_3 = _at_level("stable", name, strain_level, ("mu_inf", "mu_0", "x_0", "c", "c_3"))
    return SofteningRubber(mu_inf, mu_0, knee, c, read_toml("rubbers")["density"] if density is None else density, c_3)


def published_rubber(
    name: str, strain_level: float = 0.10, *, terms: int = 3, density: float | None = None
) -> MooneyRivlin:
    """A shipped rubber at a strain level, by the published constants; arguments as `rubber` has them. Raises
    MaterialError for an unknown name, a level outside the tested ones or another number of terms.

    Parameters
    ----------
    terms : int
        3 for the constants of App. A, 2 for the two-constant fit of Table 3-3.

    Examples
    --------
    >>> round(published_rubber("CR", 0.10).small_strain_shear_modulus)
    1422406
    """
    if terms not in _TABLES:
        raise MaterialError(f"A published rubber has 2 or 3 constants, but terms = {terms!r} was given.")
    constants = _at_level(_TABLES[terms], name, strain_level, ("c10", "c01", "c11"))
    return MooneyRivlin(*constants, read_toml("rubbers")["density"] if density is None else density)


def _at_level(table: str, name: str, strain_level: float, constants: tuple[str, ...]) -> list[float]:
    """Constants of a rubber in a table of the shipped ones, interpolated."""
    data = read_toml("rubbers")
    if name not in data[table]:
        raise MaterialError(f"The shipped rubbers are {', '.join(rubber_names())}, but {name!r} was given.")
    require_finite(f"Rubber {name}", strain_level=strain_level)
    levels = data["strain_level"]
    if not levels[0] <= strain_level <= levels[-1]:
        raise MaterialError(
            f"Rubber {name}: strain_level must lie between {levels[0]:.0%} and {levels[-1]:.0%}, "
            f"the tested levels, but {strain_level:.4g} ({strain_level:.4%}) was given."
        )
    found = []
    for key in constants:
        values = data[table][name][key]
        if key == "x_0":
            found.append(float(np.exp(np.interp(strain_level, levels, np.log(values)))))
        else:
            found.append(float(np.interp(strain_level, levels, values)))
    return found


@dataclass(frozen=True)
class ShippedLoss:
    """A loss factor that comes with the program: tan delta, the middle of a range, and its source."""

    value: float
    range: tuple[float, float]
    note: str
    source: str


def shipped_loss_names() -> tuple[str, ...]:
    """Names of the materials whose loss factors come with the program."""
    return tuple(name for name, entry in read_toml("loss_factors").items() if isinstance(entry, dict))


def shipped_loss(name: str) -> ShippedLoss:
    """Loss factor that comes with the program, with its spread; raises `MaterialError` for an unknown name."""
    if name not in shipped_loss_names():
        raise MaterialError(f"Loss factors are shipped for {', '.join(shipped_loss_names())}, but {name!r} was given.")
    entry = read_toml("loss_factors")[name]
    return ShippedLoss(entry["value"], tuple(entry["range"]), entry["note"], read_toml("loss_factors")["source"])
