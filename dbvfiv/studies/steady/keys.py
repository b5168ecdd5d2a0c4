"""The section steady of the case file."""

from __future__ import annotations

from pydantic import StrictInt

from ...case.physics import LoadPressure
from ...case.quantity import Number
from ...case.section import Section, key


class Keys(Section):
    """Equilibria over a list of pressures."""

    pressures: tuple[LoadPressure, ...] = key(
        (2e3, 6e3, 12e3, 18e3, 24e3, 29e3, 36e3, 50e3),
        "Static inlet pressures of the head-discharge curve.",
        min_length=1,
    )
    cracking_area: Number = key(
        2.0,
        "Where the valve counts as cracked: the passage at the lips over that at rest, which is a gap and not nothing.",
        gt=1,
        le=100,
    )
    tolerance: Number = key(1e-8, "Residual, relative to the load, at which Newton stops.", gt=0, le=1e-2)
    max_iterations: StrictInt = key(30, "Newton iterations of one load step.", ge=1, le=10000)
    min_step: Number = key(1e-4, "Smallest load step, relative to the target, before giving up.", gt=0, le=1)
