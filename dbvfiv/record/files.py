"""Opening result files, and the names that they may take; whatever is wrong with one is told in a sentence."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import sleep

import h5py

from ..errors import CaseError
from .layout import LAYOUT
from .lock import check_free, is_being_written

#: A file that is being written is tried this often, s apart.
_TRIES, _PAUSE = 40, 0.02
#: What broken or foreign HDF5 files make h5py and the readers raise.
_BROKEN = (OSError, KeyError, RuntimeError, ValueError, TypeError, IndexError, AttributeError, MemoryError)


@contextmanager
def reading(path: str | Path) -> Iterator[h5py.File]:
    """An open result file; also one that another process is still writing.

    Raises
    ------
    CaseError
        If there is no such file, it is no result of this program, comes from a newer version, or is damaged.
    """
    path = Path(path)
    if path.is_dir():
        raise CaseError(f"{str(path)!r} is a folder and not a result file.")
    if not path.exists():
        raise CaseError(f"The result file {str(path)!r} does not exist.")
    _refuse_empty(path)
    try:
        file = _opened(path)
    except PermissionError:
        raise CaseError(f"The result file {str(path)!r} may not be read by this user.") from None
    except _BROKEN as error:
        if "truncated" in str(error):
            raise CaseError(f"{str(path)!r} is cut short, so nothing can be read from it.") from error
        if h5py.is_hdf5(path):
            raise CaseError(
                f"The result file {str(path)!r} cannot be opened; it is damaged or open for writing in this process."
            ) from error
        raise CaseError(f"{str(path)!r} is not a result file, because it is not HDF5.") from error
    with file:
        try:
            kind, layout = str(file.attrs["dbvfiv_kind"]), int(file.attrs["layout"])
        except _BROKEN as error:
            raise CaseError(f"{str(path)!r} is an HDF5 file but not a result of dbvfiv.") from error
        if layout > LAYOUT:
            raise CaseError(
                f"{str(path)!r} has file layout {layout} and this version reads up to {LAYOUT}; "
                f"it was written by {file.attrs.get('program', 'a newer program')}."
            )
        if layout < LAYOUT:
            raise CaseError(
                f"{str(path)!r} was written by an older program ({file.attrs.get('program', 'unknown')}) and this "
                f"version cannot read it; make it anew with '{file.attrs.get('command', f'dbvfiv {kind}')}'."
            )
        try:
            yield file
        except CaseError:
            raise
        except _BROKEN as error:
            detail = " ".join(str(error).split())[:120].rstrip(".")
            raise CaseError(
                f"The {kind} result {str(path)!r} is damaged or cut short ({type(error).__name__}: {detail})."
            ) from error


def _refuse_empty(path: Path) -> None:
    """An empty file holds the name of a run that has not begun."""
    if path.stat().st_size:
        return
    if is_being_written(path):
        raise CaseError(f"{str(path)!r} holds nothing yet, because its run is about to begin.")
    raise CaseError(
        f"{str(path)!r} is empty: if it is of a run, that was stopped before it began; a new run may take its name."
    )


def kind_of(path: str | Path) -> str:
    """Kind of study that a result file is of: "steady", "map", "transient" and so on.

    Raises
    ------
    CaseError
        As `reading`.
    """
    with reading(path) as file:
        return str(file.attrs["dbvfiv_kind"])


def _opened(path: Path) -> h5py.File:
    """A file for reading; one in single-writer mode also while it is written, or after its writer was killed."""
    ended = False
    for _ in range(_TRIES):
        try:
            return h5py.File(path, "r", locking=False)
        except PermissionError:
            raise
        except OSError as error:
            plain = error
        if ended:
            break
        marked = _marked_as_open(path)  # reading a cut file as a growing one would never end
        if marked:
            try:
                return h5py.File(path, "r", locking=False, libver="latest", swmr=True)
            except OSError:
                pass
        # its writer may have closed it since it was tried first, so a file without one is tried once more
        ended = not marked or not is_being_written(path)
        sleep(_PAUSE)  # caught between two writes of the same instant
    raise plain


def _marked_as_open(path: Path) -> bool:
    """True where the file's superblock (version 3) says that a writer has not closed it."""
    with open(path, "rb") as file:
        head = file.read(12)
    return len(head) == 12 and head[8] == 3 and bool(head[11] & 0b101)


def check_writable(path: str | Path) -> None:
    """Make sure that a result may take this name, before anything is computed.

    Raises
    ------
    CaseError
        If it may not.
    """
    path = Path(path)
    if not path.is_dir():
        check_free(path)  # first: a file that is being written is a result, however it reads at this instant
    refuse_foreign(path)


def refuse_foreign(path: Path) -> None:
    """Check that a result may take this name.

    Raises
    ------
    CaseError
        If it is the name of a folder or of a file that is no result.
    """
    if path.is_dir():
        raise CaseError(f"{str(path)!r} is a folder; the result needs the name of a file.")
    if path.exists() and path.stat().st_size and not _replaceable(path):
        raise CaseError(
            f"{str(path)!r} exists and is not a result of dbvfiv, so it is not overwritten; choose another name."
        )


def _replaceable(path: Path) -> bool:
    if not h5py.is_hdf5(path):
        return False
    try:
        with _opened(path) as file:
            return "dbvfiv_kind" in file.attrs
    except _BROKEN:
        return path.suffix in (".h5", ".hdf5")  # HDF5 cut short
