"""``dbvfiv steady``: equilibria over a list of pressures."""

from __future__ import annotations

from typing import Annotated

import typer

from ._options import AsJson, CaseFile, Output, Override, PlotFolder, read_case
from ._output import print_json, print_places
from ._progress import Progress

ORDER = 20

Pressures = Annotated[
    list[str] | None,
    typer.Option(
        "--pressure",
        "-p",
        metavar="P",
        help="Static inlet pressure, 36e3 (Pa), '36 kPa', '2 m' (head of the fluid), '2 mH2O', or a range "
        "'2 kPa:50 kPa:12'; may be repeated.",
    ),
]


def command(
    case_file: CaseFile = None,
    pressures: Pressures = None,
    output: Output = None,
    plots: PlotFolder = None,
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """Equilibria of the coupled valve: flow, lip area, jet velocity, deflections, layer stresses.

    The pressures are those of --pressure; else a drive.pressure given with --set; else steady.pressures of the case, or
    its drive.pressure where only that is given. Each state is found from the one before.

    Nothing is written unless asked for: -o keeps states, stations and layer stresses in a result file (an earlier
    result of that name is replaced), state by state, so that Ctrl-C keeps what is done. `dbvfiv plot`, `export` and
    `info` read it.

    dbvfiv steady cases/dbv12.toml -p "18 kPa" -p "36 kPa" -o dbv12.h5
    """
    from ..api import Valve, read_pressures
    from ..errors import SolveError
    from ..results.steady_table import HEAD, row_of

    case = read_case(case_file, overrides)
    wanted = (
        _given(pressures, case.fluid.density)
        if pressures
        else read_pressures(case.steady_pressures(), "drive.pressure")
    )
    valve = Valve(case, case_file.stem if case_file else "dbv12")
    valve.model  # a case that gives no model is told before the table begins
    if not as_json:
        print("\n".join(HEAD), flush=True)
    progress = Progress(quiet=as_json, row=None if as_json else row_of)
    result = valve.steady(wanted, output=output, observer=progress)
    figures = result.plot(plots) if plots is not None and result.states else []
    if as_json:
        document = result.summary()
        document["output"] = str(output) if output else None
        document["figures"] = [str(figure) for figure in figures]
        print_json(document)
    else:
        print_places(output, figures, plots)
    if not result.complete:
        raise KeyboardInterrupt
    if result.failures:
        reached = (
            f"{len(result.states)} of {len(wanted)} pressures were reached"
            if result.states
            else "No pressure was reached"
        )
        kept = f"; those states are kept in {output}" if output and result.states else ""
        raise SolveError(f"{reached}{kept}.")  # why was said when it happened


def _given(texts: list[str], density: float) -> tuple[float, ...]:
    from ..api import read_pressures

    found = (_range(t, density) if ":" in t else read_pressures([t], "--pressure", density) for t in texts)
    return tuple(pressure for pressures in found for pressure in pressures)


def _range(text: str, density: float) -> tuple[float, ...]:
    from ..case.axis import parse_axis
    from ..errors import CaseError

    try:
        return parse_axis(f"pressure={text}", density=density).values
    except ValueError as error:
        raise CaseError(
            f"--pressure is given as {text!r}, {error}; a range is START:STOP:COUNT, with ':log' behind it "
            f"for logarithmic steps."
        ) from None
