"""Records of time series in text files: columns, times and rates read and judged, and the verdict in words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import CaseError
from ..texts import clause
from .judge import JudgeOptions, Verdict, judge
from .motion import judge_record
from .series import Series, in_steps, spectrum
from .table import Table, read_table, seconds_in

#: What mends a record, by what is wrong with it, in options of `dbvfiv verdict`; and where there are no options.
OPTIONS = {"rows": " (--skip-bad leaves such rows out)", "unit": " (or give --time-unit)", "rate": " with --rate"}
PLAIN = {"rows": "; take such rows out", "unit": "", "rate": ""}


@dataclass(frozen=True)
class Reading:
    """Options for reading the signals of a file."""

    columns: Sequence[str] = ()  #: Columns by name or number from 1; all where empty.
    time: str = ""  #: Column of the times, by name or number; the first where empty.
    rate: float | None = None  #: optional, Hz; sampling rate, where no column holds times.
    unit: str | None = None  #: Unit of the times; else as the header says.
    skip_bad: bool = False  #: Leave out rows that hold no number.
    #: since and until: optional, s; times before and after which samples are left out.
    since: float | None = None
    until: float | None = None
    detrend: bool = True  #: Take the level off a measured record.
    hints: Mapping[str, str] = field(default_factory=lambda: OPTIONS)  #: `OPTIONS` or `PLAIN`.


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

    def named_by(self, told: Mapping[str, Any]) -> JudgedSignal:
        """The signal with what another verdict, as plain numbers, says that it does."""
        own = {"name": told["verdict"], "period": told.get("period") or math.nan, "cycles": told["cycles_observed"]}
        return replace(self, verdict=replace(self.verdict, decided=told["decided"], reason=told["reason"], **own))

    def summary(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        extra = {"skipped_rows": self.signal.skipped, "peaks": self.peaks}
        return {"name": self.signal.name} | self.verdict.summary() | extra

    def lines(self) -> list[str]:
        """The verdict for people."""
        signal, verdict = self.signal, self.verdict
        notes = list(verdict.notes)
        if signal.skipped:
            rows = signal.skipped + len(signal.time)
            notes.append(f"{signal.skipped} of {rows} rows hold no number and were left out.")
        head = f"{signal.name}: {verdict.name}{'' if verdict.decided else ' (not certain)'}. {verdict.reason}"
        lines = [head, *(f"  Note: {note}" for note in notes)]
        for label, value in _numbers_of(verdict):
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
    file: Path, reading: Reading, options: JudgeOptions = JudgeOptions(), closed_below: float | None = None
) -> list[JudgedSignal]:
    """Judge the columns of a text file. Raises CaseError for a file that cannot be read, or whose columns are no time
    series.
    """
    if not file.is_file():
        raise CaseError(f"The file {str(file)!r} does not exist.")
    if reading.rate is not None and not 0 < reading.rate < math.inf:
        raise CaseError(f"--rate is {reading.rate:g}; it must be greater than 0.")
    try:
        signals = _signals_of(read_table(file), reading)
    except ValueError as error:
        raise CaseError(f"{str(file)!r} cannot be read as a time series: {clause(str(error))}.") from None
    except OSError as error:
        raise CaseError(f"{str(file)!r} cannot be read ({error.strerror or error}).") from None
    return judge_signals(file, signals, reading, options, closed_below)


def judge_signals(
    file: Path,
    signals: Sequence[Signal],
    reading: Reading,
    options: JudgeOptions = JudgeOptions(),
    closed_below: float | None = None,
) -> list[JudgedSignal]:
    """Judge signals of a file within the times asked for. Raises CaseError for one that is no time series."""
    found = []
    start = -math.inf if reading.since is None else reading.since
    end = math.inf if reading.until is None else reading.until
    for signal in signals:
        part = signal.between(start, end)
        verdict = _judged(file, part, options, closed_below, reading)
        found.append(JudgedSignal(part, verdict, _peaks(part.between(*verdict.judged))))
    return found


#: Names of columns that number samples, and seconds since 1970 that are those of a date: 1980.
_NUMBERED, _DATES = ("sample", "samples", "index", "no", "no.", "nr", "#", "n"), 3.2e8


def _signals_of(table: Table, reading: Reading) -> list[Signal]:
    at = None if reading.rate is not None else table.index(reading.time) if reading.time else 0
    wanted = [table.index(name) for name in reading.columns] or [i for i in range(len(table.names)) if i != at]
    if not wanted:
        raise ValueError(f"it has a single column; give the sampling rate{reading.hints['rate']}")
    if at is None:
        time = np.arange(len(table.values)) / reading.rate
    elif reading.unit is None and table.names[at].strip().lower() in _NUMBERED:
        numbers = f"its first column {table.names[at]!r} numbers the samples"
        raise ValueError(f"{numbers}; give their rate{reading.hints['rate']}")
    else:
        factor = seconds_in(reading.unit) if reading.unit is not None else _seconds(table, at, reading)
        time = factor * table.values[:, at]
        if np.isfinite(time).any() and np.nanmin(time) > _DATES:  # times of day, which start with the record
            time = time - np.nanmin(time)
    found = []
    for i in wanted:
        needed = [i] if at is None else [at, i]
        bad = table.bad_rows(needed)
        if bad.any() and not reading.skip_bad:
            raise ValueError(f"{table.describe_bad(needed)}{reading.hints['rows']}")
        found.append(Signal(table.names[i], time[~bad], table.values[~bad, i], int(bad.sum())))
    return found


def _seconds(table: Table, column: int, reading: Reading) -> float:
    try:
        return table.seconds(column)
    except ValueError as error:
        raise ValueError(
            f"its times stand in the column {table.names[column]!r}, but {error}{reading.hints['unit']}"
        ) from None


def _judged(file: Path, signal: Signal, options: JudgeOptions, closed_below: float | None, reading: Reading) -> Verdict:
    if len(signal.time) < 2:
        number = "no samples" if not len(signal.time) else "a single sample"
        after = "" if reading.since is None else f" from {reading.since:g} s on"
        raise CaseError(
            f"Column {clause(signal.name)!r} of {str(file)!r} has {number}{after}, and two are needed at least."
        )
    try:
        given = signal.time, signal.values, options
        if signal.measured:
            return judge_record(*given, closed_below=closed_below, detrend=reading.detrend)
        return judge(*given, closed_below=closed_below, gaps=False)
    except ValueError as error:
        text = str(error).rstrip(".")
        raise CaseError(
            f"Column {clause(signal.name)!r} of {str(file)!r} cannot be judged: {text[0].lower()}{text[1:]}."
        ) from None


def _peaks(signal: Signal) -> list[dict[str, float]]:
    """Five largest peaks of the spectrum."""
    if len(signal.time) < 16:
        return []
    frequency, amplitude = spectrum(Series.of(signal.time, signal.values))
    inner = [i for i in range(1, len(amplitude) - 1) if amplitude[i - 1] < amplitude[i] >= amplitude[i + 1]]
    best = sorted(inner, key=lambda i: -amplitude[i])[:5]
    return [
        {"frequency": float(frequency[i]), "amplitude": float(amplitude[i])}
        for i in best
        if amplitude[i] > 1e-9 * amplitude.max()
    ]


def _numbers_of(verdict: Verdict) -> list[tuple[str, float]]:
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
