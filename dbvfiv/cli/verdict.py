"""``dbvfiv verdict``: the final behaviour of time series, from a text file or a transient run."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import CaseError
from .terminal import AsJson, print_json

if TYPE_CHECKING:
    from ..verdict.reading import Signal


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
    import h5py

    from ..drawing.signal import save_signal
    from ..verdict import JudgeOptions
    from ..verdict.reading import Reading, judge_file, judge_signals

    reading = Reading(columns or (), time, rate, time_unit, skip_bad, since, until, detrend)
    if not 0 < steady < 1:
        raise CaseError(f"--steady is {steady:g}; it must be greater than 0 and less than 1.")
    options = JudgeOptions(steady=steady)
    if file.is_file() and h5py.is_hdf5(file):
        judged = judge_signals(file, _signals_of_run(file, columns), reading, options, closed_below)
    else:
        judged = judge_file(file, reading, options, closed_below)
    own = [] if plots is None else [(each.signal, each.verdict) for each in judged]
    figures = [save_signal(plots, signal.name, signal.time, signal.values, told) for signal, told in own]
    if as_json:
        print_json({"signals": [each.summary() for each in judged]})
        return
    for each in judged:
        print("\n".join(each.lines()))
    for figure in figures:
        print(f"Wrote {figure}.")


def _signals_of_run(file: Path, columns: list[str] | None) -> list[Signal]:
    """Signals of a transient run."""
    from ..studies.session import load_result
    from ..verdict.reading import Signal

    result = load_result(file)
    if result.kind != "transient":
        raise CaseError(f"{str(file)!r} holds a result of kind {result.kind!r} and no time series.")
    known = [name for name, values in result.history.items() if values.ndim == 1]
    names = columns or ["mass_flow", "lip_opening"]
    for name in names:
        if name not in known:
            raise CaseError(f"The run has no column {name!r}; it has {', '.join(known)}.")
    return [Signal(name, result.history["time"], result.history[name], measured=False) for name in names]
