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
    if duration is not None and kind != "transient":
        raise CaseError(f"A new duration belongs to transient runs; {str(path)!r} is of kind {kind!r}.")
    if kind in KINDS:
        from .studies.session import resume_result

        return resume_result(path, observer, {} if duration is None else {"transient.duration": duration})
    if kind not in ("map", "onset"):
        raise CaseError(
            f"{str(path)!r} holds a result of kind {kind!r}; what can be resumed are transient, map, onset "
            f"and closure runs."
        )
    if kind == "map":
        from .stability import resume_map

        return resume_map(path, observer, workers)
    if kind == "onset":
        from .stability import resume_onset

        return resume_onset(path, observer)
