"""Display of a running study: a bar on standard error, rows on standard output, warnings as they come."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Any

from ..observer import Observer


class Progress(Observer):
    """A bar on standard error where that is a terminal; warnings on standard error in any case.

    Parameters
    ----------
    quiet : bool
        Never show a bar.
    row : callable, optional
        Makes a line for standard output from each item.
    """

    def __init__(self, quiet: bool = False, row: Callable[[Any], str] | None = None):
        self._show = not quiet and sys.stderr.isatty()
        self._row = row
        self._bar = None
        self._said: set[str] = set()

    def begin(self, study: str, total: int | None) -> None:
        if self._show:
            from tqdm import tqdm

            self._bar = tqdm(total=total, desc=study, file=sys.stderr, leave=False, dynamic_ncols=True, mininterval=0.2)

    def progress(self, text: str) -> None:
        if self._bar is not None:
            self._bar.set_postfix_str(text)

    def item(self, result: object) -> None:
        if self._row is not None:
            self._print(self._row(result), sys.stdout)
        if self._bar is not None:
            self._bar.update()

    def warn(self, sentence: str) -> None:
        if sentence not in self._said:
            self._said.add(sentence)
            self._print(f"Warning: {sentence}", sys.stderr)

    def end(self, interrupted: bool) -> None:
        if self._bar is not None:
            self._bar.close()
            self._bar = None

    def _print(self, text: str, file: Any) -> None:
        if self._bar is not None:
            self._bar.clear()
        print(text, file=file, flush=True)
        if self._bar is not None:
            self._bar.refresh()
