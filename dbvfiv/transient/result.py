"""A transient run as a result: histories, states, verdict; in memory or in a file."""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from ..errors import CaseError
from ..record.files import reading
from ..record.header import Header, read_header
from ..record.layout import read_texts
from ..record.mesh import MeshData, read_mesh
from ..record.result import Result
from ..record.vtkhdf import Step
from .assess import RunVerdict
from .file import STATES
from .history import PROFILES, SCALARS

if TYPE_CHECKING:
    from ..record.whole_valve import WholeValve
    from .run import TransientRun


@dataclass(frozen=True)
class TransientState:
    """A full state of a run.

    Attributes
    ----------
    time : float, s
    nodal, nodal_rate : (nn, 5) arrays
        Displacements (m) and rotations (rad) of the nodes, and their rates.
    station_pressure, station_area : (m,) arrays, Pa, m2 of a quarter
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
    """Full states of a file, read one at a time."""

    def __init__(self, path: Path | None, count: int):
        self._path, self._count = path, count

    def __len__(self) -> int:
        return self._count

    def __getitem__(self, index):
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(self._count))]
        if not -self._count <= index < self._count:
            raise IndexError(index)
        index %= self._count
        with reading(self._path) as file:
            row = {c.name: file["states"][c.name][index] for c in STATES}
        velocity = np.full(len(row["station_area"]), np.nan)
        velocity[-1] = row.pop("inlet_velocity")
        return TransientState(float(row.pop("time")), station_velocity=velocity, **row)


class TransientResults(Result):
    """A time history and its verdict.

    Attributes
    ----------
    history : dict of str to array
        Columns of `dbvfiv.transient.history`, one row for each step.
    states : sequence of TransientState
        Full states if the run was kept in a file, the last one otherwise.
    verdict : dict
        What `RunVerdict.summary` gives.
    stopped : bool
        Whether the verdict ended the run.

    Examples
    --------
    >>> run = dbvfiv.load().transient(output="run.h5")           # doctest: +SKIP
    >>> run.verdict["verdict"], run.history["mass_flow"][-1]     # doctest: +SKIP
    """

    kind = "transient"

    def __init__(
        self,
        header: Header,
        mesh: MeshData,
        history: dict[str, np.ndarray],
        states: Sequence,
        verdict: dict[str, Any],
        **common: Any,
    ):
        super().__init__(header, mesh, **common)
        self.history, self.states, self.verdict = history, states, verdict

    @classmethod
    def of(cls, run: TransientRun, header: Header | None = None, path: Path | None = None) -> TransientResults:
        """From a run that has just ended."""
        header = header or Header.of("transient", run.model.case)
        return cls(
            replace(header, complete=not run.interrupted and not run.failures),
            MeshData.of(run.model),
            {c.name: run.history[c.name].copy() for c in (*SCALARS, *PROFILES)},
            StateList(path, run.progress.saved) if path else (_last_state(run),),
            run.verdict.summary(),
            warnings=run.warnings,
            failures=run.failures,
            path=path,
            model=run.model,
        )

    @classmethod
    def read(cls, file: h5py.File, path: Path) -> TransientResults:
        history = file["history"]
        rows = len(history["time"])
        if rows == 0:
            raise CaseError(
                f"{str(path)!r} holds no steps yet: the run has just begun, or was killed before anything was written."
            )
        columns = {c.name: history[c.name][:rows] for c in (*SCALARS, *PROFILES)}
        verdict = json.loads(bytes(file["verdict"][()]) or b"{}")
        result = cls(
            read_header(file),
            read_mesh(file),
            columns,
            StateList(path, len(file["states/time"])),
            verdict,
            warnings=read_texts(file, "messages/warnings"),
            failures=read_texts(file, "messages/failures"),
            path=path,
        )
        if verdict.get("steps") != rows - 1:
            result.verdict = result._reassessed().summary()
        return result

    def _reassessed(self) -> RunVerdict:
        """The verdict on the rows that are there: a run that was killed has an older one in its file, or none."""
        from .assess import assess

        gap = 4.0 * float(self.history["station_area"][0, 0])
        return assess(_Rows(self.history), gap)

    def save(self, path: str | Path) -> Path:
        """Copy the file of the run.

        Raises
        ------
        CaseError
            If the run was not kept in a file; give `output` when it is started.
        """
        if self.path is None:
            raise CaseError("The run was not kept in a file; give it an output when it is started.")
        path = Path(path)
        if path.resolve() != Path(self.path).resolve():
            shutil.copyfile(self.path, path)
        return path

    def summary(self) -> dict[str, Any]:
        h = self.history
        last = {
            name: float(h[name][-1])
            for name in ("mass_flow", "lip_opening", "lip_displacement", "outlet_area", "inlet_pressure", "balance")
        }
        return {
            **self.verdict,
            "last": last,
            "states": len(self.states),
            "failures": list(self.failures),
            "warnings": list(self.warnings),
            "complete": self.complete,
        }

    def lines(self) -> list[str]:
        verdict, h = self.verdict, self.history
        lines = [
            (
                f"{verdict['verdict']}{'' if verdict['decided'] else ' (not certain)'} after "
                f"{verdict['time']:.4g} s and {verdict['steps']} steps"
            ),
            verdict["reason"],
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
        return _TransientSteps(self, valve)

    def animate(self, path: str | Path, frames: int = 48, duration: float | None = None) -> Path:
        """Write a GIF of the deformed lip and centre line over the last cycle, or over the last `duration`, s."""
        from ..plots.transient_motion import animate

        return animate(self, Path(path), frames, duration)


def _last_state(run: TransientRun) -> TransientState:
    """The state that a run ended in, which is all that is kept without a file."""
    model, state, h = run.model, run.progress.state, run.history
    velocity = np.full(model.stations, np.nan)
    velocity[-1] = state.speed
    pressure, area = h["station_pressure"][-1].astype(float), h["station_area"][-1].astype(float)
    return TransientState(state.time, model.nodal(state.q), model.nodal(state.v), pressure, area, velocity)


class _TransientSteps(Sequence):
    """States as steps over the time in s."""

    def __init__(self, result: TransientResults, valve: WholeValve):
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


class _Rows:
    """Columns that look like a `History`."""

    def __init__(self, columns: dict[str, np.ndarray]):
        self._columns, self.rows = columns, len(columns["time"])

    def __getitem__(self, name: str) -> np.ndarray:
        return self._columns[name]
