"""``dbvfiv fit``: constants of a rubber from its tests."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from ._later import action
from ._options import AsJson, PlotFolder

ORDER = 13


class Form(StrEnum):
    """Forms of the energy."""

    SOFTENING = "softening"
    NEO_HOOKEAN = "neo-hookean"
    MOONEY_RIVLIN = "mooney-rivlin"
    YEOH = "yeoh"
    OGDEN = "ogden"


class Constraint(StrEnum):
    """Constraints on the constants."""

    NONE = "none"
    NON_NEGATIVE = "non-negative"
    STABLE = "stable"


class Weighting(StrEnum):
    """Error that a fit minimises."""

    ABSOLUTE = "absolute"
    RELATIVE = "relative"


class Cycle(StrEnum):
    """Load cycle that is fitted."""

    FIRST = "first"
    LAST = "last"


def command(
    path: Annotated[
        Path,
        typer.Argument(
            metavar="FILE.csv", help="Test in tension, or several with a column test (uniaxial, planar, biaxial)."
        ),
    ],
    planar: Annotated[
        Path | None, typer.Option("--planar", metavar="FILE.csv", help="Test in planar tension (pure shear).")
    ] = None,
    biaxial: Annotated[
        Path | None, typer.Option("--biaxial", metavar="FILE.csv", help="Test in equibiaxial tension.")
    ] = None,
    law: Annotated[Form | None, typer.Option("--law", help="Form told in full; softening if not given.")] = None,
    terms: Annotated[int | None, typer.Option("--terms", help="Its number of terms.")] = None,
    constraint: Annotated[Constraint, typer.Option("--constraint", help="On the constants.")] = Constraint.NONE,
    stable_to: Annotated[
        str | None, typer.Option("--stable-to", metavar="STRAIN", help='With --constraint stable: up to "30 %".')
    ] = None,
    error: Annotated[Weighting, typer.Option("--error", help="What is made small.")] = Weighting.ABSOLUTE,
    cycle: Annotated[
        Cycle, typer.Option("--cycle", help="Which loading, where the file has a column cycle.")
    ] = Cycle.LAST,
    name: Annotated[str, typer.Option("--name", help="Name of the material in the table to paste.")] = "rubber",
    density: Annotated[str, typer.Option("--density", help="Its density in the table to paste.")] = "1300 kg/m^3",
    plots: PlotFolder = None,
    as_json: AsJson = False,
) -> None:
    """Constants of a rubber from its tests: every form compared, one in full, its table for a case file.

    dbvfiv fit tension.csv --planar shear.csv --constraint stable --plots figures
    """
    action("fit").tell(
        (path, planar, biaxial), (law, terms, constraint, stable_to, error, cycle), (name, density), plots, as_json
    )
