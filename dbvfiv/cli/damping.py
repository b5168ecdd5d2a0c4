"""``dbvfiv damping``: how much the wall damps, by the case and over frequency."""

from __future__ import annotations

from typing import Annotated

import typer

from ._later import action
from ._options import AsJson, CaseFile, Override, PlotFolder

ORDER = 12


def command(
    case_file: CaseFile = None,
    at: Annotated[
        str | None,
        typer.Option(
            "--at", metavar="F1,F2", help="Also alpha and beta that match the loss factors at two frequencies, Hz."
        ),
    ] = None,
    plots: PlotFolder = None,
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """Damping of the wall: materials, fits of their loss factors with errors, damping ratio over frequency.

    dbvfiv damping my.toml --set damping.model="loss factor" --at 5,40 --plots figures
    """
    action("damping").tell(case_file, overrides, at, plots, as_json)
