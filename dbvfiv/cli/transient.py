"""``dbvfiv transient``: a time history and its verdict."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ._options import AsJson, CaseFile, Output, Override, PlotFolder, read_case
from ._output import print_json
from ._progress import Progress

ORDER = 40

Animation = Annotated[
    Path | None, typer.Option("--animate", metavar="FILE.gif", help="Write an animation of the last cycle.")
]


def command(
    case_file: CaseFile = None,
    output: Output = None,
    plots: PlotFolder = None,
    animate: Animation = None,
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """Time history of the coupled valve and a verdict: steady, decaying, limit cycle, growing, closed or irregular.

    How the run starts, what drives it, its steps and what ends it are keys of the section transient; `dbvfiv case
    --explain transient` lists them. With -o everything is kept while the run goes on; `dbvfiv resume` continues it
    after Ctrl-C or a crash.

    dbvfiv transient cases/dbv12.toml --set transient.start=kick --set fluid.density=10 -o run.h5
    """
    from ..api import Valve

    case = read_case(case_file, overrides)
    valve = Valve(case, case_file.stem if case_file else "dbv12")
    result = valve.transient(output=output, observer=Progress(quiet=as_json))
    report(result, output, plots, animate, as_json)


def report(result, output: Path | None, plots: Path | None, animate: Path | None, as_json: bool) -> None:
    """Print a finished run, draw it, and leave with the exit status it deserves."""
    from ..errors import SolveError

    figures = result.plot(plots) if plots is not None else []
    if animate is not None:
        figures.append(result.animate(animate))
    if as_json:
        print_json(
            result.summary()
            | {"output": str(output) if output else None, "figures": [str(figure) for figure in figures]}
        )
    else:
        print("\n".join(result.lines()))
        for text in (f"Kept in {output}." if output else "", *(f"Wrote {figure}." for figure in figures)):
            if text:
                print(text)
    if result.failures:
        kept = f"what was found up to there is kept in {output}" if output else "nothing was kept, as no -o was given"
        raise SolveError(f"The run ended early at {result.history['time'][-1]:.6g} s; {kept}.")
    if not result.complete:
        raise KeyboardInterrupt
