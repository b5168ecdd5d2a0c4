"""``dbvfiv cycle``: what a valve does beyond its onset."""

from __future__ import annotations

from typing import Annotated

import typer

from ...case.parameters import listed
from ...case.quantity import number_or_text
from ..case import Case
from ..request import DensityOption, PressureOption, Request, refuse_moved

ORDER = 42


def command(
    case: Case,
    over: Annotated[
        str | None,
        typer.Option(
            "--over",
            metavar="RANGE",
            help=f"PARAMETER=START:STOP:COUNT[:log] of {listed()}; cycle.over without it.",
        ),
    ] = None,
    pressure: PressureOption = None,
    density: DensityOption = None,
) -> Request:
    """Limit cycles followed from an onset along a parameter: amplitude, frequency, stability.

    The oscillation itself is solved for, as a Fourier series in time with all unknowns of the valve, so nothing has to
    settle. Its Floquet exponents say whether it is stable; where that changes, and where the branch turns back or the
    lips just touch, a special point is located. Unstable cycles are followed as well.

    With -o every cycle is kept at once: `dbvfiv resume` goes on after Ctrl-C or a crash.

    dbvfiv cycle cases/light-fluid.toml --over density=25:60:8 -o cycle.h5 --plots figures
    """
    refuse_moved({"cycle.over": over or case.cycle.over}, pressure=pressure, density=density)
    changes = {
        "drive.pressure": number_or_text(pressure),
        "fluid.density": number_or_text(density),
        "cycle.over": over,
    }
    return Request(changes)
