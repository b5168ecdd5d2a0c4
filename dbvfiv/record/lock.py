"""One writer for a result file: whoever comes second is told before anything is touched."""

from __future__ import annotations

import fcntl
import os
from pathlib import Path

from ..errors import CaseError


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
                raise CaseError(f"The result file {str(self.path)!r} cannot be written ({error.strerror}).") from None
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
                named = os.stat(self.path)
            except FileNotFoundError:  # replaced or removed meanwhile
                os.close(descriptor)
                continue
            except OSError:
                os.close(descriptor)
                raise CaseError(
                    f"{str(self.path)!r} is being written by another process; wait for it or choose another name."
                ) from None
            if os.path.samestat(named, os.fstat(descriptor)):
                return descriptor
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


def is_being_written(path: Path) -> bool:
    """Whether a process holds the right to write a file."""
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
