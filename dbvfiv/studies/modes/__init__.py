"""``dbvfiv modes``: how each mode of the coupled valve rings."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from pydantic import StrictBool, StrictInt

from ...case.model import Case
from ...case.quantity import Frequency, Number, Rate
from ...case.section import Section, key
from ...errors import CaseError
from ..request import DensityOption, LawsOption, Request, pressure_option

ORDER = 25


class Keys(Section):
    """Leading eigenvalues of the coupled state."""

    needs = {"shift_frequency": "shift"}

    count: StrictInt = key(10, "How many modes; a conjugate pair is one.", ge=1, le=1000)
    max_frequency: Frequency | None = key(
        None, "Only modes up to this frequency; chosen where damping does not order the modes.", gt=0, le=1e6
    )
    shift: Rate | None = key(None, "Real part of a shift to search near, instead of automatic ones.", ge=-1e6, le=1e6)
    shift_frequency: Frequency = key(0.0, "Frequency of that shift.", ge=0, le=1e6)
    tolerance: Number = key(1e-8, "Largest accepted relative residual of the full pencil.", gt=0, le=1e-2)
    continuity: Literal["case", "both"] = key("case", "The flow model of the case, or both models side by side.")
    symmetry: Literal["SS", "SA", "AS", "AA", "S", "A", "all"] = key(
        "SS",
        "Symmetry class, symmetric (S) or antisymmetric (A) about x = 0, first letter, and about y = 0, second: SS "
        "opens and closes the lips, SA sways them together in y, AS sideways in x, AA twists; or all four. Where a "
        "half is computed there are two about y = 0 alone: S, which SS stands for too, opens the lips or sways them "
        "sideways, A sways them together in y or twists.",
    )
    in_vacuo: StrictBool = key(False, "Leave the fluid out: the stressed structure alone.")

    @property
    def shifts(self) -> tuple[complex, ...] | None:
        """The shift to search near, 1/s, as a search takes it; None for automatic ones."""
        return None if self.shift is None else (complex(self.shift, 2 * math.pi * self.shift_frequency),)


def command(
    case: Case,
    pressure: Annotated[
        str | None,
        pressure_option("Static inlet pressure in place of drive.pressure; 0 with --in-vacuo is the valve at rest."),
    ] = None,
    density: DensityOption = None,
    law: LawsOption = None,
    count: Annotated[int | None, typer.Option("--count", "-n", metavar="N", help="How many modes.")] = None,
    in_vacuo: Annotated[
        bool,
        typer.Option(
            "--in-vacuo", help="Leave the flow out: the structure under its steady pressures, with any fluid outside."
        ),
    ] = False,
    symmetry: Annotated[
        str | None,
        typer.Option(
            "--symmetry",
            metavar="CLASS",
            help="Symmetry class: SS opens and closes the lips, SA sways them in y, AS in x, AA twists; or all.",
        ),
    ] = None,
    animate: Annotated[
        list[int] | None,
        typer.Option(
            "--animate", metavar="N", help="Write a GIF of one cycle of mode N into --plots; may be repeated."
        ),
    ] = None,
    plots: Path | None = None,
) -> Request:
    """Leading modes of one steady state: growth rate, frequency, damping ratio, residual, and whether the state is
    stable.

    The number of unstable eigenvalues is counted twice, in the list of modes and by the argument principle
    along the imaginary axis; both eigenvalues of a pair count. Modes are symmetric about both planes unless --symmetry
    asks for another symmetry class; the lowest mode of a valve is often sway, SA. With --law both the other flow
    model is asked too, and where both disagree about stable or not the result says so.

    dbvfiv modes cases/dbv12.toml -p "6 kPa" --density 10 --set damping.alpha=0 -o modes.h5 --plots figures --animate 1
    """
    if animate and plots is None:
        raise CaseError("--animate needs --plots DIR, the folder that the GIF is written into.")

    def further(result: Any) -> list[Path]:
        return [result.animate(plots / f"mode-{number}.gif", number) for number in animate or ()]

    return Request(further=further)
