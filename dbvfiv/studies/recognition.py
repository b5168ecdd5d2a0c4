"""Measured records beside computed modes, limit cycles and runs: the likeliest of them, and a figure.

The weight of a computed oscillation is that of its distance under normal errors, exp(-z^2 / 2), z^2 the sum over the
frequency and, where both are known, the damping ratio; errors of both sides are 95 % half widths.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ..case.parameters import PARAMETERS
from ..drawing.style import ACCENT, COMPUTED, headline, new_figure
from ..errors import CaseError
from ..texts import json_value
from ..verdict import Series, judge_record, spectrum
from ..verdict.lines import WIDE
from ..verdict.reading import JudgedSignal
from .result import StudyResult

#: Share of the weights from which one candidate is named alone.
_ALONE = 0.9
#: Relative error of a computed damping ratio over that of a frequency: loss factors of one compound differ by half.
_DAMPING = 5.0


@dataclass(frozen=True)
class Candidate:
    """A computed oscillation."""

    name: str
    #: frequency and frequency_interval: Hz; with half its 95 % interval.
    frequency: float
    frequency_interval: float
    #: damping_ratio and damping_ratio_interval: zero and NaN of what keeps its amplitude.
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
        return float(np.sqrt(sum((WIDE * off) ** 2 / (a**2 + (b or 0.0) ** 2) for off, a, b in errors)))

    def summary(self) -> dict[str, Any]:
        """Plain numbers for JSON."""
        return json_value(self)


def candidates_of(result: StudyResult, error: float) -> list[Candidate]:
    """Oscillations of a result of modes, cycle or transient. Raises CaseError if the result holds none.

    Parameters
    ----------
    error : float
        Half the 95 % interval of computed frequencies, relative: stiffness, mesh, water outside.
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
        seen = result.history["time"] >= result.judged_from
        signal = (result.history[name][seen] for name in ("time", "lip_displacement"))
        verdict = judge_record(*signal, gaps=False, mains=())
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
    signals : sequence of JudgedSignal
    error : float
        See `candidates_of`.
    """

    def __init__(self, signals: Sequence[JudgedSignal], result: StudyResult, error: float):
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
        for one in self.signals:
            for line in one.verdict.lines:
                if line["called"] in ("", "sideband", "resonance"):
                    yield one.signal.name, line

    def sentence(self, line: dict[str, Any]) -> str:
        """The likeliest candidates of a line in a sentence."""
        found = [one for one in self.matches(line) if one[2] <= WIDE * np.sqrt(2 if line.get("rate", 0) < 0 else 1)]
        kept = line.get("rate", 0.0) >= 0
        if not found:
            near, _, distance = self.matches(line)[0]
            if not np.isfinite(distance):
                return "It is damped, and nothing that was computed is."
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
                        {"name": one.name, "share": share, "distance": json_value(d)}
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
        for judged in self.signals:
            rows += ["", f"{judged.signal.name}: {judged.verdict.name}. {judged.verdict.reason}"]
            own = [line for name, line in self._lines() if name == judged.signal.name]
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
        for judged in self.signals:
            part = judged.signal.between(*judged.verdict.judged)
            if len(part.time) >= 16:
                frequency, amplitude = spectrum(Series.of(part.time, part.values))
                lower.semilogy(
                    frequency, np.maximum(amplitude, max(1e-6 * amplitude.max(), 1e-300)), lw=1.0, label=part.name
                )
        upper.axhline(0.0, color="black", lw=0.8)
        upper.set_ylabel("Damping ratio, %")
        lower.set(xlabel="Frequency, Hz", ylabel="Amplitude of the record", xlim=(0, 1.2 * highest))
        if lower.lines:
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
