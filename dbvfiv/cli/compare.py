"""``dbvfiv compare``: several runs of one kind in one figure and one table."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ._later import action
from ._options import AsJson

ORDER = 52


def command(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="RUN.h5 RUN.h5 ...", help="Result files of transient runs, of steady or of closure ones."
        ),
    ],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE.png", help="Figure to write.")] = Path(
        "comparison.png"
    ),
    as_json: AsJson = False,
) -> None:
    """Compare transient runs: their histories in one figure, their verdicts in one table; or steady runs: their head
    and discharge in one figure, the flows at the pressures of the first and what they differ by in one table; or
    closure runs: seal, force, displacement, passage and stiffness over the back pressure. Measured data that they name
    are in the figure, and what each is off by is told. Runs are named by the case keys that tell them apart.
    """
    action("compare").compare(files, output, as_json)
