"""``dbvfiv levels``: strain levels of the rubbers that agree with the strains their layers see."""

from __future__ import annotations

from typing import Annotated

from ...case.model import Case
from ...case.physics import LoadPressure
from ...case.section import Section, key
from ..request import pressure_option

ORDER = 25


class Keys(Section):
    """Strain levels that agree with themselves."""

    pressures: tuple[LoadPressure, ...] = key(
        (18e3, 29e3, 36e3), "Static inlet pressures at which levels are looked for.", min_length=1
    )


def command(
    case: Case,
    pressures: Annotated[list[str] | None, pressure_option("Static inlet pressure; may be repeated.")] = None,
) -> None:
    """Strain level of each rubber that agrees with what its layer strains (Eq. 7.1), and the flow with it.

    Each rubber has the constants of a level, 10 to 60 %; with them 99 % of its layer strain by less than so much; that
    is the next level, until both agree. `materials.strain_level = "auto"` does the same at the largest pressure that
    the case names.

    dbvfiv levels cases/dbv12.toml -p "18 kPa" -p "36 kPa"
    """
