"""A study runs, and its result is reported."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...errors import SolveError
from ...studies.case import Case, load_case
from ...studies.request import Request
from ...studies.session import Session
from ...studies.study import find_study
from .._output import print_json, print_places
from .._progress import Progress


def read_case(path: Path | None, overrides: list[str] | None) -> Case:
    """Load the case a command was given.

    Raises
    ------
    CaseError
    """
    return load_case(path, overrides or ())


def perform(kind: str, case: Case, request: Request, name: str, output: Path | None, plots: Path | None, as_json: bool):
    """Run a study on a case with what its command asks for, and report it."""
    changes = {key: value for key, value in request.changes.items() if value is not None}
    choices = {key: value for key, value in request.choices.items() if value is not None}
    session = Session(case, name).replace(changes)
    session.mesh  # a case that gives no model is told before a table begins
    live = None if as_json else find_study(kind).live
    progress = Progress(quiet=as_json, row=live and live(session.case))
    result = session.perform(kind, output, progress, **choices)
    report(result, output, plots, as_json, further=request.further, printed=live is not None)


def report(
    result: Any,
    output: Path | None,
    plots: Path | None,
    as_json: bool,
    further: Callable[[Any], list[Path]] | None = None,
    printed: bool = False,
) -> None:
    """Print a result, draw it, and leave with the exit status it deserves.

    Parameters
    ----------
    result : StudyResult
    further : callable, optional
        Writes further files.
    printed : bool
        Whether its table was printed row by row already.

    Raises
    ------
    KeyboardInterrupt
        If the run was interrupted.
    SolveError
        If something was not reached.
    """
    figures = result.plot(plots) if plots is not None and result.drawable else []
    figures += further(result) if further else []
    if as_json:
        places = {"output": str(output) if output else None, "figures": [str(figure) for figure in figures]}
        print_json(result.summary() | places)
    else:
        lines = [*(result.remarks() if printed else result.lines()), *filter(None, [result.record.settled])]
        if lines:
            print("\n".join(lines))
        print_places(output, figures, plots)
    if result.interrupted:
        raise KeyboardInterrupt
    shortfall = result.shortfall()
    if shortfall is not None:
        raise SolveError(f"{shortfall}.")  # why was said when it happened
