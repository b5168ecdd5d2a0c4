"""One writer for a result file: whoever comes second is told before anything is touched."""

from __future__ import annotations

import errno
import fcntl
import os
from pathlib import Path
from time import sleep

from ..errors import CaseError

#: Readers that ask whether a file is being written hold it for an instant: so often a writer tries, s apart.
_TRIES, _PAUSE = 5, 0.02
#: What a file system says that knows no files without a name.
_NO_NAMELESS = (errno.EOPNOTSUPP, errno.EISDIR, errno.EINVAL, errno.ENOENT)


class WriterLock:
    """The right to write a result of some name, held by this process until it is released or the process ends.

    An empty file takes the name where there was none. The lock sits on the file that has the name, so it moves to the
    new file when that takes the old one's place (`move`).

    Parameters
    ----------
    path : path

    Raises
    ------
    CaseError
        If another process holds it, or the folder cannot be written.
    """

    def __init__(self, path: Path):
        self.path = path
        self._descriptor = self._taken()

    def _taken(self) -> int:
        while True:
            try:
                descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
            except OSError as error:
                raise _unwritable(self.path, error) from None
            try:
                _lock(descriptor, self.path)
                if os.path.samestat(os.stat(self.path), os.fstat(descriptor)):
                    return descriptor
            except FileNotFoundError:  # replaced or removed meanwhile
                pass
            except BaseException:
                os.close(descriptor)
                raise
            os.close(descriptor)

    def move(self, new: Path) -> None:
        """Let a finished file take the name, and hold it instead."""
        descriptor = os.open(new, os.O_RDWR)
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        os.replace(new, self.path)
        os.close(self._descriptor)
        self._descriptor = descriptor

    def release(self) -> None:
        """Let others write; an empty file that only held the name goes."""
        if self._descriptor < 0:
            return
        try:
            if os.fstat(self._descriptor).st_size == 0 and self.path.exists():
                self.path.unlink()
        finally:
            os.close(self._descriptor)
            self._descriptor = -1


def check_free(path: Path) -> None:
    """Make sure that a result may be written under a name, and leave everything as it is.

    Raises
    ------
    CaseError
        If another process writes it, or the file or its folder cannot be written.
    """
    try:
        if path.exists():
            descriptor = os.open(path, os.O_RDWR)
            try:
                _lock(descriptor, path)
            finally:
                os.close(descriptor)
        _check_folder(path.absolute().parent)
    except OSError as error:
        raise _unwritable(path, error) from None


def _check_folder(folder: Path) -> None:
    """Try a file without a name in a folder, or in the nearest that there is: nothing can stay behind of it."""
    while not folder.exists():
        folder = folder.parent
    if not folder.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, f"{str(folder)!r} is not a folder")
    try:
        os.close(os.open(folder, os.O_TMPFILE | os.O_RDWR, 0o600))
    except OSError as error:
        if error.errno not in _NO_NAMELESS:
            raise
        if not os.access(folder, os.W_OK | os.X_OK):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES)) from None


def _lock(descriptor: int, path: Path) -> None:
    for left in reversed(range(_TRIES)):
        try:
            return fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if not left:
                raise CaseError(
                    f"{str(path)!r} is being written by another process; wait for it or choose another name."
                ) from None
            sleep(_PAUSE)


def _unwritable(path: Path, error: OSError) -> CaseError:
    return CaseError(f"The result file {str(path)!r} cannot be written ({error.strerror}).")


def is_being_written(path: Path) -> bool:
    """True where a process holds the right to write a file."""
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except OSError:
        return True
    finally:
        os.close(descriptor)
    return False
