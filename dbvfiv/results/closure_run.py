"""Back-pressure runs from a case, with or without a file, and their continuation."""

from __future__ import annotations

from pathlib import Path

from ..case.model import Case
from ..errors import CaseError
from ..observer import Observer, Observers
from ..record.files import reading
from ..record.header import Header, read_header
from ..record.layout import read_texts
from ..studies.closing import run_closing
from ..studies.closure import run_closure
from ..studies.closure_model import ClosureModel, closure_model
from .closure import ClosureResults
from .closure_file import ClosureFile
from .registry import load_result


def start_closure(
    case: Case, name: str, in_time: bool = False, output: str | Path | None = None, observer: Observer | None = None
) -> ClosureResults:
    """States at the back pressures of a case and, with `in_time`, the turn of its drive.

    Parameters
    ----------
    output : path, optional
        Result file, written state by state.

    Raises
    ------
    CaseError
        If the case gives no model or the file cannot be written.
    """
    observer = observer or Observer()
    model, header = _model(case), Header.of("closure", case, name)
    if output is None:
        result = run_closure(case, observer=observer, model=model)
        return ClosureResults.of(
            result, header, run_closing(case, observer) if in_time and not result.interrupted else None
        )
    closing = None
    with ClosureFile(output, model, header, in_time) as file:
        result = run_closure(case, observer=Observers(file, observer), model=model, keeper=file)
        file.conclude(result, complete=not (result.interrupted or in_time))
        if in_time and not result.interrupted:
            closing = run_closing(case, observer)
            file.keep_closing(closing)
    return ClosureResults.of(result, header, closing)


def resume_closure(path: str | Path, observer: Observer | None = None) -> ClosureResults:
    """Continue an interrupted or killed run from its last state; a turn of the drive in time that was cut short begins
    anew.

    The states are those of an uninterrupted run.

    Raises
    ------
    CaseError
        If the file is no back-pressure run or has nothing left to do.
    """
    observer = observer or Observer()
    with reading(path) as file:
        header = read_header(file)
        if header.kind != "closure":
            raise CaseError(f"{str(path)!r} is no back-pressure run but one of kind {header.kind!r}.")
        if header.complete:
            raise CaseError(f"The run in {str(path)!r} went to its end, so nothing is left to do.")
        in_time, reached = bool(file.attrs["in_time"]), int(file["states"].attrs["rows"])
        failures = read_texts(file, "messages/failures")
    case = header.rebuildable_case()
    if not reached:
        return start_closure(case, header.name, in_time, path, observer)
    left = () if failures else case.closure.pressures[reached:]
    model, interrupted = _model(case), False
    with ClosureFile(path, model, again=True) as file:
        if left:
            result = run_closure(
                case, left, observer=Observers(file, observer), model=model, keeper=file, restart=file.restart()
            )
            interrupted = result.interrupted
            file.conclude(result, complete=not (interrupted or in_time))
        else:
            file.finish((), (), (), (), failures, complete=not in_time)
        if in_time and not interrupted:
            file.keep_closing(run_closing(case, observer))
    return load_result(path)


def _model(case: Case) -> ClosureModel:
    try:
        return closure_model(case)
    except CaseError:
        raise
    except ValueError as error:  # what geometry, mesh and shell refuse
        raise CaseError(str(error)) from error
