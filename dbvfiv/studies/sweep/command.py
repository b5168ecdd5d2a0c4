"""``dbvfiv sweep``: modes tracked along a parameter."""

from __future__ import annotations

from typing import Annotated

import typer

from ...case.parameters import SWEPT, listed
from ...case.quantity import number_or_text
from ..request import DensityOption, PressureOption, Request

ORDER = 26


def command(
    over: Annotated[
        str | None,
        typer.Option(
            "--over",
            metavar="RANGE",
            help=f"PARAMETER=START:STOP:COUNT[:log] of {listed(SWEPT)}; sweep.over without it.",
        ),
    ] = None,
    pressure: PressureOption = None,
    density: DensityOption = None,
    count: Annotated[
        int | None, typer.Option("--count", "-n", metavar="N", help="How many leading modes to follow.")
    ] = None,
    symmetry: Annotated[
        str | None,
        typer.Option("--symmetry", metavar="CLASS", help="Class of motion: SS, SA, AS or AA; see dbvfiv modes."),
    ] = None,
) -> Request:
    """Damping and frequency of the leading modes, followed along a parameter of load, fluid or damping.

    Each mode keeps its number through crossings; "confidence" says how sure each match is. Where the steady state
    stays, modes are those of a reduced-order model checked with the full matrices. Ctrl-C keeps what is done.

    dbvfiv sweep cases/dbv12.toml -p "6 kPa" --set damping.alpha=0 --over density=1:1000:40:log -o sweep.h5 --plots
    figures
    """
    changes = {
        "sweep.over": over,
        "sweep.count": count,
        "sweep.symmetry": symmetry,
        "drive.pressure": number_or_text(pressure),
        "fluid.density": number_or_text(density),
    }
    return Request(changes)
