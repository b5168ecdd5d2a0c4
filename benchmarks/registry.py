"""Benchmarks register themselves; each yields rows."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass

import numpy as np


@dataclass(frozen=True)
class Row:
    """One measurement.

    Attributes
    ----------
    what : str
    value : float
    unit : str
        "x" for a ratio.
    target : float or None
        Value not to exceed; None for what is given for scale.
    note : str
    """

    what: str
    value: float
    unit: str = "x"
    target: float | None = None
    note: str = ""

    def to_dict(self) -> dict:
        return asdict(self) | {"met": None if self.target is None else bool(self.value <= self.target)}


BENCHMARKS: dict[str, Callable[[], Iterator[Row]]] = {}


def benchmark(name: str):
    """Register a generator of rows under a name."""

    def register(function):
        BENCHMARKS[name] = function
        return function

    return register


def medians(functions: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Median seconds of each function; they take turns, so that a slow spell of the machine meets all of them."""
    for function in functions.values():
        function()
    taken = {name: [] for name in functions}
    gc.collect()
    for _ in range(rounds):
        for name, function in functions.items():
            taken[name].append(seconds(function)[0])
    return {name: float(np.median(times)) for name, times in taken.items()}


def seconds(function: Callable[[], object]) -> tuple[float, object]:
    """Time of one call and what it returned."""
    start = time.perf_counter()
    result = function()
    return time.perf_counter() - start, result
