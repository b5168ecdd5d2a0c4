"""Request of a command line to a study."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

import typer

from ..case.quantity import number_or_text
from ..errors import CaseError

#: Suffixes of sheets, tables that are no result files.
SHEETS = (".csv", ".xlsx")


def is_sheet(path: Path | None) -> bool:
    """True for the name of a sheet, by its suffix."""
    return path is not None and path.suffix.lower() in SHEETS


def with_unit(given: str | list[str] | None) -> str | list[str] | None:
    """Refuse a bare number where a command takes a pressure, or several, or ranges of it.

    Raises
    ------
    CaseError
    """
    for text in given if isinstance(given, list) else [given or ""]:
        for part in text.split(":")[:2]:
            if isinstance(number := number_or_text(part), float) and number != 0:
                raise CaseError(
                    f"--pressure is given as {text!r}, without a unit: Pa or m? Give '{part} Pa', '{part} kPa', or "
                    f"'{part} m' for a head of the fluid."
                )
    return given


#: What several studies take in place of keys of the case.
PressureOption = Annotated[
    str | None,
    typer.Option(
        "--pressure",
        "-p",
        metavar="P",
        callback=with_unit,
        help="Pressure in place of drive.pressure: '18 kPa', or a head of the fluid, '2 m'.",
    ),
]
DensityOption = Annotated[
    str | None, typer.Option("--density", metavar="RHO", help="Fluid density in place of fluid.density.")
]
LawOption = Annotated[
    str | None,
    typer.Option(
        "--law",
        metavar="LAW",
        help="Continuity law in place of fluid.continuity: quasi-steady, storage, or both side by side.",
    ),
]
ClassesOption = Annotated[
    str | None,
    typer.Option(
        "--symmetry",
        metavar="CLASSES",
        help="SS, the class of the model, or all: also sway in y (SA), sideways in x (AS) and twist (AA).",
    ),
]


@dataclass(frozen=True)
class Request:
    """A study as the command line wants it.

    Attributes
    ----------
    changes : dict
        Keys of the case and what takes their place; those with None are left as they are.
    choices : dict
        What the study takes that is no key of the case; likewise.
    further : callable, optional
        From the result to further files, such as an animation.
    sheet : callable, optional
        From results to a table that takes the place of the result file.
    variants : tuple of dict
        Changes of the case with which the study is made again, for the same sheet.
    """

    changes: dict[str, Any] = field(default_factory=dict)
    choices: dict[str, Any] = field(default_factory=dict)
    further: Callable[[Any], list[Path]] | None = None
    sheet: Callable[[Sequence[Any]], Path] | None = None
    variants: tuple[dict[str, Any], ...] = ()
