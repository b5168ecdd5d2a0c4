"""``dbvfiv transient``: a time history and its verdict."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ..request import Request

ORDER = 40

Animation = Annotated[
    Path | None, typer.Option("--animate", metavar="FILE.gif", help="Write an animation of the last cycle.")
]


def command(animate: Animation = None) -> Request:
    """Time history of the coupled valve and a verdict: steady, decaying, limit cycle, growing, closed or irregular.

    How the run starts, what drives it, its steps and what ends it are keys of the section transient; `dbvfiv case
    --explain transient` lists them. With -o everything is kept while the run goes on; `dbvfiv resume` continues it
    after Ctrl-C or a crash.

    dbvfiv transient cases/dbv12.toml --set transient.start=kick --set fluid.density=10 -o run.h5
    """

    def further(result: Any) -> list[Path]:
        return [result.animate(animate)] if animate is not None and result.drawable else []

    return Request(further=further)
