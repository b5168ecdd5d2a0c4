"""Measured records, read and judged, beside computed modes, limit cycles and runs: the likeliest of them, and a figure.

The weight of a computed oscillation is that of its distance under normal errors, exp(-z^2 / 2), z^2 the sum over the
frequency and, where both are known, the damping ratio; errors of both sides are 95 % half widths.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from matplotlib.figure import Figure

from ..case.parameters import PARAMETERS
from ..drawing.signal import save_signal
from ..drawing.style import ACCENT, COMPUTED, headline, new_figure
from ..errors import CaseError
from ..verdict import JudgeOptions, Series, Verdict, in_steps, judge, judge_record, spectrum
from ..verdict.table import Table, read_table, seconds_in
from .result import StudyResult
from .session import load_result

#: Standard errors in half a 95 % interval; share of the weights from which one candidate is named alone.
_WIDE, _ALONE = 1.96, 0.9
#: Relative error of a computed damping ratio over that of a frequency: loss factors of one compound differ by half.
_DAMPING = 5.0


@dataclass(frozen=True)
class Candidate:
    """A computed oscillation.

    Attributes
    ----------
    name : str
    frequency, frequency_interval : float, Hz
        With half its 95 % interval.
    damping_ratio, damping_ratio_interval : float
        Zero and NaN of what keeps its amplitude.
    """

    name: str
    frequency: float
    frequency_interval: float
    damping_ratio: float = 0.0
    damping_ratio_interval: float = np.nan

    @property
    def sustained(self) -> bool:
        """True for a motion that keeps its amplitude: a cycle, or a mode that grows until it does."""
        return not self.damping_ratio > 0

    def distance(self, line: dict[str, Any]) -> float:
        """Distance from a measured oscillation in standard errors; infinite where one dies out and the other does not
        and cannot be forced.
        """
        errors = [(line["frequency"] - self.frequency, self.frequency_interval, line["frequency_interval"])]
        if line.get("rate", 0.0) < 0:
            if self.sustained:
                return np.inf
            own = line["damping_ratio_interval"]
            errors.append((line["damping_ratio"] - self.damping_ratio, self.damping_ratio_interval, own))
        return float(np.sqrt(sum((_WIDE * off) ** 2 / (a**2 + (b or 0.0) ** 2) for off, a, b in errors)))

    def summary(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        plain = {name: float(getattr(self, name)) for name in list(self.__dataclass_fields__)[1:]}
        return {"name": self.name} | {name: value if np.isfinite(value) else None for name, value in plain.items()}


def candidates_of(result: StudyResult, error: float) -> list[Candidate]:
    """Oscillations of a result of modes, cycle or transient.

    Parameters
    ----------
    result : StudyResult
    error : float
        Half the 95 % interval of computed frequencies, relative: stiffness, mesh, water outside.

    Raises
    ------
    CaseError
        If the result holds none.
    """
    if result.kind == "modes":
        found = [
            Candidate(f"mode {m.number}", m.frequency, error * m.frequency, m.damping_ratio, _DAMPING * error * abs(z))
            for m in result.modes
            if (z := m.damping_ratio) < 1 and m.frequency > 0
        ]
    elif result.kind == "cycle":
        row = PARAMETERS[result.parameter]
        found = [
            Candidate(f"cycle at {row.text(p.value)}", float(p.frequency), error * float(p.frequency))
            for p in result.points
            if p.stable is not False
        ]
    elif result.kind == "transient":
        verdict = judge_record(result.history["time"], result.history["lip_displacement"])
        found = [
            Candidate(
                "run" if number == 0 else f"run, line {number + 1}",
                line["frequency"],
                float(np.hypot(error * line["frequency"], line["frequency_interval"] or 0.0)),
                line.get("damping_ratio", 0.0),
                _DAMPING * error * abs(line.get("damping_ratio", np.nan)),
            )
            for number, line in enumerate(verdict.lines)
        ]
    else:
        raise CaseError(f"A result of {result.kind} has no oscillations; one of modes, cycle or transient is needed.")
    if not found:
        raise CaseError(f"The {result.kind} result of {result.header.name!r} holds no oscillation to compare with.")
    return found


class Recognition:
    """Measured oscillations beside computed ones.

    Parameters
    ----------
    signals : sequence of (str, (k,) array, (k,) array, Verdict)
        Name, times, values and verdict of each signal.
    result : StudyResult
    error : float
        See `candidates_of`.
    """

    def __init__(self, signals: Sequence[tuple[str, Any, Any, Verdict]], result: StudyResult, error: float):
        self.signals, self.result, self.error = signals, result, error
        self.candidates = candidates_of(result, error)

    def matches(self, line: dict[str, Any]) -> list[tuple[Candidate, float, float]]:
        """Candidates by falling share of the weights, each with its share and its distance."""
        distances = np.array([one.distance(line) for one in self.candidates])
        weights = np.exp(-0.5 * (distances**2 - min(distances.min(), 1e3) ** 2))
        shares = weights / weights.sum() if weights.sum() > 0 else weights
        order = np.argsort(distances, kind="stable")
        return [(self.candidates[i], float(shares[i]), float(distances[i])) for i in order]

    def _lines(self):
        for name, _, _, verdict in self.signals:
            for line in verdict.lines:
                if not line["called"] or line["called"] == "sideband":
                    yield name, line

    def sentence(self, line: dict[str, Any]) -> str:
        """The likeliest candidates of a line in a sentence."""
        found = [one for one in self.matches(line) if one[2] <= _WIDE * np.sqrt(2 if line.get("rate", 0) < 0 else 1)]
        kept = line.get("rate", 0.0) >= 0
        if not found:
            near, _, distance = self.matches(line)[0]
            if not np.isfinite(distance):
                return "It dies out, and nothing that was computed does."
            return f"None of them: the nearest, {near.name}, is {distance:.2g} standard errors away."
        first = found[0][0]
        if kept and not first.sustained:
            more = f"; {first.name} is damped, so something drives it, or damping is less than computed"
        else:
            more = ""
        if found[0][1] >= _ALONE or len(found) == 1:
            return f"It is {first.name}{more}."
        others = " or ".join(f"{one.name} ({100 * share:.0f} %)" for one, share, _ in found[:4])
        return f"It may be {others}: the intervals do not part them{more}."

    def document(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return {
            "computed": [one.summary() for one in self.candidates],
            "relative_error": self.error,
            "measured": [
                {"signal": name}
                | line
                | {
                    "says": self.sentence(line),
                    "matches": [
                        {"name": one.name, "share": share, "distance": d if np.isfinite(d) else None}
                        for one, share, d in self.matches(line)
                    ],
                }
                for name, line in self._lines()
            ],
        }

    def lines(self) -> list[str]:
        """Both sides in a table, and what each measured line is."""
        rows = [f"{'computed':<28}{'frequency, Hz':>22}{'damping ratio, %':>22}"]
        rows += [f"{one.name:<28}{_numbers(one)}" for one in self.candidates]
        for name, _, _, verdict in self.signals:
            rows += ["", f"{name}: {verdict.name}. {verdict.reason}"]
            own = [line for signal, line in self._lines() if signal == name]
            rows += [f"{'oscillation':<28}{_numbers(line)}  {self.sentence(line)}" for line in own]
        words = f"Intervals are of 95 %; those of computed frequencies are {100 * self.error:.3g} % (--within)"
        return [*rows, "", f"{words}, of computed damping {100 * _DAMPING * self.error:.3g} % of it."]

    def draw(self) -> Figure:
        """Frequency and damping of both sides above, the spectrum of the record below."""
        figure = new_figure(7.6, 5.8)
        upper, lower = figure.subplots(2, 1, sharex=True)
        for one in self.candidates:
            bar = 0.0 if np.isnan(one.damping_ratio_interval) else 100 * one.damping_ratio_interval
            at = (one.frequency, 100 * one.damping_ratio)
            upper.errorbar(*at, xerr=one.frequency_interval, yerr=bar, fmt="o", ms=4, color=COMPUTED, capsize=2)
            upper.annotate(one.name, at, xytext=(4, 4), textcoords="offset points", fontsize=8, color=COMPUTED)
        for _, line in self._lines():
            ratio, half = line.get("damping_ratio", 0.0), line.get("damping_ratio_interval") or 0.0
            wide = line["frequency_interval"] or 0.0
            options = {"fmt": "s", "ms": 5, "color": ACCENT, "capsize": 3}
            upper.errorbar(line["frequency"], 100 * ratio, xerr=wide, yerr=100 * half, **options)
        highest = max([one.frequency for one in self.candidates] + [line["frequency"] for _, line in self._lines()])
        for name, time, values, verdict in self.signals:
            within = (time >= verdict.judged[0]) & (time <= verdict.judged[1])
            if np.count_nonzero(within) >= 16:
                frequency, amplitude = spectrum(Series.of(time[within], values[within]))
                lower.semilogy(frequency, np.maximum(amplitude, 1e-6 * amplitude.max()), lw=1.0, label=name)
        upper.axhline(0.0, color="black", lw=0.8)
        upper.set_ylabel("Damping ratio, %")
        lower.set(xlabel="Frequency, Hz", ylabel="Amplitude of the record", xlim=(0, 1.2 * highest))
        lower.legend()
        headline(figure, f"Measured (squares) beside computed, {self.result.header.name}")
        return figure


def _numbers(numbers: Any) -> str:
    return _pair(numbers, "frequency") + _pair(numbers, "damping_ratio", 100.0)


def _pair(numbers: Any, name: str, scale: float = 1.0) -> str:
    """A number with half its interval, 22 wide."""
    read = numbers.get if isinstance(numbers, dict) else lambda key: getattr(numbers, key)
    value, half = read(name), read(f"{name}_interval")
    if value is None:
        return f"{'constant':>22}"
    if half is None or np.isnan(half):
        return f"{f'{scale * value:.4g}':>22}" if value else f"{'constant':>22}"
    return f"{f'{scale * value:.5g} +- {scale * half:.2g}':>22}"


# -- records read and judged
# ----


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
        return save_signal(folder, self.signal.name, self.signal.time, self.signal.values, self.verdict)

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
