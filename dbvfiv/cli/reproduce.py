"""``dbvfiv reproduce``: the thesis, figure by figure."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ._later import action
from ._options import AsJson

ORDER = 95


def command(
    figures: Annotated[
        list[str] | None, typer.Argument(metavar="[FIGURE ...]", help="Figures and tables, 7-4 or T3-5; all without.")
    ] = None,
    folder: Annotated[
        Path, typer.Option("-o", "--output", metavar="DIR", help="Folder for the page and the runs.")
    ] = Path("out/thesis"),
    quick: Annotated[
        bool, typer.Option("--quick", help="Coarse mesh and short histories: for a look, not for the numbers.")
    ] = False,
    listing: Annotated[bool, typer.Option("--list", help="Only say which there are.")] = False,
    as_json: AsJson = False,
) -> None:
    """The thesis's figures and tables made again: ours, the published number, the difference, and what it means.

    dbvfiv reproduce 7-4 7-11 -o out/thesis
    """
    action("reproduce").reproduce(tuple(figures or ()), folder, quick, listing, as_json)
