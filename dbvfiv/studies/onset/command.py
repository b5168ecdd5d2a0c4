"""``dbvfiv onset``: where a state loses stability."""

from __future__ import annotations

from typing import Annotated

import typer

from ...case.parameters import listed
from ...case.quantity import number_or_text
from ..case import Case
from ..request import ClassesOption, DensityOption, LawOption, PressureOption, Request, law_changes, refuse_moved

ORDER = 28


def command(
    case: Case,
    over: Annotated[
        str | None,
        typer.Option(
            "--over",
            metavar="PARAMETER",
            help=f"{listed()}, with =START:STOP:COUNT[:log] for a range of one's own; onset.over without it.",
        ),
    ] = None,
    pressure: PressureOption = None,
    density: DensityOption = None,
    law: LawOption = None,
    symmetry: ClassesOption = None,
) -> Request:
    """Every onset along one parameter: value, frequency, super- or subcritical, uncertainty of the mesh.

    All crossings of the range are looked for, also tongues of instability that close again. Each is located with the
    full matrices, confirmed by direct eigenvalues and independent counts on both sides, described by its first Lyapunov
    coefficient (onset.normal_form), and found again on a coarser mesh for an uncertainty (onset.coarse_mesh).

    With --law both the other continuity law is scanned too, and what both disagree about is said.

    With --symmetry all the motions that are not symmetric about both planes are looked at too, and each onset names its
    class.

    With -o every value of the scan and every onset is kept at once: `dbvfiv resume` goes on after Ctrl-C or a crash.

    dbvfiv onset cases/dbv12.toml --over density -p "6 kPa"
    """
    refuse_moved({"onset.over": over or case.onset.over}, pressure=pressure, density=density)
    changes = {
        "drive.pressure": number_or_text(pressure),
        "fluid.density": number_or_text(density),
        "onset.over": over,
        "onset.symmetry": symmetry,
    }
    return Request(changes | law_changes(law, "onset"))
