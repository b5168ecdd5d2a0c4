"""Opening result files, for writing and for reading; whatever is wrong with one is told in a sentence."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from time import sleep
from typing import Self

import h5py

from ..errors import CaseError
from .layout import LAYOUT
from .lock import is_being_written

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


class KeptFile:
    """A result file that is open while a study runs, as `_file`; leaving the context closes it."""

    _file: h5py.File

    def close(self) -> None:
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()


def kind_of(path: str | Path) -> str:
    """Which study a result file is of: "steady", "map", "transient" and so on.

    Raises
    ------
    CaseError
        As `reading`.
    """
    with reading(path) as file:
        return str(file.attrs["dbvfiv_kind"])


def _opened(path: Path) -> h5py.File:
    """A file for reading; one in single-writer mode also while it is written, or after its writer was killed."""
    for _ in range(_TRIES):
        try:
            return h5py.File(path, "r", locking=False)
        except PermissionError:
            raise
        except OSError as error:
            plain = error
        if not _marked_as_open(path):  # reading a cut file as a growing one would never end
            raise plain
        try:
            return h5py.File(path, "r", locking=False, libver="latest", swmr=True)
        except OSError:
            if not is_being_written(path):
                raise plain from None
        sleep(_PAUSE)  # caught between two writes of the same instant
    raise plain


def _marked_as_open(path: Path) -> bool:
    """Whether the file's superblock (version 3) says that a writer has not closed it."""
    with open(path, "rb") as file:
        head = file.read(12)
    return len(head) == 12 and head[8] == 3 and bool(head[11] & 0b101)


def create(path: str | Path, single_writer: bool = False) -> h5py.File:
    """A new result file; an earlier result of the same name is replaced, any other file is left alone.

    Parameters
    ----------
    single_writer : bool
        Prepare the file for HDF5's single-writer mode, in which being killed never breaks it.

    Raises
    ------
    CaseError
    """
    path = Path(path)
    refuse_foreign(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        file = h5py.File(path, "w", libver="latest" if single_writer else None)
    except OSError as error:
        if "lock" in str(error):
            raise CaseError(f"{str(path)!r} is being written by another process; choose another name.") from None
        reason = (getattr(error, "strerror", None) or "the folder may not be written").split(" (", 1)[-1].strip("()")
        raise CaseError(f"The result file {str(path)!r} cannot be written ({_short(reason)}).") from None
    if not single_writer:
        _hold_back_metadata(file)
    return file


def check_writable(path: str | Path) -> None:
    """Make sure that a result may take this name, before anything is computed.

    Raises
    ------
    CaseError
        As `create`.
    """
    path = Path(path)
    refuse_foreign(path)
    trial = path.with_name(f".{path.name}.trial")
    try:
        _create_beside(trial, path).close()
    finally:
        if trial.parent.is_dir():
            trial.unlink(missing_ok=True)


@contextmanager
def writing(path: str | Path) -> Iterator[h5py.File]:
    """A result file that takes its name when it is complete; whoever is killed before leaves what was there.

    Raises
    ------
    CaseError
        As `create`.
    """
    path = Path(path)
    refuse_foreign(path)
    new = path.with_name(f".{path.name}.new")
    try:
        with _create_beside(new, path) as file:
            yield file
        os.replace(new, path)
    finally:
        new.unlink(missing_ok=True)


def _create_beside(new: Path, path: Path) -> h5py.File:
    """A file under another name, with errors that speak of the name it is to have."""
    try:
        return create(new)
    except CaseError as error:
        raise CaseError(str(error).replace(str(new), str(path))) from None


def reopen(path: str | Path) -> h5py.File:
    """The result file of an interrupted run, to go on writing into it.

    Raises
    ------
    CaseError
    """
    try:
        file = h5py.File(path, "r+")
    except OSError as error:
        raise CaseError(
            f"The result file {str(path)!r} cannot be opened for writing ({error.strerror or error})."
        ) from error
    _hold_back_metadata(file)
    return file


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


def _short(reason: str) -> str:
    if "errno" in reason:
        return reason.split("error message = ")[-1].split(",")[0].strip("'\" ")
    return " ".join(reason.split())[:120].rstrip(".")


def _hold_back_metadata(file: h5py.File) -> None:
    """Let the file's structure reach the disk at flushes only, so that being killed between them does no harm."""
    settings = file.id.get_mdc_config()
    settings.evictions_enabled = False
    settings.incr_mode = settings.flash_incr_mode = settings.decr_mode = 0
    file.id.set_mdc_config(settings)
