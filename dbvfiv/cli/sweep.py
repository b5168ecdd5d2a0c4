"""``dbvfiv sweep``: modes tracked along a parameter."""

from __future__ import annotations

from typing import Annotated

import typer

from ..case.parameters import SWEPT, listed
from ._options import AsJson, CaseFile, Output, Override, PlotFolder, read_case
from ._output import print_json, print_places
from ._progress import Progress
from .modes import number_or_text

ORDER = 26


def command(
    case_file: CaseFile = None,
    over: Annotated[
        str | None,
        typer.Option(
            "--over",
            metavar="RANGE",
            help=f"PARAMETER=START:STOP:COUNT[:log] of {listed(SWEPT)}; sweep.over without it.",
        ),
    ] = None,
    pressure: Annotated[
        str | None,
        typer.Option("--pressure", "-p", metavar="P", help="Static inlet pressure in place of drive.pressure."),
    ] = None,
    density: Annotated[
        str | None, typer.Option("--density", metavar="RHO", help="Fluid density in place of fluid.density.")
    ] = None,
    count: Annotated[
        int | None, typer.Option("--count", "-n", metavar="N", help="How many leading modes to follow.")
    ] = None,
    output: Output = None,
    plots: PlotFolder = None,
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """Damping and frequency of the leading modes, followed along a parameter of load, fluid or damping.

    Each mode keeps its number through crossings; "confidence" says how sure each match is. Over density, alpha and beta
    the equilibrium stays and modes are found on a reduced basis that full solves confirm. Ctrl-C keeps what is done.

    dbvfiv sweep cases/dbv12.toml -p "6 kPa" --set damping.alpha=0 --over density=1:1000:40:log -o sweep.h5 --plots
    figures
    """
    from ..api import Valve
    from ..errors import SolveError
    from ..results.sweep_table import head, row_of

    case = read_case(case_file, overrides)
    if over is not None:
        case = case.replace({"sweep.over": over})
    valve = Valve(case, case_file.stem if case_file else "dbv12")
    rows = _Rows(None if as_json else head(case.sweep.axis.parameter), row_of)
    observer = Progress(quiet=as_json, row=None if as_json else rows)
    result = valve.sweep(
        count=count,
        output=output,
        observer=observer,
        pressure=number_or_text(pressure),
        density=number_or_text(density),
    )
    figures = result.plot(plots) if plots is not None and result.branches else []
    if as_json:
        print_json(
            result.summary()
            | {"output": str(output) if output else None, "figures": [str(figure) for figure in figures]}
        )
    else:
        print("\n".join(result.lines()[2 + len(result.values) :]))
        print_places(output, figures, plots)
    if result.failures:
        kept = f"; they are kept in {output}" if output else ""
        raise SolveError(
            f"{len(result.values)} of {len(result.axis.values)} values were reached{kept}."
        )  # why was said when it happened
    if not result.complete:
        raise KeyboardInterrupt


class _Rows:
    """Rows for values, the head before the first; nothing for the steady state on the way."""

    def __init__(self, head, row_of):
        self._head, self._row_of = head, row_of

    def __call__(self, item) -> str:
        if not hasattr(item, "unstable_count"):
            return f"Steady state at {item.pressure:.6g} Pa."
        row = self._row_of(item)
        if self._head:
            row, self._head = "\n".join([*self._head, row]), None
        return row
