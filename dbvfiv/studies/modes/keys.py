"""The section modes of the case file."""

from __future__ import annotations

from typing import Literal

from pydantic import StrictBool, StrictInt

from ...case.quantity import Frequency, Number, Rate
from ...case.section import Section, key


class Keys(Section):
    """Leading eigenvalues of the coupled state."""

    count: StrictInt = key(10, "How many modes; a conjugate pair is one.", ge=1, le=1000)
    max_frequency: Frequency | None = key(
        None, "Only modes up to this frequency; chosen where damping does not order the modes.", gt=0, le=1e6
    )
    shift: Rate | None = key(None, "Real part of a shift to search near, instead of automatic ones.", ge=-1e6, le=1e6)
    shift_frequency: Frequency = key(0.0, "Frequency of that shift.", ge=0, le=1e6)
    tolerance: Number = key(1e-8, "Largest accepted relative residual of the full pencil.", gt=0, le=1e-2)
    continuity: Literal["case", "both"] = key("case", "The continuity law of the case, or both laws side by side.")
    symmetry: Literal["SS", "SA", "AS", "AA", "S", "A", "all"] = key(
        "SS",
        "Class of motion, symmetric (S) or antisymmetric (A) about x = 0, first letter, and about y = 0, second: SS "
        "opens and closes the lips, SA sways them together in y, AS sideways in x, AA twists; or all four. Where a "
        "half is computed there are two about y = 0 alone: S, which SS stands for too, opens the lips or sways them "
        "sideways, A sways them together in y or twists.",
    )
    in_vacuo: StrictBool = key(False, "Leave the fluid out: the stressed structure alone.")
