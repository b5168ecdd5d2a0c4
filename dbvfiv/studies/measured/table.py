"""Table of the deviations of several runs from the same measured data."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol

import numpy as np

from .. import comparing


class Compared(Protocol):
    """Measured data of one kind beside computed ones: a title, and a number for each point."""

    @property
    def off(self) -> tuple[str, dict[str, float]]: ...


def told(runs: Sequence[Iterable[Compared]]) -> list[str]:
    """Tables for people, one for each kind of data: a row for each point that runs have, a column for each run; nothing
    if no run has any.
    """
    kinds: dict[str, list[dict[str, float]]] = {}
    for number, parts in enumerate(runs):
        for part in parts:
            title, values = part.off
            kinds.setdefault(title, [{} for _ in runs])[number] = values
    lines = []
    for title, columns in kinds.items():
        names = list(dict.fromkeys(name for column in columns for name in column))
        width = max(len(name) for name in names) + 2
        lines += ["", title, " " * width + "".join(f"{number:>10}" for number in range(1, len(runs) + 1))]
        lines += [
            f"{name:<{width}}" + "".join(comparing.cell(column.get(name, np.nan), 10, ".4g") for column in columns)
            for name in names
        ]
    return lines
