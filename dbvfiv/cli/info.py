"""``dbvfiv info``: what a result file holds."""

from __future__ import annotations

from typing import Annotated

import typer

from ._later import action
from ._options import AsJson, ResultFile

ORDER = 60


def command(
    file: ResultFile,
    as_json: AsJson = False,
    case: Annotated[bool, typer.Option("--case", help="Print the case it was computed from, as a case file.")] = False,
) -> None:
    """Summarise a result file: what was run, with which versions, and its numbers. Also while the run goes on."""
    action("info").tell(file, as_json, case)
