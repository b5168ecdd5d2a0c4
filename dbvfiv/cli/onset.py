"""``dbvfiv onset``: where a state loses stability."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..case.parameters import listed
from ._options import AsJson, CaseFile, Output, Override, PlotFolder, read_case
from ._output import print_json, print_places
from ._progress import Progress

ORDER = 28


def command(
    case_file: CaseFile = None,
    over: Annotated[
        str | None,
        typer.Option(
            "--over",
            metavar="PARAMETER",
            help=f"{listed()}, with =START:STOP:COUNT[:log] for a range of one's own; onset.over without it.",
        ),
    ] = None,
    output: Output = None,
    plots: PlotFolder = None,
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """Every onset along one parameter: value, frequency, super- or subcritical, uncertainty of the mesh.

    All crossings of the range are looked for, also tongues of instability that close again. Each is located with the
    full matrices, confirmed by direct eigenvalues and independent counts on both sides, described by its first Lyapunov
    coefficient (onset.normal_form), and found again on a coarser mesh for an uncertainty (onset.coarse_mesh).

    With -o every value of the scan and every onset is kept at once: `dbvfiv resume` goes on after Ctrl-C or a crash.

    dbvfiv onset cases/dbv12.toml --over density --set drive.pressure="6 kPa"
    """
    from ..stability import onset

    case = read_case(case_file, overrides)
    if over is not None:
        case = case.replace({"onset.over": over})
    result = onset(case, case_file.stem if case_file else "dbv12", output, Progress(quiet=as_json))
    report(result, output, plots, as_json)


def report(result, output: Path | None, plots: Path | None, as_json: bool) -> None:
    """Print finished onsets, draw them, and leave with the exit status they deserve."""
    from ..errors import SolveError

    figures = result.plot(plots) if plots is not None and len(result.values) else []
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
    if result.failures:
        raise SolveError(
            f"Parts of the range were not reached: {len(result.failures)} states failed."
        )  # why was said when it happened
