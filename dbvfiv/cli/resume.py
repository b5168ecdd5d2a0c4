"""``dbvfiv resume``: continue an interrupted run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer

from ._options import AsJson, ResultFile
from ._progress import Progress

ORDER = 45


def command(
    file: ResultFile,
    duration: Annotated[Optional[str], typer.Option("--duration", metavar="T", help="New end of the run, 2.0 (s) or '500 ms'.")] = None,
    plots: Annotated[Optional[Path], typer.Option("--plots", metavar="DIR", help="Draw all figures into this folder.")] = None,
    animate: Annotated[Optional[Path], typer.Option("--animate", metavar="FILE.gif", help="Write an animation of the last cycle.")] = None,
    workers: Annotated[Optional[int], typer.Option("--workers", "-w", metavar="N", min=1, help="Of a map: processes that share the columns.")] = None,
    as_json: AsJson = False,
) -> None:
    """Continue a transient run, a stability map, an onset or a closure run that was interrupted or killed, or a finished transient run with a later
    --duration.

    A transient run goes on from the last restart point in the same file, with the same numbers as a run that was never interrupted; a map solves the
    columns that are missing in it, an onset run the values, a closure run the back pressures.
    """
    from ..case.quantity import Quantity
    from ..errors import CaseError
    from ..transient.api import resume
    from .transient import report

    kind = _kind(file)
    others = {"map": "a map", "onset": "an onset run", "closure": "a closure run"}
    if kind in others and (duration is not None or animate is not None):
        raise CaseError(f"--duration and --animate belong to transient runs; this is {others[kind]}.")
    if kind == "closure":
        from ..results.closure_run import resume_closure
        from .closure import report as report_closure

        return report_closure(resume_closure(file, Progress(quiet=as_json)), file, plots, as_json)
    if kind == "onset":
        from ..stability import resume_onset
        from .onset import report as report_onset

        return report_onset(resume_onset(file, Progress(quiet=as_json)), file, plots, as_json)
    if kind == "map":
        from ..stability import resume_map
        from .map import report as report_map

        return report_map(resume_map(file, Progress(quiet=as_json), workers), file, plots, as_json)
    end = None
    if duration is not None:
        try:
            end = Quantity("s", "s").parse(_number_or_text(duration))
        except ValueError as error:
            raise CaseError(f"--duration is given as {duration!r}, {error}.") from None
    result = resume(file, end, Progress(quiet=as_json))
    report(result, file, plots, animate, as_json)


def _kind(path: Path) -> str:
    from ..results.files import reading

    with reading(path) as file:
        return str(file.attrs["dbvfiv_kind"])


def _number_or_text(text: str) -> float | str:
    try:
        return float(text)
    except ValueError:
        return text
