"""Time series from text files: columns separated by commas, semicolons, tabs or blanks, with or without a header."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np


@dataclass(frozen=True)
class Table:
    """Columns of numbers.

    Attributes
    ----------
    names : tuple of str
        From the header, or "column 1", ...
    values : (rows, columns) array
    """

    names: tuple[str, ...]
    values: np.ndarray

    def index(self, wanted: str) -> int:
        """Column by name, part of a name or number from 1.

        Raises
        ------
        ValueError
        """
        exact = [i for i, name in enumerate(self.names) if name.lower() == wanted.lower()]
        part = [i for i, name in enumerate(self.names) if wanted.lower() in name.lower()]
        if exact or len(part) == 1:
            return (exact or part)[0]
        if wanted.isdigit() and 1 <= int(wanted) <= len(self.names):
            return int(wanted) - 1
        raise ValueError(f"There is no column {wanted!r}; there are {', '.join(self.names)}")


def read_table(path: str | Path) -> Table:
    """Read a text file of numbers; text after ``#`` and empty lines are skipped.

    Raises
    ------
    ValueError
        One clause: which line does not fit.
    OSError
        If the file cannot be read.
    """
    names: tuple[str, ...] = ()
    rows: list[list[float]] = []
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except UnicodeDecodeError:
        raise ValueError("it is not a text file") from None
    for number, line in enumerate(text.splitlines(), 1):
        words = _words(line.split("#")[0])
        if not words:
            continue
        try:
            row = [float(word) for word in words]
        except ValueError:
            if rows or names:
                raise ValueError(f"line {number} holds {' '.join(words)[:40]!r}, which is not numbers") from None
            names = tuple(words)
            continue
        if rows and len(row) != len(rows[0]):
            raise ValueError(f"line {number} has {len(row)} numbers and those before have {len(rows[0])}")
        rows.append(row)
    if not rows:
        raise ValueError("it holds no numbers")
    if names and len(names) != len(rows[0]):
        raise ValueError(f"its header names {len(names)} columns and its rows have {len(rows[0])}")
    return Table(names or tuple(f"column {i + 1}" for i in range(len(rows[0]))), np.array(rows))


def _words(line: str) -> list[str]:
    line = line.strip()
    for separator in ",;\t":
        if separator in line:
            return [word.strip().strip('"') for word in line.split(separator)]
    return line.split()
