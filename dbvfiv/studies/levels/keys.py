"""The section levels of the case file."""

from __future__ import annotations

from ...case.physics import LoadPressure
from ...case.section import Section, key


class Keys(Section):
    """Strain levels that agree with themselves."""

    pressures: tuple[LoadPressure, ...] = key(
        (18e3, 29e3, 36e3), "Static inlet pressures at which levels are looked for.", min_length=1
    )
