"""A transient run as a result: histories, states, verdict."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from ...errors import CaseError
from ...motion.control import RunOptions
from ...record.mesh import WholeValve
from ...record.record import Record
from ...record.vtkhdf import Step
from ..result import StudyResult
from ..stability.verdict import Verdict
from . import figures
from .animation import animate
from .assess import assess, stability_of
from .tables import HISTORY, PROFILES, SCALARS, STATE_COLUMNS, STATES, added_columns

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
        Columns of `dbvfiv.studies.transient.tables.SCALARS` and `PROFILES`, and of `RELAXING` where the wall relaxes,
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
    def stability(self) -> Verdict | None:
        """Verdict on the steady state that the run was kicked from; None of a run that was not kicked."""
        if self.case.transient.start != "kick" or not self.begun:
            return None
        refusals = self.record.notes(REFUSAL)
        if refusals:
            return Verdict.not_valid(refusals[-1]["text"])
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
        return _TransientSteps(self, valve)

    def animate(self, path: str | Path, frames: int = 48, duration: float | None = None) -> Path:
        """Write a GIF of the deformed lip and centre line over the last cycle, or over the last `duration`, s."""
        self.require_steps()
        return animate(self, Path(path), frames, duration)


class _TransientSteps(Sequence):
    """States as steps over the time in s."""

    def __init__(self, result: TransientResult, valve: WholeValve):
        self.result, self.valve = result, valve

    def __len__(self) -> int:
        return len(self.result.states)

    def __getitem__(self, index: int) -> Step:
        state = self.result.states[index]
        row = np.empty(len(self.result.mesh.nodes), int)
        row[self.result.mesh.rows] = np.arange(len(self.result.mesh.rows))[:, None]
        return Step(
            state.time,
            {
                "displacement": self.valve.vectors(state.nodal[:, :3]),
                "velocity": self.valve.vectors(state.nodal_rate[:, :3]),
                "pressure": state.station_pressure[row][self.valve.node],
            },
        )
