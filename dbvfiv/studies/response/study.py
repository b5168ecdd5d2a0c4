"""Response of steady states to the pressure at the inlet: run, storage, and what can be read off it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...case.parameters import PARAMETERS, Mu
from ...drawing.style import ACCENT, COMPUTED, headline, new_figure, parameter_label, some_of
from ...errors import CaseError, SolveError
from ...record.mesh import MeshData
from ...record.record import GrowingRecord, Record
from ...record.table import Column, TableSpec
from ..case import Case
from ..result import StudyResult
from ..session import Session
from ..stability.place import check_scan, describe_fixed, fixed_conditions
from ..stability.walk import StabilityWalk
from ..study import Study
from .transfer import OUTPUTS, Transfer, require_inertia

CURVE, PEAKS, POINTS = "curve", "peaks", "points"
_CURVE = (
    Column("value", "SI", "Of the range"),
    Column("frequency", "Hz", "Of the pressure at the inlet"),
    *(Column(f"{n}_{p}", f"{u}/Pa", f"{p} part, per pressure") for n, u in OUTPUTS.items() for p in ("real", "imag")),
)
_PEAKS = (
    Column("value", "SI", "Of the range"),
    Column("frequency", "Hz", "Of the mode"),
    Column("growth_rate", "1/s", "Of the mode"),
    *(Column(name, f"{unit}/Pa", "Amplitude per pressure at that frequency") for name, unit in OUTPUTS.items()),
)
_POINTS = (
    Column("value", "SI", "Of the range"),
    Column("growth_rate", "1/s", "Of the mode of least damping ratio up to response.max_frequency"),
    Column("frequency", "Hz", "Of that mode"),
    Column("damping_ratio", "", "Of that mode"),
    Column("correlation_time", "s", "Of the lip under the noise"),
    *(Column(f"{name}_rms", unit, "Root mean square under the noise") for name, unit in OUTPUTS.items()),
    Column("error", "", "Relative, of the reduced operator against the full one at frequencies it was not made for"),
    Column("size", "", "Unknowns of the reduced operator", "i8"),
)
#: Frequencies below the curves at which the response is made too, over their step.
SLOW = np.geomspace(0.01, 0.7, 8)
_TABLES = TableSpec(CURVE, _CURVE, chunk=512), TableSpec(PEAKS, _PEAKS), TableSpec(POINTS, _POINTS)


def tables_of(_mesh: MeshData) -> tuple[TableSpec, ...]:
    """Tables of a result: curves, peaks, and one row for each value of the range."""
    return _TABLES


def rows_to_keep(known: Record, _case: Case) -> dict[str, int]:
    """Rows that a run goes on from: those of the values whose point vouches for them."""
    done = known.column(POINTS, "value")
    own = {table: int(np.isin(known.column(table, "value"), done).sum()) for table in (CURVE, PEAKS)}
    return own | {POINTS: len(done)}


def run(session: Session, record: GrowingRecord) -> None:
    """Response at the state of the case, or at every value of response.over.

    Raises
    ------
    CaseError
        Without a fluid that has inertia.
    SolveError
        Without flow.
    """
    case, asked = session.case, session.case.response
    axis = asked.axis
    parameter, values = ("pressure", (case.drive.pressure,)) if axis is None else (axis.parameter, axis.values)
    check_scan(case, parameter)
    require_inertia(session.model)
    rows = asked.density()
    walk = StabilityWalk(case, record, session.model)
    done = set(record.column(POINTS, "value"))
    record.begin("response", len(values))
    for value in values:
        if value in done:
            continue
        try:
            _respond(walk, Mu.of(case).at(**{parameter: value}), value, rows, record)
        except (CaseError, SolveError, ArithmeticError) as error:
            record.fail(f"At {PARAMETERS[parameter].text(value)}: {error}")
        record.item(value)


def _respond(walk: StabilityWalk, place: Mu, value: float, rows, record: GrowingRecord) -> None:
    """Keep the response at one parameter point."""
    asked = walk.case.response
    verdict = walk.verdict(place)
    if not verdict.stable:
        state = "is not stable" if verdict.stable is False else "is not known to be stable"
        raise SolveError(f"the state {state}, so that motions about it do not stay small. {verdict.reason}")
    # down to a little above zero: a long line lets slow pulsation through that it keeps from faster one
    step = asked.max_frequency / asked.count
    even = step * np.arange(1, asked.count + 1)
    transfer = Transfer(walk.family(place).linear, place, np.append(step * SLOW, even))
    curve = transfer.at(even)
    columns: dict[str, Any] = {"value": np.full(len(curve), value), "frequency": even}
    for name, row in zip(OUTPUTS, curve.T):
        columns |= {f"{name}_real": row.real, f"{name}_imag": row.imag}
    table = np.array(rows)
    found = transfer.spread(lambda f: np.interp(f, *table.T, left=0.0, right=0.0), table[:, 0])
    modes = transfer.modes()
    peaks = np.abs(transfer.at(modes.imag / (2 * np.pi)))
    record.extend(CURVE, columns)
    for mode, heights in zip(modes, peaks):
        row = {"value": value, "frequency": mode.imag / (2 * np.pi), "growth_rate": mode.real}
        record.append(PEAKS, row | dict(zip(OUTPUTS, heights)))
    point = {"value": value, "error": transfer.error, "size": transfer.size}
    # the peak of least damping, or the leading mode where there is none in the range of frequencies
    ratios = -modes.real / np.abs(modes)
    least = modes[int(np.argmin(ratios))] if len(modes) else complex(verdict.growth_rate, 2 * np.pi * verdict.frequency)
    point |= {"growth_rate": least.real, "frequency": least.imag / (2 * np.pi)}
    point |= {"damping_ratio": -least.real / abs(least)}
    point |= {"correlation_time": found.correlation_time[0]}
    record.append(POINTS, point | {f"{name}_rms": rms for name, rms in zip(OUTPUTS, found.rms)})


class ResponseResult(StudyResult):
    """Response to the pressure at the inlet.

    Attributes
    ----------
    parameter : str
    points : list of dict
        One for each value of the range that is stable.

    Examples
    --------
    >>> found = dbvfiv.load("cases/dbv12-in-line.toml").response(pressure="2 m")                # doctest: +SKIP
    >>> found.points[0]["lip_displacement_rms"], found.peaks(found.points[0]["value"])          # doctest: +SKIP
    """

    kind = "response"

    @property
    def parameter(self) -> str:
        axis = self.case.response.axis
        return "pressure" if axis is None else axis.parameter

    @cached_property
    def points(self) -> list[dict[str, Any]]:
        rows = self.record.table_rows(_TABLES[2])
        return [{name: np.asarray(value).item() for name, value in row.items()} for row in rows]

    def curve(self, value: float) -> dict[str, np.ndarray]:
        """Frequencies, Hz, and complex responses per Pa by name at a value of the range."""
        here = self.record.column(CURVE, "value") == value
        read = lambda name: self.record.column(CURVE, name)[here]  # noqa: E731
        return {"frequency": read("frequency")} | {n: read(f"{n}_real") + 1j * read(f"{n}_imag") for n in OUTPUTS}

    def peaks(self, value: float) -> list[dict[str, float]]:
        """Modes in the range of frequencies at a value of the range, with the amplitudes per Pa at each."""
        found = []
        for row in self.record.table_rows(_TABLES[1]):
            if row["value"] == value:
                plain = {name: float(number) for name, number in row.items()}
                turns = 2 * np.pi * plain["frequency"]
                found.append(plain | {"damping_ratio": -plain["growth_rate"] / np.hypot(plain["growth_rate"], turns)})
        return sorted(found, key=lambda peak: peak["frequency"])

    def summary(self) -> dict[str, Any]:
        points = []
        for point in self.points:
            curve = self.curve(point["value"])
            shown = {"frequency": curve.pop("frequency").tolist()}
            shown |= {n: {"amplitude": np.abs(c).tolist(), "phase": np.angle(c).tolist()} for n, c in curve.items()}
            peaks = [{k: float(v) for k, v in p.items()} for p in self.peaks(point["value"])]
            points.append(point | {"peaks": peaks, "curve": shown})
        fixed = fixed_conditions(self.case, self.parameter)
        return {"parameter": self.parameter, "points": points, "fixed": fixed} | self.ending()

    def shortfall(self) -> str | None:
        lost = len(self.failures)
        return f"There is no response at {lost} of the states" if lost else None

    def drawers(self) -> Iterator[tuple[str, Callable[[], Figure]]]:
        yield from draw(self)

    def lines(self) -> list[str]:
        row = PARAMETERS[self.parameter]
        said = [f"At {describe_fixed(self.case, self.parameter)}; {self.noise}:"]
        head = f"{self.parameter:>14}{'damping, %':>12}{'at, Hz':>10}{'lip rms, um':>13}{'flow rms, L/s':>15}"
        said.append(f"{head}{'correlation, s':>16}")
        said += [
            f"{row.text(p['value']):>14}{100 * p['damping_ratio']:>12.4g}{p['frequency']:>10.4g}"
            f"{1e6 * p['lip_displacement_rms']:>13.4g}{1e3 * p['flow_rms']:>15.4g}{p['correlation_time']:>16.4g}"
            for p in self.points
        ]
        if not self.points:
            return [*said, "There is no stable state."]
        last = self.points[-1]
        said += ["", f"Peaks at {row.text(last['value'])}, per kPa at the inlet:"]
        said.append(f"{'frequency, Hz':>14}{'damping, %':>12}{'lip, um':>12}{'flow, L/s':>12}{'flange, Pa':>12}")
        said += [
            f"{p['frequency']:>14.5g}{100 * p['damping_ratio']:>12.4g}{1e9 * p['lip_displacement']:>12.4g}"
            f"{1e6 * p['flow']:>12.4g}{1e3 * p['flange_pressure']:>12.4g}"
            for p in self.peaks(last["value"])
        ]
        worst = max(point["error"] for point in self.points)
        said.append(f"Reduced operator of {last['size']} unknowns, within {worst:.1g} of the full one where checked.")
        return said

    @property
    def noise(self) -> str:
        """Pressure noise in words."""
        asked = self.case.response
        if asked.spectrum is not None:
            return f"pressure noise of {asked.spectrum.name}"
        return f"white pressure noise of {asked.noise:.4g} Pa up to {asked.max_frequency:.4g} Hz"


_SHOWN = (("lip_displacement", 1e9, "Lip, um per kPa"), ("flow", 1e6, "Flow, L/s per kPa"))


def draw(result: StudyResult) -> Iterator[tuple[str, Callable[[], Figure]]]:
    """Figures of a response, each with its name."""
    if result.points:
        yield "response", lambda: response(result)
    if len(result.points) > 1:
        yield "precursors", lambda: precursors(result)


def _under(figure: Figure, result: StudyResult) -> None:
    words = f"{describe_fixed(result.case, result.parameter)} · {result.noise}"
    figure.supxlabel(words, x=0.01, ha="left", fontsize=8.5, color="0.35")


def response(result: StudyResult) -> Figure:
    """Amplitudes per pressure at the inlet and the phase of the lip, over frequency."""
    figure = new_figure(7.6, 6.4)
    axes = figure.subplots(3, 1, sharex=True)
    for point in some_of(result.points):
        curve, label = result.curve(point["value"]), PARAMETERS[result.parameter].text(point["value"])
        for panel, (name, scale, _) in zip(axes, _SHOWN):
            panel.semilogy(curve["frequency"], scale * np.abs(curve[name]), lw=1.2, label=label)
        axes[2].plot(curve["frequency"], np.unwrap(np.angle(curve["lip_displacement"])) * 180 / np.pi, lw=1.2)
    for peak in result.peaks(result.points[-1]["value"]):
        axes[0].axvline(peak["frequency"], color="0.6", lw=0.7, ls=":")
    for panel, (_, _, label) in zip(axes, _SHOWN):
        panel.set_ylabel(label)
    axes[2].set(xlabel="Frequency, Hz", ylabel="Phase of the lip, deg", xlim=(0, result.case.response.max_frequency))
    axes[0].legend(fontsize=8)
    headline(figure, f"Response of {result.header.name} to the pressure at the inlet")
    _under(figure, result)
    return figure


def precursors(result: StudyResult) -> Figure:
    """Root mean square of the lip under the noise, its correlation time, and the least damping over the range."""
    figure = new_figure(7.6, 6.4)
    axes = figure.subplots(3, 1, sharex=True)
    x = np.array([point["value"] for point in result.points]) / PARAMETERS[result.parameter].scale
    rows = (
        ("lip_displacement_rms", 1e6, "Lip rms, um", COMPUTED),
        ("correlation_time", 1.0, "Correlation time, s", COMPUTED),
        ("damping_ratio", 100.0, "Least damping, %", ACCENT),
    )
    for panel, (name, scale, label, colour) in zip(axes, rows):
        panel.plot(x, [scale * point[name] for point in result.points], "o-", color=colour)
        panel.set_ylabel(label)
    axis = result.case.response.axis
    if axis is not None and axis.log:
        axes[2].set_xscale("log")
    axes[2].set_xlabel(parameter_label(result.case, result.parameter))
    headline(figure, f"Towards the onset, {result.header.name}")
    _under(figure, result)
    return figure


STUDY = Study("response", tables_of, run, ResponseResult, rows_to_keep=rows_to_keep)
