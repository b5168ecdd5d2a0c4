"""The three tested rubbers at any strain level between the tested ones.

The constants were fitted four times, to tension up to 10, 20, 40 and 60 % (Th. 3.2). Between the
levels they are interpolated linearly in the strain level, all of them with the same weights.
The energy is linear in the constants, so energy, stress and tangent at any given strain are then
interpolated linearly too, however strongly the constants cancel each other.
"""

from __future__ import annotations

import tomllib
from functools import cache
from importlib.resources import files

import numpy as np

from dbvfiv.materials.checks import MaterialError, require_finite
from dbvfiv.materials.mooney_rivlin import MooneyRivlin

_TABLES = {2: "two", 3: "three"}


@cache
def _data() -> dict:
    return tomllib.loads(files("dbvfiv.materials").joinpath("rubbers.toml").read_text("utf-8"))


def rubber_names() -> tuple[str, ...]:
    """Names of the shipped rubbers."""
    return tuple(sorted(_data()["three"]))


def strain_levels() -> tuple[float, ...]:
    """Tested strain levels as fractions, ascending."""
    return tuple(_data()["strain_level"])


def rubber(name: str, strain_level: float = 0.10, *, terms: int = 3, density: float | None = None) -> MooneyRivlin:
    """A shipped rubber at a strain level.

    Parameters
    ----------
    name : str
        "CR", "SBR" or "EPDM".
    strain_level : float
        Engineering strain up to which the constants are meant, as a fraction, 0.10 to 0.60.
    terms : int
        3 for the constants the valve model uses (App. A), 2 for the two-constant fit of Table 3-3.
    density : float, optional
        kg/m3; the shipped 1300 if not given.

    Raises
    ------
    MaterialError
        For an unknown name, a level outside the tested ones or another number of terms.

    Examples
    --------
    >>> round(rubber("CR", 0.10).small_strain_shear_modulus)
    1422406
    """
    data = _data()
    if terms not in _TABLES:
        raise MaterialError(f"A shipped rubber has 2 or 3 constants, but terms = {terms!r} was given.")
    table = data[_TABLES[terms]]
    if name not in table:
        raise MaterialError(f"The shipped rubbers are {', '.join(rubber_names())}, but {name!r} was given.")
    require_finite(f"Rubber {name}", strain_level=strain_level)
    levels = data["strain_level"]
    if not levels[0] <= strain_level <= levels[-1]:
        raise MaterialError(
            f"Rubber {name}: strain_level must lie between {levels[0]:.0%} and {levels[-1]:.0%}, "
            f"the tested levels, but {strain_level:.4g} ({strain_level:.4%}) was given."
        )
    c10, c01, c11 = (float(np.interp(strain_level, levels, table[name][c])) for c in ("c10", "c01", "c11"))
    return MooneyRivlin(c10, c01, c11, data["density"] if density is None else density)
