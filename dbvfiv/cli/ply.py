"""``dbvfiv ply``: constants of a fibre ply from its tests."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ._later import action
from ._options import AsJson, PlotFolder

ORDER = 14


def command(
    warp: Annotated[Path, typer.Argument(metavar="WARP.csv", help="Strip pulled along the fibre.")],
    weft: Annotated[Path, typer.Argument(metavar="WEFT.csv", help="Strip pulled across it.")],
    bias: Annotated[Path | None, typer.Option("--bias", metavar="FILE.csv", help="Strip cut at 45 degrees.")] = None,
    fraction: Annotated[str, typer.Option("--fraction", help="Volume fraction of the fibre.")] = "45 %",
    xi: Annotated[float, typer.Option("--xi", help="Halpin-Tsai coefficient along the fibre.")] = 120000.0,
    at: Annotated[
        str | None, typer.Option("--at", metavar="F1,F2,...", help="Also the ply of other fractions of the fibre.")
    ] = None,
    name: Annotated[str, typer.Option("--name", help="Name of the material in the tables to paste.")] = "ply",
    density: Annotated[str, typer.Option("--density", help="Its density in the tables to paste.")] = "1270 kg/m^3",
    plots: PlotFolder = None,
    as_json: AsJson = False,
) -> None:
    """Constants of a ply from tension along warp and weft, and of its fibre and matrix by Halpin-Tsai backwards.

    dbvfiv ply warp.csv weft.csv --fraction "45 %" --at "30 %,60 %" --plots figures
    """
    action("ply").tell((warp, weft, bias), (fraction, xi, at), (name, density), plots, as_json)
