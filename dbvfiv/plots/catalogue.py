"""Which figures a result has.

A figure family is a module with ``draw(result, **choices)``, which yields names and functions that draw. A study
registers its families here, under the kind of its result; choices that a family does not take are not handed to it.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import CaseError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from ..record.result import Result

FAMILIES: dict[str, tuple[str, ...]] = {
    "steady": ("discharge", "shapes", "passage", "deformed", "layers"),
    "closure": ("closure", "closure_curves", "layers"),
    "modes": ("modes_plane", "modes_shapes", "modes_centre_line", "modes_winding"),
    "sweep": ("sweep_curves", "sweep_locus"),
    "transient": ("transient",),
}
FORMATS = ("png", "svg")


def figures_of(result: Result, only: Sequence[str] = (), **choices: Any) -> dict[str, Figure]:
    """Figures of a result by name.

    Parameters
    ----------
    only : sequence of str
        Names; all figures without it.
    choices
        What families may be told, such as ``pressure`` (Pa) for figures of a single state.

    Raises
    ------
    CaseError
        For a name that the result has no figure of, or a result without anything to draw.
    """
    from .style import style

    drawers = dict(_drawers(result, choices))
    if not drawers:
        raise CaseError(f"The {result.kind} result of {result.header.name!r} holds nothing that could be drawn.")
    for name in only:
        if name not in drawers:
            raise CaseError(f"There is no figure {name!r} of this result; it has {', '.join(drawers)}.")
    with style():
        return {name: drawer() for name, drawer in drawers.items() if not only or name in only}


def save_figures(result: Result, folder: str | Path = ".", format: str = "png", **choices: Any) -> list[Path]:
    """Draw the figures of a result into files NAME.FORMAT of a folder.

    Raises
    ------
    CaseError
        As `figures_of` does, and when the folder cannot be written.
    """
    from .style import style

    if format not in FORMATS:
        raise CaseError(f"Figures are written as {' or '.join(FORMATS)}, not as {format!r}.")
    folder = Path(folder)
    written = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, figure in figures_of(result, **choices).items():
            path = folder / f"{name}.{format}"
            with style():
                figure.savefig(path, metadata={"Date": None} if format == "svg" else None)
            written.append(path)
    except OSError as error:
        raise CaseError(f"The folder {str(folder)!r} cannot be written ({error.strerror or error}).") from error
    return written


def _drawers(result: Result, choices: dict[str, Any]) -> Iterator[tuple[str, Callable[[], Figure]]]:
    if not getattr(result, "states", True):
        return
    for family in FAMILIES.get(result.kind, ()):
        draw = import_module(f"{__package__}.{family}").draw
        taken = inspect.signature(draw).parameters
        yield from draw(result, **{name: value for name, value in choices.items() if name in taken})
