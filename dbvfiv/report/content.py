"""Content of a report: parts with sentences, tables and pictures."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable
from dataclasses import dataclass

from matplotlib.figure import Figure

from ..case.units import Units
from ..drawing.style import put_in_units, style


@dataclass(frozen=True)
class Table:
    """A table for people.

    Attributes
    ----------
    head : tuple of str
        Titles of the columns, with units.
    rows : tuple of tuple of str
    """

    head: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


@dataclass(frozen=True)
class Picture:
    """A figure, and where it helps one that answers to the pointer, which stands in its place on screens.

    Attributes
    ----------
    name : str
    caption : str
    png : bytes
        What is printed.
    live : str
        HTML of the interactive figure; empty where there is none.
    """

    name: str
    caption: str
    png: bytes
    live: str = ""

    @property
    def source(self) -> str:
        """The image as a data address."""
        return "data:image/png;base64," + base64.b64encode(self.png).decode()


@dataclass(frozen=True)
class Part:
    """A part of a report.

    Attributes
    ----------
    name : str
        Its place on the page.
    title : str
    sentences : tuple of str
    tables : tuple of Table
    pictures : tuple of Picture
    trust : tuple of str
        How far to trust it: residuals, counts, uncertainties, warnings.
    listing : tuple of str
        Lines as the command prints them, in columns.
    """

    name: str
    title: str
    sentences: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    trust: tuple[str, ...] = ()
    listing: tuple[str, ...] = ()


def picture(name: str, caption: str, draw: Callable[[], Figure], live: str = "", units: Units | None = None) -> Picture:
    """A picture from a function that draws a figure in the program's style, in units of choice."""
    with style():
        figure = draw()
        if units is not None:
            put_in_units(figure, units)
        written = io.BytesIO()
        figure.savefig(written, format="png", dpi=110)
    return Picture(name, caption, written.getvalue(), live)


def pictures_of(result, captions: dict[str, str]) -> tuple[Picture, ...]:
    """Pictures of a result by the names of its figures, in its units; those that it does not have are left out."""
    drawers = dict(result.drawers())
    return tuple(
        picture(name, caption, drawers[name], units=result.case.units)
        for name, caption in captions.items()
        if name in drawers
    )
