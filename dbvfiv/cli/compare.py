"""``dbvfiv compare``: several transient runs in one figure and one table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ._later import action
from ._options import AsJson

ORDER = 52


def command(
    files: Annotated[list[Path], typer.Argument(metavar="RUN.h5 RUN.h5 ...", help="Result files of transient runs.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE.png", help="Figure to write.")] = Path(
        "comparison.png"
    ),
    as_json: AsJson = False,
) -> None:
    """Compare transient runs: their histories in one figure, their verdicts in one table, named by the case keys that
    tell them apart.
    """
    action("compare").compare(files, output, as_json)
