"""``dbvfiv verdict``: what a time series does in the end."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ._options import AsJson
from ._output import print_json

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
    harmonics, RMS, extremes, spectrum.

    dbvfiv verdict pressure.csv --column 2 --plots figures
    """
    import numpy as np

    from ..errors import CaseError
    from ..verdict import JudgeOptions, judge

    signals = _signals(file, columns, time, rate)
    if not 0 < steady < 1:
        raise CaseError(f"--steady is {steady:g}; it must be greater than 0 and less than 1.")
    found, figures = [], []
    for name, t, values in signals:
        keep = np.ones(len(t), bool) if since is None else t >= since
        if np.count_nonzero(keep) < 2:
            raise CaseError(f"Column {name!r} has no samples from {since:g} s on.")
        try:
            verdict = judge(t[keep], values[keep], JudgeOptions(steady=steady), closed_below=closed_below)
        except ValueError as error:
            raise CaseError(
                f"Column {name!r} of {str(file)!r} cannot be judged: {str(error)[0].lower()}{str(error)[1:]}"
            ) from None
        found.append((name, verdict, t[keep], values[keep]))
        if plots is not None:
            from ..plots.transient_signal import save_signal

            figures.append(save_signal(plots, name, t[keep], values[keep], verdict))
    if as_json:
        print_json(
            {
                "signals": [
                    {"name": name} | verdict.summary() | {"peaks": _peaks(t, values)}
                    for name, verdict, t, values in found
                ]
            }
        )
        return
    for name, verdict, t, values in found:
        print("\n".join(_lines(name, verdict, _peaks(t, values))))
    for figure in figures:
        print(f"Wrote {figure}.")


def _signals(file: Path, columns: list[str] | None, time: str, rate: float | None):
    """Names, times and values."""
    import h5py
    import numpy as np

    from ..errors import CaseError
    from ..verdict.table import read_table

    if not file.exists():
        raise CaseError(f"The file {str(file)!r} does not exist.")
    if file.is_file() and h5py.is_hdf5(file):
        from ..results import load_result

        result = load_result(file)
        if result.kind != "transient":
            raise CaseError(f"{str(file)!r} holds a result of kind {result.kind!r} and no time series.")
        names = columns or ["mass_flow", "lip_opening"]
        for name in names:
            if name not in result.history or result.history[name].ndim != 1:
                known = ", ".join(k for k, v in result.history.items() if v.ndim == 1)
                raise CaseError(f"The run has no column {name!r}; it has {known}.")
        return [(name, result.history["time"], result.history[name]) for name in names]
    if rate is not None and not rate > 0:
        raise CaseError(f"--rate is {rate:g}; it must be greater than 0.")
    try:
        table = read_table(file)
        at = None if rate is not None else table.index(time)
        wanted = [table.index(name) for name in columns] if columns else [i for i in range(len(table.names)) if i != at]
    except ValueError as error:
        raise CaseError(f"{str(file)!r} cannot be read as a time series: {error}.") from None
    if not wanted:
        raise CaseError(f"{str(file)!r} has a single column; give the sampling rate with --rate.")
    t = np.arange(len(table.values)) / rate if at is None else table.values[:, at]
    return [(table.names[i], t, table.values[:, i]) for i in wanted]


def _peaks(t, values, count: int = 5) -> list[dict]:
    """Largest peaks of the spectrum."""
    from ..verdict import Series, spectrum

    if len(t) < 16:
        return []
    frequency, amplitude = spectrum(Series.of(t, values))
    inner = [i for i in range(1, len(amplitude) - 1) if amplitude[i - 1] < amplitude[i] >= amplitude[i + 1]]
    best = sorted(inner, key=lambda i: -amplitude[i])[:count]
    return [
        {"frequency": float(frequency[i]), "amplitude": float(amplitude[i])}
        for i in best
        if amplitude[i] > 1e-9 * amplitude.max()
    ]


def _lines(name: str, verdict, peaks: list[dict]) -> list[str]:
    head = f"{name}: {verdict.name}{'' if verdict.decided else ' (not certain)'}. {verdict.reason}"
    numbers = [
        ("mean", verdict.mean),
        ("amplitude", verdict.amplitude),
        ("rms", verdict.rms),
        ("smallest", verdict.smallest),
        ("largest", verdict.largest),
        ("period, s", verdict.period),
        ("frequency, Hz", verdict.frequency),
        ("periodicity error", verdict.periodicity_error),
    ]
    lines = [head] + [f"  {label:<20}{value:.7g}" for label, value in numbers if value == value]
    if verdict.cycles:
        lines.append(f"  {'cycles':<20}{verdict.cycles}")
    if len(verdict.harmonics):
        lines.append(f"  {'harmonics':<20}" + ", ".join(f"{a:.3g}" for a in verdict.harmonics[:, 0]))
    if peaks:
        lines.append(
            f"  {'spectrum':<20}" + ", ".join(f"{p['amplitude']:.3g} at {p['frequency']:.4g} Hz" for p in peaks)
        )
    return lines
