"""``dbvfiv closure``: the valve under back pressure."""

from __future__ import annotations

from typing import Annotated

import typer

from ...case.quantity import number_or_text
from ..request import ClassesOption, Request, with_unit

ORDER = 35


def command(
    pressures: Annotated[
        list[str] | None,
        typer.Option(
            "--pressure",
            "-p",
            metavar="P",
            callback=with_unit,
            help="Back pressure, '7 kPa' or '3 m'; may be repeated.",
        ),
    ] = None,
    compare: Annotated[
        bool,
        typer.Option("--compare", help="Do the same with the other kind of supports, and draw both in one figure."),
    ] = False,
    in_time: Annotated[
        bool,
        typer.Option(
            "--in-time", help="Also turn the drive from closure.open_pressure to as much back pressure in time."
        ),
    ] = False,
    symmetry: ClassesOption = None,
) -> Request:
    """Back pressure: does the valve shut, where and how firmly, what stays open, how far is the wall from buckling?

    The pressures are those of --pressure, else closure.pressures of the case; each state is found from the one before,
    and the last one before a limit is listed too. The safety factor refers to closure.rated_pressure, or to the largest
    of the pressures. closure.supports chooses contact of the inner faces or the simplified supports of the thesis,
    closure.start = "open" turns a flow back first, slowly; --in-time does so with the inertia of wall and fluid and
    tells the closing time. --symmetry all also watches for buckling into motions that the model's symmetry leaves out.

    dbvfiv closure cases/closure.toml -o closure.h5 --plots figures
    """
    changes = {"closure.pressures": [number_or_text(text) for text in pressures] if pressures else None}
    changes["closure.symmetry"] = symmetry
    return Request(changes, {"in_time": in_time or None, "compare": compare or None})
