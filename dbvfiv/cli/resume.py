"""``dbvfiv resume``: continue an interrupted run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ._later import action
from ._options import AsJson, PlotFolder, ResultFile

ORDER = 45


def command(
    file: ResultFile,
    duration: Annotated[
        str | None, typer.Option("--duration", metavar="T", help="New end of the run, 2.0 (s) or '500 ms'.")
    ] = None,
    plots: PlotFolder = None,
    animate: Annotated[
        Path | None, typer.Option("--animate", metavar="FILE.gif", help="Write an animation of the last cycle.")
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", "-w", metavar="N", min=1, help="Of a map: processes that share the columns."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Continue a run that was interrupted or killed in its file, or a finished transient run with a later --duration.

    The numbers are those of a run that was never interrupted: a transient run goes on from its last restart point, a
    map solves the columns that are missing in it, an onset run the values, steady and closure runs the pressures.
    """
    action("resume").go_on(file, duration, plots, animate, workers, as_json)
