"""``dbvfiv verdict``: what a time series does in the end."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ._later import action
from ._options import AsJson

ORDER = 47


def command(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="FILE", help="CSV with a column of times and others of values, or the result of a transient run."
        ),
    ],
    columns: Annotated[
        list[str] | None,
        typer.Option(
            "--column", "-c", metavar="NAME", help="Column by name or number from 1; may be repeated; all by default."
        ),
    ] = None,
    time: Annotated[str, typer.Option("--time", metavar="NAME", help="Column of the times, by name or number.")] = "1",
    rate: Annotated[
        float | None, typer.Option("--rate", metavar="HZ", help="Sampling rate, where no column holds times.")
    ] = None,
    time_unit: Annotated[
        str | None,
        typer.Option(
            "--time-unit", metavar="U", help="Unit of the times: s, ms, us, ns, min, h; else as the header says."
        ),
    ] = None,
    skip_bad: Annotated[
        bool, typer.Option("--skip-bad", help="Leave out rows that hold no number, and say how many.")
    ] = False,
    since: Annotated[
        float | None, typer.Option("--since", metavar="T", help="Leave out what comes before this time, s.")
    ] = None,
    steady: Annotated[
        float, typer.Option("--steady", metavar="X", help="Relative change below which a signal is steady.")
    ] = 1e-4,
    closed_below: Annotated[
        float | None,
        typer.Option("--closed-below", metavar="X", help="Level below which a signal counts as closed."),
    ] = None,
    plots: Annotated[
        Path | None,
        typer.Option("--plots", metavar="DIR", help="Draw each signal and its spectrum into this folder."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Judge any time series: steady, decaying, limit cycle, growing, closed or irregular, with period, amplitude,
    harmonics, RMS, extremes, spectrum. Times are seconds unless the header says otherwise, as in "time [ms]".

    dbvfiv verdict pressure.csv --column 2 --plots figures
    """
    act = action("verdict")
    reading = act.Reading(columns or (), time, rate, time_unit, skip_bad, since)
    act.tell(file, reading, steady, closed_below, plots, as_json)
