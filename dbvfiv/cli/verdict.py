"""``dbvfiv verdict``: the final behaviour of time series, from a text file or a transient run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..errors import CaseError
from .terminal import AsJson, print_json


def verdict(
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
    until: Annotated[
        float | None, typer.Option("--until", metavar="T", help="Leave out what comes after this time, s.")
    ] = None,
    detrend: Annotated[
        bool, typer.Option("--detrend/--no-detrend", help="Take a drifting level off a measured record.")
    ] = True,
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
    harmonics, RMS, extremes, spectrum. Times are seconds unless the header says otherwise, as in "time [ms]", or dates.

    Of a measured record oscillations are told from noise, drift and mains: rings that decayed, several lines,
    modulation; frequency, amplitude and damping ratio with 95 % intervals.

    dbvfiv verdict pressure.csv --column 2 --plots figures
    """
    from ..studies.recognition import Reading, judge_file
    from ..verdict import JudgeOptions

    reading = Reading(columns or (), time, rate, time_unit, skip_bad, since, until, detrend)
    if not 0 < steady < 1:
        raise CaseError(f"--steady is {steady:g}; it must be greater than 0 and less than 1.")
    judged = judge_file(file, reading, JudgeOptions(steady=steady), closed_below)
    figures = [each.draw(plots) for each in judged] if plots is not None else []
    if as_json:
        print_json({"signals": [each.summary() for each in judged]})
        return
    for each in judged:
        print("\n".join(each.lines()))
    for figure in figures:
        print(f"Wrote {figure}.")
