"""Interrupted studies go on where their files end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .errors import CaseError
from .observer import Observer
from .record.files import kind_of
from .studies.session import resume_result
from .studies.workers import read_workers

#: What a resumed study may be given anew, the studies that take it, and what it is called in a sentence.
_OWN = {
    "duration": (("transient",), "A new duration belongs to transient runs"),
    "workers": (("map", "uncertainty"), "Workers belong to maps and to samples of an uncertainty"),
}


def resume(
    path: str | Path,
    *,
    duration: float | str | None = None,
    workers: int | str | None = None,
    observer: Observer | None = None,
) -> Any:
    """Continue an interrupted or killed study in its file.

    Parameters
    ----------
    path : path
        Result file; its case says what is still to do.
    duration : number (s) or text with a unit, optional
        Of a transient run: a later end.
    workers : int or str, optional
        Of a map or an uncertainty: processes that share the work, or the address of a Dask scheduler.
    observer : Observer, optional

    Returns
    -------
    StudyResult
        As of the study itself.

    Raises
    ------
    CaseError
        If the file cannot be read, or there is nothing left to do.

    Examples
    --------
    >>> run = dbvfiv.resume("run.h5", duration="2 s")     # doctest: +SKIP
    """
    kind = kind_of(path)
    given = {"duration": duration, "workers": workers}
    for name, value in given.items():
        owners, words = _OWN[name]
        if value is not None and kind not in owners:
            raise CaseError(f"{words}; {str(path)!r} is of kind {kind!r}.")
    changes = {} if duration is None else {"transient.duration": duration}
    return resume_result(path, observer, changes, **({} if workers is None else {"workers": read_workers(workers)}))
