"""Reports of a running study to the outside: progress bars, files and plots are observers."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from typing import Any

from .effects import with_effect


class Observer:
    """Does nothing; override what is of interest. Any method may raise KeyboardInterrupt to stop a run between two
    steps.
    """

    def begin(self, study: str, total: int | None) -> None:
        """A study starts; `total` items are expected if that is known."""

    def progress(self, text: str) -> None:
        """A step inside an item was made."""

    def item(self, result: object) -> None:
        """An item (a state, a mode, a step) is finished."""

    def warn(self, sentence: str) -> None:
        """Something the user should know, though the run goes on."""

    def end(self, interrupted: bool) -> None:
        """The study is over."""


def is_watched() -> bool:
    """True where standard error is a terminal or a notebook, or read by a program that sets ``DBVFIV_BAR``."""
    return sys.stderr.isatty() or "ipykernel" in sys.modules or bool(os.environ.get("DBVFIV_BAR"))


class Progress(Observer):
    """A bar on standard error where that is a terminal or a notebook; warnings on standard error in any case.

    Parameters
    ----------
    quiet : bool
        Never show a bar.
    row : callable, optional
        Makes a line for standard output from each item.
    say : callable
        Puts the numbers of a line into the units of choice.
    """

    def __init__(self, quiet: bool = False, row: Callable[[Any], str] | None = None, say: Callable[[str], str] = str):
        self._show = not quiet and is_watched()
        self._row, self._say = row, say
        self._bar = None
        self._warned: set[str] = set()

    def begin(self, study: str, total: int | None) -> None:
        if self._show:
            from tqdm import tqdm

            self._bar = tqdm(total=total, desc=study, file=sys.stderr, leave=False, dynamic_ncols=True, mininterval=0.2)

    def progress(self, text: str) -> None:
        if self._bar is not None:
            self._bar.set_postfix_str(self._say(text))

    def item(self, result: object) -> None:
        if self._row is not None:
            self._print(self._row(result), sys.stdout)
        if self._bar is not None:
            self._bar.update()

    def warn(self, sentence: str) -> None:
        if sentence not in self._warned:
            self._warned.add(sentence)
            self._print(f"Warning: {with_effect(sentence)}", sys.stderr)

    def end(self, interrupted: bool) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def _print(self, text: str, file: Any) -> None:
        if self._bar is not None:
            self._bar.clear()
        print(self._say(text), file=file, flush=True)
        if self._bar is not None:
            self._bar.refresh()
