"""A transient run as a result: verdicts on its signals, histories, states."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...errors import CaseError
from ...model import ValveModel
from ...motion.control import RunOptions
from ...record.mesh import MeshData, WholeValve
from ...record.record import Record
from ...record.vtkhdf import Step
from ...verdict import JudgeOptions, Verdict, judge
from ..result import StudyResult
from ..stability.verdict import DIVERGES, FLUTTERS, STABLE, UNDECIDED
from ..stability.verdict import Verdict as StabilityVerdict
from ..state import StateSteps
from . import figures
from .figures import animate
from .keeping import HISTORY, PROFILES, SCALARS, STATE_COLUMNS, STATES, added_columns

#: Columns of a history by name.
Columns = Mapping[str, np.ndarray]
#: Smallest area over that of the lip gap at rest up to which a valve is closed: where the pressure drives fluid out,
#: and where nothing does.
SHUT, UNOPENED = 0.5, 2.0
#: Pascal; no fluid's pressure falls further below that of the surroundings.
ATMOSPHERE = 101_325.0


@dataclass(frozen=True)
class RunVerdict:
    """Verdicts on the signals and what mass flow and lip displacement say together.

    Attributes
    ----------
    mass_flow, lip_displacement : Verdict
    lip_opening : Verdict
        Of the clear opening, which is cut off at zero and says nothing more; amplitudes are about twice as large.
    residual : float
        Unbalanced force at the end over pressure force; not a number while the pressure changes.
    steps : int
    time : float, s
    """

    mass_flow: Verdict
    lip_displacement: Verdict
    lip_opening: Verdict
    residual: float
    steps: int
    time: float

    @property
    def name(self) -> str:
        """The livelier of the two: a flow can look settled while the lip still moves."""
        names = (self.mass_flow.name, self.lip_displacement.name)
        return max(names, key=_LIVELINESS.index)

    @property
    def decided(self) -> bool:
        """True where the verdicts on mass flow and lip displacement agree and a longer run would not change them."""
        lip = self.lip_displacement
        return self.mass_flow.decided and lip.decided and self.mass_flow.name == lip.name

    @property
    def governing(self) -> Verdict:
        """The verdict that gives the name."""
        return self.mass_flow if self.mass_flow.name == self.name else self.lip_displacement

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON: name and numbers of the mass flow, then each signal by itself."""
        flow = self.mass_flow.summary()
        top = {key: flow[key] for key in ("amplitude", "frequency", "mean", "cycles_observed", "periodicity_error")}
        return {
            "verdict": self.name,
            "decided": bool(self.decided),
            "reason": self.governing.reason,
            **top,
            "steps": self.steps,
            "time": self.time,
            "residual": self.residual if np.isfinite(self.residual) else None,
            "mass_flow": flow,
            "lip_opening": self.lip_opening.summary(),
            "lip_displacement": self.lip_displacement.summary(),
        }


_STABILITY = {"steady": STABLE, "decaying": STABLE, "limit cycle": FLUTTERS, "growing": FLUTTERS}
_LIVELINESS = ("closed", "steady", "decaying", "limit cycle", "growing", "undecided", "irregular")


def assess(
    history: Columns,
    model: ValveModel,
    residual: float = np.nan,
    options: JudgeOptions = JudgeOptions(),
    since: float = 0.0,
) -> RunVerdict:
    """Verdict on a history.

    A valve is closed where its lips shut the gap they have at rest, or where nothing drives fluid out and they do not
    open; one that stands at its gap under a pressure lets flow what passes there.

    Parameters
    ----------
    history : mapping of str to array
        See `dbvfiv.studies.transient.keeping.SCALARS`.
    model : ValveModel
    residual : float
        Of the equilibrium at the end; not a number if it is not known.
    since : float
        Time, s, before which the drive still changed.
    """
    time = history["time"]
    chosen = time >= since
    known = residual if np.isfinite(residual) else None
    signals = ("mass_flow", "lip_displacement", "lip_opening")
    found = [judge(time[chosen], history[name][chosen], options, residual=known) for name in signals]
    driven = history["inlet_pressure"] > model.case.rest_pressure
    area = history["smallest_area"] / (np.where(driven, SHUT, UNOPENED) * lip_gap(model))
    if judge(time[chosen], area[chosen], options, closed_below=1.0).name == "closed":
        reason = "The lips shut the gap that they have at rest, or nothing drives fluid out and they do not open."
        found = [Verdict(**{**vars(v), "name": "closed", "decided": True, "reason": reason}) for v in found]
    return RunVerdict(*found, residual, len(time) - 1, float(time[-1]))


def stability_of(summary: Mapping[str, Any]) -> StabilityVerdict:
    """Stability of the steady state that a run was kicked from, by what became of the kick.

    Parameters
    ----------
    summary : mapping
        Of a `RunVerdict`.
    """
    lip = summary.get("lip_displacement") or {}
    frequency = lip.get("frequency") or np.nan
    outcome = _STABILITY.get(summary["verdict"], UNDECIDED)
    if summary["verdict"] == "growing" and not np.isfinite(frequency):
        outcome = DIVERGES
    reason = f"After a kick the run in time ends as {summary['verdict']}: {summary['reason']}"
    return StabilityVerdict(outcome, reason, frequency=frequency, certain=bool(summary["decided"]))


def lip_gap(model: ValveModel) -> float:
    """Flow area of the whole valve at the lip at rest, m2."""
    mesh = model.mesh
    return mesh.part.copies * float(mesh.rest_area[0] - mesh.wall_deduction[0])


