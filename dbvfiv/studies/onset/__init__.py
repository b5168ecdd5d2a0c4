"""``dbvfiv onset``: where a state loses stability."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import StrictBool

from ...case.axis import RangeSection, StabilityRange
from ...case.parameters import listed
from ...case.quantity import Number
from ...case.section import key
from ..request import ClassesOption, DensityOption, LawsOption, PressureOption, over_option

ORDER = 28


class Keys(RangeSection):
    """Onset of instability along one parameter."""

    over: StabilityRange = key(
        "density",
        f"The parameter to move: {listed(notes=True)}; with =START:STOP:COUNT[:log] behind it for another range than "
        "the usual one.",
    )
    tolerance: Number = key(1e-9, "Relative accuracy of a located onset on its mesh.", gt=0, le=1e-3)
    normal_form: StrictBool = key(
        True, "Also the first Lyapunov coefficient, which tells whether cycles are attracting or repelling."
    )
    coarse_mesh: Number = key(
        0.5,
        (
            "Elements of the second mesh over those of the first, for the uncertainty by Richardson's rule; 0 "
            "leaves it out."
        ),
        ge=0,
        lt=1,
    )

    continuity: Literal["case", "both"] = key("case", "The flow model of the case, or both models side by side.")

    symmetry: Literal["SS", "all"] = key(
        "SS",
        "Symmetry classes looked at: SS is that of the model, all adds those in which the lips sway in y (SA), the "
        "valve sways sideways in x (AS) and twists (AA).",
    )


def command(
    over: Annotated[
        str | None,
        over_option(
            f"{listed()}, with =START:STOP:COUNT[:log] for a range of one's own; onset.over without it.", "PARAMETER"
        ),
    ] = None,
    pressure: PressureOption = None,
    density: DensityOption = None,
    law: LawsOption = None,
    symmetry: ClassesOption = None,
) -> None:
    """Every onset along one parameter: value, frequency, super- or subcritical, uncertainty of the mesh.

    All crossings of the range are looked for, also tongues of instability that close again. Each is located with the
    full matrices, confirmed by direct eigenvalues and independent counts on both sides, described by its first Lyapunov
    coefficient (onset.normal_form), and found again on a coarser mesh for an uncertainty (onset.coarse_mesh).

    With --law both the other flow model is scanned too, and what both disagree about is said.

    With --symmetry all the motions that are not symmetric about both planes are looked at too, and each onset names its
    class.

    With -o every value of the scan and every onset is kept at once: `dbvfiv resume` goes on after Ctrl-C or a crash.

    dbvfiv onset cases/dbv12.toml --over density -p "6 kPa"
    """
