"""``dbvfiv map``: stability over two parameters."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..case.parameters import listed
from ._options import AsJson, CaseFile, Output, Override, PlotFolder, read_case
from ._output import print_json, print_places
from ._progress import Progress

ORDER = 30

_RANGE = f"PARAMETER=START:STOP:COUNT[:log] of {listed()}"


def command(
    case_file: CaseFile = None,
    x: Annotated[
        str | None, typer.Option("--x", metavar="RANGE", help=f"Horizontal axis, {_RANGE}; map.x without it.")
    ] = None,
    y: Annotated[
        str | None, typer.Option("--y", metavar="RANGE", help="Vertical axis, likewise; map.y without it.")
    ] = None,
    both: Annotated[bool, typer.Option("--both", help="Both continuity laws side by side.")] = False,
    workers: Annotated[
        int | None, typer.Option("--workers", "-w", metavar="N", min=1, help="Processes that share the columns.")
    ] = None,
    output: Output = None,
    plots: PlotFolder = None,
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """Growth rate of the leading mode over two parameters, with the exact onset curves.

    Every cell carries two counts of its unstable modes, by eigenvalues and by the argument principle; where they
    disagree it is uncertain, and hatched. Some cells are solved again with the full matrices (map.checks). Columns are
    put in where onsets appear or vanish (map.refine), and until the onset curves are known between them too; every
    point of a curve is neutral by the full matrices (map.curve).

    With -o every finished column is kept at once: `dbvfiv resume` goes on after Ctrl-C or a crash. Under mpiexec with
    mpi4py the columns are shared among its processes.

    dbvfiv map cases/dbv12.toml --x "pressure=0.5 kPa:20 kPa:64" --y density=1:1000:64:log --workers 2 -o map.h5 --plots
    figures
    """
    from ..stability import stability_map

    case = read_case(case_file, overrides)
    changes = {"map.x": x, "map.y": y, "map.continuity": "both" if both else None, "map.workers": workers}
    changes = {key: value for key, value in changes.items() if value is not None}
    case = case.replace(changes) if changes else case
    result = stability_map(case, case_file.stem if case_file else "dbv12", output, Progress(quiet=as_json))
    report(result, output, plots, as_json)


def report(result, output: Path | None, plots: Path | None, as_json: bool) -> None:
    """Print a finished map, draw it, and leave with the exit status it deserves."""
    figures = result.plot(plots) if plots is not None and result.columns else []
    if as_json:
        print_json(
            result.summary()
            | {"output": str(output) if output else None, "figures": [str(figure) for figure in figures]}
        )
    else:
        print("\n".join(result.lines()))
        print_places(output, figures, plots)
    if not result.complete:
        raise KeyboardInterrupt
