"""Time histories of the valve: run, result with its verdict, several runs side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.figure import Figure

from ...errors import CaseError
from ...motion.control import Drive, RunOptions
from ...record.mesh import MeshData, WholeValve
from ...record.record import GrowingRecord, Record
from ...record.vtkhdf import Step
from ...texts import digits
from ..case import Case
from ..comparing import cell, labels
from ..result import StudyResult
from ..session import Session, Study
from ..stability.verdict import DIVERGES, FLUTTERS, STABLE, UNDECIDED, Verdict
from ..state import StateSteps
from . import figures
from .history import HISTORY, RESTART, STATE_COLUMNS, STATES, rows_to_keep, tables_of
from .run import NUMBERS, REFUSAL, Runner, assess


def check(case: Case) -> None:
    """Refuse a drive below the pressure at rest where the flow has no inertia: the steady law has outward flow alone.
    Raises CaseError.
    """
    if not case.fluid.unsteady and (least := min(Drive.of(case).pressures)) < case.rest_pressure:
        raise CaseError(
            f"fluid.unsteady is false, which knows outward flow alone, and the least drive is {least:g} Pa, below the "
            f"{case.rest_pressure:g} Pa at which nothing flows.",
            key="fluid.unsteady",
        )


def run(session: Session, record: GrowingRecord) -> None:
    """The history that the section transient of the case asks for, from where the record ends."""
    runner = Runner(session.model, record=record, case=session.case)
    found = runner.resume() if record.rows(RESTART) else runner.start()
    if found.interrupted:
        raise KeyboardInterrupt


#: Difference of the pump's pressure from drive.pressure, over that, up to which a run is at its operating point.
_OPERATING = 1e-3
_STABILITY = {"steady": STABLE, "decaying": STABLE} | dict.fromkeys(("limit cycle", "growing", "chatters"), FLUTTERS)


def stability_of(summary: Mapping[str, Any]) -> Verdict:
    """Stability of the steady state that a run was kicked from, by what became of the kick.

    Parameters
    ----------
    summary : mapping
        Of a `RunVerdict`.
    """
    lip = summary.get("lip_displacement") or {}
    frequency = lip.get("frequency") or np.nan
    outcome = _STABILITY.get(summary["verdict"], UNDECIDED) if summary["decided"] else UNDECIDED
    if outcome == FLUTTERS and summary["verdict"] == "growing" and not np.isfinite(frequency):
        outcome = DIVERGES
    reason = f"After a kick the run in time ends as {summary['verdict']}: {summary['reason']}"
    return Verdict(outcome, reason, frequency=frequency, certain=outcome != UNDECIDED)


_NO_VERDICT = {
    "verdict": "undecided",
    "decided": False,
    "reason": "No step was made: the run has just begun, or was ended before the first.",
    **dict.fromkeys(NUMBERS),
    "steps": 0,
    "time": 0.0,
    "residual": None,
    **dict.fromkeys(("mass_flow", "lip_opening", "lip_displacement")),
}


class TransientState(NamedTuple):
    """A full state of a run."""

    time: float  #: s.
    #: nodal and nodal_rate: (nn, c); displacements (m) and rotations (rad) of the nodes, and their rates, c = 5.
    nodal: np.ndarray
    nodal_rate: np.ndarray
    #: station_pressure and station_area: (m,), Pa, m2 of the part that is computed.
    station_pressure: np.ndarray
    station_area: np.ndarray
    station_velocity: np.ndarray  #: (m,), m/s; at the flange only; the others are not a number.


class StateList(Sequence):
    """Full states of a record, read one at a time."""

    def __init__(self, record: Record):
        self._record = record

    def __repr__(self) -> str:
        return f"<StateList: {len(self)} states>"

    def __len__(self) -> int:
        return self._record.rows(STATES)

    def __getitem__(self, index):
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        row = [self._record.value(STATES, c.name, range(len(self))[index]) for c in STATE_COLUMNS]
        velocity = np.full(len(row[-2]), np.nan)
        velocity[-1] = row.pop()
        return TransientState(float(row[0]), *row[1:], velocity)


class TransientResult(StudyResult):
    """A time history and its verdict.

    Attributes
    ----------
    history : dict of str to array
        Columns that `dbvfiv.studies.transient.history` describes; one row for each step.
    states : sequence of TransientState
        Full states, `transient.save_every` apart, and the last one.
    verdict : dict
        What `RunVerdict.summary` gives; without a step all is None.

    Examples
    --------
    >>> run = dbvfiv.load().transient(output="run.h5")           # doctest: +SKIP
    >>> run.verdict["verdict"], run.history["mass_flow"][-1]     # doctest: +SKIP
    """

    kind = "transient"

    @cached_property
    def history(self) -> dict[str, np.ndarray]:
        return {c.name: self.record.column(HISTORY, c.name) for c in self.record.tables[HISTORY].columns}

    def dissipated(self) -> dict[str, float]:
        """Energy lost since the start, J: to Rayleigh damping and, where there are any, in groups of layers that relax,
        in an elastic line and in faces that touch.
        """
        h = self.history
        lost = zip(self.mesh.relaxing, h["branch_loss"][-1]) if self.mesh.relaxing else ()
        losses = {"Rayleigh damping": float(h["dissipation"][-1])} | {name: float(value) for name, value in lost}
        named = {"line": "line_dissipation", "contact of the faces": "contact_loss"}
        return losses | {name: float(h[column][-1]) for name, column in named.items() if column in h}

    @cached_property
    def states(self) -> StateList:
        return StateList(self.record)

    @property
    def begun(self) -> bool:
        """True where the run has a start and at least one step."""
        return self.record.rows(HISTORY) > 1

    @cached_property
    def verdict(self) -> dict[str, Any]:
        notes, steps = self.record.notes("verdict"), self.record.rows(HISTORY) - 1
        if notes and notes[-1]["steps"] == steps:
            return {name: value for name, value in notes[-1].items() if name != "what"}
        if not self.begun:
            return dict(_NO_VERDICT)
        # a run that goes on or was killed has an older one, or none
        return assess(self.history, self.model, drive=Drive.of(self.case)).summary()

    @property
    def judged_from(self) -> float:
        """Time, s, from which on the run is judged."""
        return ((self.verdict.get("mass_flow") or {}).get("judged") or [0.0])[0] or 0.0

    @cached_property
    def stability(self) -> Verdict | None:
        """Verdict on the steady state that the run was kicked from; None of a run that was not kicked."""
        if self.case.transient.start != "kick" or not self.begun:
            return None
        refusals = self.record.notes(REFUSAL)
        if refusals:
            return Verdict.not_valid(refusals[-1]["text"])
        if (since := Drive.of(self.case).settled_at) > 0:
            return Verdict.undecided(f"The drive changes until {since:.4g} s, and the steady state with it.")
        own = self.case.drive.pressure
        if self.case.has_pump and abs(self.history["inlet_pressure"][0] - own) > _OPERATING * own:
            return Verdict.undecided(
                "The pump gives another pressure than drive.pressure at the flow of the steady state, which the run "
                "leaves therefore; leave one of the two out."
            )
        return stability_of(self.verdict)

    @property
    def complete(self) -> bool:
        """True where the run went to its end, or to where its verdict ended it."""
        return super().complete and not self.failures

    @property
    def interrupted(self) -> bool:
        return not super().complete

    @property
    def stopped(self) -> bool:
        """True where the verdict ended the run."""
        return self.complete and float(self.history["time"][-1]) < RunOptions.of(self.case).end

    def require_steps(self) -> None:
        """Make sure that there is something to show.

        Raises
        ------
        CaseError
        """
        if not self.begun:
            whose = f"in {str(self.path)!r}" if self.path else f"of {self.header.name!r}"
            raise CaseError(f"The run {whose} holds no steps yet: it has just begun, or was ended before the first.")

    def summary(self) -> dict[str, Any]:
        h, last = self.history, {}
        if self.begun:
            last = {
                name: float(h[name][-1])
                for name in ("mass_flow", "lip_opening", "lip_displacement", "outlet_area", "inlet_pressure", "balance")
            }
            if self.mesh.relaxing:
                last["dissipated"] = self.dissipated()
        return {
            **self.verdict,
            "stability": self.stability and self.stability.summary(),
            "last": last,
            "states": len(self.states),
            "failures": list(self.failures),
            "warnings": list(self.warnings),
            "complete": self.complete,
        }

    def _missed(self, lost: int) -> str:
        kept = "nothing was kept, as no -o was given"
        if self.path:
            kept = f"what was found up to there is kept in {self.path}"
        return f"The run ended early at {self.history['time'][-1]:.6g} s; {kept}"

    def lines(self) -> list[str]:
        verdict, h = self.verdict, self.history
        under = f", {self.case.continuity}" if self.case.continuity else ""
        if not self.begun:
            return [verdict["reason"]]
        lines = [
            f"{figures.verdict_word(verdict)} after {verdict['time']:.4g} s and {verdict['steps']} steps{under}",
            verdict["reason"],
            *([self.stability.sentence(under.removeprefix(", "))] if self.stability else []),
            "",
            "                         last         mean    amplitude    frequency   cycles   periodicity error",
        ]
        for name, unit, factor in (
            ("mass_flow", "kg/s", 1.0),
            ("lip_opening", "mm", 1e3),
            ("lip_displacement", "mm", 1e3),
        ):
            found = verdict[name]
            last = [h[name][-1], found["mean"], found["amplitude"]]
            numbers = [None if value is None else factor * value for value in last]
            cells = "".join(cell(value, 13, ".5g") for value in (*numbers, found["frequency"]))
            error = cell(found["periodicity_error"], 20, ".2g")
            lines.append(f"{name.replace('_', ' '):<16}{cells}{found['cycles_observed']:>9}{error}   {unit}, Hz")
        if chatter := verdict.get("chatter"):
            lines += [
                "",
                f"{chatter['shuttings']} shuttings, {chatter['rate']:.4g} a second (scatter of the intervals "
                f"{digits(100 * chatter['interval_scatter'], 2)} %), shut {100 * chatter['shut_share']:.0f} % of the "
                f"time; mean flow {chatter['mean_flow']:.4g} kg/s",
                f"opening before them {1e3 * chatter['opening']:.3g} mm (largest "
                f"{1e3 * chatter['largest_opening']:.3g} mm), a lip meets the other at "
                f"{chatter['impact_speed']:.3g} m/s (at most {chatter['largest_impact_speed']:.3g} m/s)",
            ]
        if self.mesh.relaxing:
            lost = ", ".join(f"{value:.4g} J in {name}" for name, value in self.dissipated().items() if value)
            lines += ["", f"dissipated since the start: {lost or 'nothing'}"]
        return lines

    @cached_property
    def cycle(self) -> tuple[float, float] | None:
        """Start and end, s, of the last cycle; None without one."""
        frequency = (self.verdict.get("lip_displacement") or {}).get("frequency")
        if not frequency:
            return None
        end = float(self.history["time"][-1])
        return max(end - 1.0 / frequency, float(self.history["time"][0])), end

    def steps(self, valve: WholeValve) -> Sequence[Step]:
        return StateSteps(self.states, lambda state: _step(state, self.mesh, valve))

    def animate(self, path: str | Path, frames: int = 48, duration: float | None = None) -> Path:
        """Write a GIF of the deformed lip and centre line over the last cycle, or over the last `duration`, s."""
        self.require_steps()
        return figures.animate(self, Path(path), frames, duration)


def _step(state: TransientState, mesh: MeshData, valve: WholeValve) -> Step:
    """Fields of a state; "time" is the time in s."""
    row = np.empty(len(mesh.nodes), int)
    row[mesh.rows] = np.arange(len(mesh.rows))[:, None]
    points = {
        "displacement": valve.vectors(state.nodal[:, :3]),
        "velocity": valve.vectors(state.nodal_rate[:, :3]),
        "pressure": state.station_pressure[row][valve.node],
    }
    return Step(state.time, points)


@dataclass(frozen=True)
class Together:
    """Several runs, their verdicts in one table, their histories in one figure."""

    results: Sequence[TransientResult]
    labels: list[str]

    def lines(self) -> list[str]:
        """Table for people: last values, amplitude, frequency and verdict of each run."""
        width = max(len(name) for name in self.labels) + 2
        lines = [f"{'':<{width}}{'last kg/s':>11}{'lip mm':>9}{'amplitude mm':>14}{'Hz':>8}  verdict"]
        for name, result in zip(self.labels, self.results):
            lip, h = result.verdict["lip_displacement"], result.history
            frequency = "-" if lip["frequency"] is None else f"{lip['frequency']:.3f}"
            lines.append(
                f"{name:<{width}}{h['mass_flow'][-1]:>11.5g}{1e3 * h['lip_displacement'][-1]:>9.4g}"
                f"{1e3 * lip['amplitude']:>14.4g}{frequency:>8}  {figures.verdict_word(result.verdict)}"
            )
        return lines

    def document(self) -> dict[str, Any]:
        """Part of the JSON document beside the runs themselves: nothing."""
        return {}

    def draw(self) -> Figure:
        """Figure of the runs."""
        return figures.draw_together(self.results)


def compare(results: Sequence[TransientResult]) -> Together:
    """Several runs side by side. Raises CaseError if one of them has no step."""
    for result in results:
        result.require_steps()
    return Together(results, labels(results, figures.QUIET))


STUDY = Study("transient", tables_of, run, TransientResult, check, rows_to_keep, extends=True, compare=compare)
