"""``dbvfiv export``: a result for ParaView."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from ._options import AsJson, ResultFile
from ._output import print_json

ORDER = 55


def command(
    file: ResultFile,
    output: Annotated[
        Optional[Path],
        typer.Option("-o", "--output", metavar="FILE|DIR", help="File ending in .vtkhdf, or a folder; beside the result without it."),
    ] = None,
    quarter: Annotated[bool, typer.Option("--quarter", help="Only the quarter that was computed, not the whole valve.")] = False,
    deformed: Annotated[
        bool, typer.Option("--deformed", help="Move the points; without it use 'Warp By Vector' along displacement.")
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Write a result as VTKHDF for ParaView: displacement, rotation, director; thickness, pressure, von Mises stress and stretch of each layer.

    The states are the time steps of the file; the "time" that ParaView shows is the inlet pressure in Pa.
    """
    from ..results import load_result

    result = load_result(file)
    written = result.export(output if output is not None else file.with_suffix(".vtkhdf"), quarter, deformed)
    if as_json:
        print_json({"written": str(written)})
    else:
        print(f"Wrote {written}.")
