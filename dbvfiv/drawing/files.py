"""Figures by name, drawn in one style and written as files."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from matplotlib.figure import Figure

from ..errors import CaseError
from .style import style

FORMATS = ("png", "svg")


def draw_figures(drawers: Mapping[str, Callable[[], Figure]], only: Sequence[str], whose: str) -> dict[str, Figure]:
    """Figures by name.

    Parameters
    ----------
    drawers : mapping of names to callables
    only : sequence of str
        Names of those wanted; all without it.
    whose : str
        For messages, "steady result of 'dbv12'".

    Raises
    ------
    CaseError
        For a name that there is no figure of, or nothing to draw.
    """
    if not drawers:
        raise CaseError(f"The {whose} holds nothing that could be drawn.")
    for name in only:
        if name not in drawers:
            raise CaseError(f"There is no figure {name!r} of this result; it has {', '.join(drawers)}.")
    with style():
        return {name: drawer() for name, drawer in drawers.items() if not only or name in only}


def write_figures(figures: Mapping[str, Figure], folder: str | Path = ".", format: str = "png") -> list[Path]:
    """Write figures into files NAME.FORMAT of a folder and return their names.

    Raises
    ------
    CaseError
        For an unknown format or a folder that cannot be written.
    """
    if format not in FORMATS:
        raise CaseError(f"Figures are written as {' or '.join(FORMATS)}, not as {format!r}.")
    folder = Path(folder)
    written = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, figure in figures.items():
            path = folder / f"{name}.{format}"
            with style():
                figure.savefig(path, metadata={"Date": None} if format == "svg" else None)
            written.append(path)
    except OSError as error:
        raise CaseError(f"The folder {str(folder)!r} cannot be written ({error.strerror or error}).") from error
    return written