def beyond_model(history: Columns) -> str | None:
    """Sentence on speeds and pressures beyond what the equations are for, None without any.

    An ideal incompressible fluid pays any price for passing a gap that shuts; a real one separates, cavitates or is
    compressed. What follows such an instant is the solution of the equations and no prediction.
    """
    fastest = np.asarray(history["mach"]) if "mach" in history else np.zeros(1)
    if fastest.max() > 1.0:
        where = int(np.argmax(fastest > 1.0))
        return (
            f"The fluid is faster than sound in the valve from {history['time'][where]:.4g} s on, in "
            f"{100 * np.mean(fastest > 1.0):.2g} % of the steps and up to Mach {fastest.max():.3g}: what shocks take "
            "is a loss of head here, and the air that lips draw in then is a rough estimate."
        )
    lowest = np.min(history["station_pressure"], axis=1)
    beyond = np.flatnonzero(lowest < -ATMOSPHERE)
    if not len(beyond):
        return None
    time, share = history["time"][beyond[0]], len(beyond) / len(lowest)
    return (
        f"Pressures fall below vacuum from {time:.4g} s on, in {100 * share:.2g} % of the steps and down to "
        f"{1e-3 * lowest.min():.4g} kPa, where the valve slams "
        "shut: the fluid's equations are beyond their range there, and the motion afterwards is no prediction."
    )


#: Kind of the note that says why the constants of the rubber do not hold at the state that was kicked.
REFUSAL = "not valid"
_NO_VERDICT = {
    "verdict": "undecided",
    "decided": False,
    "reason": "No step was made: the run has just begun, or was ended before the first.",
    **dict.fromkeys(("amplitude", "frequency", "mean", "cycles_observed", "periodicity_error")),
    "steps": 0,
    "time": 0.0,
    "residual": None,
    **dict.fromkeys(("mass_flow", "lip_opening", "lip_displacement")),
}


@dataclass(frozen=True)
class TransientState:
    """A full state of a run.

    Attributes
    ----------
    time : float, s
    nodal, nodal_rate : (nn, c) arrays
        Displacements (m) and rotations (rad) of the nodes, and their rates, c = 5.
    station_pressure, station_area : (m,) arrays, Pa, m2 of the part that is computed
    station_velocity : (m,) array, m/s
        At the flange only; the others are not a number.
    """

    time: float
    nodal: np.ndarray
    nodal_rate: np.ndarray
    station_pressure: np.ndarray
    station_area: np.ndarray
    station_velocity: np.ndarray


class StateList(Sequence):
    """Full states of a record, read one at a time."""

    def __init__(self, record: Record):
        self._record = record

    def __len__(self) -> int:
        return self._record.rows(STATES)

    def __getitem__(self, index):
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        at = range(len(self))[index]
        row = {c.name: self._record.value(STATES, c.name, at) for c in STATE_COLUMNS}
        velocity = np.full(len(row["station_area"]), np.nan)
        velocity[-1] = row.pop("inlet_velocity")
        return TransientState(float(row.pop("time")), station_velocity=velocity, **row)


class TransientResult(StudyResult):
    """A time history and its verdict.

    Attributes
    ----------
    history : dict of str to array
        Columns of `dbvfiv.studies.transient.keeping.SCALARS` and `PROFILES`, and of `RELAXING` where the wall relaxes,
        for the groups of layers in `mesh.relaxing`, of `LINE` behind an elastic line, of `GAS` where the fluid is
        compressed, and of `FACES` where inner faces touch; one row for each step.
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
        columns = (*SCALARS, *PROFILES, *added_columns(self.mesh))
        return {c.name: self.record.column(HISTORY, c.name) for c in columns}

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
        return assess(self.history, self.model).summary()

    @cached_property
    def stability(self) -> StabilityVerdict | None:
        """Verdict on the steady state that the run was kicked from; None of a run that was not kicked."""
        if self.case.transient.start != "kick" or not self.begun:
            return None
        refusals = self.record.notes(REFUSAL)
        if refusals:
            return StabilityVerdict.not_valid(refusals[-1]["text"])
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

    def shortfall(self) -> str | None:
        if not self.failures:
            return None
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
            (
                f"{verdict['verdict']}{'' if verdict['decided'] else ' (not certain)'} after "
                f"{verdict['time']:.4g} s and {verdict['steps']} steps{under}"
            ),
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
            numbers = (
                factor * h[name][-1],
                *(
                    None if found[k] is None else f * found[k]
                    for k, f in (("mean", factor), ("amplitude", factor), ("frequency", 1.0))
                ),
            )
            cells = "".join(f"{'-' if value is None else f'{value:.5g}':>13}" for value in numbers)
            error = found["periodicity_error"]
            lines.append(
                f"{name.replace('_', ' '):<16}{cells}{found['cycles_observed']:>9}"
                f"{'-' if error is None else f'{error:.2g}':>20}   {unit}, Hz"
            )
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

    def drawers(self) -> Iterator[tuple[str, Callable[[], Figure]]]:
        return figures.draw(self) if self.begun else iter(())

    def steps(self, valve: WholeValve) -> Sequence[Step]:
        return StateSteps(self.states, lambda state: _step(state, self.mesh, valve))

    def animate(self, path: str | Path, frames: int = 48, duration: float | None = None) -> Path:
        """Write a GIF of the deformed lip and centre line over the last cycle, or over the last `duration`, s."""
        self.require_steps()
        return animate(self, Path(path), frames, duration)


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
