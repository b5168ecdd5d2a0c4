"""``dbvfiv plot``: figures of a result, or of the valve of a case."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ._later import action
from ._options import AsJson, Override

ORDER = 50


class Format(StrEnum):
    """Kinds of figure files."""

    png = "png"
    svg = "svg"


def command(
    file: Annotated[
        Path,
        typer.Argument(metavar="RESULT.h5|CASE.toml", help="Result file of an earlier command, or a case file."),
    ],
    folder: Annotated[Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the figures.")] = Path("."),
    format: Annotated[Format, typer.Option("--format", help="File format.")] = Format.png,
    only: Annotated[
        list[str] | None, typer.Option("--only", metavar="NAME", help="Draw this figure; may be repeated.")
    ] = None,
    pressure: Annotated[
        str | None,
        typer.Option(
            "--pressure",
            "-p",
            metavar="P",
            help="Draw 3D view and layer stresses for the state nearest to this pressure.",
        ),
    ] = None,
    mode: Annotated[
        int | None, typer.Option("--mode", metavar="N", help="Draw centre line and shape of this mode only.")
    ] = None,
    animate: Annotated[
        list[int] | None,
        typer.Option(
            "--animate",
            metavar="N",
            help="Also write a GIF: of one cycle of mode N, or of the last N cycles of a transient; may be repeated.",
        ),
    ] = None,
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """Draw the figures of a result file; those of one state show the highest pressure unless --pressure is given.

    Of a case file: the valve with its measures, wall and layers, before anything is solved.
    """
    chosen = (only or (), pressure, mode, animate or (), overrides or ())
    action("plot").plot(file, folder, format.value, *chosen, as_json)
