"""Interrupted studies go on where their files end."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .errors import CaseError
from .studies import KINDS

if TYPE_CHECKING:
    from .observer import Observer
    from .record.result import Result


def resume(
    path: str | Path, *, duration: float | None = None, workers: int | None = None, observer: Observer | None = None
) -> Result:
    """Continue an interrupted or killed study in its file: a transient run, a map, an onset or a closure run.

    Parameters
    ----------
    path : path
        Result file; its case says what is still to do.
    duration : float, optional
        Of a transient run: a later end, s.
    workers : int, optional
        Of a map: processes that share the columns.
    observer : Observer, optional

    Returns
    -------
    Result
        As of the study itself.

    Raises
    ------
    CaseError
        If the file is none of these, or there is nothing left to do.
    """
    from .record.files import kind_of

    kind = kind_of(path)
    if workers is not None and kind != "map":
        raise CaseError(f"Workers belong to maps; {str(path)!r} is of kind {kind!r}.")
    if duration is not None and kind != "transient":
        raise CaseError(f"A new duration belongs to transient runs; {str(path)!r} is of kind {kind!r}.")
    if kind in KINDS:
        from .studies.session import resume_result

        return resume_result(path, observer, **({} if workers is None else {"workers": workers}))
    if kind == "closure":
        from .results.closure_run import resume_closure

        return resume_closure(path, observer)
    from .transient.api import resume as resume_transient

    return resume_transient(path, duration, observer)
