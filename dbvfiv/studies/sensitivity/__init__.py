"""``dbvfiv sensitivity``: how the leading mode answers to the parameters."""

from __future__ import annotations

from typing import Annotated

import typer
from pydantic import StrictInt, StrictStr

from ...case.parameters import listed
from ...case.quantity import Number
from ...case.section import Section, key
from ..request import DensityOption, PressureOption

ORDER = 27


class Keys(Section):
    """Derivatives of an eigenvalue by parameters."""

    of: tuple[StrictStr, ...] = key(
        (),
        f"Parameters to differentiate by: {listed()}, or of a layer, counted from 1 inside to outside, such as "
        "'layer 3 angle', 'layer 1 thickness' or 'layer 2 mu_0'; all that the valve has where none is named.",
    )
    mode: StrictInt = key(1, "Number of the mode, by falling growth rate.", ge=1, le=1000)
    step: Number = key(2e-5, "Relative step of the differences.", gt=1e-8, le=1e-2)


def command(
    of: Annotated[
        list[str] | None,
        typer.Option(
            "--of",
            metavar="PARAMETER",
            help="pressure, density, ..., or 'layer 3 angle', 'layer 2 mu_0'; may be repeated; all without it.",
        ),
    ] = None,
    pressure: PressureOption = None,
    density: DensityOption = None,
    mode: Annotated[
        int | None, typer.Option("--mode", metavar="N", help="Number of the mode, by falling growth rate.")
    ] = None,
) -> None:
    """Change of growth rate and frequency of the leading mode with every parameter: load, fluid, damping, wall, and the
    thickness, angle and constants of each layer.

    The equilibrium moves along. Derivatives by the left and right vectors of the mode: neither an eigenvalue search nor
    an equilibrium beside the state.

    dbvfiv sensitivity cases/dbv12.toml -p "6 kPa" --density 10 --of pressure --of thickness --of "layer 3 angle"
    """
