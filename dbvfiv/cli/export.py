"""``dbvfiv export``: a result for ParaView."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ._later import action
from ._options import AsJson, ResultFile

ORDER = 55


def command(
    file: ResultFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE|DIR",
            help="File ending in .vtkhdf, or a folder; beside the result without it.",
        ),
    ] = None,
    quarter: Annotated[
        bool, typer.Option("--quarter", help="Only the quarter that was computed, not the whole valve.")
    ] = False,
    deformed: Annotated[
        bool, typer.Option("--deformed", help="Move the points; without it use 'Warp By Vector' along displacement.")
    ] = False,
    mode: Annotated[
        int | None,
        typer.Option("--mode", metavar="N", help="Of modes: one cycle of mode N, its phases as time steps in s."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Write a result as VTKHDF for ParaView: displacement, rotation, director; thickness, pressure, von Mises stress
    and stretch of each layer.

    The states are the time steps of the file; the "time" that ParaView shows is the inlet pressure in Pa. Of modes it
    is the number of the mode: mode_real, mode_imag and mode_amplitude come with the displacement of the steady state;
    --mode N writes one cycle of that mode instead.
    """
    action("export").export(file, output, quarter, deformed, mode, as_json)
