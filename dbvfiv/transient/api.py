"""Runs from a case, with or without a file, and their continuation."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..errors import CaseError
from ..observer import Observer, Observers
from ..record.files import reading
from ..record.header import Header, read_header
from .file import TransientFile, read_restart
from .history import PROFILES, SCALARS, History
from .result import TransientResults
from .run import Runner

if TYPE_CHECKING:
    from ..model import ValveModel


def transient(
    model: ValveModel, name: str = "case", output: str | Path | None = None, observer: Observer | None = None
) -> TransientResults:
    """Run the case of a model; see `dbvfiv.transient.run`.

    Parameters
    ----------
    output : path, optional
        Result file, written while the run goes on.

    Raises
    ------
    CaseError
        If the file cannot be written or the stored state to start from not be used.
    SolveError
        If there is no first state.
    """
    observer = observer or Observer()
    header = Header.of("transient", model.case, name)
    if output is None:
        return TransientResults.of(Runner(model, observer=observer).start(), header)
    with TransientFile(output, model, header) as file:
        run = Runner(model, observer=Observers(file, observer), keeper=file).start()
        file.conclude(run)
    return TransientResults.of(run, header, Path(output))


def resume(path: str | Path, duration: float | None = None, observer: Observer | None = None) -> TransientResults:
    """Continue an interrupted or killed run from its last restart point, or a finished one to a later end.

    The numbers are those of an uninterrupted run.

    Parameters
    ----------
    duration : float, optional
        New end, s; that of the case by default.

    Raises
    ------
    CaseError
        If the file is no transient run or has nothing left to do.
    """
    from ..model import ValveModel

    observer = observer or Observer()
    restart = read_restart(path)
    with reading(path) as file:
        header = read_header(file)
        if restart is None:  # killed before its first step was safe
            case = header.rebuildable_case()
            return transient(
                ValveModel(case if duration is None else case.replace({"transient.duration": duration})),
                header.name,
                path,
                observer,
            )
        columns = {c.name: file["history"][c.name][: restart.rows] for c in (*SCALARS, *PROFILES)}
    case = header.rebuildable_case()
    if duration is not None:
        case = case.replace({"transient.duration": duration})
    if columns["time"][-1] >= case.transient.duration * (1 - 1e-12) - 1e-9 * case.transient.step:
        raise CaseError(
            f"The run in {str(path)!r} has reached its end at {columns['time'][-1]:.6g} s; give a later one "
            f"with --duration."
        )
    model = ValveModel(case)
    history = History(model.stations)
    history.restore({name: np.asarray(values) for name, values in columns.items()})
    header = Header(**{**vars(header), "case": case, "complete": False})
    file, restart = TransientFile.reopen(path, model, header)
    with file:
        run = Runner(model, observer=Observers(file, observer), keeper=file).resume(history, restart.numbers)
        file.conclude(run)
    return TransientResults.of(run, header, Path(path))
