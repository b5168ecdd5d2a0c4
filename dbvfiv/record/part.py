"""The first rows of a record: what a run that goes on takes over from an earlier attempt."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from .record import Record


class RecordPart(Record):
    """A record without the last rows of some of its tables; its notes are all there.

    Parameters
    ----------
    whole : Record
    rows : mapping of str to int
        How many rows of a table are left; all of those that are not named.
    """

    def __init__(self, whole: Record, rows: Mapping[str, int]):
        self.whole, self._left = whole, dict(rows)
        self.header, self.mesh, self.path = whole.header, whole.mesh, whole.path

    def rows(self, table: str) -> int:
        return min(self._left.get(table, self.whole.rows(table)), self.whole.rows(table))

    def column(self, table: str, name: str) -> np.ndarray:
        return self.whole.column(table, name)[: self.rows(table)]

    def value(self, table: str, name: str, row: int) -> Any:
        return self.whole.value(table, name, range(self.rows(table))[row])

    @property
    def log(self) -> list[dict[str, Any]]:
        return self.whole.log
