"""A steady state of a result, and what can be asked about it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from eigen.operator import CoupledPencil

from ..case.axis import write_axis
from ..case.parameters import Mu
from ..errors import CaseError, SolveError
from ..model.dynamics import linearise
from ..model.equilibria import LoadPath, SteadyOptions, require_equilibrium
from ..model.state import SteadyState
from ..model.valve import ValveModel
from ..record.mesh import WholeValve
from ..record.record import GrowingRecord
from ..record.states import read_layers, read_states, restart_row, restore_path, state_row, summarise
from ..record.vtkhdf import Step, layer_field_names, motion
from ..shell.recovery import LayerFields
from .case import Case
from .result import StudyResult
from .session import find_study, named_changes


@dataclass(frozen=True, eq=False)
class State(SteadyState):
    """An equilibrium of a result, and what can be asked about it.

    Attributes
    ----------
    results : StudyResult
        The run it belongs to.
    table : str
        Where it is kept in that.
    index : int
        Its place there.

    Examples
    --------
    >>> state = dbvfiv.load().steady(pressure=36e3)     # doctest: +SKIP
    >>> state.mass_flow, state.layers.von_mises.max()   # doctest: +SKIP
    """

    results: StudyResult = field(repr=False)
    table: str = field(repr=False)
    index: int = field(repr=False)

    def __repr__(self) -> str:
        numbers = f"{self.mass_flow:.4g} kg/s, lip opening {self.lip_opening * 1e3:.4g} mm"
        return f"<State at {self.pressure / 1e3:.6g} kPa: {numbers}>"

    def __getstate__(self) -> dict[str, Any]:
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @cached_property
    def layers(self) -> LayerFields:
        """Strains and stresses of the layers."""
        return read_layers(self.results.record, self.table, self.index)

    @property
    def model(self) -> ValveModel:
        """The coupled model it is a state of."""
        return self.results.model

    def summary(self) -> dict[str, Any]:
        """Plain SI numbers for JSON."""
        return summarise(self)

    def solution(self) -> SteadyState:
        """The state by itself, to start from for instance."""
        return SteadyState(**{f.name: getattr(self, f.name) for f in fields(SteadyState)})

    def pencil(self, **changes: Any) -> CoupledPencil:
        """Operator of small motions about this state: M, C, K, G and J as sparse matrices, the fluid's parts dense.

        Fluid and damping may differ from those it was found with, the pressure may not. Rows of M, C and K are the
        unknowns of ``q``, those of ``model.shell.dofs``.

        Raises
        ------
        CaseError
            If another pressure is asked for.
        SolveError
            If it is no steady state of that fluid.

        Examples
        --------
        >>> state.pencil(density=1.2, alpha=0).K     # doctest: +SKIP
        """
        given, model = {"drive.pressure": self.pressure} | self._changes(changes), self.model
        session = self.results.session.replace(given)
        point, own = Mu.of(session.case), Mu.of(model.case)
        moves = any(point.get(name) != own.get(name) for name in ("density", "pipe_length"))
        if moves or session.case.has_waves != model.case.has_waves:
            model = session.model
            require_equilibrium(model, self)
        return linearise(model, self.q, self.pressure).pencil(point)

    def modes(
        self, *, count: int | None = None, output: str | Path | None = None, observer: Any = None, **changes: Any
    ) -> Any:
        """Leading modes of this state; fluid and damping may differ from those it was found with.

        Examples
        --------
        >>> state.modes(density=1.2, alpha=0).plot("figures")     # doctest: +SKIP
        """
        return self._ask("modes", {"modes.count": count}, changes, output, observer)

    def sweep(
        self,
        over: str | Mapping[str, Sequence[float | str]] | None = None,
        *,
        count: int | None = None,
        output: str | Path | None = None,
        observer: Any = None,
        **changes: Any,
    ) -> Any:
        """Modes of this state tracked along a parameter of load, fluid or damping, as `Valve.sweep` takes it."""
        return self._ask("sweep", {"sweep.over": write_axis(over), "sweep.count": count}, changes, output, observer)

    def sensitivity(
        self,
        of: str | Sequence[str] = (),
        *,
        mode: int | None = None,
        output: str | Path | None = None,
        observer: Any = None,
        **changes: Any,
    ) -> Any:
        """Derivatives of the leading mode of this state by parameters, such as ["pressure", "layer 3 angle"]; by all
        that the valve has without them.
        """
        return self._ask("sensitivity", sensitivity_keys(of, mode), changes, output, observer)

    def _changes(self, given: dict[str, Any], kind: str = "") -> dict[str, Any]:
        """Changes of the case from keyword arguments; the pressure is that of the state."""
        changes = named_changes(given, kind)
        if "drive.pressure" in changes:
            raise CaseError("A state has the pressure it was found at; ask the valve for another.", "drive.pressure")
        return changes

    def _ask(self, kind: str, keys: dict[str, Any], given: dict[str, Any], output: Any, observer: Any) -> Any:
        session = self.results.session.replace({"drive.pressure": self.pressure})
        session = session.prepared(kind, keys | self._changes(given, kind))
        session.start = self.solution()
        return session.perform(kind, output, observer)

    def plot(self, folder: str | Path = ".", format: str = "png") -> list[Path]:
        """Write the figures of this state alone."""
        return gather_states(self.results, [self]).plot(folder, format)

    def save(self, path: str | Path) -> Path:
        """Write a result file with this state alone."""
        return gather_states(self.results, [self]).save(path)

    def export(self, path: str | Path, quarter: bool = False, deformed: bool = False) -> Path:
        """Write this state for ParaView."""
        return gather_states(self.results, [self]).export(path, quarter, deformed)

    def export_shapes(
        self, folder: str | Path = ".", format: str = "stl", shapes: Sequence[str] = (), quarter: bool = False
    ) -> list[Path]:
        """Write faces of the wall, the wall and the fluid inside as STL (m) or STEP (mm); see
        `dbvfiv.exchange.files.write_shapes`.

        Examples
        --------
        >>> state.export_shapes("cad", "step", ["fluid", "wall"])     # doctest: +SKIP
        """
        return gather_states(self.results, [self]).export_shapes(folder, format, shapes, quarter)


def sensitivity_keys(of: str | Sequence[str], mode: int | None) -> dict[str, Any]:
    """Keys of the case from what a sensitivity is asked for."""
    names = [of] if isinstance(of, str) or not isinstance(of, Iterable) else list(of)
    return {"sensitivity.of": names or None, "sensitivity.mode": mode}


def states_of(result: StudyResult, table: str) -> tuple[State, ...]:
    """The states that a table of a result holds."""
    found = enumerate(read_states(result.record, table))
    return tuple(State(**vars(state), results=result, table=table, index=i) for i, state in found)


#: Note on a pressure that was not reached.
UNREACHED = "unreached"


def miss(record: GrowingRecord, pressure: float, error: SolveError) -> None:
    """Keep a pressure, Pa, that is not reached: it is not tried again, and its failure is said again."""
    record.note(UNREACHED, pressure=pressure, text=str(error))
    record.fail(str(error))


def missed_before(record: GrowingRecord) -> list[dict[str, Any]]:
    """Notes on pressures that an earlier attempt did not reach, whose failures are said again."""
    missed = record.notes(UNREACHED)
    for note in missed:
        record.fail(note["text"])
    return missed


def reach_states(
    model: ValveModel,
    case: Case,
    record: GrowingRecord,
    table: str,
    pressures: Iterable[float],
    states: list[SteadyState],
    tell: Callable[[SteadyState], None] | None = None,
) -> list[str]:
    """Walk a load path over pressures, Pa, and keep each state in a table of a record; one that is not reached is a
    failure, and the walk goes on from the last state.

    Parameters
    ----------
    case : Case
        With the options of the walk.
    record, table : GrowingRecord, str
        States and failures that it holds are not looked for again; the walk goes on from the last state.
    pressures : iterable of float, Pa
    states : list of SteadyState
        Takes the states, those that the record holds first.
    tell : callable, optional
        Is given each state that was found.

    Returns
    -------
    list of str
        Sentences on the pressures that were not reached.
    """
    path = LoadPath(model, SteadyOptions.of(case), observer=record)
    states.extend(read_states(record, table))
    if states:
        restore_path(path, record, table, len(states) - 1, states[-1])
    missed = missed_before(record)
    failures = [note["text"] for note in missed]
    # each as often as it was met: pressures may come back
    left = Counter([*(state.pressure for state in states), *(note["pressure"] for note in missed)])
    for pressure in pressures:
        if left[pressure] > 0:
            left[pressure] -= 1
            continue
        record.progress(f"steady state at {pressure:.6g} Pa")
        before = path.pressure, path.q, path.slope, path.step
        try:
            state = path.go_to(pressure)
        except SolveError as error:
            path.pressure, path.q, path.slope, path.step = before  # as in a run that goes on without this pressure
            failures.append(str(error))
            miss(record, pressure, error)
            continue
        record.append(table, state_row(model, state) | restart_row(path))
        states.append(state)
        if tell is not None:
            tell(state)
    return failures


@dataclass(frozen=True)
class StateSteps(Sequence):
    """Steps for ParaView, made one at a time from states."""

    states: Sequence[Any]
    step: Callable[[Any], Step]

    def __len__(self) -> int:
        return len(self.states)

    def __getitem__(self, number: int) -> Step:
        return self.step(self.states[number])


def pressure_steps(
    states: Iterable[Any], valve: WholeValve, rows: Sequence[str] = (), nodes: Sequence[str] = ()
) -> StateSteps:
    """Steps for ParaView of states in the order of their pressures, Pa, which are the "time": motion, layers, numbers
    ``station_NAME`` of `rows` on elements, and numbers of `nodes` at points.
    """
    ordered = sorted({state.pressure: state for state in states}.values(), key=lambda state: state.pressure)

    def step(state: Any) -> Step:
        mesh = state.results.mesh
        at, cells = mesh.element_rows(), {"thickness": mesh.thickness}
        for name in rows:
            values = getattr(state, f"station_{name}")
            cells[name] = 0.5 * (values[at] + values[at + 1])
        layers = {"von_mises": state.layers.von_mises, "largest_stretch": state.layers.stretch[:, :, 1]}
        for quantity, values in layers.items():
            cells |= dict(zip(layer_field_names(mesh, quantity), values.T))
        points = motion(mesh, valve, state.nodal) | {name: getattr(state, name)[valve.node] for name in nodes}
        return Step(state.pressure, points, {name: valve.cells(values) for name, values in cells.items()})

    return StateSteps(ordered, step)


def gather_states(origin: StudyResult, states: Sequence[State]) -> Any:
    """A steady result with some states of a result of any kind."""
    study = find_study("steady")
    (table,) = study.tables(origin.mesh)
    record = GrowingRecord(replace(origin.header, kind="steady"), origin.mesh, (table,))
    record.warn(*origin.warnings)
    for state in states:
        held = {c.name for c in origin.record.tables[state.table].columns}
        row = {
            c.name: origin.record.value(state.table, c.name, state.index)
            if c.name in held
            else np.full(table.shape(c), np.nan)
            for c in table.columns
        }
        record.append(table.name, row)
    record.conclude(origin.complete)
    return study.result(record, origin.session)
