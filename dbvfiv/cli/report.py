"""``dbvfiv report``: one page for a person."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ._later import action
from ._options import AsJson, CaseFile, Override

ORDER = 15


def command(
    case_file: CaseFile = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="PAGE.html", help="The page; CASE-report.html without it.")
    ] = None,
    runs: Annotated[
        Path | None,
        typer.Option(
            "--runs", metavar="DIR", help="Folder for the results that it rests on; beside the page without it."
        ),
    ] = None,
    cells: Annotated[int, typer.Option("--cells", min=4, max=200, help="Values along each axis of the map.")] = 20,
    workers: Annotated[int, typer.Option("--workers", min=1, max=1024, help="Processes that share the map.")] = 1,
    without: Annotated[
        list[str] | None,
        typer.Option(
            "--without",
            metavar="RUN",
            help="Leave out steady, modes, classes, onset, map, cycle or closure; may be repeated.",
        ),
    ] = None,
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """One HTML page: how far the valve opens, whether it vibrates, whether it shuts, and how far to trust each answer.

    dbvfiv report my.toml -o my.html
    """
    action("report").report(case_file, output, runs, cells, workers, tuple(without or ()), overrides, as_json)
