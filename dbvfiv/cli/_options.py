"""The arguments that commands share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import CaseError
from ._later import action


def _writable(path: Path | None) -> Path | None:
    """Refuse a name that cannot be written before anything is computed."""
    if path is not None:
        action("files").check_writable(path)
    return path


def _folder(path: Path | None) -> Path | None:
    """Refuse a name for figures that is taken by a file before anything is computed."""
    if path is not None and path.exists() and not path.is_dir():
        raise CaseError(f"--plots {str(path)!r} is a file and not a folder.")
    return path


CaseFile = Annotated[Path | None, typer.Argument(metavar="[CASE]", help="Case file; the 12-inch valve without one.")]
ResultFile = Annotated[Path, typer.Argument(metavar="RESULT.h5", help="Result file of an earlier command.")]
Override = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help='Change a key of the case: --set drive.pressure="18 kPa".'),
]
AsJson = Annotated[bool, typer.Option("--json", help="One JSON document on standard output, nothing else.")]
Output = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="RESULT.h5", help="Keep everything in this HDF5 file.", callback=_writable),
]
PlotFolder = Annotated[
    Path | None, typer.Option("--plots", metavar="DIR", help="Draw all figures into this folder.", callback=_folder)
]
