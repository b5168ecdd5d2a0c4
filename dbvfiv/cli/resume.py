"""``dbvfiv resume``: continue an interrupted run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from ._options import AsJson, PlotFolder, ResultFile
from ._progress import Progress
from ._study import report

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
    from ..case.quantity import Quantity
    from ..errors import CaseError
    from ..record.files import kind_of
    from ..resuming import resume

    kind = kind_of(file)
    if animate is not None and kind != "transient":
        raise CaseError(f"--animate belongs to transient runs; {str(file)!r} is of kind {kind!r}.")

    end = None
    if duration is not None:
        try:
            end = Quantity("s", "s").parse(_number_or_text(duration))
        except ValueError as error:
            raise CaseError(f"--duration is given as {duration!r}, {error}.") from None
    result = resume(file, duration=end, workers=workers, observer=Progress(quiet=as_json))
    films = animate is not None and result.drawable
    report(result, file, plots, as_json, further=_film_into(animate) if films else None)


def _film_into(path: Path) -> Callable[[Any], list[Path]]:
    return lambda result: [result.animate(path)]


def _number_or_text(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text
