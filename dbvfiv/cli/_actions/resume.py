"""An interrupted run goes on."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...case.quantity import Quantity, number_or_text
from ...errors import CaseError
from ...record.files import kind_of
from ...resuming import resume
from .._progress import Progress
from .study import report


def go_on(
    file: Path, duration: str | None, plots: Path | None, animate: Path | None, workers: int | None, as_json: bool
) -> None:
    """Continue a run in its file and report it.

    Raises
    ------
    CaseError
        If the file or an option does not fit.
    """
    kind = kind_of(file)
    if animate is not None and kind != "transient":
        raise CaseError(f"--animate belongs to transient runs; {str(file)!r} is of kind {kind!r}.")

    end = None
    if duration is not None:
        try:
            end = Quantity("s", "s").parse(number_or_text(duration))
        except ValueError as error:
            raise CaseError(f"--duration is given as {duration!r}, {error}.") from None
    result = resume(file, duration=end, workers=workers, observer=Progress(quiet=as_json))
    films = animate is not None and result.drawable
    report(result, file, plots, as_json, further=_film_into(animate) if films else None)


def _film_into(path: Path) -> Callable[[Any], list[Path]]:
    return lambda result: [result.animate(path)]
