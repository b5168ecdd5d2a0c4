"""``dbvfiv cfd``: viscous flow in three dimensions through a computed shape."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ._later import action
from ._options import AsJson, PlotFolder, ResultFile

ORDER = 57


def command(
    file: ResultFile,
    folder: Annotated[
        Path,
        typer.Option("-o", "--output", metavar="DIR", help="Folder of the OpenFOAM case: new, or one to go on with."),
    ],
    pressure: Annotated[
        str | None,
        typer.Option("--state", "-p", metavar="P", help="The state nearest to this pressure; else the highest."),
    ] = None,
    pipe: Annotated[
        str | None,
        typer.Option(
            "--pipe",
            metavar="D|free",
            help="Inner diameter of the pipe that the valve stands in, such as '330 mm', or free; else as in the case.",
        ),
    ] = None,
    fineness: Annotated[
        float,
        typer.Option(
            "--fineness", min=0.3, max=3.0, help="Cells in each direction: 0.5 for 26 thousand, 1 for 207 thousand."
        ),
    ] = 0.5,
    iterations: Annotated[int, typer.Option("--iterations", min=1, help="At most this many, over all runs.")] = 400,
    run: Annotated[bool, typer.Option("--run/--no-run", help="Run OpenFOAM, or only write its case.")] = True,
    plots: PlotFolder = None,
    as_json: AsJson = False,
) -> None:
    """Viscous flow through the shape of a steady state, with its flow: a mesh of hexahedra of a quarter, 5 diameters of
    pipe before it and 12 behind, an OpenFOAM case (simpleFoam, k-omega SST), its run where OpenFOAM is installed, and
    pressures, recovery and force on the wall beside the one-dimensional law.

    dbvfiv cfd my.h5 --state "36 kPa" --pipe "330 mm" -o flow36 --plots figures
    """
    action("cfd").compute(file, folder, pressure, (pipe, fineness, iterations), run, plots, as_json)
