"""``dbvfiv closure``: the valve under back pressure."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ._options import AsJson, CaseFile, Output, Override, PlotFolder, read_case
from ._output import print_json, print_places
from ._progress import Progress

ORDER = 35

Pressures = Annotated[
    list[str] | None,
    typer.Option("--pressure", "-p", metavar="P", help="Back pressure, 7e3 (Pa) or '7 kPa'; may be repeated."),
]


def command(
    case_file: CaseFile = None,
    pressures: Pressures = None,
    output: Output = None,
    plots: PlotFolder = None,
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
    overrides: Override = None,
    as_json: AsJson = False,
) -> None:
    """Back pressure: does the valve shut, where and how firmly, what stays open, how far is the wall from buckling?

    The pressures are those of --pressure, else closure.pressures of the case; each state is found from the one before.
    closure.supports chooses contact of the inner faces or the simplified supports of the thesis, closure.start = "open"
    turns a flow back first, slowly; --in-time does so with the inertia of wall and fluid and tells the closing time.

    dbvfiv closure cases/closure.toml -o closure.h5 --plots figures
    """
    from ..api import Valve, read_pressures
    from ..errors import SolveError
    from ..results.closure_table import HEAD, row_of

    case = read_case(case_file, overrides)
    wanted = read_pressures(pressures, "--pressure") if pressures else case.closure.pressures
    name = case_file.stem if case_file else "dbv12"
    results, failures = [], []
    supports = [case.closure.supports]
    if compare:
        supports.append("held-lips" if supports[0] == "contact" else "contact")
    for number, kind in enumerate(supports):
        valve = Valve(case.replace({"closure.supports": kind}), name)
        if not as_json:
            title = [f"Supports: {kind}"] if compare else []
            print("\n".join([*title, *HEAD]), flush=True)
        target = output if output is None or not number else output.with_name(f"{output.stem}-{kind}{output.suffix}")
        result = valve.closure(
            wanted,
            in_time=in_time and not number,
            output=target,
            observer=Progress(quiet=as_json, row=None if as_json else row_of),
        )
        if not as_json:
            print("\n".join([*result.verdict(), *([f"Kept in {target}."] if target else [])]))
        results.append(result)
        failures += result.failures
        if not result.complete:
            break
    figures = _figures(results, plots) if plots is not None else []
    if as_json:
        document = results[0].summary()
        if len(results) > 1:
            document["compared"] = results[1].summary()
        print_json(
            document | {"output": str(output) if output else None, "figures": [str(figure) for figure in figures]}
        )
    elif figures:
        print_places(None, figures, plots)
    if not all(result.complete for result in results):
        raise KeyboardInterrupt
    if failures:
        raise SolveError(
            f"{len(results[0].states)} of {len(wanted)} back pressures were reached."
        )  # why was said when it happened


def report(result, path: Path, plots: Path | None, as_json: bool) -> None:
    """Show a run that was continued."""
    from ..errors import SolveError

    figures = _figures([result], plots) if plots is not None else []
    if as_json:
        print_json(result.summary() | {"output": str(path), "figures": [str(figure) for figure in figures]})
    else:
        print("\n".join(result.lines()))
        print_places(path, figures, plots)
    if not result.complete:
        raise KeyboardInterrupt
    if result.failures:
        raise SolveError(f"{len(result.states)} of {len(result.case.closure.pressures)} back pressures were reached.")


def _figures(results, folder: Path) -> list[Path]:
    written = []
    for number, result in enumerate(results):
        if result.states:
            written += result.plot(folder if not number else folder / result.supports)
    if len(results) > 1 and all(result.states for result in results):
        from ..drawing.style import style
        from ..plots.closure_curves import supports_compared

        path = folder / "supports-compared.png"
        with style():
            supports_compared(*results).savefig(path)
        written.append(path)
    return written
