"""``dbvfiv verdict``: the final behaviour of time series, from a text file or a transient run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import CaseError
from .terminal import AsJson, print_json

if TYPE_CHECKING:
    import numpy as np

    from ..verdict import JudgeOptions, Verdict
    from ..verdict.table import Table


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


@dataclass(frozen=True)
class Reading:
    """Options for reading the signals of a file.

    Attributes
    ----------
    columns : sequence of str
        Columns by name or number from 1; all where empty.
    time : str
        Column of the times, by name or number.
    rate : float, optional, Hz
        Sampling rate, where no column holds times.
    unit : str, optional
        Unit of the times; else as the header says.
    skip_bad : bool
        Leave out rows that hold no number.
    since, until : float, optional, s
        Times before and after which samples are left out.
    detrend : bool
        Take the level off a measured record.
    """

    columns: Sequence[str] = ()
    time: str = "1"
    rate: float | None = None
    unit: str | None = None
    skip_bad: bool = False
    since: float | None = None
    until: float | None = None
    detrend: bool = True


@dataclass(frozen=True)
class Signal:
    """A signal to judge, and how many rows were left out of it."""

    name: str
    time: np.ndarray
    values: np.ndarray
    skipped: int = 0
    measured: bool = True

    def between(self, start: float, end: float) -> Signal:
        """The part within two times, s."""
        keep = (self.time >= start) & (self.time <= end)
        return replace(self, time=self.time[keep], values=self.values[keep])


@dataclass(frozen=True)
class JudgedSignal:
    """A signal, what it does in the end, and the largest peaks of its spectrum."""

    signal: Signal
    verdict: Verdict
    peaks: list[dict[str, float]]

    def summary(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        extra = {"skipped_rows": self.signal.skipped, "peaks": self.peaks}
        return {"name": self.signal.name} | self.verdict.summary() | extra

    def draw(self, folder: Path) -> Path:
        """Write the signal and its spectrum into a folder."""
        from ..drawing.signal import save_signal

        return save_signal(folder, self.signal.name, self.signal.time, self.signal.values, self.verdict)

    def lines(self) -> list[str]:
        """The verdict for people."""
        from ..verdict import in_steps

        signal, verdict = self.signal, self.verdict
        notes = list(verdict.notes)
        if signal.skipped:
            rows = signal.skipped + len(signal.time)
            notes.append(f"{signal.skipped} of {rows} rows hold no number and were left out.")
        head = f"{signal.name}: {verdict.name}{'' if verdict.decided else ' (not certain)'}. {verdict.reason}"
        lines = [head, *(f"  Note: {note}" for note in notes)]
        for label, value in _numbers(verdict):
            if value == value:
                lines.append(f"  {label:<20}{value:.7g}")
        lines += [_line_of(one) for one in verdict.lines]
        if verdict.modulation:
            frequency, half = verdict.modulation["frequency"], verdict.modulation["frequency_interval"]
            lines.append(f"  {'modulated at':<20}{frequency:.6g} +- {half:.2g} Hz")
        if verdict.cycles:
            lines.append(f"  {'cycles':<20}{verdict.cycles}")
        if len(verdict.harmonics):
            lines.append(f"  {'harmonics':<20}" + ", ".join(f"{a:.3g}" for a in verdict.harmonics[:, 0]))
        if self.peaks:
            fine = 1.0 / (verdict.judged[1] - verdict.judged[0])
            peaks = ", ".join(f"{p['amplitude']:.3g} at {in_steps(p['frequency'], fine)} Hz" for p in self.peaks)
            lines.append(f"  {'spectrum':<20}{peaks} (resolution {fine:.2g} Hz)")
        return lines


def _line_of(line: dict[str, Any]) -> str:
    """One oscillation with its 95 % intervals."""

    def spread(name: str, unit: str, scale: float = 1.0) -> str:
        half = line[f"{name}_interval"]
        return f"{scale * line[name]:.6g}" + ("" if half is None else f" +- {scale * half:.2g}") + f" {unit}".rstrip()

    said = [spread("frequency", "Hz"), f"amplitude {spread('amplitude', '')}"]
    if "damping_ratio" in line:
        said.append(f"damping ratio {spread('damping_ratio', '%', 100.0)}")
    return f"  {line['called'] or 'oscillation':<20}{', '.join(said)}"


def judge_file(
    file: Path, reading: Reading, options: JudgeOptions, closed_below: float | None = None
) -> list[JudgedSignal]:
    """Judge the columns of a text file or of a transient run."""
    found = []
    for signal in _read_signals(file, reading):
        verdict = _judged(file, signal, options, closed_below, reading)
        found.append(JudgedSignal(signal, verdict, _peaks(signal.between(*verdict.judged))))
    return found


def _read_signals(file: Path, reading: Reading) -> list[Signal]:
    """Signals of a text file or of a transient run."""
    import h5py

    from ..verdict.table import read_table

    if not file.is_file():
        raise CaseError(f"The file {str(file)!r} does not exist.")
    if reading.rate is not None and not 0 < reading.rate < math.inf:
        raise CaseError(f"--rate is {reading.rate:g}; it must be greater than 0.")
    try:
        if h5py.is_hdf5(file):
            signals = _signals_of_run(file, reading)
        else:
            signals = _signals_of_table(read_table(file), reading)
    except ValueError as error:
        raise CaseError(f"{str(file)!r} cannot be read as a time series: {error}.") from None
    except OSError as error:
        raise CaseError(f"{str(file)!r} cannot be read ({error.strerror or error}).") from None
    start = -math.inf if reading.since is None else reading.since
    end = math.inf if reading.until is None else reading.until
    return [signal.between(start, end) for signal in signals]


def _signals_of_run(file: Path, reading: Reading) -> list[Signal]:
    from ..studies.session import load_result

    result = load_result(file)
    if result.kind != "transient":
        raise CaseError(f"{str(file)!r} holds a result of kind {result.kind!r} and no time series.")
    names = reading.columns or ["mass_flow", "lip_opening"]
    for name in names:
        if name not in result.history or result.history[name].ndim != 1:
            known = ", ".join(k for k, v in result.history.items() if v.ndim == 1)
            raise CaseError(f"The run has no column {name!r}; it has {known}.")
    return [Signal(name, result.history["time"], result.history[name], measured=False) for name in names]


#: Names of columns that number samples, and seconds since 1970 that are those of a date: 1980.
_NUMBERED, _DATES = ("sample", "samples", "index", "no", "no.", "nr", "#", "n"), 3.2e8


def _signals_of_table(table: Table, reading: Reading) -> list[Signal]:
    import numpy as np

    from ..verdict.table import seconds_in

    at = None if reading.rate is not None else table.index(reading.time)
    wanted = [table.index(name) for name in reading.columns] or [i for i in range(len(table.names)) if i != at]
    if not wanted:
        raise ValueError("it has a single column; give the sampling rate with --rate")
    if at is None:
        time = np.arange(len(table.values)) / reading.rate
    elif reading.unit is None and table.names[at].strip().lower() in _NUMBERED:
        raise ValueError(f"its first column {table.names[at]!r} numbers the samples; give their rate with --rate")
    else:
        factor = seconds_in(reading.unit) if reading.unit is not None else _seconds(table, at)
        time = factor * table.values[:, at]
        if np.isfinite(time).any() and np.nanmin(time) > _DATES:  # times of day, which start with the record
            time = time - np.nanmin(time)
    found = []
    for i in wanted:
        needed = [i] if at is None else [at, i]
        bad = table.bad_rows(needed)
        if bad.any() and not reading.skip_bad:
            raise ValueError(f"{table.describe_bad(needed)} (--skip-bad leaves such rows out)")
        found.append(Signal(table.names[i], time[~bad], table.values[~bad, i], int(bad.sum())))
    return found


def _seconds(table: Table, column: int) -> float:
    try:
        return table.seconds(column)
    except ValueError as error:
        raise ValueError(
            f"its times stand in the column {table.names[column]!r}, but {error} (or give --time-unit)"
        ) from None


def _judged(file: Path, signal: Signal, options: JudgeOptions, closed_below: float | None, reading: Reading) -> Verdict:
    from ..verdict import judge, judge_record

    if len(signal.time) < 2:
        number = "no samples" if not len(signal.time) else "a single sample"
        after = "" if reading.since is None else f" from {reading.since:g} s on"
        raise CaseError(f"Column {signal.name!r} of {str(file)!r} has {number}{after}, and two are needed at least.")
    try:
        given = signal.time, signal.values, options
        if signal.measured:
            return judge_record(*given, closed_below=closed_below, detrend=reading.detrend)
        return judge(*given, closed_below=closed_below)
    except ValueError as error:
        text = str(error).rstrip(".")
        raise CaseError(
            f"Column {signal.name!r} of {str(file)!r} cannot be judged: {text[0].lower()}{text[1:]}."
        ) from None


def _peaks(signal: Signal, count: int = 5) -> list[dict[str, float]]:
    """Largest peaks of the spectrum."""
    from ..verdict import Series, spectrum

    if len(signal.time) < 16:
        return []
    frequency, amplitude = spectrum(Series.of(signal.time, signal.values))
    inner = [i for i in range(1, len(amplitude) - 1) if amplitude[i - 1] < amplitude[i] >= amplitude[i + 1]]
    best = sorted(inner, key=lambda i: -amplitude[i])[:count]
    return [
        {"frequency": float(frequency[i]), "amplitude": float(amplitude[i])}
        for i in best
        if amplitude[i] > 1e-9 * amplitude.max()
    ]


def _numbers(verdict: Verdict) -> list[tuple[str, float]]:
    return [
        ("mean", verdict.mean),
        ("amplitude", verdict.amplitude),
        ("rms", verdict.rms),
        ("smallest", verdict.smallest),
        ("largest", verdict.largest),
        ("period, s", verdict.period),
        ("frequency, Hz", verdict.frequency),
        ("periodicity error", verdict.periodicity_error),
        ("noise, rms", verdict.noise),
    ]
