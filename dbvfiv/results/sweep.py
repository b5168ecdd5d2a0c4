"""Modes along a parameter: the result, in memory or in a file."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import h5py
import numpy as np

from ..case.parameters import PARAMETERS
from ..record.files import writing
from ..record.header import Header, read_header, write_header
from ..record.layout import TEXT, Column, Table, read_array, read_texts, replace_texts, write_array
from ..record.mesh import MeshData, read_mesh, write_mesh
from ..record.result import Result
from .modes import surroundings
from .state import SUMMARY
from .sweep_table import crossing_line, head, rows_of_sweep

if TYPE_CHECKING:
    from ..studies.sweep import SweepResult

_BRANCHES = (
    Column("id", "", "Number of each branch, by falling largest growth rate", "i8"),
    Column("growth_rate", "1/s", "Of each branch (first axis) at each value; NaN where it does not exist"),
    Column(
        "angular_frequency",
        "rad/s",
        "Imaginary part of the eigenvalue; negative for the second of two real modes that have merged",
    ),
    Column("confidence", "", "0 to 1, of the match with the value before"),
)
_CHECKS = (
    Column("value", "", "Value of the parameter"),
    Column("error", "", "Relative error of the basis, or largest residual of full solves"),
    Column("unstable_count", "", "Unstable eigenvalues listed", "i8"),
    Column("unstable_count_independent", "", "Unstable eigenvalues by the argument principle", "i8"),
    Column("agrees", "", "Whether both counts are equal", "bool"),
    Column("accurate", "", "Whether the error is within the tolerance", "bool"),
)
_MESSAGES = ("warnings", "notes", "failures")


@dataclass(frozen=True, eq=False)
class Branch:
    """A mode followed along the parameter.

    Attributes
    ----------
    id : int
    growth_rate : (p,) 1/s
        NaN where the branch does not exist.
    angular_frequency : (p,) rad/s
    confidence : (p,)
    """

    id: int
    growth_rate: np.ndarray
    angular_frequency: np.ndarray
    confidence: np.ndarray

    @property
    def frequency(self) -> np.ndarray:
        """(p,) Hz, not negative."""
        return np.abs(self.angular_frequency) / (2 * np.pi)

    def summary(self) -> dict[str, Any]:
        """Plain numbers for JSON; None where the branch does not exist."""
        columns = {"growth_rate": self.growth_rate, "frequency": self.frequency, "confidence": self.confidence}
        return {"id": self.id} | {
            name: [float(v) if np.isfinite(v) else None for v in values] for name, values in columns.items()
        }


@dataclass(frozen=True)
class Crossing:
    """Where a branch crosses zero growth, by interpolation between two values.

    Attributes
    ----------
    branch : int
    value : float
    frequency : float, Hz
    to_unstable : bool
        Whether the branch becomes unstable as the parameter grows.
    """

    branch: int
    value: float
    frequency: float
    to_unstable: bool


class SweepResults(Result):
    """Modes tracked along one parameter.

    Attributes
    ----------
    parameter : str
        "pressure", "density", "alpha" or "beta".
    values : (p,) SI
        Those done.
    branches : tuple of Branch
    unstable_count : (p,) int
        Both eigenvalues of a pair count.
    checks : (c,) structured as `dbvfiv.studies.sweep_family.Check`
    certified : bool
    states : see `dbvfiv.results.state.SUMMARY`
        Rows, one for each value over pressure, a single one otherwise.
    notes : tuple of str
    """

    kind = "sweep"

    def __init__(
        self,
        header: Header,
        mesh: MeshData,
        values: np.ndarray,
        branches: dict[str, np.ndarray],
        unstable_count: np.ndarray,
        checks: Sequence[dict[str, Any]],
        certified: bool,
        states: Sequence[dict[str, Any]],
        notes: Sequence[str] = (),
        **common: Any,
    ):
        super().__init__(header, mesh, **common)
        self.axis = header.case.sweep.axis
        self.parameter = self.axis.parameter
        self.values, self._table = values, branches
        self.branches = tuple(
            Branch(int(i), *(branches[c.name][row] for c in _BRANCHES[1:])) for row, i in enumerate(branches["id"])
        )
        self.unstable_count, self.checks, self.certified = unstable_count, tuple(checks), certified
        self.points, self.notes = tuple(states), tuple(notes)

    @property
    def units(self) -> str:
        """Of the parameter."""
        return PARAMETERS[self.parameter].quantity.si

    @classmethod
    def of(cls, result: SweepResult, header: Header | None = None, warnings: Sequence[str] = ()) -> SweepResults:
        """From a run that has just ended.

        Parameters
        ----------
        result : dbvfiv.studies.sweep.SweepResult
        header : Header, optional
            Where it comes from; its case names the range in sweep.over.
        warnings : sequence of str
        """
        model, found = result.model, result.branches
        header = header or Header.of("sweep", model.case)
        table = {
            "id": found.ids,
            "growth_rate": found.eigenvalues.real,
            "angular_frequency": found.eigenvalues.imag,
            "confidence": found.confidence,
        }
        missing = ~np.isfinite(found.eigenvalues.real)
        table["angular_frequency"] = np.where(missing, np.nan, table["angular_frequency"])
        states = [{c.name: getattr(state, c.name) for c in SUMMARY} for state in result.states]
        return cls(
            replace(header, complete=not (result.interrupted or result.failures)),
            MeshData.of(model),
            result.values,
            table,
            result.unstable_count,
            [{f.name: getattr(check, f.name) for f in fields(check)} for check in result.checks],
            result.certified,
            states,
            notes=result.notes,
            warnings=warnings,
            failures=result.failures,
            model=model,
        )

    @classmethod
    def read(cls, file: h5py.File, path: Path) -> SweepResults:
        group = file["sweep"]
        branches = {c.name: read_array(group["branches"], c) for c in _BRANCHES}
        messages = {name: read_texts(file, f"messages/{name}") for name in _MESSAGES}
        return cls(
            read_header(file),
            read_mesh(file),
            group["values"][...],
            branches,
            group["unstable_count"][...].astype(int),
            _rows(Table(group["checks"], _CHECKS)),
            bool(group.attrs["certified"]),
            _rows(Table(file["states"], SUMMARY)),
            path=path,
            **messages,
        )

    def save(self, path: str | Path) -> Path:
        with writing(path) as file:
            write_header(file, self.header)
            write_mesh(file, self.mesh)
            group = file.create_group("sweep")
            group.attrs["certified"] = self.certified
            write_array(group, Column("values", self.units, f"Values of {self.axis.key}"), self.values)
            write_array(
                group,
                Column("unstable_count", "", "Unstable eigenvalues, both of a pair counted", "i8"),
                self.unstable_count,
            )
            for column in _BRANCHES:
                write_array(group.require_group("branches"), column, self._table[column.name])
            checks = Table.create(group.create_group("checks"), _CHECKS, {})
            for row in self.checks:
                checks.append(row)
            states = Table.create(file.create_group("states"), SUMMARY, {"max_displacement_position": (3,)})
            for row in self.points:
                states.append(row)
            messages = file.create_group("messages")
            for name in _MESSAGES:
                replace_texts(messages, name, getattr(self, name))
        return Path(path)

    def crossings(self) -> tuple[Crossing, ...]:
        """Where branches cross zero growth, interpolated between neighbouring values; two real ones that have merged
        count once.
        """
        scale = np.log if self.axis.log else np.asarray
        place = scale(self.values)
        found = []
        for branch in self.branches:
            growth = branch.growth_rate
            for i in np.flatnonzero(growth[:-1] * growth[1:] < 0):
                share = growth[i] / (growth[i] - growth[i + 1])
                at = place[i] + share * (place[i + 1] - place[i])
                frequency = branch.frequency[i] + share * (branch.frequency[i + 1] - branch.frequency[i])
                if branch.angular_frequency[i] >= 0:
                    found.append(
                        Crossing(
                            branch.id, float(np.exp(at) if self.axis.log else at), float(frequency), bool(growth[i] < 0)
                        )
                    )
        return tuple(sorted(found, key=lambda c: c.value))

    def summary(self) -> dict[str, Any]:
        states = [
            {name: list(v) if isinstance(v, (tuple, np.ndarray)) else v for name, v in row.items()}
            for row in self.points
        ]
        return {
            "parameter": self.parameter,
            "values": self.values.tolist(),
            "branches": [branch.summary() for branch in self.branches],
            "unstable_count": self.unstable_count.tolist(),
            "crossings": [vars(crossing) for crossing in self.crossings()],
            "certificate": {"certified": self.certified, "checks": list(self.checks)},
            "surroundings": {name: v for name, v in surroundings(self.case).items() if name != self.parameter},
            "states": states,
            "notes": list(self.notes),
            "warnings": list(self.warnings),
            "failures": list(self.failures),
            "interrupted": not (self.complete or self.failures),
        }

    def lines(self) -> list[str]:
        crossings = [crossing_line(self, crossing) for crossing in self.crossings()]
        places = ", ".join(f"{check['value']:.4g}" for check in self.checks)
        word = "Certified" if self.certified else "Not certified"
        checked = (
            [f"{word}: checked at {self.parameter} {places} {self.units}."]
            if self.checks
            else ["Not certified: no value was checked."]
        )
        return [
            *head(self.parameter),
            *rows_of_sweep(self),
            "",
            *crossings,
            *checked,
            *(f"Note: {note}" for note in self.notes),
        ]


def _rows(table: Table) -> list[dict[str, Any]]:
    columns = {c.name: table.read(c.name) for c in table.columns}
    text = {c.name for c in table.columns if c.dtype == TEXT}
    return [{name: _plain(values[i], name in text) for name, values in columns.items()} for i in range(table.rows)]


def _plain(value: Any, text: bool) -> Any:
    if text:
        return str(value)
    return tuple(value.tolist()) if getattr(value, "ndim", 0) else value.item()
