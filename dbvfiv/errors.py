"""Kinds of failure a user can meet, each told in one sentence.

``CaseError`` means the question was wrong (exit status 2), ``SolveError`` that
the question was fine and no answer was found (exit status 1), ``DiskFull`` that
there is no room for the answer (exit status 1).
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

Result = TypeVar("Result")


class CaseError(ValueError):
    """A case, an override or a command-line value that cannot be used.

    Parameters
    ----------
    sentence : str
        One sentence: which key, what was given, what is allowed.
    key : str, optional
        Dotted key in the case, such as ``drive.pressure``.
    line : int, optional
        Line of the TOML file, counted from 1, where it is known.
    """

    def __init__(self, sentence: str, key: str | None = None, line: int | None = None):
        super().__init__(" ".join(str(sentence).split()))
        self.key = key
        self.line = line


class SolveError(RuntimeError):
    """A solution that was not found.

    Parameters
    ----------
    sentence : str
        One sentence: at which pressure or time, and what was tried.
    """

    def __init__(self, sentence: str):
        super().__init__(" ".join(str(sentence).split()))


class JumpError(SolveError):
    """A bracket of growth rates of opposite sign across which they jump, so that no mode is neutral."""


class NotValidError(SolveError):
    """A state that the constants of its rubber do not describe, so that nothing is said of its vibration."""


class DiskFull(RuntimeError):
    """The disk has no room for what a run has found.

    No ``SolveError``: it ends a study, which would go on to the next value after one that was not solved.
    """


def attempt(work: Callable[[], Result]) -> Result:
    """Do some work on a case, with what geometry, mesh and shell refuse as a `CaseError`."""
    try:
        return work()
    except CaseError:
        raise
    except ValueError as error:
        raise CaseError(str(error)) from error


def is_accepted(check: Callable[[], Any]) -> bool:
    """True where a check refuses nothing by a CaseError."""
    try:
        check()
    except CaseError:
        return False
    return True


def as_path(given: Any, what: str) -> Path:
    """Path of a file or folder. Raises CaseError for anything that is no name; `what` begins the sentence."""
    try:
        return Path(given)
    except TypeError:
        raise CaseError(f"{what} is given as {given!r}; it must be the name of a file or folder.") from None
