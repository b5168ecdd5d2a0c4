"""A run that is in its file already is not made again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..errors import CaseError
from ..observer import Observer
from .session import Session, load_result, resume_result


def kept_run(kind: str, session: Session, path: Path, observer: Observer | None = None, **choices: Any) -> Any:
    """The result of a study: from its file where that holds the same case, else computed into it.

    Parameters
    ----------
    kind : str
        Of the study.
    session : Session
    path : path
        Result file. One of another case is written over.
    observer : Observer, optional
    choices
        What the study takes that is no key of the case.

    Raises
    ------
    KeyboardInterrupt
        If the run was interrupted; what was found is in the file.
    CaseError, SolveError
    """
    session = session.settle(observer)
    kept = _load(path)
    if kept is not None and kept.kind == kind and kept.case == session.case:
        if kept.complete or kept.failures:
            return kept
        result = resume_result(path, observer, **choices)
    else:
        result = session.perform(kind, path, observer, **choices)
    if result.interrupted and not result.failures:
        raise KeyboardInterrupt
    return result


def _load(path: Path) -> Any:
    try:
        return load_result(path) if path.exists() else None
    except CaseError:  # of another version, or no result at all
        return None
