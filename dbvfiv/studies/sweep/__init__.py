"""``dbvfiv sweep``: modes tracked along a parameter."""

from __future__ import annotations

from typing import Annotated, Literal

import typer
from pydantic import StrictInt

from ...case.axis import Axis, Range, parse_axis
from ...case.parameters import SWEPT, listed
from ...case.quantity import Number
from ...case.section import Section, key
from ..request import DensityOption, PressureOption, over_option

ORDER = 26


class Keys(Section):
    """Modes tracked along one parameter."""

    over: Range = key("density=1:1000:40:log", "Parameter and its values: PARAMETER=START:STOP:COUNT[:log].")
    count: StrictInt = key(6, "How many leading modes to follow.", ge=1, le=100)
    checks: StrictInt = key(3, "Values at which eigenvalues and the count of unstable modes are checked.", ge=1, le=50)
    tolerance: Number = key(
        1e-6,
        "Accepted relative error of eigenvalues of the reduced-order model; beyond it values are solved in full.",
        gt=0,
        le=1e-2,
    )
    least_confidence: Number = key(
        0.6, "A step is halved while the match of a leading mode is less certain than this.", gt=0, lt=1
    )

    symmetry: Literal["SS", "SA", "AS", "AA", "S", "A"] = key(
        "SS",
        "Symmetry class followed: SS opens and closes the lips, SA sways them together in y, AS sideways in x, AA "
        "twists; S or A where a half is computed, see modes.symmetry.",
    )

    @property
    def axis(self) -> Axis:
        """The parsed range."""
        return parse_axis(self.over)


def command(
    over: Annotated[
        str | None, over_option(f"PARAMETER=START:STOP:COUNT[:log] of {listed(SWEPT)}; sweep.over without it.")
    ] = None,
    pressure: PressureOption = None,
    density: DensityOption = None,
    count: Annotated[
        int | None, typer.Option("--count", "-n", metavar="N", help="How many leading modes to follow.")
    ] = None,
    symmetry: Annotated[
        str | None,
        typer.Option("--symmetry", metavar="CLASS", help="Symmetry class: SS, SA, AS or AA; see dbvfiv modes."),
    ] = None,
) -> None:
    """Damping and frequency of the leading modes, followed along a parameter of load, fluid or damping.

    Each mode keeps its number through crossings; "confidence" says how sure each match is. Where the steady state
    stays, modes are those of a reduced-order model checked with the full matrices. Ctrl-C keeps what is done.

    dbvfiv sweep cases/dbv12.toml -p "6 kPa" --set damping.alpha=0 --over density=1:1000:40:log -o sweep.h5 --plots
    figures
    """
