"""Differences between several runs, and one figure of all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..drawing.style import style
from ..errors import CaseError
from .result import StudyResult


def differing_keys(results: Sequence[StudyResult], quiet: Sequence[str] = ()) -> list[str]:
    """Keys of the cases that are not the same in all runs, those left out that only steer a run (`quiet`)."""
    flat = [_flat(result.case.to_dict()) for result in results]
    every = dict.fromkeys(key for case in flat for key in case)
    keys = [key for key in every if any(case.get(key) != flat[0].get(key) for case in flat)]
    return [key for key in keys if key not in quiet]


def labels(results: Sequence[StudyResult], quiet: Sequence[str] = ()) -> list[str]:
    """Legend entries that say what tells the runs apart: by three keys, by more where those do not."""
    keys = differing_keys(results, quiet)
    if not keys:
        return [result.path.stem if result.path else result.header.name for result in results]
    flat = [_flat(result.case.to_dict()) for result in results]
    last = [key.split(".")[-1] for key in keys]
    names = [key if last.count(word) > 1 else word for key, word in zip(keys, last)]
    for count in range(min(3, len(keys)), len(keys) + 1):
        found = [", ".join(f"{n} {_text(case.get(k))}" for n, k in zip(names[:count], keys)) for case in flat]
        if len(set(found)) == len(found):
            break
    return found


def plain(values: np.ndarray) -> list[float | None]:
    """Numbers for JSON; None where a run has nothing."""
    return [float(value) if np.isfinite(value) else None for value in values]


def cell(value: float, width: int, form: str) -> str:
    """A number of a table for people; a dash where a run has nothing."""
    return (f"{value:{form}}" if np.isfinite(value) else "-").rjust(width)


def tabulate_deviations(runs: Sequence[Iterable[Any]]) -> list[str]:
    """Tables of the deviations of runs from the same measured data, one for each kind of data (a title and a number for
    each point, `off`): a row for each point that runs have, a column for each run; nothing
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
            f"{name:<{width}}" + "".join(cell(column.get(name, np.nan), 10, ".4g") for column in columns)
            for name in names
        ]
    return lines


def save_figure(draw: Callable[[], Figure], path: Path) -> Path:
    """Draw into a file.

    Raises
    ------
    CaseError
        If the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with style():
            draw().savefig(path)
    except (OSError, ValueError) as error:
        raise CaseError(f"{str(path)!r} cannot be written ({error}).") from error
    return path


def _flat(data, prefix: str = "") -> dict:
    tables = isinstance(data, list) and data and all(isinstance(item, dict) for item in data)
    if isinstance(data, dict) or tables:
        found = {}
        for key, value in enumerate(data) if tables else data.items():
            found |= _flat(value, f"{prefix}.{key}" if prefix else key)
        return found
    return {prefix: data}


def _text(value) -> str:
    return "none" if value is None else f"{value:g}" if isinstance(value, float) else str(value)
