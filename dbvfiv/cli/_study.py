"""Commands of the studies: each brings its own options, and here is what they share."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any, get_type_hints

from ..errors import SolveError
from ..studies import KINDS
from ._options import AsJson, CaseFile, Output, Override, PlotFolder, read_case
from ._output import print_json, print_places
from ._progress import Progress

#: What a command of a study may take from what all share.
_SHARED = ("case", "plots")


def study_commands() -> list[tuple[str, ModuleType]]:
    """Names and command modules of all studies."""
    return [(kind, import_module(f"..studies.{kind}.command", __package__)) for kind in KINDS]


def make_command(kind: str, module: ModuleType) -> Callable[..., None]:
    """A command with the options of a study between the case file and what all studies share."""
    hints = get_type_hints(module.command, include_extras=True)
    own = [p for name, p in inspect.signature(module.command).parameters.items() if name not in _SHARED]

    taken = [name for name in inspect.signature(module.command).parameters if name in _SHARED]

    def command(
        case_file: Path | None, output: Path | None, plots: Path | None, overrides, as_json: bool, **given: Any
    ) -> None:
        case = read_case(case_file, overrides)
        shared = {"case": case, "plots": plots}
        request = module.command(**{name: shared[name] for name in taken}, **given)
        changes = {key: value for key, value in request.changes.items() if value is not None}
        choices = {name: value for name, value in request.choices.items() if value is not None}
        # what is heavy to import is loaded when a case has been read
        from ..studies.session import Session
        from ..studies.study import find_study

        session = Session(case.replace(changes) if changes else case, case_file.stem if case_file else "dbv12")
        session.mesh  # a case that gives no model is told before a table begins
        live = None if as_json else find_study(kind).live
        progress = Progress(quiet=as_json, row=live and live(session.case))
        result = session.perform(kind, output, progress, **choices)
        report(result, output, plots, as_json, further=request.further, printed=live is not None)

    shared_last = (("output", Output, None), ("plots", PlotFolder, None), ("overrides", Override, None))
    parameters = [
        _parameter("case_file", CaseFile, None),
        *(p.replace(annotation=hints[p.name], kind=p.KEYWORD_ONLY) for p in own),
        *(_parameter(*one) for one in shared_last),
        _parameter("as_json", AsJson, False),
    ]
    command.__signature__ = inspect.Signature(parameters)
    command.__annotations__ = {p.name: p.annotation for p in parameters}
    command.__doc__ = module.command.__doc__
    return command


def _parameter(name: str, annotation: Any, default: Any) -> inspect.Parameter:
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default, annotation=annotation)


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
        lines = result.remarks() if printed else result.lines()
        if lines:
            print("\n".join(lines))
        print_places(output, figures, plots)
    if result.interrupted:
        raise KeyboardInterrupt
    shortfall = result.shortfall()
    if shortfall is not None:
        raise SolveError(f"{shortfall}.")  # why was said when it happened
