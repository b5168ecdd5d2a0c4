"""``dbvfiv modes``: how each mode of the coupled valve rings."""

from __future__ import annotations

from typing import Annotated

import typer

from ._options import AsJson, CaseFile, Output, Override, PlotFolder, read_case
from ._output import print_json, print_places
from ._progress import Progress

ORDER = 25


def command(
    case_file: CaseFile = None,
    pressure: Annotated[
        str | None,
        typer.Option(
            "--pressure",
            "-p",
            metavar="P",
            help="Static inlet pressure in place of drive.pressure; 0 with --in-vacuo is the valve at rest.",
        ),
    ] = None,
    density: Annotated[
        str | None, typer.Option("--density", metavar="RHO", help="Fluid density in place of fluid.density.")
    ] = None,
    count: Annotated[int | None, typer.Option("--count", "-n", metavar="N", help="How many modes.")] = None,
    in_vacuo: Annotated[
        bool, typer.Option("--in-vacuo", help="Leave the fluid out: the structure under its steady pressures alone.")
    ] = False,
    output: Output = None,
    plots: PlotFolder = None,
    animate: Annotated[
        list[int] | None,
        typer.Option(
            "--animate", metavar="N", help="Write a GIF of one cycle of mode N into --plots; may be repeated."
        ),
    ] = None,
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """Leading modes of one steady state: growth rate, frequency, damping ratio, residual, and whether the state is
    stable.

    The number of unstable eigenvalues is counted twice, in the list of modes and by the winding of the determinant
    along the imaginary axis; both eigenvalues of a pair count. The model has one quarter of the valve, so all modes are
    symmetric about both planes.

    dbvfiv modes cases/dbv12.toml -p "6 kPa" --density 10 --set damping.alpha=0 -o modes.h5 --plots figures --animate 1
    """
    from ..api import Valve
    from ..errors import CaseError

    case = read_case(case_file, overrides)
    if animate and plots is None:
        raise CaseError("--animate needs --plots DIR, the folder that the GIF is written into.")
    valve = Valve(case, case_file.stem if case_file else "dbv12")
    given = {"density": number_or_text(density), "in_vacuo": in_vacuo or None}
    result = valve.modes(
        number_or_text(pressure), count=count, output=output, observer=Progress(quiet=as_json), **given
    )
    figures = result.plot(plots) if plots is not None else []
    figures += [result.animate(plots / f"mode-{number}.gif", number) for number in animate or ()]
    if as_json:
        print_json(
            result.summary()
            | {"output": str(output) if output else None, "figures": [str(figure) for figure in figures]}
        )
        return
    print("\n".join(result.lines()))
    print_places(output, figures, plots)


def number_or_text(value: str | None) -> float | str | None:
    """A number where an option is one; texts with units as they are."""
    try:
        return None if value is None else float(value)
    except ValueError:
        return value
